//! A watertight triangle mesh of a surface, to a chord tolerance.
//!
//! Each edge curve is divided once, and both of its patches use those points. Inside, a patch has a grid of its own;
//! a strip of triangles joins the grid to the four sides.

use crate::{Patch, SplineSurface};
use topipe_mesh::{DVec3, TriangleMesh, VertexId};

/// Divisions of one edge or one side of a patch's grid at the most: finer than that is a tolerance out of reach.
const MOST: usize = 256;

/// Number of equal pieces into which a curve with these control points must be divided: the distance of a curve
/// from its chords is at most |second derivative| / 8 over the square of the number.
fn divisions(control: impl Iterator<Item = DVec3>, degree: usize, spans: usize, tolerance: f64) -> usize {
    let points: Vec<DVec3> = control.collect();
    let bend = points.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).length()).fold(0.0, f64::max);
    // Second differences of control points bound the second derivative up to the square of the span count.
    let second = bend * (degree * (degree - 1)) as f64 * (spans * spans) as f64;
    ((second / (8.0 * tolerance)).sqrt().ceil() as usize).clamp(1, MOST)
}

impl SplineSurface {
    /// Triangles whose distance from the surface is about `chord_tolerance` (mm) at the most.
    ///
    /// Guarantees: a closed surface gives a closed mesh, oriented alike, with shared vertices. The tolerance is an
    /// estimate from the control points; at most 256 divisions are made per patch side.
    pub fn tessellate(&self, chord_tolerance: f64) -> TriangleMesh {
        let tolerance = if chord_tolerance > 0.0 { chord_tolerance } else { f64::MIN_POSITIVE };
        let mut mesh = TriangleMesh { positions: self.vertices.clone(), triangles: Vec::new() };
        // Points along each edge, ends included, as mesh vertices.
        let edges: Vec<Vec<VertexId>> = self
            .edges
            .iter()
            .map(|edge| {
                let spans = edge.basis.breaks().len() - 1;
                let count = divisions(edge.control.iter().copied(), edge.basis.degree(), spans, tolerance);
                let mut points = vec![VertexId(edge.ends[0])];
                for k in 1..count {
                    points.push(VertexId::new(mesh.positions.len()));
                    mesh.positions.push(edge.position(k as f64 / count as f64));
                }
                points.push(VertexId(edge.ends[1]));
                points
            })
            .collect();
        for patch in &self.patches {
            let sides: Vec<Vec<VertexId>> = patch
                .sides
                .iter()
                .map(|side| {
                    let mut points = edges[side.edge as usize].clone();
                    if side.reversed {
                        points.reverse();
                    }
                    points
                })
                .collect();
            add_patch(&mut mesh, patch, &sides, tolerance);
        }
        mesh
    }
}

fn grid_size(patch: &Patch, sides: &[Vec<VertexId>], tolerance: f64) -> (usize, usize) {
    let (nu, nv) = (patch.basis_u.len(), patch.basis_v.len());
    let spans = |breaks: usize| breaks - 1;
    let along_u = (0..nv)
        .map(|j| {
            let row = patch.control[j * nu..(j + 1) * nu].iter().copied();
            divisions(row, patch.basis_u.degree(), spans(patch.basis_u.breaks().len()), tolerance)
        })
        .fold(2, usize::max);
    let along_v = (0..nu)
        .map(|i| {
            let column = (0..nv).map(|j| patch.control[j * nu + i]);
            divisions(column, patch.basis_v.degree(), spans(patch.basis_v.breaks().len()), tolerance)
        })
        .fold(2, usize::max);
    let longest = |a: usize, b: usize| (sides[a].len() - 1).max(sides[b].len() - 1);
    (along_u.max(longest(0, 2)), along_v.max(longest(1, 3)))
}

fn add_patch(mesh: &mut TriangleMesh, patch: &Patch, sides: &[Vec<VertexId>], tolerance: f64) {
    let (nu, nv) = grid_size(patch, sides, tolerance);
    let first = mesh.positions.len();
    // Inner grid points (i, j) with 1 <= i < nu, 1 <= j < nv.
    for j in 1..nv {
        for i in 1..nu {
            mesh.positions.push(patch.evaluate(i as f64 / nu as f64, j as f64 / nv as f64).position);
        }
    }
    let at = |i: usize, j: usize| VertexId::new(first + (j - 1) * (nu - 1) + i - 1);
    for j in 1..nv - 1 {
        for i in 1..nu - 1 {
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    // The ring of the grid facing each side, in the direction of the side.
    let rings: [Vec<(VertexId, f64)>; 4] = [
        (1..nu).map(|i| (at(i, 1), i as f64 / nu as f64)).collect(),
        (1..nv).map(|j| (at(nu - 1, j), j as f64 / nv as f64)).collect(),
        (1..nu).rev().map(|i| (at(i, nv - 1), 1.0 - i as f64 / nu as f64)).collect(),
        (1..nv).rev().map(|j| (at(1, j), 1.0 - j as f64 / nv as f64)).collect(),
    ];
    for (side, ring) in sides.iter().zip(&rings) {
        zip(mesh, side, ring);
    }
}

/// Joins a side (parameters 0 to 1, evenly spaced) to the ring inside of it, advancing on whichever is behind.
fn zip(mesh: &mut TriangleMesh, side: &[VertexId], ring: &[(VertexId, f64)]) {
    let last = side.len() - 1;
    let t = |k: usize| k as f64 / last as f64;
    let (mut i, mut j) = (0, 0);
    while i < last || j + 1 < ring.len() {
        // Compare the middles of the next pieces; the corners of the side lie beyond the ring's ends.
        let outer = if i < last { (t(i) + t(i + 1)) / 2.0 } else { f64::INFINITY };
        let inner = if j + 1 < ring.len() { (ring[j].1 + ring[j + 1].1) / 2.0 } else { f64::INFINITY };
        if outer <= inner {
            mesh.triangles.push([side[i], side[i + 1], ring[j].0]);
            i += 1;
        } else {
            mesh.triangles.push([side[i], ring[j + 1].0, ring[j].0]);
            j += 1;
        }
    }
}
