//! Regions of known shape become faces of their own: the quads inside them are taken out.
//!
//! A plane or a cylinder needs no patches. Where the whole border of a region runs along macro-edges, its quads are
//! replaced by one [`RegionFace`] whose loops are those macro-edges. Other regions stay as they are: their quads cross
//! the border, and the fit treats them as free surface.

use crate::{QuadLayout, RegionFace, Side};
use topipe_mesh::RegionId;

/// What became of the regions of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dissolved {
    /// Regions that are faces of their own now.
    pub faces: usize,
    /// Regions whose border is not followed by macro-edges, or that have no quads.
    pub free: usize,
}

/// Stands for "several regions".
const MIXED: RegionId = RegionId(u32::MAX - 1);

/// Replaces the quads of each region by a region face wherever macro-edges follow all of its border.
///
/// Guarantees: what [`QuadLayout`] guarantees still holds if it did before; regions that are faces already stay so.
/// Macro-edges and macro-vertices that nothing uses any more are dropped, the others keep their order.
pub fn dissolve(layout: &mut QuadLayout) -> Dissolved {
    let regions = layout.part.regions.len();
    // The region of each quad, and whether a region has a quad that is only partly inside.
    let mut region_of_quad = vec![RegionId::NONE; layout.quads.len()];
    let mut seen = vec![false; layout.quads.len()];
    for (&quad, &region) in layout.quad_of_face.iter().zip(&layout.part.region_of_face) {
        let Some(entry) = region_of_quad.get_mut(quad as usize) else { continue };
        if !seen[quad as usize] {
            (seen[quad as usize], *entry) = (true, region);
        } else if *entry != region {
            *entry = MIXED;
        }
    }
    let mut crossed = vec![false; regions];
    let mut whole = vec![false; regions];
    for (&quad, &region) in layout.quad_of_face.iter().zip(&layout.part.region_of_face) {
        if region.index() < regions && quad != QuadLayout::NO_QUAD {
            whole[region.index()] = true;
            crossed[region.index()] |= region_of_quad[quad as usize] == MIXED;
        }
    }
    let taken = |quad: usize| {
        let region = region_of_quad[quad];
        (region.index() < regions && !crossed[region.index()]).then_some(region)
    };

    // The two uses of each edge by quads: forwards and backwards.
    let mut uses: Vec<[Option<(usize, usize)>; 2]> = vec![[None; 2]; layout.edges.len()];
    for (quad, sides) in layout.quads.iter().enumerate() {
        for (k, side) in sides.iter().enumerate() {
            uses[side.edge as usize][usize::from(side.reversed)] = Some((quad, k));
        }
    }
    let across = |side: Side| uses[side.edge as usize][usize::from(!side.reversed)];
    let on_border = |quad: usize, k: usize| {
        across(layout.quads[quad][k]).is_none_or(|(other, _)| region_of_quad[other] != region_of_quad[quad])
    };
    let mut faces: Vec<Option<RegionFace>> = vec![None; regions];
    let mut done = vec![[false; 4]; layout.quads.len()];
    for quad in 0..layout.quads.len() {
        let Some(region) = taken(quad) else { continue };
        let face = faces[region.index()].get_or_insert_with(|| RegionFace { region, loops: Vec::new() });
        for k in 0..4 {
            if done[quad][k] || !on_border(quad, k) {
                continue;
            }
            let mut around = Vec::new();
            let (mut q, mut i) = (quad, k);
            while !done[q][i] {
                done[q][i] = true;
                around.push(layout.quads[q][i]);
                // The next border side about the end of this one: turn inside the region.
                i = (i + 1) % 4;
                while !on_border(q, i) {
                    let Some((other, j)) = across(layout.quads[q][i]) else { break };
                    (q, i) = (other, (j + 1) % 4);
                }
            }
            face.loops.push(around);
        }
    }
    let gone: Vec<bool> = (0..layout.quads.len()).map(|quad| taken(quad).is_some()).collect();
    let found: Vec<RegionFace> = faces.into_iter().flatten().collect();
    let dissolved = Dissolved { faces: found.len(), free: crossed.iter().filter(|&&c| c).count() };
    layout.region_faces.extend(found);
    layout.region_faces.sort_by_key(|face| face.region);
    drop_quads(layout, &gone);
    crate::doublets::compact(layout);
    dissolved
}

