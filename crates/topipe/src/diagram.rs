//! A pipeline as SVG: stages in columns by how far they are from the beginning, rows in an order with few crossings.

use std::fmt::Write;
use topipe_engine::{Outcome, Pipeline, RunRecord};

/// Sizes in pixels.
const WIDTH: f64 = 168.0;
const HEIGHT: f64 = 46.0;
const COLUMN: f64 = 250.0;
const ROW: f64 = 70.0;
const MARGIN: f64 = 20.0;

struct Node {
    title: String,
    subtitle: String,
    look: Look,
    column: usize,
    row: f64,
}

/// How a node is drawn.
#[derive(Clone, Copy, PartialEq)]
enum Look {
    Stage,
    Failed,
    Skipped,
    Export,
}

/// The picture of a pipeline.
pub(crate) fn of_pipeline(pipeline: &Pipeline) -> String {
    let mut nodes: Vec<Node> =
        pipeline.stages.iter().map(|stage| Node::new(&stage.name, stage.stage.kind(), Look::Stage)).collect();
    let mut edges: Vec<Edge> =
        pipeline.graph.edges().map(|(from, port, to)| (from, to, label(port))).collect();
    for export in &pipeline.exports {
        edges.push((export.stage, nodes.len(), String::new()));
        nodes.push(Node::new(&export.file, "", Look::Export));
    }
    svg(nodes, &edges)
}

/// The picture of a run: what failed and what was skipped stand out.
pub(crate) fn of_record(record: &RunRecord) -> String {
    let look = |outcome: &Outcome| match outcome {
        Outcome::Failed { .. } => Look::Failed,
        Outcome::Skipped { .. } => Look::Skipped,
        _ => Look::Stage,
    };
    let mut nodes: Vec<Node> = record
        .stages
        .iter()
        .map(|stage| Node::new(&stage.stage, &stage.kind, look(&stage.outcome)))
        .collect();
    let at = |name: &str| record.stages.iter().position(|stage| stage.stage == name);
    let mut edges: Vec<Edge> = Vec::new();
    for (to, stage) in record.stages.iter().enumerate() {
        let inputs = stage.inputs.iter();
        edges.extend(inputs.filter_map(|(port, input)| Some((at(&input.stage)?, to, label(port)))));
    }
    for export in &record.exports {
        if let Some(from) = at(&export.stage) {
            edges.push((from, nodes.len(), String::new()));
            nodes.push(Node::new(&export.file, "", Look::Export));
        }
    }
    svg(nodes, &edges)
}

/// The usual port needs no name.
fn label(port: &str) -> String {
    if port == "input" { String::new() } else { port.to_owned() }
}

impl Node {
    fn new(title: &str, subtitle: &str, look: Look) -> Self {
        Self { title: title.to_owned(), subtitle: subtitle.to_owned(), look, column: 0, row: 0.0 }
    }
}

