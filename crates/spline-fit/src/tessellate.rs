//! A watertight triangle mesh of a surface, to a chord tolerance.
//!
//! Each edge curve is divided once, and both of its faces use those points. Inside, a patch has a grid of its own;
//! a strip of triangles joins the grid to the four sides. A face of known shape is triangulated between its borders.

pub(crate) mod across;
mod trimmed;

use crate::surface::Column;
use crate::{Basis, CurveShape, EdgeCurve, Patch, PatchSide, SplineSurface};
use rayon::prelude::*;
use topipe_mesh::spatial::BoxIndex;
use topipe_mesh::{DVec3, RegionShape, TriangleMesh, VertexId};

/// Divisions of one edge or one side of a patch's grid at the most: finer than that is a tolerance out of reach.
const MOST: usize = 256;

/// Number of equal pieces into which a curve must be divided: the distance of a curve from its chords is at most
/// |second derivative| / 8 over the square of the number, and the control points of the second derivative bound it.
fn divisions(basis: &Basis, control: impl Iterator<Item = DVec3>, tolerance: f64) -> usize {
    let (p, knots) = (basis.degree(), basis.knots());
    let points: Vec<DVec3> = control.collect();
    // Where knots coincide the derivative jumps, and there is nothing to divide.
    let ratio = |d: DVec3, length: f64| if length > 0.0 { d / length } else { DVec3::ZERO };
    let slope = |i: usize| p as f64 * ratio(points[i + 1] - points[i], knots[i + p + 1] - knots[i + 1]);
    let second = (0..points.len().saturating_sub(2))
        .map(|i| (p - 1) as f64 * ratio(slope(i + 1) - slope(i), knots[i + p + 1] - knots[i + 2]).length())
        .fold(0.0, f64::max);
    ((second / (8.0 * tolerance)).sqrt().ceil() as usize).clamp(1, MOST)
}

/// Divisions of an edge: a line has none, an arc as many as its chords need.
fn edge_divisions(edge: &EdgeCurve, tolerance: f64) -> usize {
    match (edge.shape, edge.sweep()) {
        (CurveShape::Line, _) => 1,
        (CurveShape::Arc { radius, .. }, Some(sweep)) => {
            // A closed circle needs three points to be one.
            let least = if edge.ends[0] == edge.ends[1] { 3.0 } else { 1.0 };
            (sweep / widest(radius, tolerance)).ceil().clamp(least, 4.0 * MOST as f64) as usize
        }
        _ => {
            let count = divisions(&edge.basis, edge.control.iter().copied(), tolerance);
            count.max(if edge.ends[0] == edge.ends[1] { 3 } else { 1 })
        }
    }
}

/// The angle of the longest chord that is no farther than `tolerance` from a circle, at most an eighth of a turn: a
/// coarse tolerance still leaves a hole.
fn widest(radius: f64, tolerance: f64) -> f64 {
    (2.0 * (1.0 - tolerance / radius).max(0.0).acos()).clamp(1e-6, std::f64::consts::FRAC_PI_4)
}

/// How often the borders of a face are sampled four times more finely when they cross because they are sampled too coarsely.
const REFINEMENTS: u32 = 4;

/// How often triangles that pass through each other are looked at: each time but the last their patches are sampled four times more finely.
/// What has not come apart then passes through itself, and is sampled as it was.
const PARTINGS: u32 = 3;

/// How near triangles come to a surface, mm.
struct Tolerances {
    patches: Vec<f64>,
    /// Of the borders of analytic faces, by edge; sides of patches are as near as these.
    borders: Vec<f64>,
    faces: f64,
}

impl SplineSurface {
    /// Triangles whose distance from the surface is about `chord_tolerance` (mm) at the most.
    ///
    /// Guarantees: a closed surface gives a closed mesh, oriented alike, with shared vertices. The tolerance is an
    /// estimate from the control points; at most 256 divisions are made per patch side. Where triangles of narrow patches that turn
    /// would pass through each other, these patches are divided more finely; where the surface itself does, they still do. Where the
    /// borders of a face would cross each other, they are sampled more finely; a face whose borders cross however finely they are
    /// sampled is left out, and the mesh is open there.
    pub fn tessellate(&self, chord_tolerance: f64) -> TriangleMesh {
        self.tessellate_with(chord_tolerance, f64::INFINITY).0
    }

    /// The same, with no edge inside an analytic face longer than `longest` (mm), and the face of each triangle:
    /// patches first, then analytic faces.
    pub fn tessellate_with(&self, chord_tolerance: f64, longest: f64) -> (TriangleMesh, Vec<u32>) {
        self.refined(chord_tolerance, longest, true, PARTINGS)
    }

    /// The triangles of the analytic faces alone, and the analytic face of each.
    pub fn tessellate_faces(&self, chord_tolerance: f64, longest: f64) -> (TriangleMesh, Vec<u32>) {
        let (mesh, mut faces) = self.refined(chord_tolerance, longest, false, 0);
        faces.iter_mut().for_each(|face| *face -= self.patches.len() as u32);
        (mesh, faces)
    }

