//! From the Reeb graph to a graph of branches: level loops become points, bumps go, chains become one branch.

use super::reeb::ReebGraph;
use crate::piece::Piece;
use glam::DVec3;
use topipe_mesh::VertexId;

/// What a branch ends at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum NodeKind {
    /// An interface, by its number.
    Interface(usize),
    /// The tip of a free end or of a bump, at this point of the surface.
    Tip(DVec3),
    /// Where level loops split or merge.
    Saddle,
}

/// The middle of a level loop.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) point: DVec3,
    /// Radius of the circle of equal area.
    pub(super) radius: f64,
}

/// One future branch.
#[derive(Debug, Clone)]
pub(super) struct Branch {
    pub(super) ends: [usize; 2],
    pub(super) samples: Vec<Sample>,
    /// A point of the surface at one of its ends.
    pub(super) mouth: DVec3,
    /// The vertices of the surface around it, to find its sections by.
    pub(super) vertices: Vec<VertexId>,
}

/// Branches and what they end at. Removed branches are `None`.
#[derive(Debug, Clone)]
pub(super) struct BranchGraph {
    pub(super) nodes: Vec<NodeKind>,
    /// Where their critical vertices lie, on the surface.
    places: Vec<DVec3>,
    pub(super) branches: Vec<Option<Branch>>,
    /// Nodes that stay although only two branches are left: their axes meet at an angle.
    corners: Vec<bool>,
    /// Branches that end or once ended at each node: noise makes many, so they are not searched for.
    incident: Vec<Vec<usize>>,
}

impl BranchGraph {
    pub(super) fn new(piece: &Piece, reeb: &ReebGraph, value: &[f64]) -> Self {
        let mut degree = vec![0; reeb.nodes.len()];
        reeb.arcs.iter().flat_map(|a| a.ends).for_each(|n| degree[n as usize] += 1);
        let nodes = (reeb.nodes.iter().zip(&degree))
            .map(|(&v, &degree)| match piece.tips.iter().find(|(_, tip)| *tip == v) {
                Some(&(interface, _)) => NodeKind::Interface(interface),
                None if degree == 1 => NodeKind::Tip(piece.mesh.position(v)),
                None => NodeKind::Saddle,
            })
            .collect();
        let edge = piece.mesh.mean_edge_length();
        let branches = (reeb.arcs.iter())
            .map(|arc| {
                let mut samples: Vec<Sample> = Vec::new();
                let mut next = f64::NEG_INFINITY;
                for &v in &arc.vertices {
                    if value[v.index()] >= next {
                        let sample = level_loop(piece, reeb, value, v);
                        next = value[v.index()] + 0.5 * sample.radius.max(edge);
                        samples.push(sample);
                    }
                }
                let mouth = piece.mesh.position(reeb.nodes[arc.ends[0] as usize]);
                Some(Branch {
                    ends: arc.ends.map(|n| n as usize),
                    samples,
                    mouth,
                    vertices: arc.vertices.clone(),
                })
            })
            .collect();
        let places = reeb.nodes.iter().map(|&v| piece.mesh.position(v)).collect();
        let mut incident = vec![Vec::new(); reeb.nodes.len()];
        for (b, arc) in reeb.arcs.iter().enumerate() {
            arc.ends.iter().for_each(|&n| incident[n as usize].push(b));
        }
        let corners = vec![false; reeb.nodes.len()];
        Self { nodes, places, branches, corners, incident }
    }

    /// The branches at a node, each with the end it has there; a branch that returns to the node comes twice.
    pub(super) fn at(&self, node: usize) -> Vec<(usize, usize)> {
        let mut candidates = self.incident[node].clone();
        candidates.sort_unstable();
        candidates.dedup();
        let mut list = Vec::new();
        for b in candidates {
            if let Some(branch) = &self.branches[b] {
                list.extend([0, 1].into_iter().filter(|&k| branch.ends[k] == node).map(|k| (b, k)));
            }
        }
        list
    }

    /// Removes free ends that are bumps on a beam, lower ones first, until none is left.
    pub(super) fn remove_bumps(&mut self, ratio: f64) {
        (0..self.nodes.len()).for_each(|node| self.join(node));
        loop {
            let mut bumps: Vec<_> = (0..self.branches.len())
                .filter_map(|b| self.bump_height(b).map(|height| (height, b)))
                .filter(|(height, _)| *height < ratio)
                .collect();
            if bumps.is_empty() {
                return;
            }
            bumps.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
            for (_, b) in bumps {
                // Those before it may have changed what it stands on.
                if self.bump_height(b).is_some_and(|height| height < ratio) {
                    self.remove(b);
                }
            }
        }
    }

    /// Removes a branch and joins what then is one branch at its ends.
    pub(super) fn remove(&mut self, b: usize) {
        if let Some(branch) = self.branches[b].take() {
            for n in branch.ends {
                // A bump is part of the beam it stands on.
                if let [(host, _), (other, _)] = self.at(n)[..]
                    && host != other
                    && let Some(host) = &mut self.branches[host]
                {
                    host.vertices.extend(&branch.vertices);
                }
                self.join(n);
            }
        }
    }

