//! The tiles that a layout was made of by midpoint subdivision.

use crate::{QuadLayout, Side};
use std::ops::Range;

/// The quads of a tile, and its sides. Side `m` of a tile is what edges `2 m` and `2 m + 1` are the halves of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Tile {
    pub(super) quads: Range<usize>,
    pub(super) sides: Vec<u32>,
}

/// The tile that begins with a quad, if one does: quads in a ring around the vertex at their third corner, each of which has a half of
/// two sides of the tile, as [`crate::refine`] makes them.
fn tile(layout: &QuadLayout, first: usize) -> Option<Tile> {
    let center = |quad: usize| layout.start(layout.quads[quad][2]);
    let last = (first..layout.quads.len()).take_while(|&quad| center(quad) == center(first)).last()?;
    let quads = first..last + 1;
    if quads.len() < 3 {
        return None;
    }
    let sides = quads.clone().map(|quad| {
        let next = if quad == last { first } else { quad + 1 };
        let ([half, spoke, ..], [.., other_spoke, other_half]) = (layout.quads[quad], layout.quads[next]);
        let is_side = half.edge / 2 == other_half.edge / 2 && half.edge != other_half.edge;
        let is_spoke = spoke == Side { edge: other_spoke.edge, reversed: !other_spoke.reversed };
        (is_side && is_spoke).then_some(half.edge / 2)
    });
    Some(Tile { sides: sides.collect::<Option<_>>()?, quads })
}

/// All tiles that are whole; quads that were divided since, and their neighbours, belong to none.
pub(super) fn tiles(layout: &QuadLayout) -> Vec<Tile> {
    let mut tiles = Vec::new();
    let mut quad = 0;
    while quad < layout.quads.len() {
        match tile(layout, quad) {
            Some(tile) => {
                quad = tile.quads.end;
                tiles.push(tile);
            }
            None => quad += 1,
        }
    }
    tiles
}

/// The sides of regions: consecutive halves in their loops. Halves that were divided since belong to none.
pub(super) fn region_sides(layout: &QuadLayout) -> Vec<u32> {
    let mut found = Vec::new();
    for sides in layout.region_faces.iter().flat_map(|face| &face.loops) {
        for (k, side) in sides.iter().enumerate() {
            let next = sides[(k + 1) % sides.len()];
            if side.edge / 2 == next.edge / 2 && side.edge != next.edge {
                found.push(side.edge / 2);
            }
        }
    }
    found
}

/// Per edge: it leads to the middle of a tile, and is no half of a side.
pub(super) fn spokes(layout: &QuadLayout) -> Vec<bool> {
    let mut spokes = vec![false; layout.edges.len()];
    for [_, one, other, _] in &layout.quads {
        spokes[one.edge as usize] = true;
        spokes[other.edge as usize] = true;
    }
    spokes
}
