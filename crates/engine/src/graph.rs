//! Who depends on whom.

use crate::diagnostic::Diagnostic;
use crate::spec::PlacedStage;
use petgraph::Direction;
use petgraph::graph::{DiGraph, NodeIndex};
use petgraph::visit::EdgeRef;
use std::collections::BTreeSet;

/// The stages, by their index in the spec, with an edge for each input.
#[derive(Debug, Clone)]
pub struct StageGraph {
    graph: DiGraph<(), &'static str, u32>,
    order: Vec<usize>,
}

impl StageGraph {
    /// An order in which each stage comes after those it depends on; among equals the order of the spec.
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// `(from, port, to)`: the artifact of `from` goes into `port` of `to`.
    pub fn edges(&self) -> impl Iterator<Item = (usize, &'static str, usize)> {
        self.graph
            .edge_references()
            .map(|edge| (edge.source().index(), *edge.weight(), edge.target().index()))
    }

    /// `start` and all it depends on, directly or not.
    pub fn with_ancestors(&self, start: impl IntoIterator<Item = usize>) -> BTreeSet<usize> {
        self.closure(start, Direction::Incoming)
    }

    /// `start` and all that depends on it, directly or not.
    pub fn with_descendants(&self, start: impl IntoIterator<Item = usize>) -> BTreeSet<usize> {
        self.closure(start, Direction::Outgoing)
    }

    fn closure(&self, start: impl IntoIterator<Item = usize>, direction: Direction) -> BTreeSet<usize> {
        let mut open: Vec<usize> = start.into_iter().collect();
        let mut closed = BTreeSet::new();
        while let Some(stage) = open.pop() {
            if closed.insert(stage) {
                open.extend(
                    self.graph.neighbors_directed(NodeIndex::new(stage), direction).map(NodeIndex::index),
                );
            }
        }
        closed
    }
}

/// Builds the graph, or says which stages depend on each other in a circle.
pub(crate) fn build(stages: &[PlacedStage]) -> Result<StageGraph, Box<Diagnostic>> {
    let mut graph = DiGraph::new();
    for _ in stages {
        graph.add_node(());
    }
    for (to, stage) in stages.iter().enumerate() {
        for (&port, &from) in &stage.node.inputs {
            graph.add_edge(NodeIndex::new(from), NodeIndex::new(to), port);
        }
    }
    let mut order = Vec::with_capacity(stages.len());
    let mut missing: Vec<usize> = stages.iter().map(|stage| stage.node.inputs.len()).collect();
    let mut ready: BTreeSet<usize> = (0..stages.len()).filter(|&stage| missing[stage] == 0).collect();
    while let Some(stage) = ready.pop_first() {
        order.push(stage);
        for next in graph.neighbors_directed(NodeIndex::new(stage), Direction::Outgoing) {
            missing[next.index()] -= 1;
            if missing[next.index()] == 0 {
                ready.insert(next.index());
            }
        }
    }
    if order.len() == stages.len() {
        return Ok(StageGraph { graph, order });
    }
    Err(circle(stages, &missing))
}

/// Describes one circle: from any stage that never became ready, follow inputs that never became ready either.
fn circle(stages: &[PlacedStage], missing: &[usize]) -> Box<Diagnostic> {
    let waiting = |stage: usize| {
        stages[stage]
            .node
            .inputs
            .iter()
            .find(|&(_, &from)| missing[from] > 0)
            .map(|(&port, &from)| (port, from))
    };
    let mut path: Vec<usize> = Vec::new();
    let mut at = missing.iter().position(|&count| count > 0).unwrap_or(0);
    while !path.contains(&at) {
        path.push(at);
        match waiting(at) {
            Some((_, from)) => at = from,
            None => break,
        }
    }
    let start = path.iter().position(|&stage| stage == at).unwrap_or(0);
    let mut members = path.split_off(start);
    // Begin where the spec begins, so that the message does not depend on how the circle was found.
    let first = members.iter().enumerate().min_by_key(|&(_, &stage)| stage).map_or(0, |(at, _)| at);
    members.rotate_left(first);
    let mut names: Vec<String> =
        members.iter().map(|&stage| format!("`{}`", stages[stage].node.name)).collect();
    names.push(names[0].clone());
    let message = format!("these stages depend on each other in a circle: {}", names.join(" needs "));
    let stage = &stages[members[0]];
    let place = waiting(members[0]).and_then(|(port, _)| stage.input_places.get(port));
    Box::new(
        place
            .unwrap_or(&stage.node.place)
            .diagnostic(message)
            .help("an input must come from an earlier stage"),
    )
}
