//! The surface as vertices, edges and loops: what all files of CAD systems have in common.
//!
//! Beside the edges of the surface there are the seams of walls that go all around (see `seams`), and an edge in which a
//! seam ends comes in pieces.

mod seams;

use crate::{AnalyticFace, EdgeCurve, PatchSide, SplineSurface};
use seams::{End, Seam, seam};
use topipe_mesh::{DVec3, RegionShape};

/// Vertices nearer than this share of the diagonal to one ruling are on it.
const SAME_RULING: f64 = 1e-11;

/// Vertices, edges and loops of a surface.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Brep {
    /// The vertices of the surface, then the ends of seams inside of edges.
    pub(crate) vertices: Vec<DVec3>,
    /// The edges of the surface in their order, in pieces where seams end in them, then the seams.
    pub(crate) edges: Vec<Edge>,
    /// The loop of each patch.
    pub(crate) patches: Vec<Vec<Oriented>>,
    /// The faces of known shape.
    pub(crate) faces: Vec<Face>,
}

/// A curve between two vertices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    /// Its first and last vertex.
    pub(crate) ends: [u32; 2],
    pub(crate) curve: Curve,
}

/// Where an edge runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Curve {
    /// Along an edge of the surface, between two of its parameters.
    Piece { edge: u32, from: f64, to: f64 },
    /// Straight.
    Seam,
}

/// An edge of a loop, as an index into [`Brep::edges`], and whether it is run against.
pub(crate) type Oriented = (u32, bool);

/// A face of known shape.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Face {
    /// From where the angle of a cylinder is counted: a unit vector to its seam, or away from a face that does not go around,
    /// so that the face lies within one turn. Of a plane any direction in it.
    pub(crate) start: DVec3,
    /// Its loops, with the face on their left seen from outside.
    pub(crate) loops: Vec<Loop>,
}

/// A closed chain of edges.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Loop {
    /// Whether it bounds its face from outside. Around a cylinder none does, but with the seam.
    pub(crate) outer: bool,
    pub(crate) edges: Vec<Oriented>,
}

/// Where seams end inside of an edge: parameter and vertex, ascending.
type Cuts = Vec<(f64, u32)>;

impl Brep {
    pub(crate) fn of(surface: &SplineSurface) -> Self {
        let low = surface.vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = surface.vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let near = SAME_RULING * (high - low).length();
        let seams: Vec<Option<Seam>> = surface.faces.iter().map(|face| seam(surface, face, near)).collect();
        let mut vertices = surface.vertices.clone();
        let mut cuts: Vec<Cuts> = vec![Vec::new(); surface.edges.len()];
        let mut seam_edges: Vec<Option<Edge>> = Vec::with_capacity(seams.len());
        for seam in &seams {
            seam_edges.push(seam.as_ref().map(|seam| {
                let ends = [0, 1].map(|k| match seam.ends[k].2 {
                    End::Vertex(v) => v,
                    End::Inside { edge, t, at } => {
                        let vertex = vertices.len() as u32;
                        vertices.push(at);
                        cuts[edge as usize].push((t, vertex));
                        vertex
                    }
                });
                Edge { ends, curve: Curve::Seam }
            }));
        }
        let mut edges = Vec::with_capacity(surface.edges.len() + seams.len());
        let mut pieces: Vec<Vec<u32>> = Vec::with_capacity(surface.edges.len());
        for (e, (edge, cuts)) in surface.edges.iter().zip(&mut cuts).enumerate() {
            cuts.sort_by(|x, y| x.0.total_cmp(&y.0));
            let mut stops = vec![(0.0, edge.ends[0])];
            stops.extend(cuts.iter());
            stops.push((1.0, edge.ends[1]));
            let first = edges.len() as u32;
            edges.extend(stops.windows(2).map(|w| {
                let ((from, a), (to, b)) = (w[0], w[1]);
                Edge { ends: [a, b], curve: Curve::Piece { edge: e as u32, from, to } }
            }));
            pieces.push((first..edges.len() as u32).collect());
        }
        let around = |sides: &[PatchSide]| sides.iter().flat_map(|side| run(side, &pieces)).collect();
        let patches = surface.patches.iter().map(|patch| around(&patch.sides)).collect();
        let mut faces = Vec::with_capacity(surface.faces.len());
        for (face, (seam, edge)) in surface.faces.iter().zip(seams.iter().zip(seam_edges)) {
            let mut loops = Vec::with_capacity(face.loops.len());
            let mut cut = [usize::MAX; 2];
            if let (Some(seam), Some(edge)) = (seam, edge) {
                // Around one border, along the seam, around the other, and back.
                let id = edges.len() as u32;
                edges.push(edge);
                cut = [seam.ends[0].0, seam.ends[1].0];
                let mut chain = from_seam(&face.loops[cut[0]], seam.ends[0], &pieces, &cuts);
                chain.push((id, false));
                chain.extend(from_seam(&face.loops[cut[1]], seam.ends[1], &pieces, &cuts));
                chain.push((id, true));
                loops.push(Loop { outer: true, edges: chain });
            }
            for (_, sides) in face.loops.iter().enumerate().filter(|(l, _)| !cut.contains(l)) {
                loops.push(Loop { outer: is_outer(face, sides, &surface.edges), edges: around(sides) });
            }
            faces.push(Face { start: start(surface, face, seam.as_ref()), loops });
        }
        Self { vertices, edges, patches, faces }
    }
}