    /// Triangles as they are, also where they pass through each other, and the face of each.
    pub(crate) fn triangulate(&self, chord_tolerance: f64) -> (TriangleMesh, Vec<u32>) {
        self.refined(chord_tolerance, f64::INFINITY, true, 0)
    }

    fn refined(
        &self,
        chord_tolerance: f64,
        longest: f64,
        patches: bool,
        partings: u32,
    ) -> (TriangleMesh, Vec<u32>) {
        let tolerance = if chord_tolerance > 0.0 { chord_tolerance } else { f64::MIN_POSITIVE };
        let mut tolerances = Tolerances {
            patches: vec![tolerance; self.patches.len()],
            borders: vec![tolerance; self.edges.len()],
            faces: tolerance,
        };
        // Only what needs it is sampled more finely: where all borders were, one such face made a billion bytes of the bell crank's STL.
        let (mut refinements, mut partings) = (REFINEMENTS, partings);
        loop {
            let (mesh, face_of_triangle, crossing) = self.triangles(&tolerances, longest, patches);
            if refinements > 0 && !crossing.is_empty() {
                refinements -= 1;
                let loops = crossing.iter().flat_map(|&face| &self.faces[face].loops);
                let mut edges: Vec<u32> = loops.flatten().map(|side| side.edge).collect();
                edges.sort_unstable();
                edges.dedup();
                edges.into_iter().for_each(|edge| tolerances.borders[edge as usize] /= 4.0);
                continue;
            }
            let crossed = match partings {
                0 => Vec::new(),
                _ => self.patches_that_cross(&mesh, &face_of_triangle),
            };
            if crossed.is_empty() {
                return (mesh, face_of_triangle);
            }
            // What still crosses in the end does so however fine it is.
            partings -= 1;
            let finer = |own: f64| if partings > 0 { own / 4.0 } else { tolerance };
            crossed
                .into_iter()
                .for_each(|patch| tolerances.patches[patch] = finer(tolerances.patches[patch]));
        }
    }

    /// The patches with triangles that pass through others.
    fn patches_that_cross(&self, mesh: &TriangleMesh, face_of_triangle: &[u32]) -> Vec<usize> {
        let patches = self.patches.len();
        let boxes = BoxIndex::build(&across::across(mesh, face_of_triangle, patches));
        let found = across::crossings_in(mesh, face_of_triangle, &boxes);
        let faces = found.iter().flat_map(|crossing| crossing.faces);
        let mut crossed: Vec<usize> = faces.map(|f| face_of_triangle[f.index()] as usize).collect();
        crossed.sort_unstable();
        crossed.dedup();
        crossed.retain(|&face| face < patches);
        crossed
    }

    /// Also returns the analytic faces whose borders cross.
    fn triangles(
        &self,
        tolerances: &Tolerances,
        longest: f64,
        patches: bool,
    ) -> (TriangleMesh, Vec<u32>, Vec<usize>) {
        let mut mesh = TriangleMesh { positions: self.vertices.clone(), triangles: Vec::new() };
        // Of a part of a surface only the edges that it has, each as near as the nearer of its two faces.
        let mut nearness = vec![f64::INFINITY; self.edges.len()];
        let of_patches = self.patches.iter().zip(&tolerances.patches);
        let of_patches =
            of_patches.flat_map(|(patch, &tolerance)| patch.sides.iter().map(move |side| (side, tolerance)));
        let of_faces = self.faces.iter().flat_map(|face| face.loops.iter().flatten());
        let of_faces = of_faces.filter_map(|side| Some((side, *tolerances.borders.get(side.edge as usize)?)));
        for (side, tolerance) in of_patches.chain(of_faces) {
            nearness.get_mut(side.edge as usize).into_iter().for_each(|own| *own = own.min(tolerance));
        }
        let inner = |e: usize| -> Vec<DVec3> {
            let edge = &self.edges[e];
            let count = if nearness[e].is_finite() { edge_divisions(edge, nearness[e]) } else { 1 };
            (1..count).map(|k| edge.exact(k as f64 / count as f64).position).collect()
        };
        let inner: Vec<Vec<DVec3>> = (0..self.edges.len()).into_par_iter().map(inner).collect();
        // Points along each edge, ends included, as mesh vertices.
        let edges: Vec<Vec<VertexId>> = self
            .edges
            .iter()
            .zip(inner)
            .map(|(edge, inner)| {
                let first = mesh.positions.len();
                mesh.positions.extend(inner);
                let numbers = (first..mesh.positions.len()).map(VertexId::new);
                let [start, end] = edge.ends.map(VertexId);
                std::iter::once(start).chain(numbers).chain([end]).collect()
            })
            .collect();
        let along = |side: &PatchSide| {
            let mut points = edges[side.edge as usize].clone();
            if side.reversed {
                points.reverse();
            }
            points
        };
        let mut face_of_triangle = Vec::new();
        let patches = if patches { &self.patches[..] } else { &[] };
        let grids = patches.par_iter().zip(&tolerances.patches).map(|(patch, &tolerance)| {
            let sides: Vec<Vec<VertexId>> = patch.sides.iter().map(along).collect();
            let size = grid_size(patch, &sides, tolerance);
            (grid(patch, size), sides, size)
        });
        let grids: Vec<_> = grids.collect();
        let mut next = mesh.positions.len();
        let mut firsts = Vec::with_capacity(grids.len());
        for (points, ..) in &grids {
            firsts.push(next);
            next += points.len();
        }
        let triangles = grids
            .par_iter()
            .zip(firsts)
            .map(|((_, sides, size), first)| patch_triangles(sides, *size, first));
        let triangles: Vec<Vec<[VertexId; 3]>> = triangles.collect();
        mesh.positions.reserve(next - mesh.positions.len());
        mesh.triangles.reserve(triangles.iter().map(Vec::len).sum());
        for (p, ((points, ..), triangles)) in grids.into_iter().zip(triangles).enumerate() {
            mesh.positions.extend(points);
            mesh.triangles.extend(triangles);
            face_of_triangle.resize(mesh.triangles.len(), p as u32);
        }
        let mut crossing = Vec::new();
        for (f, face) in self.faces.iter().enumerate() {
            let loops: Vec<Vec<VertexId>> = face
                .loops
                .iter()
                .map(|around| {
                    let mut points = Vec::new();
                    for side in around {
                        let mut piece = along(side);
                        piece.pop();
                        points.extend(piece);
                    }
                    points
                })
                .collect();
            let angle = match face.shape {
                RegionShape::Plane { .. } => f64::INFINITY,
                RegionShape::Cylinder { radius, .. } => widest(radius, tolerances.faces),
            };
            if !trimmed::add(&mut mesh, &face.shape, &loops, angle, longest) {
                crossing.push(f);
            }
            face_of_triangle.resize(mesh.triangles.len(), (self.patches.len() + f) as u32);
        }
        (mesh, face_of_triangle, crossing)
    }
}

