//! The dual of a tiling, and the layout that its matching gives.

use crate::matching::Diagonal;
use crate::pairing::{match_good_pairs, match_without_doublets, surface_angles};
use crate::refine::{Quads, Regions, refine};
use crate::sides::{FeaturePath, TileSide, Tiled, feature_paths, midpoints, tile_sides};
use crate::spokes::{self, SpokeTask};
use crate::straighten::straighten;
use crate::{Lengths, MacroEdge, Pairing, Parameters, QuadLayout, QuadMatchingError, Side};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashSet};
use topipe_mesh::{FaceId, HalfEdgeId, Part, VertexId};
use topipe_progress::Progress;
use topipe_tiling::Tiling;

/// Cuts the macro-edges of a tiling into its mesh and pairs the macro-triangles; see the crate's documentation.
pub fn match_quads(
    tiling: &Tiling,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<QuadLayout, QuadMatchingError> {
    parameters.validate()?;
    let tiles = tiling.tile_count();
    // Bordered tiles have no dual to be paired: a surface with borders need not have an even number of triangles.
    // What is refined once anyway is divided from its centres there.
    if tiling.bordered && parameters.pairing == Pairing::Perfect {
        let value = "perfect".into();
        let range = "\"refined\" or \"midpoint\" for bordered tiles; set method = \"augmented-voronoi\" of the tiling for the others";
        return Err(QuadMatchingError::Parameter { field: "pairing", value, range });
    }
    if parameters.pairing == Pairing::Midpoint || tiling.bordered {
        return crate::midpoint::subdivide(tiling, None, parameters, progress);
    }
    if tiling.tile_of_face.len() != tiling.part.mesh.face_count() || tiling.anchors.len() != tiles {
        return Err(QuadMatchingError::Tiling("its arrays do not fit together".into()));
    }
    let mut tiled = Tiled::new(tiling)?;
    let sides = tile_sides(&tiled, tiles)?;
    let features = feature_paths(tiling, &tiled);
    let middles = midpoints(&mut tiled, &sides, &features, parameters.snap);
    progress.check()?;
    // Sides again: middles may have split border edges.
    let sides = tile_sides(&tiled, tiles)?;
    let (sites, edges) = cut_macro_edges(&mut tiled, &sides, &features, &middles, parameters, progress)?;

    let triangles = macro_triangles(&tiled, &sides)?;
    let edge_of: BTreeMap<[u32; 2], u32> =
        edges.iter().enumerate().map(|(i, e)| (e.ends, i as u32)).collect();
    let mut diagonals = diagonals(&tiled, &sites, &edges, &triangles, &edge_of)?;
    let macro_edges: HashSet<[VertexId; 2]> =
        edges.iter().flat_map(|e| e.path.windows(2)).map(|w| [w[0].min(w[1]), w[0].max(w[1])]).collect();
    let triangle_of_face = flood_triangles(&tiled, &triangles, &macro_edges)?;
    let partner = match parameters.pairing {
        Pairing::Perfect => {
            let partner =
                match_without_doublets(sites.len(), triangles.len(), &edges, &mut diagonals, parameters);
            let single = partner.iter().filter(|p| p.is_none()).count();
            if single > 0 {
                return Err(QuadMatchingError::NoPerfectMatching { single, all: triangles.len() });
            }
            partner
        }
        Pairing::Refined | Pairing::Midpoint => {
            let angles = surface_angles(&tiled, &sites, &triangles, &triangle_of_face);
            match_good_pairs(&sites, &triangles, &edges, &diagonals, &angles, parameters)
        }
    };
    progress.check()?;
    let followed = edges.iter().filter(|e| e.feature.is_some()).count();
    let lost: HashSet<usize> =
        partner.iter().flatten().copied().filter(|&i| edges[i].feature.is_some()).collect();
    progress.remark(&format!(
        "{followed} macro-edges follow features, {} of them were removed by the matching",
        lost.len()
    ));

    // Each matched diagonal makes one region of four sides; a triangle left over is a region of its own.
    let side = |from: u32, to: u32| -> Result<Side, QuadMatchingError> {
        let edge = edge_of
            .get(&[from.min(to), from.max(to)])
            .ok_or_else(|| QuadMatchingError::Tiling(format!("tiles {from} and {to} do not meet")))?;
        Ok(Side { edge: *edge, reversed: from > to })
    };
    let mut regions: Vec<Vec<Side>> = Vec::with_capacity(triangles.len());
    let mut region_of_triangle = vec![0u32; triangles.len()];
    for (t, triangle) in triangles.iter().enumerate() {
        let corners = match partner[t] {
            None => triangle.tiles.to_vec(),
            Some(i) => {
                let [t1, t2] = diagonals[i].triangles;
                if t as u32 != t1 {
                    continue;
                }
                let [o1, d1, d2] = rotated_to(triangle, edges[i].ends);
                let [o2, ..] = rotated_to(&triangles[t2 as usize], edges[i].ends);
                region_of_triangle[t2 as usize] = regions.len() as u32;
                vec![o1, d1, o2, d2]
            }
        };
        region_of_triangle[t] = regions.len() as u32;
        let n = corners.len();
        regions.push((0..n).map(|k| side(corners[k], corners[(k + 1) % n])).collect::<Result<_, _>>()?);
    }
    let region_of_face: Vec<u32> = triangle_of_face.iter().map(|&t| region_of_triangle[t as usize]).collect();

    let macro_triangles = triangles.len() as u32;
    let (edges, sides) = without_removed(edges, regions, &partner);
    tiled.tile_of_face = region_of_face;
    let mut regions = Regions { tiled, vertices: sites, edges, sides };
    for _ in 0..parameters.straightening_rounds {
        straighten(&mut regions, parameters.snap, progress)?;
    }
    let quads = match parameters.pairing {
        Pairing::Perfect => Quads {
            quads: regions.sides.iter().filter_map(|sides| sides[..].try_into().ok()).collect(),
            vertices: regions.vertices,
            edges: regions.edges,
            quad_of_face: regions.tiled.tile_of_face.clone(),
            tiled: regions.tiled,
        },
        Pairing::Refined | Pairing::Midpoint => {
            refine(regions, &Default::default(), parameters.snap, progress)?
        }
    };
    let (part, _): (Part, Vec<FaceId>) = quads.tiled.refiner.finish();
    let mut layout = QuadLayout {
        lengths: Lengths::of(&part.mesh),
        part,
        vertices: quads.vertices,
        edges: quads.edges,
        quads: quads.quads,
        quad_of_face: quads.quad_of_face,
        region_faces: Vec::new(),
        tiles: tiles as u32,
        macro_triangles,
    };
    crate::doublets::merge(&mut layout);
    crate::doublets::compact(&mut layout);
    layout.check_corners(parameters)?;
    Ok(layout)
}

/// Drops the macro-edges that were removed by the matching and renumbers the sides.
fn without_removed(
    edges: Vec<MacroEdge>,
    mut regions: Vec<Vec<Side>>,
    partner: &[Option<usize>],
) -> (Vec<MacroEdge>, Vec<Vec<Side>>) {
    let removed: HashSet<usize> = partner.iter().flatten().copied().collect();
    let mut number = vec![u32::MAX; edges.len()];
    let mut kept = Vec::with_capacity(edges.len());
    for (i, edge) in edges.into_iter().enumerate() {
        if !removed.contains(&i) {
            number[i] = kept.len() as u32;
            kept.push(edge);
        }
    }
    for side in regions.iter_mut().flatten() {
        side.edge = number[side.edge as usize];
    }
    (kept, regions)
}

/// A macro-triangle: three tiles counter-clockwise around a corner vertex of the tiling.
pub(crate) struct MacroTriangle {
    corner: VertexId,
    pub(crate) tiles: [u32; 3],
}

/// The tiles of a triangle, the one opposite to the given edge first.
pub(crate) fn rotated_to(triangle: &MacroTriangle, edge: [u32; 2]) -> [u32; 3] {
    let [a, b, c] = triangle.tiles;
    if !edge.contains(&a) {
        [a, b, c]
    } else if !edge.contains(&b) {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

type Cuts = (Vec<VertexId>, Vec<MacroEdge>);

fn cut_macro_edges(
    tiled: &mut Tiled,
    sides: &[Vec<TileSide>],
    features: &BTreeMap<[u32; 2], FeaturePath>,
    middles: &BTreeMap<[u32; 2], VertexId>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Cuts, QuadMatchingError> {
    let mut faces: Vec<Vec<FaceId>> = vec![Vec::new(); sides.len()];
    for (f, &tile) in tiled.tile_of_face.iter().enumerate() {
        faces[tile as usize].push(FaceId::new(f));
    }
    let tasks: Vec<SpokeTask> = sides
        .iter()
        .enumerate()
        .zip(faces)
        .map(|((tile, of_tile), faces)| {
            let tile = tile as u32;
            let mut border: Vec<VertexId> = Vec::new();
            let mut targets = Vec::with_capacity(of_tile.len());
            let mut anchor = None;
            for side in of_tile {
                border.extend(&side.path[..side.path.len() - 1]);
                let pair = [tile.min(side.neighbor), tile.max(side.neighbor)];
                let spoke = features.get(&pair).map(|feature| {
                    // From this tile's site to the crossing.
                    let path: Vec<VertexId> = if tile == pair[0] {
                        feature.path[..=feature.crossing].to_vec()
                    } else {
                        feature.path[feature.crossing..].iter().rev().copied().collect()
                    };
                    anchor = Some(path[0]);
                    path
                });
                targets.push((middles[&pair], spoke));
            }
            SpokeTask { tile, border, targets, faces, anchor }
        })
        .collect();
    // Cutting one tile leaves the faces of the others as they are.
    let shared = &*tiled;
    let cut: Vec<_> = tasks.par_iter().map(|task| spokes::cut(shared, task, parameters.snap)).collect();
    let mut sites = Vec::with_capacity(tasks.len());
    let mut halves: BTreeMap<[u32; 2], [Vec<VertexId>; 2]> = BTreeMap::new();
    for (task, cut) in tasks.iter().zip(cut) {
        if task.tile % 64 == 0 {
            progress.check()?;
            progress.step(task.tile.into(), tasks.len() as u64, "tiles");
        }
        let (site, paths) = cut?.replay(tiled);
        sites.push(site);
        for (side, path) in sides[task.tile as usize].iter().zip(paths) {
            let pair = [task.tile.min(side.neighbor), task.tile.max(side.neighbor)];
            halves.entry(pair).or_default()[(task.tile != pair[0]) as usize] = path;
        }
    }
    let mut edges = Vec::with_capacity(halves.len());
    for (ends, [mut path, other]) in halves {
        path.extend(other.iter().rev().skip(1));
        edges.push(MacroEdge { ends, path, feature: features.get(&ends).map(|f| f.kind) });
    }
    Ok((sites, edges))
}

fn macro_triangles(tiled: &Tiled, sides: &[Vec<TileSide>]) -> Result<Vec<MacroTriangle>, QuadMatchingError> {
    let mut triangles = Vec::new();
    for (tile, of_tile) in sides.iter().enumerate() {
        for side in of_tile {
            let corner = side.path[0];
            let around = tiled.tiles_around(corner);
            let [a, b, c] = around[..] else {
                return Err(QuadMatchingError::Tiling(format!(
                    "{} tiles meet at vertex {}",
                    around.len(),
                    corner.0
                )));
            };
            // Each corner is met from three tiles; the lowest one lists it.
            if a.min(b).min(c) == tile as u32 {
                triangles.push(MacroTriangle { corner, tiles: [a, b, c] });
            }
        }
    }
    Ok(triangles)
}

/// One diagonal per macro-edge, in the same order.
fn diagonals(
    tiled: &Tiled,
    sites: &[VertexId],
    edges: &[MacroEdge],
    triangles: &[MacroTriangle],
    edge_of: &BTreeMap<[u32; 2], u32>,
) -> Result<Vec<Diagonal>, QuadMatchingError> {
    let mut beside: Vec<Vec<u32>> = vec![Vec::new(); edges.len()];
    for (t, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.tiles;
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if let Some(&edge) = edge_of.get(&[from.min(to), from.max(to)]) {
                beside[edge as usize].push(t as u32);
            }
        }
    }
    let at = |tile: u32| tiled.refiner.part().mesh.position(sites[tile as usize]);
    edges
        .iter()
        .zip(beside)
        .map(|(edge, beside)| {
            let [t1, t2] = beside[..] else {
                return Err(QuadMatchingError::Tiling(format!(
                    "the border of tiles {} and {} has {} corners",
                    edge.ends[0],
                    edge.ends[1],
                    beside.len()
                )));
            };
            let [o1, d1, d2] = rotated_to(&triangles[t1 as usize], edge.ends);
            let [o2, ..] = rotated_to(&triangles[t2 as usize], edge.ends);
            Ok(Diagonal {
                triangles: [t1, t2],
                corners: [at(o1), at(d1), at(d2), at(o2)],
                feature: edge.feature.is_some(),
                penalty: 0.0,
            })
        })
        .collect()
}

/// The macro-triangle of each face: what can be reached from its corner without crossing a macro-edge.
fn flood_triangles(
    tiled: &Tiled,
    triangles: &[MacroTriangle],
    macro_edges: &HashSet<[VertexId; 2]>,
) -> Result<Vec<u32>, QuadMatchingError> {
    let mut triangle_of_face = vec![u32::MAX; tiled.tile_of_face.len()];
    for (t, triangle) in triangles.iter().enumerate() {
        let mut stack: Vec<FaceId> =
            tiled.refiner.outgoing(triangle.corner).iter().map(|h| h.face()).collect();
        stack.iter().for_each(|f| triangle_of_face[f.index()] = t as u32);
        while let Some(face) = stack.pop() {
            for k in 0..3 {
                let h = HalfEdgeId::of(face, k);
                let (a, b) = (tiled.refiner.origin(h), tiled.refiner.target(h));
                let next = tiled.refiner.twin(h).face();
                if triangle_of_face[next.index()] == u32::MAX && !macro_edges.contains(&[a.min(b), a.max(b)])
                {
                    triangle_of_face[next.index()] = t as u32;
                    stack.push(next);
                }
            }
        }
    }
    match triangle_of_face.iter().position(|&t| t == u32::MAX) {
        Some(face) => Err(QuadMatchingError::Tiling(format!("face {face} lies in no macro-triangle"))),
        None => Ok(triangle_of_face),
    }
}