/// The pieces of the edge along a side, in the order in which they are run.
fn run(side: &PatchSide, pieces: &[Vec<u32>]) -> Vec<Oriented> {
    let mut run: Vec<Oriented> = pieces[side.edge as usize].iter().map(|&id| (id, side.reversed)).collect();
    if side.reversed {
        run.reverse();
    }
    run
}

/// A whole border from the end of a seam around to it again.
fn from_seam(
    around: &[PatchSide],
    (_, first, end): (usize, usize, End),
    pieces: &[Vec<u32>],
    cuts: &[Cuts],
) -> Vec<Oriented> {
    let n = around.len();
    let mut all: Vec<Oriented> = (0..n).flat_map(|k| run(&around[(first + k) % n], pieces)).collect();
    if let End::Inside { edge, t, .. } = end {
        // Pieces of the first edge before the cut come last.
        let before = cuts[edge as usize].iter().filter(|cut| cut.0 < t).count() + 1;
        let count = pieces[edge as usize].len();
        all.rotate_left(if around[first].reversed { count - before } else { before });
    }
    all
}

fn start(surface: &SplineSurface, face: &AnalyticFace, seam: Option<&Seam>) -> DVec3 {
    let (point, axis) = match face.shape {
        RegionShape::Plane { normal, .. } => return normal.any_orthonormal_vector(),
        RegionShape::Cylinder { point, axis, .. } => (point, axis),
    };
    let out = |p: DVec3| (p - point).reject_from_normalized(axis);
    let start = match seam.map(|seam| seam.ends[0].2) {
        Some(End::Vertex(v)) => out(surface.vertices[v as usize]),
        Some(End::Inside { at, .. }) => out(at),
        None => {
            let sides = face.loops.iter().flatten();
            -sides.map(|side| out(surface.edges[side.edge as usize].exact(0.5).position)).sum::<DVec3>()
        }
    };
    start.try_normalize().unwrap_or(axis.any_orthonormal_vector())
}

/// Whether a loop bounds its face from outside. Around a cylinder none does, and STEP then wants none.
fn is_outer(face: &AnalyticFace, around: &[PatchSide], edges: &[EdgeCurve]) -> bool {
    let alone = AnalyticFace { shape: face.shape, loops: vec![around.to_vec()] };
    match face.shape {
        RegionShape::Plane { .. } => alone.area(edges) > 0.0,
        RegionShape::Cylinder { .. } => alone.winding(edges) == 0 && alone.area(edges) > 0.0,
    }
}
