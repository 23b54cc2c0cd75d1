//! Joins what is kept of a layout to the layout of the rest.

use super::carried::Carried;
use super::tiles::spokes;
use crate::{MacroEdge, QuadLayout, RegionFace, Side};
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;
use topipe_mesh::{Lineage, Part, Provenance, RegionId, VertexId};
use topipe_tiling::Tiling;

/// Two layouts of one mesh, which the second has refined.
pub(super) struct Join<'a> {
    pub(super) carried: &'a Carried,
    pub(super) part: &'a Part,
    /// What of it is tiled anew.
    pub(super) tiling: &'a Tiling,
    /// The layout of the rest, in which what is kept is the region `kept`.
    pub(super) rest: &'a QuadLayout,
    /// Sides of earlier tiles that both have.
    pub(super) given: &'a [u32],
    pub(super) kept: RegionId,
    /// Per face of the earlier layout's mesh: its region, `kept`, or none.
    pub(super) zones: &'a [RegionId],
}

/// An edge of the earlier layout, and whether that of the rest runs against it.
type Same = (u32, bool);

/// One layout of both; the quads that are kept come first. Fails with the given sides that the rest has divided otherwise.
pub(super) fn splice(
    join: &Join<'_>,
    is_kept: impl Fn(u32) -> bool,
    tiles: u32,
) -> Result<QuadLayout, BTreeSet<u32>> {
    let Join { carried, part, rest, given, kept, zones, .. } = *join;
    let earlier = &carried.layout;
    let all = || given.iter().copied().collect::<BTreeSet<u32>>();
    let own = own_lineage(join).ok_or_else(all)?;
    let lineage = carried.lineage.of_child(&rest.part, &own, &part.mesh).ok_or_else(all)?;
    let same = same_edges(join, &own.provenance(&earlier.part.mesh))?;

    // Edges of the earlier layout that the joined one has.
    let mut stays = vec![false; earlier.edges.len()];
    let mut kept_quads = Vec::new();
    for quad in (0..earlier.quads.len()).filter(|&quad| is_kept(quad as u32)) {
        kept_quads.push(quad);
        earlier.quads[quad].iter().for_each(|side| stays[side.edge as usize] = true);
    }
    same.iter().flatten().for_each(|(e, _)| stays[*e as usize] = true);

    let mut vertex_of: FxHashMap<VertexId, u32> = FxHashMap::default();
    let mut vertices = Vec::new();
    let mut number = |v: VertexId, vertices: &mut Vec<VertexId>| {
        *vertex_of.entry(v).or_insert_with(|| {
            vertices.push(v);
            vertices.len() as u32 - 1
        })
    };
    let mut path_in_rest: FxHashMap<u32, Vec<VertexId>> = FxHashMap::default();
    for (edge, same) in rest.edges.iter().zip(&same) {
        if let Some((e, reversed)) = *same {
            let mut path = edge.path.clone();
            if reversed {
                path.reverse();
            }
            path_in_rest.insert(e, path);
        }
    }
    // Halves of sides first, so that they go in pairs as in the layouts they come from. Refinement leaves the numbers of vertices as they are.
    let mut edges: Vec<MacroEdge> = Vec::new();
    let mut edge_of_earlier = vec![u32::MAX; earlier.edges.len()];
    let mut edge_of_rest: Vec<Same> = vec![(u32::MAX, false); rest.edges.len()];
    let [spokes_before, spokes_now] = [earlier, rest].map(spokes);
    for spokes in [false, true] {
        let own = (0..earlier.edges.len()).filter(|&e| stays[e] && spokes_before[e] == spokes);
        for e in own {
            let edge = &earlier.edges[e];
            let path = path_in_rest.remove(&(e as u32)).unwrap_or_else(|| edge.path.clone());
            let ends = [path[0], path[path.len() - 1]].map(|v| number(v, &mut vertices));
            edge_of_earlier[e] = edges.len() as u32;
            edges.push(MacroEdge { ends, path, feature: edge.feature });
        }
        for e in (0..rest.edges.len()).filter(|&e| spokes_now[e] == spokes) {
            let edge = &rest.edges[e];
            edge_of_rest[e] = match same[e] {
                Some((e, reversed)) => (edge_of_earlier[e as usize], reversed),
                None => {
                    let ends = edge.ends.map(|v| number(rest.vertices[v as usize], &mut vertices));
                    edges.push(MacroEdge { ends, ..edge.clone() });
                    (edges.len() as u32 - 1, false)
                }
            };
        }
    }
    let of_rest = |side: Side| {
        let (edge, reversed) = edge_of_rest[side.edge as usize];
        Side { edge, reversed: side.reversed != reversed }
    };
    let mut quad_number = vec![QuadLayout::NO_QUAD; earlier.quads.len()];
    let mut quads: Vec<[Side; 4]> = Vec::with_capacity(kept_quads.len() + rest.quads.len());
    for &quad in &kept_quads {
        quad_number[quad] = quads.len() as u32;
        let side = |side: Side| Side { edge: edge_of_earlier[side.edge as usize], ..side };
        quads.push(earlier.quads[quad].map(side));
    }
    let first = quads.len() as u32;
    quads.extend(rest.quads.iter().map(|quad| quad.map(of_rest)));

    let mut joined = rest.part.clone();
    let mut quad_of_face = Vec::with_capacity(rest.quad_of_face.len());
    for (f, (&quad, parent)) in rest.quad_of_face.iter().zip(own.faces()).enumerate() {
        let parent = parent.index();
        quad_of_face.push(if zones[parent] == kept {
            joined.region_of_face[f] = earlier.part.region_of_face[parent];
            quad_number[earlier.quad_of_face[parent] as usize]
        } else if quad == QuadLayout::NO_QUAD {
            quad
        } else {
            first + quad
        });
    }
    joined.provenance = lineage.provenance(&part.mesh);
    let region_faces = rest
        .region_faces
        .iter()
        .filter(|face| face.region != kept)
        .map(|face| RegionFace {
            region: face.region,
            loops: face.loops.iter().map(|sides| sides.iter().map(|&side| of_rest(side)).collect()).collect(),
        })
        .collect();
    Ok(QuadLayout {
        part: joined,
        lengths: earlier.lengths,
        vertices,
        edges,
        quads,
        quad_of_face,
        region_faces,
        tiles: tiles + rest.tiles,
        macro_triangles: 0,
    })
}