fn grid_size(patch: &Patch, sides: &[Vec<VertexId>], tolerance: f64) -> (usize, usize) {
    let (nu, nv) = (patch.basis_u.len(), patch.basis_v.len());
    let along_u = (0..nv)
        .map(|j| {
            let row = patch.control[j * nu..(j + 1) * nu].iter().copied();
            divisions(&patch.basis_u, row, tolerance)
        })
        .fold(2, usize::max);
    let along_v = (0..nu)
        .map(|i| {
            let column = (0..nv).map(|j| patch.control[j * nu + i]);
            divisions(&patch.basis_v, column, tolerance)
        })
        .fold(2, usize::max);
    let longest = |a: usize, b: usize| (sides[a].len() - 1).max(sides[b].len() - 1);
    (along_u.max(longest(0, 2)), along_v.max(longest(1, 3)))
}

/// The inner points (i, j) of a grid, with 1 <= i < nu and 1 <= j < nv.
fn grid(patch: &Patch, (nu, nv): (usize, usize)) -> Vec<DVec3> {
    let columns: Vec<Column> =
        (1..nu).map(|i| patch.column(&patch.basis_u.evaluate(i as f64 / nu as f64))).collect();
    let mut points = Vec::with_capacity((nu - 1) * (nv - 1));
    for j in 1..nv {
        let row = patch.basis_v.evaluate(j as f64 / nv as f64);
        points.extend(columns.iter().map(|column| column.evaluate(&row).position));
    }
    points
}

/// The triangles of a patch; `first` is the number of the first inner point of its grid.
fn patch_triangles(sides: &[Vec<VertexId>], (nu, nv): (usize, usize), first: usize) -> Vec<[VertexId; 3]> {
    let mut triangles = Vec::with_capacity(2 * nu * nv);
    let at = |i: usize, j: usize| VertexId::new(first + (j - 1) * (nu - 1) + i - 1);
    for j in 1..nv - 1 {
        for i in 1..nu - 1 {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
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
        zip(&mut triangles, side, ring);
    }
    triangles
}

/// Joins a side (parameters 0 to 1, evenly spaced) to the ring inside of it, advancing on whichever is behind.
fn zip(triangles: &mut Vec<[VertexId; 3]>, side: &[VertexId], ring: &[(VertexId, f64)]) {
    let last = side.len() - 1;
    let t = |k: usize| k as f64 / last as f64;
    let (mut i, mut j) = (0, 0);
    while i < last || j + 1 < ring.len() {
        // Compare the middles of the next pieces; the corners of the side lie beyond the ring's ends.
        let outer = if i < last { (t(i) + t(i + 1)) / 2.0 } else { f64::INFINITY };
        let inner = if j + 1 < ring.len() { (ring[j].1 + ring[j + 1].1) / 2.0 } else { f64::INFINITY };
        if outer <= inner {
            triangles.push([side[i], side[i + 1], ring[j].0]);
            i += 1;
        } else {
            triangles.push([side[i], ring[j + 1].0, ring[j].0]);
            j += 1;
        }
    }
}
