//! More quads around a vertex, and the others as they are.
//!
//! The edges at the vertex are halved, and each quad around it becomes three: from a point inside it paths lead to the two middles
//! and to the corner opposite. What lies around these quads keeps its sides, so that a division does not run on through the layout as
//! it does where quads are halved from side to side. The quad at the vertex is about half as wide as before. The angle at the
//! corner opposite is shared by two quads; the new vertices and those around them are relaxed afterwards, by which quads beside them
//! change their shape a little.
//!
//! Source: the template for one marked corner in the refinement of quadrilateral meshes (Schneiders 1996).

use crate::ends::turn_ends;
use crate::refine::{Regions, flood, middle_of};
use crate::relax::{Effort, Incidence, relax, within_gates};
use crate::sides::Tiled;
use crate::spokes::{self, SpokeTask};
use crate::{MacroEdge, Parameters, QuadLayout, QuadMatchingError, RegionFace, Side};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{FaceId, VertexId};
use topipe_progress::Progress;

/// Times that other vertices are tried in place of those whose division leaves a corner outside the gates.
const ATTEMPTS: usize = 6;
/// What is done about the corners of the new quads.
const EFFORTS: [Effort; 5] =
    [Effort::Improve, Effort::Improve, Effort::Improve, Effort::Search, Effort::Search];

/// A layout with quads divided.
#[derive(Debug, Clone, PartialEq)]
pub struct Division {
    /// The finer layout.
    pub layout: QuadLayout,
    /// For each of the wanted places the macro-vertex around which quads were divided. Several places may have one in common.
    pub vertices: Vec<Option<u32>>,
}

/// Divides quads: for each of the wanted places those around one of its macro-vertices, the first that can be divided or is divided
/// for an earlier place. It can where no quad around it is divided around another vertex, and no corner of the new quads lies outside
/// 15 to 165 degrees.
///
/// None where nothing is divided. Vertices, edges and quads of the given layout keep their numbers, an edge that is halved for its
/// first half and a quad for the piece at the vertex; so do vertices of the mesh, and faces as long as they are not cut.
///
/// Not guaranteed: that every place gets a division. Provenance in the finer layout refers to the mesh of the given one.
pub fn divide(
    layout: &QuadLayout,
    wanted: &[Vec<u32>],
    progress: &Progress,
) -> Result<Option<Division>, QuadMatchingError> {
    divide_in(layout, &Refiner::new(&layout.part)?, wanted, progress)
}

/// The same in a copy of a refiner that has made the part of the layout: provenance in the finer layout refers to the part that
/// was refined.
pub(crate) fn divide_in(
    layout: &QuadLayout,
    refiner: &Refiner,
    wanted: &[Vec<u32>],
    progress: &Progress,
) -> Result<Option<Division>, QuadMatchingError> {
    let around = around(layout, wanted);
    let mut rejected: FxHashSet<u32> = FxHashSet::default();
    for _ in 0..ATTEMPTS {
        progress.check()?;
        let (stars, vertices) = stars(layout, &around, wanted, &rejected);
        if stars.is_empty() {
            break;
        }
        match divided(layout, refiner.clone(), &stars, progress)? {
            Ok(layout) => return Ok(Some(Division { layout, vertices })),
            Err(outside) => rejected.extend(outside),
        }
    }
    Ok(None)
}

/// A vertex and the quads around it, each with its corner there.
struct Star<'a> {
    vertex: u32,
    quads: &'a [(usize, usize)],
}

/// The quads around the wanted vertices, each with its corner there.
fn around(layout: &QuadLayout, wanted: &[Vec<u32>]) -> FxHashMap<u32, Vec<(usize, usize)>> {
    let mut around: FxHashMap<u32, Vec<(usize, usize)>> =
        wanted.iter().flatten().map(|&vertex| (vertex, Vec::new())).collect();
    for quad in 0..layout.quads.len() {
        for (k, vertex) in layout.corners(quad).into_iter().enumerate() {
            if let Some(quads) = around.get_mut(&vertex) {
                quads.push((quad, k));
            }
        }
    }
    around
}