    /// Removes a free end in which the two other branches of its foot `node` run into each other; these then meet in
    /// a corner.
    pub(super) fn absorb(&mut self, b: usize, node: usize) {
        self.corners[node] = true;
        self.branches[b] = None;
    }

    pub(super) fn is_corner(&self, node: usize) -> bool {
        self.corners[node]
    }

    /// The tip of a free end on a saddle, and the saddle.
    pub(super) fn free_end(&self, b: usize) -> Option<(DVec3, usize)> {
        let branch = self.branches[b].as_ref()?;
        match branch.ends.map(|n| self.nodes[n]) {
            [NodeKind::Tip(tip), NodeKind::Saddle] => Some((tip, branch.ends[1])),
            [NodeKind::Saddle, NodeKind::Tip(tip)] => Some((tip, branch.ends[0])),
            _ => None,
        }
    }

    /// Makes the two ends of a branch one node.
    pub(super) fn contract(&mut self, b: usize) {
        let Some(gone) = self.branches[b].take() else { return };
        let [keep, drop] = gone.ends;
        for b in std::mem::take(&mut self.incident[drop]) {
            if let Some(branch) = &mut self.branches[b] {
                branch.ends.iter_mut().filter(|end| **end == drop).for_each(|end| *end = keep);
            }
            self.incident[keep].push(b);
        }
        self.join(keep);
    }

    /// How far the tip of a free end is from the axis of what it stands on, in radii of that; `None` for a branch
    /// that is no free end on a saddle.
    fn bump_height(&self, b: usize) -> Option<f64> {
        let branch = self.branches[b].as_ref()?;
        let (tip, foot) = self.free_end(b)?;
        let near: Vec<Sample> = (self.at(foot).into_iter())
            .filter(|(other, _)| *other != b)
            .filter_map(|(other, end)| {
                let samples = &self.branches[other].as_ref()?.samples;
                if end == 0 { samples.first() } else { samples.last() }.copied()
            })
            .filter(|s| s.radius > 0.0)
            .collect();
        if near.is_empty() {
            // Between saddles next to each other there is no level loop: the saddle itself must do.
            let radius = branch.samples.iter().map(|s| s.radius).fold(0.0, f64::max);
            return Some(if radius > 0.0 { tip.distance(self.places[foot]) / radius } else { 0.0 });
        }
        let axis = near.iter().map(|s| s.point).sum::<DVec3>() / near.len() as f64;
        let radius = near.iter().map(|s| s.radius).fold(f64::MIN_POSITIVE, f64::max);
        Some(tip.distance(axis) / radius)
    }

    /// Where exactly two ends of two branches meet in a saddle, they become one branch.
    fn join(&mut self, node: usize) {
        if self.nodes[node] != NodeKind::Saddle || self.corners[node] {
            return;
        }
        let [(a, end_a), (b, end_b)] = self.at(node)[..] else { return };
        if a == b {
            return; // a ring
        }
        let (Some(mut first), Some(mut second)) = (self.branches[a].take(), self.branches[b].take()) else {
            return;
        };
        if end_a == 0 {
            first.reverse();
        }
        if end_b == 1 {
            second.reverse();
        }
        first.ends[1] = second.ends[1];
        self.incident[first.ends[1]].push(a);
        first.samples.extend(second.samples);
        if first.vertices.len() < second.vertices.len() {
            std::mem::swap(&mut first.vertices, &mut second.vertices);
        }
        first.vertices.append(&mut second.vertices);
        self.branches[a] = Some(first);
    }
}

impl Branch {
    fn reverse(&mut self) {
        self.ends.reverse();
        self.samples.reverse();
    }
}

/// The length-weighted middle of the level loop just above `v`.
fn level_loop(piece: &Piece, reeb: &ReebGraph, value: &[f64], v: VertexId) -> Sample {
    let connectivity = &piece.connectivity;
    let here = reeb.rank[v.index()];
    let position = piece.mesh.position(v);
    let Some(start) = connectivity.outgoing(v).find(|&h| reeb.rank[connectivity.target(h).index()] > here)
    else {
        return Sample { point: position, radius: 0.0 };
    };
    let level = value[v.index()];
    let mut points = Vec::new();
    reeb.walk_level(connectivity, start, here, |h| {
        let (a, b) = (connectivity.origin(h), connectivity.target(h));
        let (fa, fb) = (value[a.index()], value[b.index()]);
        let t = if fa == fb { 0.5 } else { ((level - fa) / (fb - fa)).clamp(0.0, 1.0) };
        points.push(piece.mesh.position(a).lerp(piece.mesh.position(b), t));
    });
    let n = points.len();
    let (mut sum, mut length, mut area) = (DVec3::ZERO, 0.0, DVec3::ZERO);
    for k in 0..n {
        let (a, b) = (points[k], points[(k + 1) % n]);
        let l = a.distance(b);
        length += l;
        sum += l * (a + b) / 2.0;
        area += (a - position).cross(b - position) / 2.0;
    }
    let point = if length > 0.0 { sum / length } else { position };
    Sample { point, radius: (area.length() / std::f64::consts::PI).sqrt() }
}
