//! The border of a tile: is it a disk, and which tiles does it meet along the way.

use crate::growth::Growth;
use std::collections::HashSet;
use topipe_mesh::refine::Refiner;
use topipe_mesh::{FaceId, HalfEdgeId, VertexId};

/// A contiguous part of a tile's border along one neighbour.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Run {
    pub(crate) neighbor: u32,
    /// Border half-edges inside the tile, counter-clockwise.
    pub(crate) half_edges: Vec<HalfEdgeId>,
}

/// What is wrong with a tile on its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Shape {
    /// Not homeomorphic to a disk.
    NotDisk,
    /// A disk with this border.
    Disk(Vec<Run>),
}

/// V - E + F of a set of faces; for an edge-connected one it is 1 exactly for a disk.
fn euler(refiner: &Refiner, growth: &Growth, tile: u32, faces: &[FaceId]) -> i64 {
    let mut vertices = HashSet::with_capacity(faces.len());
    let mut inner = 0i64;
    for &face in faces {
        for k in 0..3 {
            let h = HalfEdgeId::of(face, k);
            vertices.insert(refiner.origin(h));
            let twin = refiner.twin(h);
            inner += (twin.is_some() && growth.owner[twin.face().index()] == tile) as i64;
        }
    }
    let edges = 3 * faces.len() as i64 - inner / 2;
    vertices.len() as i64 - edges + faces.len() as i64
}

/// Examines the tile whose faces (all of them) are `faces`.
pub(crate) fn shape(refiner: &Refiner, growth: &Growth, faces: &[FaceId]) -> Shape {
    let Some(&first) = faces.first() else { return Shape::NotDisk };
    let tile = growth.owner[first.index()];
    if euler(refiner, growth, tile, faces) != 1 {
        return Shape::NotDisk;
    }
    let across = |h: HalfEdgeId| growth.owner[refiner.twin(h).face().index()];
    let mut border = faces
        .iter()
        .flat_map(|&f| (0..3).map(move |k| HalfEdgeId::of(f, k)))
        .filter(|&h| refiner.twin(h).is_some() && across(h) != tile);
    let Some(start) = border.next() else { return Shape::NotDisk };
    // A disk and a ring together also have characteristic 1, but more than one border.
    let mut left = border.count();
    let mut runs: Vec<Run> = Vec::new();
    let mut h = start;
    loop {
        match runs.last_mut() {
            Some(run) if run.neighbor == across(h) => run.half_edges.push(h),
            _ => runs.push(Run { neighbor: across(h), half_edges: vec![h] }),
        }
        h = h.next();
        while across(h) == tile {
            h = refiner.twin(h).next();
        }
        if h == start {
            break;
        }
        left = left.saturating_sub(1);
    }
    if left > 0 {
        return Shape::NotDisk;
    }
    if runs.len() > 1
        && runs[0].neighbor == runs[runs.len() - 1].neighbor
        && let Some(mut last) = runs.pop()
    {
        last.half_edges.append(&mut runs[0].half_edges);
        runs[0].half_edges = last.half_edges;
    }
    Shape::Disk(runs)
}

/// The shortest run along a neighbour that is met more than once, if there is one.
pub(crate) fn double_contact(refiner: &Refiner, runs: &[Run]) -> Option<usize> {
    let length = |run: &Run| -> f64 {
        let at = |v: VertexId| refiner.part().mesh.position(v);
        run.half_edges.iter().map(|&h| at(refiner.origin(h)).distance(at(refiner.target(h)))).sum()
    };
    let mut best: Option<(f64, usize)> = None;
    for (i, run) in runs.iter().enumerate() {
        if runs.iter().enumerate().any(|(j, other)| j != i && other.neighbor == run.neighbor) {
            let len = length(run);
            if best.is_none_or(|(shortest, _)| len < shortest) {
                best = Some((len, i));
            }
        }
    }
    best.map(|(_, i)| i)
}