fn drop_quads(layout: &mut QuadLayout, gone: &[bool]) {
    let mut next = 0;
    let number: Vec<u32> = gone
        .iter()
        .map(|&gone| {
            if gone {
                return QuadLayout::NO_QUAD;
            }
            next += 1;
            next - 1
        })
        .collect();
    let mut quad = 0;
    layout.quads.retain(|_| {
        quad += 1;
        !gone[quad - 1]
    });
    for quad in &mut layout.quad_of_face {
        *quad = number.get(*quad as usize).copied().unwrap_or(QuadLayout::NO_QUAD);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MacroEdge, verify};
    use topipe_mesh::{DVec3, Part, Region, RegionShape, TriangleMesh, VertexId};

    /// The sides of a cube, counter-clockwise from outside: bottom, top, front, right, back, left.
    const SIDES: [[u32; 4]; 6] =
        [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

    /// A cube with one quad a side; faces 2 k and 2 k + 1 belong to side k.
    fn cube(regions: &[(usize, u32)]) -> QuadLayout {
        let corner = |v: u32| {
            let high = |bit: bool| f64::from(u8::from(bit));
            [high(v % 4 == 1 || v % 4 == 2), high(v % 4 >= 2), high(v >= 4)]
        };
        let triangles = SIDES.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let mut part = Part::new(TriangleMesh::from_arrays((0..8).map(corner).collect(), triangles));
        let count = regions.iter().map(|&(_, region)| region + 1).max().unwrap_or(0);
        let shape = RegionShape::Plane { point: DVec3::ZERO, normal: DVec3::Z };
        part.regions = (0..count).map(|_| Region { shape, area: 0.0, residual: 0.0 }).collect();
        for &(face, region) in regions {
            part.region_of_face[face] = RegionId(region);
        }
        let mut edges: Vec<MacroEdge> = Vec::new();
        let quads = SIDES.map(|corners| {
            [0, 1, 2, 3].map(|k: usize| {
                let (a, b) = (corners[k], corners[(k + 1) % 4]);
                let ends = [a.min(b), a.max(b)];
                let edge = edges.iter().position(|edge| edge.ends == ends).unwrap_or_else(|| {
                    edges.push(MacroEdge { ends, path: ends.map(VertexId).to_vec(), feature: None });
                    edges.len() - 1
                });
                Side { edge: edge as u32, reversed: a > b }
            })
        });
        QuadLayout {
            part,
            vertices: (0..8).map(VertexId).collect(),
            edges,
            quads: quads.to_vec(),
            quad_of_face: (0..12).map(|face| face / 2).collect(),
            region_faces: Vec::new(),
            tiles: 0,
            macro_triangles: 0,
        }
    }

    #[test]
    fn quads_of_a_region_become_one_face() {
        // The top and the front are one region: their common edge goes.
        let mut layout = cube(&[(2, 0), (3, 0), (4, 0), (5, 0)]);
        assert_eq!(verify(&layout), Vec::<String>::new());
        assert_eq!(dissolve(&mut layout), Dissolved { faces: 1, free: 0 });
        assert_eq!(verify(&layout), Vec::<String>::new());
        assert_eq!((layout.quads.len(), layout.edges.len(), layout.vertices.len()), (4, 11, 8));
        let loops = &layout.region_faces[0].loops;
        assert_eq!(loops.iter().map(Vec::len).collect::<Vec<_>>(), [6]);
        // Again there is nothing left to do.
        assert_eq!(dissolve(&mut layout), Dissolved { faces: 0, free: 0 });
    }

    #[test]
    fn a_ring_of_quads_has_two_borders() {
        let around: Vec<(usize, u32)> = (4..12).map(|face| (face, 0)).collect();
        let mut layout = cube(&around);
        assert_eq!(dissolve(&mut layout), Dissolved { faces: 1, free: 0 });
        assert_eq!(verify(&layout), Vec::<String>::new());
        assert_eq!((layout.quads.len(), layout.edges.len()), (2, 8));
        assert_eq!(layout.region_faces[0].loops.iter().map(Vec::len).collect::<Vec<_>>(), [4, 4]);
    }

    #[test]
    fn a_region_that_ends_inside_a_quad_stays() {
        let mut layout = cube(&[(2, 0), (3, 0), (4, 1), (6, 1)]);
        assert_eq!(dissolve(&mut layout), Dissolved { faces: 1, free: 1 });
        assert_eq!(layout.region_faces.iter().map(|face| face.region).collect::<Vec<_>>(), [RegionId(0)]);
        assert_eq!(layout.quads.len(), 5);
        assert_eq!(verify(&layout), Vec::<String>::new());
    }
}
