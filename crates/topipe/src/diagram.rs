//! A pipeline as SVG: stages in columns by how far they are from the beginning, in an order with few crossings;
//! edges that pass over columns have their own place in them.

use std::fmt::Write;
use topipe_engine::{Outcome, Pipeline, RunRecord};

/// Sizes in pixels.
const WIDTH: f64 = 168.0;
const HEIGHT: f64 = 46.0;
const EXPORT: f64 = 30.0;
const COLUMN: f64 = 250.0;
/// Between two nodes.
const GAP: f64 = 22.0;
/// For an edge that goes by.
const PASSAGE: f64 = 16.0;
/// Between two edges that end at a node, so that their names can be read.
const PORT: f64 = 13.0;
const MARGIN: f64 = 20.0;

struct Node {
    title: String,
    subtitle: String,
    look: Look,
    column: usize,
    /// Where its middle is, from above.
    middle: f64,
    /// How many edges end here.
    edges: usize,
}

/// How a node is drawn.
#[derive(Clone, Copy, PartialEq)]
enum Look {
    Stage,
    Failed,
    Skipped,
    Export,
    /// Nothing: an edge goes by.
    Passage,
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
        let (title, subtitle) = (title.to_owned(), subtitle.to_owned());
        Self { title, subtitle, look, column: 0, middle: 0.0, edges: 0 }
    }

    fn height(&self) -> f64 {
        match self.look {
            Look::Passage => 0.0,
            Look::Export => EXPORT,
            _ => HEIGHT.max(PORT * (self.edges + 1) as f64),
        }
    }

    /// What it takes in its column.
    fn room(&self) -> f64 {
        if self.look == Look::Passage { PASSAGE } else { self.height() + GAP }
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
    for (_, to, _) in edges {
        nodes[*to].edges += 1;
    }
    let drawn = nodes.len();
    let routes = route(&mut nodes, edges);
    let mut steps: Vec<(usize, usize)> =
        routes.iter().flat_map(|route| route.windows(2).map(|pair| (pair[0], pair[1]))).collect();
    steps.sort_unstable();
    steps.dedup();
    let columns = place(&mut nodes, &steps);
    let low = nodes.iter().map(|node| node.middle - node.height() / 2.0).fold(f64::INFINITY, f64::min);
    let high = nodes.iter().map(|node| node.middle + node.height() / 2.0).fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
    let (width, height) =
        (MARGIN * 2.0 + COLUMN * (columns.max(1) - 1) as f64 + WIDTH, MARGIN * 2.0 + high - low);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let at = |node: &Node| (MARGIN + COLUMN * node.column as f64, MARGIN + node.middle - low);
    // Several edges into a node end one below the other, in the order in which they come from the column before.
    let port = |to: usize, edge: usize| {
        let mut into: Vec<usize> = (0..edges.len()).filter(|&k| edges[k].1 == to).collect();
        into.sort_by(|&a, &b| {
            let key = |k: usize| nodes[routes[k][routes[k].len() - 2]].middle;
            key(a).total_cmp(&key(b)).then(a.cmp(&b))
        });
        let place = into.iter().position(|&k| k == edge).unwrap_or(0);
        nodes[to].height() * ((place + 1) as f64 / (into.len() + 1) as f64 - 0.5)
    };
    for (edge, (_, to, label)) in edges.iter().enumerate() {
        let dash = if nodes[*to].look == Look::Export { " stroke-dasharray=\"4 3\"" } else { "" };
        let (x, mut y) = at(&nodes[routes[edge][0]]);
        let mut x = x + WIDTH;
        let mut path = format!("M{x:.1} {y:.1}");
        let (mut u, mut v) = (x, y);
        for (k, &stop) in routes[edge].iter().enumerate().skip(1) {
            let end = k + 1 == routes[edge].len();
            (u, v) = at(&nodes[stop]);
            v += if end { port(*to, edge) } else { 0.0 };
            let bend = (u - x) / 2.0;
            let _ = write!(path, " C{:.1} {y:.1} {:.1} {v:.1} {u:.1} {v:.1}", x + bend, u - bend);
            if !end {
                let _ = write!(path, " H{:.1}", u + WIDTH);
            }
            (x, y) = (u + WIDTH, v);
        }
        let _ = writeln!(
            text,
            "<path d=\"{path}\" fill=\"none\" stroke=\"#8a94a0\" stroke-width=\"1.4\"{dash}/>"
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
    for node in &nodes[..drawn] {
        let (x, y) = at(node);
        let height = node.height();
        let (fill, stroke, radius) = match node.look {
            Look::Failed => ("#fdf1ef", "#a3271f", 5.0),
            Look::Skipped => ("#fdf6e3", "#b8973a", 5.0),
            Look::Export => ("#f6f4ee", "#b8ae94", height / 2.0),
            Look::Stage | Look::Passage => ("#e8f0f8", "#5b84ad", 5.0),
        };
        let _ = writeln!(
            text,
            "<rect x=\"{x:.1}\" y=\"{:.1}\" width=\"{WIDTH}\" height=\"{height:.1}\" rx=\"{radius:.1}\" \
             fill=\"{fill}\" stroke=\"{stroke}\"/>",
            y - height / 2.0
        );
        let (middle, lines) =
            (x + WIDTH / 2.0, [(&node.title, "13", "#1c2530"), (&node.subtitle, "10.5", "#5b6570")]);
        for (k, (line, size, color)) in lines.into_iter().filter(|(line, ..)| !line.is_empty()).enumerate() {
            let lift = if node.subtitle.is_empty() { 5.0 } else { -2.0 };
            let _ = writeln!(
                text,
                "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"{size}\" fill=\"{color}\">{}</text>",
                y + lift + 15.0 * k as f64,
                escape(&shortened(line))
            );
        }
    }
    text + "</svg>\n"
}

type Edge = (usize, usize, String);

/// The nodes each edge passes: one is added in every column between its ends, so that it runs between the others.
fn route(nodes: &mut Vec<Node>, edges: &[Edge]) -> Vec<Vec<usize>> {
    // Edges from the same node share their way as far as it is the same.
    let mut shared = std::collections::BTreeMap::new();
    let mut routes = Vec::new();
    for (from, to, _) in edges {
        let mut route = vec![*from];
        for column in nodes[*from].column + 1..nodes[*to].column {
            route.push(*shared.entry((*from, column)).or_insert_with(|| {
                let mut passage = Node::new("", "", Look::Passage);
                passage.column = column;
                nodes.push(passage);
                nodes.len() - 1
            }));
        }
        route.push(*to);
        routes.push(route);
    }
    routes
}

/// Rounds over all columns: first to order them, then to place what is ordered.
const ROUNDS: usize = 12;

/// Orders each column by the mean place of the neighbours, to and fro (Sugiyama's barycentre rule), and puts each node as
/// near to its neighbours as the others in its column let it. Returns the number of columns.
fn place(nodes: &mut [Node], steps: &[(usize, usize)]) -> usize {
    let count = nodes.iter().map(|node| node.column + 1).max().unwrap_or(0);
    let mut columns: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (at, node) in nodes.iter().enumerate() {
        columns[node.column].push(at);
    }
    let mut neighbours: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    for &(from, to) in steps {
        neighbours[from].push(to);
        neighbours[to].push(from);
    }
    let wish = |at: usize, nodes: &[Node]| match neighbours[at].len() {
        0 => nodes[at].middle,
        many => neighbours[at].iter().map(|&other| nodes[other].middle).sum::<f64>() / many as f64,
    };
    columns.iter().for_each(|column| stack(column, nodes));
    for round in 0..2 * ROUNDS {
        for k in 0..count {
            let column = if round % 2 == 0 { k } else { count - 1 - k };
            let mut order: Vec<(f64, usize)> =
                columns[column].iter().map(|&at| (wish(at, nodes), at)).collect();
            if round < ROUNDS {
                order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                columns[column] = order.iter().map(|(_, at)| *at).collect();
                stack(&columns[column], nodes);
            } else {
                settle(&order, nodes);
            }
        }
    }
    count
}

/// One below the other, without gaps, around zero.
fn stack(column: &[usize], nodes: &mut [Node]) {
    let all: f64 = column.iter().map(|&at| nodes[at].room()).sum();
    let mut y = -all / 2.0;
    for &at in column {
        nodes[at].middle = y + nodes[at].room() / 2.0;
        y += nodes[at].room();
    }
}

/// Nodes in their order, without overlap, with the least sum of squares of the distances from their wishes: neighbours that
/// would overlap form a block, which stands at the mean of its wishes (isotonic regression by pooling).
fn settle(order: &[(f64, usize)], nodes: &mut [Node]) {
    // Each node's place relative to the first when all touch.
    let mut offset = 0.0;
    let mut offsets = Vec::new();
    let mut blocks: Vec<(f64, usize)> = Vec::new();
    for (k, (wish, at)) in order.iter().enumerate() {
        if k > 0 {
            offset += (nodes[order[k - 1].1].room() + nodes[*at].room()) / 2.0;
        }
        offsets.push(offset);
        blocks.push((wish - offset, 1));
        while let [.., (above, many), (below, few)] = blocks[..]
            && above > below
        {
            blocks.truncate(blocks.len() - 2);
            let count = many + few;
            blocks.push(((above * many as f64 + below * few as f64) / count as f64, count));
        }
    }
    let places = blocks.iter().flat_map(|(place, count)| std::iter::repeat_n(*place, *count));
    for ((place, offset), (_, at)) in places.zip(offsets).zip(order) {
        nodes[*at].middle = place + offset;
    }
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