/// How the mesh of the rest lies on that of the earlier layout.
fn own_lineage(join: &Join<'_>) -> Option<Lineage> {
    let Join { carried, tiling, rest, .. } = *join;
    let mesh = &carried.layout.part.mesh;
    let of_tiling = Lineage::new(&tiling.part, mesh)?;
    of_tiling.of_child(&rest.part, &Lineage::new(&rest.part, &tiling.part.mesh)?, mesh)
}

/// For each edge of the rest the one of the earlier layout that it is. Fails with the given sides that are not, each once, edges of the
/// rest.
fn same_edges(join: &Join<'_>, provenance: &[Provenance]) -> Result<Vec<Option<Same>>, BTreeSet<u32>> {
    let Join { carried, rest, given, .. } = *join;
    let earlier = &carried.layout;
    let key = |a: VertexId, b: VertexId| [a.min(b), a.max(b)];
    let mut edge_at: FxHashMap<[VertexId; 2], u32> = FxHashMap::default();
    for e in given.iter().flat_map(|side| [2 * side, 2 * side + 1]) {
        for pair in earlier.edges[e as usize].path.windows(2) {
            edge_at.insert(key(pair[0], pair[1]), e);
        }
    }
    // The edge of the earlier mesh that a piece of a path lies on.
    let on = |pair: &[VertexId]| {
        let mut ends: Vec<VertexId> = Vec::with_capacity(4);
        for v in pair {
            match provenance[v.index()] {
                Provenance::Vertex(v) => ends.push(v),
                Provenance::Edge { ends: own, .. } => ends.extend(own),
                Provenance::Face { .. } => return None,
            }
        }
        ends.sort_unstable();
        ends.dedup();
        let [a, b] = ends[..] else { return None };
        edge_at.get(&[a, b]).copied()
    };
    let mut found = vec![false; earlier.edges.len()];
    let mut wrong = BTreeSet::new();
    let same = rest
        .edges
        .iter()
        .map(|edge| {
            let e = edge.path.windows(2).find_map(on)?;
            let path = &earlier.edges[e as usize].path;
            let (own, other) =
                ([edge.path[0], edge.path[edge.path.len() - 1]], [path[0], path[path.len() - 1]]);
            let whole = edge.path.windows(2).all(|pair| on(pair) == Some(e));
            let reversed = own[0] != other[0];
            let ends_meet = own == if reversed { [other[1], other[0]] } else { other };
            if !whole || !ends_meet || std::mem::replace(&mut found[e as usize], true) {
                wrong.insert(e / 2);
                return None;
            }
            Some((e, reversed))
        })
        .collect();
    let missing = given.iter().filter(|&&side| !found[2 * side as usize] || !found[2 * side as usize + 1]);
    wrong.extend(missing);
    if wrong.is_empty() { Ok(same) } else { Err(wrong) }
}