/// The stars that are divided together, and for each place the vertex of one: no two have a quad in common.
fn stars<'a>(
    layout: &QuadLayout,
    around: &'a FxHashMap<u32, Vec<(usize, usize)>>,
    wanted: &[Vec<u32>],
    rejected: &FxHashSet<u32>,
) -> (Vec<Star<'a>>, Vec<Option<u32>>) {
    let mut taken: FxHashSet<usize> = FxHashSet::default();
    let star = |vertex: u32, taken: &mut FxHashSet<usize>| {
        let quads = around.get(&vertex)?;
        let mut own: FxHashSet<usize> = FxHashSet::default();
        // A quad with two corners at the vertex has no one corner opposite.
        let simple = quads.iter().all(|&(quad, _)| !taken.contains(&quad) && own.insert(quad));
        let round = quads.iter().flat_map(|&(quad, k)| sides_at(layout, quad, k)).any(|side| {
            let ends = layout.edges[side.edge as usize].ends;
            ends[0] == ends[1]
        });
        (simple && !round && !quads.is_empty()).then(|| {
            taken.extend(own);
            Star { vertex, quads }
        })
    };
    let mut stars: Vec<Star<'a>> = Vec::new();
    let mut centers: FxHashSet<u32> = FxHashSet::default();
    let mut divides = |vertex: u32| {
        if rejected.contains(&vertex) || centers.contains(&vertex) {
            return centers.contains(&vertex);
        }
        let star = star(vertex, &mut taken);
        centers.extend(star.as_ref().map(|star| star.vertex));
        let is_one = star.is_some();
        stars.extend(star);
        is_one
    };
    let vertices = wanted.iter().map(|place| place.iter().copied().find(|&vertex| divides(vertex))).collect();
    (stars, vertices)
}

/// The sides of a quad that meet at its corner `k`: the one that leaves it and the one that ends there.
fn sides_at(layout: &QuadLayout, quad: usize, k: usize) -> [Side; 2] {
    [layout.quads[quad][k], layout.quads[quad][(k + 3) % 4]]
}

/// The layout with the stars divided, or the vertices of those that leave a corner of the new quads outside the gates.
fn divided(
    layout: &QuadLayout,
    refiner: Refiner,
    stars: &[Star<'_>],
    progress: &Progress,
) -> Result<Result<QuadLayout, Vec<u32>>, QuadMatchingError> {
    let snap = Parameters::default().snap;
    let corners = || stars.iter().flat_map(|star| star.quads).copied();
    let mut tiled = Tiled::over(refiner, layout.quad_of_face.clone());
    let mut vertices = layout.vertices.clone();
    let mut edges = layout.edges.clone();
    let halves = halve(layout, corners(), &mut tiled, &mut vertices, &mut edges, snap);

    let tasks = tasks(layout, corners(), &tiled, &vertices, &halves);
    // Cutting one quad leaves the faces of the others as they are.
    let shared = &tiled;
    let cut: Vec<_> = tasks.par_iter().map(|task| spokes::cut(shared, task, snap)).collect();
    let mut quads = layout.quads.clone();
    for ((quad, k), cut) in corners().zip(cut) {
        let (center, paths) = cut?.replay(&mut tiled);
        let number = vertices.len() as u32;
        vertices.push(center);
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| layout.quads[quad][(k + i) % 4]);
        let ends = [halves[&a.edge].middle, layout.start(c), halves[&d.edge].middle];
        let first = edges.len() as u32;
        let spoke = |(path, end)| MacroEdge { ends: [number, end], path, feature: None };
        edges.extend(paths.into_iter().zip(ends).map(spoke));
        // From the new vertex, and to it.
        let [out_a, out_c, out_d] = [0, 1, 2].map(|i| Side { edge: first + i, reversed: false });
        let [in_a, in_c, in_d] = [out_a, out_c, out_d].map(|side| Side { reversed: true, ..side });
        let half = |side: Side, second: bool| half(&halves, side, second);
        quads[quad] = [half(a, false), in_a, out_d, half(d, true)];
        quads.push([half(a, true), b, in_c, out_a]);
        quads.push([c, half(d, false), in_d, out_c]);
    }
    let loops = |face: &RegionFace| face.loops.iter().map(|sides| halved(&halves, sides)).collect();
    let region_faces = layout.region_faces.iter();
    let region_faces =
        region_faces.map(|face| RegionFace { region: face.region, loops: loops(face) }).collect();
    let mut new = vec![false; layout.quads.len()];
    new.resize(quads.len(), true);
    corners().for_each(|(quad, _)| new[quad] = true);
    tiled.tile_of_face = flood(&tiled, &edges, &quads, |quad| new[quad])?;

    let sides = quads.iter().map(|quad| quad.to_vec()).collect();
    let mut regions = Regions { tiled, vertices, edges, sides };
    let incidence = Incidence::of(&regions, new);
    // What has moved nothing would move nothing again.
    let mut idle = None;
    for effort in EFFORTS {
        if idle != Some(effort) && relax(&mut regions, &incidence, effort, snap, progress)? == 0 {
            idle = Some(effort);
        }
    }
    turn_ends(&mut regions);
    let outside = outside(&regions, layout.quads.len(), stars);
    if !outside.is_empty() {
        return Ok(Err(outside));
    }
    let Regions { tiled, vertices, edges, .. } = regions;
    let quad_of_face = tiled.tile_of_face;
    let (part, _) = tiled.refiner.finish();
    Ok(Ok(QuadLayout { part, vertices, edges, quads, quad_of_face, region_faces, ..*layout }))
}

