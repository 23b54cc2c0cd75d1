//! Doublets: two quads that share two consecutive sides, and so a vertex of valence two between them.
//!
//! A patch can not be regular there. The four outer sides bound one bigger quad, which replaces the two (source,
//! section 2.2, case 1).

use crate::{QuadLayout, Side};

/// Marks a quad that was merged into another.
const GONE: u32 = u32::MAX;

/// Merges all doublets; merging one may make another.
pub(crate) fn merge(layout: &mut QuadLayout) {
    let mut into: Vec<u32> = (0..layout.quads.len() as u32).collect();
    let mut alive = vec![true; layout.quads.len()];
    loop {
        let mut corners: Vec<Vec<(usize, usize)>> = vec![Vec::new(); layout.vertices.len()];
        for quad in (0..layout.quads.len()).filter(|&q| alive[q]) {
            for (k, vertex) in layout.corners(quad).into_iter().enumerate() {
                corners[vertex as usize].push((quad, k));
            }
        }
        let doublet = corners.iter().find_map(|at| match at[..] {
            [(p, i), (q, j)] if p != q => Some((p, i, q, j)),
            _ => None,
        });
        let Some((p, i, q, j)) = doublet else { break };
        // Around the vertex: p has sides i (out) and i + 3 (in), the outer ones are i + 1 and i + 2.
        let outer = |quad: usize, k: usize| -> [Side; 2] {
            [layout.quads[quad][(k + 1) % 4], layout.quads[quad][(k + 2) % 4]]
        };
        let ([a, b], [c, d]) = (outer(p, i), outer(q, j));
        layout.quads[p] = [a, b, c, d];
        alive[q] = false;
        into[q] = p as u32;
    }
    for quad in &mut layout.quad_of_face {
        while into[*quad as usize] != *quad {
            *quad = into[*quad as usize];
        }
    }
    let mut number = vec![GONE; layout.quads.len()];
    let mut kept = Vec::new();
    for quad in (0..layout.quads.len()).filter(|&q| alive[q]) {
        number[quad] = kept.len() as u32;
        kept.push(layout.quads[quad]);
    }
    layout.quads = kept;
    layout.quad_of_face.iter_mut().for_each(|quad| *quad = number[*quad as usize]);
}

/// Drops macro-edges and macro-vertices that no side of a quad or of a region face uses.
pub(crate) fn compact(layout: &mut QuadLayout) {
    let mut edge_used = vec![false; layout.edges.len()];
    let loops = layout.region_faces.iter().flat_map(|face| face.loops.iter().flatten());
    layout.quads.iter().flatten().chain(loops).for_each(|side| edge_used[side.edge as usize] = true);
    let mut vertex_used = vec![false; layout.vertices.len()];
    for (edge, _) in layout.edges.iter().zip(&edge_used).filter(|(_, used)| **used) {
        edge.ends.iter().for_each(|&v| vertex_used[v as usize] = true);
    }
    let number = |used: &[bool]| -> Vec<u32> {
        let mut next = 0;
        used.iter()
            .map(|&used| {
                next += used as u32;
                next.wrapping_sub(1)
            })
            .collect()
    };
    let (edge_number, vertex_number) = (number(&edge_used), number(&vertex_used));
    let mut keep = edge_used.iter();
    layout.edges.retain(|_| keep.next() == Some(&true));
    let mut keep = vertex_used.iter();
    layout.vertices.retain(|_| keep.next() == Some(&true));
    for edge in &mut layout.edges {
        edge.ends = edge.ends.map(|v| vertex_number[v as usize]);
    }
    let loops = layout.region_faces.iter_mut().flat_map(|face| face.loops.iter_mut().flatten());
    for side in layout.quads.iter_mut().flatten().chain(loops) {
        side.edge = edge_number[side.edge as usize];
    }
}