fn svg(mut nodes: Vec<Node>, edges: &[Edge]) -> String {
    // A node stands behind all it depends on. There are no cycles, so as many rounds as nodes are enough.
    for _ in 0..nodes.len() {
        let mut moved = false;
        for (from, to, _) in edges {
            let column = nodes[*from].column + 1;
            moved |= nodes[*to].column < column;
            nodes[*to].column = nodes[*to].column.max(column);
        }
        if !moved {
            break;
        }
    }
    let columns = place(&mut nodes, edges);
    let rows = columns.iter().map(Vec::len).max().unwrap_or(0);
    let (width, height) = (
        MARGIN * 2.0 + COLUMN * (columns.len().max(1) - 1) as f64 + WIDTH,
        MARGIN * 2.0 + ROW * rows.max(1) as f64,
    );
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let at =
        |node: &Node| (MARGIN + COLUMN * node.column as f64, MARGIN + ROW * node.row + (ROW - HEIGHT) / 2.0);
    for (edge, (from, to, label)) in edges.iter().enumerate() {
        let ((x, y), (u, v)) = (at(&nodes[*from]), at(&nodes[*to]));
        // Several edges into a node end one below the other, in the order of where they come from.
        let key = |k: usize| (nodes[edges[k].0].row, nodes[edges[k].0].column);
        let mut into: Vec<usize> = (0..edges.len()).filter(|&k| edges[k].1 == *to).collect();
        into.sort_by(|&a, &b| {
            key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal).then(a.cmp(&b))
        });
        let place = into.iter().position(|&k| k == edge).unwrap_or(0);
        let (x, y, v) =
            (x + WIDTH, y + HEIGHT / 2.0, v + HEIGHT * (place + 1) as f64 / (into.len() + 1) as f64);
        let bend = (u - x) / 2.0;
        let dash = if nodes[*to].look == Look::Export { " stroke-dasharray=\"4 3\"" } else { "" };
        let _ = writeln!(
            text,
            "<path d=\"M{x:.1} {y:.1} C{:.1} {y:.1} {:.1} {v:.1} {u:.1} {v:.1}\" fill=\"none\" stroke=\"#8a94a0\" \
             stroke-width=\"1.4\"{dash}/>",
            x + bend,
            u - bend
        );
        if !label.is_empty() {
            let _ = writeln!(
                text,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" font-size=\"8.5\" fill=\"#5b6570\">{}</text>",
                u - 5.0,
                v - 2.5,
                escape(label)
            );
        }
    }
    for node in &nodes {
        let (x, y) = at(node);
        let (fill, stroke, radius) = match node.look {
            Look::Stage => ("#e8f0f8", "#5b84ad", 5.0),
            Look::Failed => ("#fdf1ef", "#a3271f", 5.0),
            Look::Skipped => ("#fdf6e3", "#b8973a", 5.0),
            Look::Export => ("#f6f4ee", "#b8ae94", HEIGHT / 2.0),
        };
        let _ = writeln!(
            text,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" rx=\"{radius}\" fill=\"{fill}\" \
             stroke=\"{stroke}\"/>"
        );
        let (middle, lines) =
            (x + WIDTH / 2.0, [(&node.title, "13", "#1c2530"), (&node.subtitle, "10.5", "#5b6570")]);
        for (k, (line, size, color)) in lines.into_iter().filter(|(line, ..)| !line.is_empty()).enumerate() {
            let lift = if node.subtitle.is_empty() { 5.0 } else { -2.0 };
            let _ = writeln!(
                text,
                "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"{size}\" fill=\"{color}\">{}</text>",
                y + HEIGHT / 2.0 + lift + 15.0 * k as f64,
                escape(&shortened(line))
            );
        }
    }
    text + "</svg>\n"
}

type Edge = (usize, usize, String);

/// Orders each column by the mean place of the neighbours, to and fro (Sugiyama's barycentre rule), and centres it.
fn place(nodes: &mut [Node], edges: &[Edge]) -> Vec<Vec<usize>> {
    let count = nodes.iter().map(|node| node.column + 1).max().unwrap_or(0);
    let mut columns: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (at, node) in nodes.iter().enumerate() {
        columns[node.column].push(at);
    }
    let most = columns.iter().map(Vec::len).max().unwrap_or(0);
    let settle = |column: &[usize], nodes: &mut [Node]| {
        let free = (most - column.len()) as f64 / 2.0;
        for (row, &at) in column.iter().enumerate() {
            nodes[at].row = free + row as f64;
        }
    };
    columns.iter().for_each(|column| settle(column, nodes));
    for round in 0..8 {
        for k in 0..count {
            let column = if round % 2 == 0 { k } else { count - 1 - k };
            let mean = |at: usize| {
                let neighbours = edges.iter().filter_map(|(from, to, _)| match (*from == at, *to == at) {
                    (true, _) => Some(*to),
                    (_, true) => Some(*from),
                    _ => None,
                });
                let rows: Vec<f64> = neighbours.map(|other| nodes[other].row).collect();
                if rows.is_empty() { nodes[at].row } else { rows.iter().sum::<f64>() / rows.len() as f64 }
            };
            let mut order: Vec<(f64, usize)> = columns[column].iter().map(|&at| (mean(at), at)).collect();
            order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            columns[column] = order.into_iter().map(|(_, at)| at).collect();
            settle(&columns[column], nodes);
        }
    }
    columns
}

/// What does not fit into a box ends with an ellipsis.
fn shortened(text: &str) -> String {
    const MOST: usize = 24;
    if text.chars().count() <= MOST {
        return text.to_owned();
    }
    text.chars().take(MOST - 1).chain(['\u{2026}']).collect()
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
