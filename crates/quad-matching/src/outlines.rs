//! The outlines of bordered tiles and of regions: macro-vertices, macro-edges and who runs along them.
//!
//! A corner is a vertex where three or more borders meet or a segment ends. Between corners borders fall into edges,
//! each of which is one side of the tile or region on either hand: conforming by construction.

use crate::refine::Regions;
use crate::sides::Tiled;
use crate::{MacroEdge, QuadMatchingError, RegionFace, Side};
use rustc_hash::FxHashMap;
use topipe_mesh::{FeatureKind, HalfEdgeId, RegionId, VertexId};
use topipe_tiling::Tiling;

/// The tiles of a tiling as regions of any number of sides, and the faces of known shape.
pub(crate) fn outlines(tiling: &Tiling) -> Result<(Regions, Vec<RegionFace>), QuadMatchingError> {
    let tiled = Tiled::new(tiling)?;
    let half_edges = 3 * tiled.tile_of_face.len();
    let kind = barriers(tiling, &tiled)?;
    let border = |h: HalfEdgeId| kind[h.index()].is_some() || tiled.is_border(h);

    let mut borders = vec![0u8; tiling.part.mesh.vertex_count()];
    for h in (0..half_edges).map(HalfEdgeId::new) {
        if !tiled.refiner.twin(h).is_some() {
            return Err(QuadMatchingError::Tiling("the mesh has a border".into()));
        }
        if border(h) {
            let slot = &mut borders[tiled.refiner.origin(h).index()];
            *slot = slot.saturating_add(1);
        }
    }
    let mut is_corner: Vec<bool> = borders.iter().map(|&count| count != 0 && count != 2).collect();
    for segment in &tiling.segments {
        is_corner[segment.path[0].index()] = true;
        is_corner[segment.path[segment.path.len() - 1].index()] = true;
    }

    let mut number = vec![u32::MAX; is_corner.len()];
    let mut vertices = Vec::new();
    for v in (0..is_corner.len()).filter(|&v| is_corner[v]) {
        number[v] = vertices.len() as u32;
        vertices.push(VertexId::new(v));
    }
    let mut edges: Vec<MacroEdge> = Vec::new();
    // The side that starts along a half-edge out of a corner.
    let mut side_at: FxHashMap<HalfEdgeId, Side> = FxHashMap::default();
    for &start in &vertices {
        for first in tiled.refiner.outgoing(start) {
            if !border(first) || side_at.contains_key(&first) {
                continue;
            }
            let mut path = vec![start];
            let mut h = first;
            loop {
                let v = tiled.refiner.target(h);
                path.push(v);
                if is_corner[v.index()] {
                    break;
                }
                let next = tiled
                    .refiner
                    .outgoing(v)
                    .into_iter()
                    .find(|&g| border(g) && tiled.refiner.target(g) != tiled.refiner.origin(h));
                h = next
                    .ok_or_else(|| QuadMatchingError::Tiling(format!("a border ends at vertex {}", v.0)))?;
            }
            let edge = edges.len() as u32;
            side_at.insert(first, Side { edge, reversed: false });
            side_at.insert(tiled.refiner.twin(h), Side { edge, reversed: true });
            let end = path[path.len() - 1];
            edges.push(MacroEdge {
                ends: [number[start.index()], number[end.index()]],
                path,
                feature: kind[first.index()],
            });
        }
    }

    let tiles = tiling.tile_count();
    let mut seen = vec![false; half_edges];
    let mut sides: Vec<Vec<Side>> = vec![Vec::new(); tiles];
    let mut loops: FxHashMap<RegionId, Vec<Vec<Side>>> = FxHashMap::default();
    for &start in &vertices {
        for first in tiled.refiner.outgoing(start) {
            if !border(first) || seen[first.index()] {
                continue;
            }
            let mut around = Vec::new();
            let mut h = first;
            loop {
                seen[h.index()] = true;
                if let Some(side) = side_at.get(&h) {
                    around.push(*side);
                }
                h = h.next();
                while !border(h) {
                    h = tiled.refiner.twin(h).next();
                }
                if h == first {
                    break;
                }
            }
            let tile = tiled.tile(first);
            if tile != u32::MAX {
                if !sides[tile as usize].is_empty() {
                    return Err(QuadMatchingError::Tiling(format!("tile {tile} has more than one border")));
                }
                sides[tile as usize] = around;
            } else {
                let region = tiling.part.region_of_face[first.face().index()];
                loops.entry(region).or_default().push(around);
            }
        }
    }
    if let Some(tile) = sides.iter().position(|sides| sides.len() < 3) {
        return Err(QuadMatchingError::Tiling(format!("tile {tile} has {} corners", sides[tile].len())));
    }
    let faces = tiling
        .regions
        .iter()
        .map(|&region| RegionFace { region, loops: loops.remove(&region).unwrap_or_default() })
        .collect();
    if !loops.is_empty() {
        return Err(QuadMatchingError::Tiling("a face lies in no tile and in no region".into()));
    }
    Ok((Regions { tiled, vertices, edges, sides }, faces))
}

/// Per half-edge: the kind of the segment along it.
fn barriers(tiling: &Tiling, tiled: &Tiled) -> Result<Vec<Option<FeatureKind>>, QuadMatchingError> {
    let mut kind = vec![None; 3 * tiled.tile_of_face.len()];
    for segment in &tiling.segments {
        if segment.path.len() < 2 || segment.path.iter().any(|v| v.index() >= tiling.part.mesh.vertex_count())
        {
            return Err(QuadMatchingError::Tiling("a segment is no path of the mesh".into()));
        }
        for pair in segment.path.windows(2) {
            let h = tiled
                .refiner
                .half_edge(pair[0], pair[1])
                .ok_or_else(|| QuadMatchingError::Tiling("a segment leaves the mesh".into()))?;
            kind[h.index()] = Some(segment.kind);
            kind[tiled.refiner.twin(h).index()] = Some(segment.kind);
        }
    }
    Ok(kind)
}