/// Halves the edges at corners of quads.
fn halve(
    layout: &QuadLayout,
    corners: impl Iterator<Item = (usize, usize)>,
    tiled: &mut Tiled,
    vertices: &mut Vec<VertexId>,
    edges: &mut Vec<MacroEdge>,
    snap: f64,
) -> FxHashMap<u32, Halves> {
    let mut beside: FxHashMap<u32, Vec<u32>> = FxHashMap::default();
    // In the order of the corners, as nothing may depend on that of a table.
    let mut order = Vec::new();
    for (quad, k) in corners {
        for side in sides_at(layout, quad, k) {
            let quads = beside.entry(side.edge).or_default();
            if quads.is_empty() {
                order.push(side.edge);
            }
            quads.push(quad as u32);
        }
    }
    let mut halves = FxHashMap::default();
    for e in order {
        let edge = &mut edges[e as usize];
        let mut path = std::mem::take(&mut edge.path);
        let at = middle_of(tiled, &mut path, edge.feature, snap, &beside[&e]);
        let middle = vertices.len() as u32;
        vertices.push(path[at]);
        let (last, feature) = (edge.ends[1], edge.feature);
        edge.ends[1] = middle;
        edge.path = path[..=at].to_vec();
        let second = edges.len() as u32;
        edges.push(MacroEdge { ends: [middle, last], path: path[at..].to_vec(), feature });
        halves.insert(e, Halves { middle, second, path });
    }
    halves
}

/// What is to be cut into the quads: from a point inside to the middles of the sides at the corner, and to the corner opposite.
fn tasks(
    layout: &QuadLayout,
    corners: impl Iterator<Item = (usize, usize)> + Clone,
    tiled: &Tiled,
    vertices: &[VertexId],
    halves: &FxHashMap<u32, Halves>,
) -> Vec<SpokeTask> {
    let mut faces: FxHashMap<u32, Vec<FaceId>> =
        corners.clone().map(|(quad, _)| (quad as u32, Vec::new())).collect();
    for (f, quad) in tiled.tile_of_face.iter().enumerate() {
        if let Some(faces) = faces.get_mut(quad) {
            faces.push(FaceId::new(f));
        }
    }
    let task = |(quad, k): (usize, usize)| {
        let sides = [0, 1, 2, 3].map(|i| layout.quads[quad][(k + i) % 4]);
        let mut border: Vec<VertexId> = Vec::new();
        for side in sides {
            let whole = halves.get(&side.edge).map(|halves| &halves.path);
            let mut path = whole.unwrap_or(&layout.edges[side.edge as usize].path).clone();
            if side.reversed {
                path.reverse();
            }
            path.pop();
            border.extend(path);
        }
        let middle = |side: Side| vertices[halves[&side.edge].middle as usize];
        let opposite = layout.vertices[layout.start(sides[2]) as usize];
        let targets = [middle(sides[0]), opposite, middle(sides[3])].map(|v| (v, None)).to_vec();
        let tile = quad as u32;
        SpokeTask { tile, border, targets, faces: faces.remove(&tile).unwrap_or_default(), anchor: None }
    };
    corners.map(task).collect()
}

/// An edge that was halved.
struct Halves {
    /// The macro-vertex in the middle.
    middle: u32,
    /// The edge from there on; the first half has the number of the whole.
    second: u32,
    /// All of the path.
    path: Vec<VertexId>,
}

/// The first or second half of a side, in its own direction; the side itself where it was not halved.
fn half(halves: &FxHashMap<u32, Halves>, side: Side, second: bool) -> Side {
    match halves.get(&side.edge) {
        Some(halves) if side.reversed != second => Side { edge: halves.second, ..side },
        _ => side,
    }
}

/// Sides, with those that were halved in two.
fn halved(halves: &FxHashMap<u32, Halves>, sides: &[Side]) -> Vec<Side> {
    let mut fine = Vec::with_capacity(sides.len());
    for &side in sides {
        fine.push(half(halves, side, false));
        if halves.contains_key(&side.edge) {
            fine.push(half(halves, side, true));
        }
    }
    fine
}

/// Vertices whose division leaves a corner of the new quads outside the gates; `before` is the number of quads there were.
fn outside(finer: &Regions, before: usize, stars: &[Star<'_>]) -> Vec<u32> {
    let bad = |quad: usize| !within_gates(finer, quad);
    let mut new = before;
    let mut found = Vec::new();
    for star in stars {
        let last = new + 2 * star.quads.len();
        if star.quads.iter().map(|&(quad, _)| quad).chain(new..last).any(bad) {
            found.push(star.vertex);
        }
        new = last;
    }
    found
}
