//! Cylinders in any direction: holes, bosses, and arcs of either.
//!
//! A patch of three rings around each facet that bends to one side gives an axis (the direction in which its normals
//! vary least) and a circle. Gauss-Newton on the vertices, which lie on the cylinder even where the facets are
//! coarse chords, makes both exact. The region then grows over all facets with vertices on the cylinder, with a
//! tolerance that narrows to what these vertices themselves deviate.
//!
//! A wall that runs all around and is not exact must end at edges, and its residuals must not follow a rule. An arc must lie on the cylinder to rounding and be seen in
//! at least five places around it: any three parallel lines lie on one, and the four edges of two equal chamfers do.

use super::noise::{Tolerance, is_systematic};
use super::rims::{ends_sharply, winds};
use rayon::prelude::*;
use topipe_mesh::fit::{Cylinder, Symmetric};
use topipe_mesh::{Connectivity, DVec3, FaceId, RegionShape, TriangleMesh, VertexId};
use topipe_progress::{Interrupted, Progress};

/// Two facets belong to one wall when their normals differ by less: a six-sided hole has 60 degrees.
const WALL_COSINE: f64 = 0.49;

/// Largest angle between neighbouring vertices of a ring, degrees: six-sided holes are the coarsest.
const WIDEST_GAP: f64 = 75.0;

/// Fewest facets of a wall: two for each side of a six-sided hole.
const FEWEST_FACES: usize = 12;

/// Growth starts with this tolerance, in edge lengths, and tightens to the one asked for: the first fit sees a
/// patch, not the whole ring.
const FIRST_TOLERANCE: f64 = 0.2;

/// A patch with a misfit of less than this, in edge lengths, is exact. If its wall comes to nothing it is grown once more with the
/// tolerance of rounding from the start: a fillet runs smoothly into the faces beside it, and a wide start may settle on a larger
/// cylinder through some of theirs. Three of the twelve fillets of a box were missed so.
const EXACT: f64 = 1e-4;

/// A patch is a candidate up to a misfit (root mean square) of the tolerance, and always up to this, in edge lengths. Patches of a noisy
/// free surface have more; growing all of them was half of the time of detection at a million triangles.
const LEAST_GATE: f64 = 0.04;

/// The precision of a fit whose region is not the last one, in tolerances.
const ROUGH: f64 = 1e-3;

/// Most vertices that such a fit looks at, evenly chosen.
const ROUGH_POINTS: usize = 2000;

/// Most candidates that are grown at the same time.
const MOST_AT_ONCE: usize = 8;

/// Fewest places around the axis, apart from each other, at which an arc has vertices.
const FEWEST_PLACES: usize = 5;

/// Places around the axis nearer than this many edge lengths are one.
const ONE_PLACE: f64 = 0.1;

/// Spread of the distances of a wall's vertices, in median absolute deviations, that still belong to it.
const OUTLIER: f64 = 5.0 * 1.4826;

/// A cylinder that was found.
pub(super) struct Wall {
    pub(super) shape: RegionShape,
    pub(super) faces: Vec<FaceId>,
    /// True when it runs all around its axis.
    pub(super) closed: bool,
}

struct Candidate {
    score: f64,
    seed: FaceId,
    cylinder: Cylinder,
    edge: f64,
    hollow: bool,
}

struct Search<'a> {
    mesh: &'a TriangleMesh,
    connectivity: &'a Connectivity,
    normals: Vec<DVec3>,
    taken: Vec<bool>,
    tolerance: f64,
    rounding: f64,
    largest: f64,
}

/// All cylinders, the best fitting first, with the faces of their walls.
///
/// Borders are as chance left them; see [`super::borders`].
pub(super) fn cylinders(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    taken: Vec<bool>,
    tolerance: f64,
    exact: Tolerance,
    progress: &Progress,
) -> Result<Vec<Wall>, Interrupted> {
    let mut search = Search {
        mesh,
        connectivity,
        normals: mesh.faces().map(|f| mesh.normal(f)).collect(),
        taken,
        tolerance,
        rounding: exact.rounding,
        largest: mesh.diagonal() / 2.0,
    };
    progress.check()?;
    let mut candidates: Vec<Candidate> =
        (0..mesh.face_count()).into_par_iter().filter_map(|f| search.candidate(FaceId::new(f))).collect();
    candidates.sort_by(|a, b| a.score.total_cmp(&b.score).then(a.seed.cmp(&b.seed)));
    let mut found = Vec::new();
    // Faces of walls that were grown and refused, and those to which walls shrank that came to nothing: most candidates of one false
    // wall are neighbours. Of a roughened part of a million triangles 23,381 walls are grown and 32,723 without the latter, which took
    // twice the time of the whole stage: they were the large ones.
    let mut refused = vec![false; mesh.face_count()];
    let mut next = 0;
    // Most candidates of a noisy surface come to nothing, and then the next can be grown at the same time. A wall that was found
    // changes what others are, and one that was refused makes many others needless, so these go alone. Marks are looked at in the
    // order of the candidates: what is found does not depend on the size of the batches.
    let mut size = 1;
    let mut scratches: Vec<Scratch> = (0..MOST_AT_ONCE).map(|_| Scratch::new(mesh)).collect();
    while next < candidates.len() {
        progress.check()?;
        let is_open = |search: &Search<'_>, refused: &[bool], c: &Candidate| {
            !search.taken[c.seed.index()] && !refused[c.seed.index()]
        };
        let mut batch = Vec::with_capacity(size);
        while batch.len() < size && next < candidates.len() {
            if is_open(&search, &refused, &candidates[next]) {
                batch.push(&candidates[next]);
            }
            next += 1;
        }
        let grow = |search: &Search<'_>, scratch: &mut Scratch, candidate: &Candidate| {
            let attempt = |scratch: &mut Scratch, first: f64| {
                let (cylinder, faces) = search.grow(candidate, scratch, first)?;
                let closed = search.judge(&cylinder, &faces, candidate.edge);
                Ok::<_, Vec<FaceId>>((cylinder, faces, closed))
            };
            let wall = attempt(scratch, FIRST_TOLERANCE.max(search.tolerance));
            if candidate.score > EXACT || matches!(wall, Ok((.., Some(_)))) {
                return wall;
            }
            match attempt(scratch, search.rounding / candidate.edge) {
                exact @ Ok((.., Some(_))) => exact,
                _ => wall,
            }
        };
        let walls: Vec<_> = batch
            .par_iter()
            .zip(&mut scratches)
            .map(|(candidate, scratch)| grow(&search, scratch, candidate))
            .collect();
        let (mut traces, mut walls_changed) = (false, false);
        for (candidate, wall) in batch.into_iter().zip(walls) {
            if !is_open(&search, &refused, candidate) {
                continue;
            }
            let wall = if walls_changed { grow(&search, &mut scratches[0], candidate) } else { wall };
            let (cylinder, faces, closed) = match wall {
                Ok(wall) => wall,
                Err(rest) => {
                    rest.iter().for_each(|f| refused[f.index()] = true);
                    continue;
                }
            };
            traces = true;
            walls_changed |= closed.is_some();
            let marks = if closed.is_some() { &mut search.taken } else { &mut refused };
            for f in &faces {
                marks[f.index()] = true;
            }
            if let Some(closed) = closed {
                found.push(Wall { shape: shape(mesh, cylinder, &faces, candidate.hollow), faces, closed });
            }
        }
        size = if traces { 1 } else { (2 * size).min(MOST_AT_ONCE) };
    }
    Ok(found)
}

/// The cylinder with a point and a sign of the axis that do not depend on how it was found.
pub(super) fn shape(mesh: &TriangleMesh, cylinder: Cylinder, faces: &[FaceId], hole: bool) -> RegionShape {
    let mut area = 0.0;
    let mut centroid = DVec3::ZERO;
    for &f in faces {
        let a = mesh.area_vector(f).length();
        area += a;
        centroid += a * mesh.centroid(f);
    }
    centroid /= area;
    let point = centroid - cylinder.radial(centroid);
    // An axis has no sign: the largest component is made positive, so that equal meshes give equal regions.
    let axis = cylinder.axis;
    let lead =
        axis.to_array().into_iter().fold(0.0, |a: f64, b| if b.abs() > a.abs() + 1e-9 { b } else { a });
    let axis = if lead < 0.0 { -axis } else { axis };
    RegionShape::Cylinder { point, axis, radius: cylinder.radius, hole }
}

/// The cylinder of least squares through faces that are known to be part of one, and whether it is a hole.
pub(super) fn through(mesh: &TriangleMesh, faces: &[FaceId]) -> Option<(Cylinder, bool)> {
    let mut moments = Symmetric::default();
    for &f in faces {
        moments.add(mesh.normal(f), mesh.area_vector(f).length());
    }
    let points = points(mesh, faces);
    let cylinder = Cylinder::along(moments.eigen().1[0], &points)?.refine(&points, 20)?;
    let outward: f64 =
        faces.iter().map(|&f| mesh.area_vector(f).dot(cylinder.radial(mesh.centroid(f)))).sum();
    Some((cylinder, outward < 0.0))
}

/// The distinct vertices of some faces, in order.
pub(super) fn points(mesh: &TriangleMesh, faces: &[FaceId]) -> Vec<DVec3> {
    let mut vertices: Vec<VertexId> = faces.iter().flat_map(|f| mesh.triangles[f.index()]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices.iter().map(|&v| mesh.position(v)).collect()
}

/// What growing walls uses again and again; between walls nothing is inside and nothing known.
struct Scratch {
    inside: Vec<bool>,
    /// Of the vertices that were looked at whether they lie on the cylinder.
    on_it: Vec<Option<bool>>,
    looked_at: Vec<VertexId>,
}

impl Scratch {
    fn new(mesh: &TriangleMesh) -> Self {
        Self {
            inside: vec![false; mesh.face_count()],
            on_it: vec![None; mesh.vertex_count()],
            looked_at: Vec::new(),
        }
    }
}

impl Search<'_> {
    /// Fits a cylinder to the patch around `seed`, if it bends to one side.
    fn candidate(&self, seed: FaceId) -> Option<Candidate> {
        if self.taken[seed.index()] {
            return None;
        }
        let hollow = self.bends(seed)?;
        let mut patch = vec![seed];
        let mut first = 0;
        for _ in 0..3 {
            let last = patch.len();
            for i in first..last {
                let face = patch[i];
                for k in 0..3 {
                    let across = self.connectivity.neighbor(face, k);
                    if across.is_some()
                        && !self.taken[across.index()]
                        && self.normals[across.index()].dot(self.normals[face.index()]) > WALL_COSINE
                        && !patch.contains(&across)
                    {
                        patch.push(across);
                    }
                }
            }
            first = last;
        }
        if patch.len() < 6 {
            return None;
        }
        let mut moments = Symmetric::default();
        let (mut weight, mut length) = (0.0, 0.0);
        for &f in &patch {
            let area = self.mesh.area_vector(f).length();
            moments.add(self.normals[f.index()], area);
            weight += area;
            let [a, b, c] = self.mesh.corners(f);
            length += a.distance(b) + b.distance(c) + c.distance(a);
        }
        let edge = length / (3 * patch.len()) as f64;
        let (values, vectors) = moments.eigen();
        // Flat (all normals alike) or curved in all directions: no cylinder.
        if values[1] < 1e-4 * weight || values[0] > 0.12 * weight || values[0] > 0.5 * values[1] {
            return None;
        }
        let points = points(self.mesh, &patch);
        let rough = Cylinder::along(vectors[0], &points)?;
        // Nearly all patches of a noisy surface end here, before the costly part.
        if rough.misfit(&points) > 2.0 * FIRST_TOLERANCE * edge {
            return None;
        }
        let cylinder = rough.refine(&points, 5)?;
        if cylinder.radius > self.largest {
            return None;
        }
        let score = cylinder.misfit(&points) / edge;
        let outward: f64 =
            patch.iter().map(|&f| self.mesh.area_vector(f).dot(cylinder.radial(self.mesh.centroid(f)))).sum();
        (score < self.tolerance.max(LEAST_GATE) && (outward < 0.0) == hollow).then_some(Candidate {
            score,
            seed,
            cylinder,
            edge,
            hollow,
        })
    }

    /// Whether the neighbours of the same wall lie on the outer side of the facet (`true`: a hollow) or on the inner
    /// side; `None` when they lie on both, or in its plane.
    fn bends(&self, face: FaceId) -> Option<bool> {
        let (normal, here) = (self.normals[face.index()], self.mesh.centroid(face));
        let (mut up, mut down) = (false, false);
        for k in 0..3 {
            let across = self.connectivity.neighbor(face, k);
            if !across.is_some() || self.normals[across.index()].dot(normal) <= WALL_COSINE {
                continue;
            }
            let there = self.mesh.centroid(across) - here;
            let height = normal.dot(there);
            let flat = 2e-3 * there.length();
            up |= height > flat;
            down |= height < -flat;
        }
        (up != down).then_some(up)
    }

    /// Grows from the seed over facets with all vertices on the cylinder, at first within `first` edge lengths, refits, and repeats
    /// until nothing changes.
    ///
    /// Where they come to nothing, the last ones. The scratch is as new before and after: clearing what was set costs the size of
    /// the wall, not of the mesh.
    fn grow(
        &self,
        candidate: &Candidate,
        scratch: &mut Scratch,
        first: f64,
    ) -> Result<(Cylinder, Vec<FaceId>), Vec<FaceId>> {
        let Scratch { inside, on_it, looked_at } = scratch;
        let mut cylinder = candidate.cylinder;
        let side = if candidate.hollow { -1.0 } else { 1.0 };
        let mut faces: Vec<FaceId> = Vec::new();
        let mut limit = first * candidate.edge;
        let narrowest = self.tolerance * candidate.edge;
        let mut narrowed = false;
        for _ in 0..20 {
            // Squares instead of roots: this is asked for more often than anything else.
            let (least, most) =
                ((cylinder.radius - limit).max(0.0).powi(2), (cylinder.radius + limit).powi(2));
            // Each vertex is a corner of six faces.
            let mut is_on_it = |v: VertexId| {
                *on_it[v.index()].get_or_insert_with(|| {
                    looked_at.push(v);
                    let square = cylinder.radial(self.mesh.position(v)).length_squared();
                    least <= square && square <= most
                })
            };
            let mut fits = |f: FaceId| {
                !self.taken[f.index()] && self.mesh.triangles[f.index()].into_iter().all(&mut is_on_it) && {
                    let radial = cylinder.radial(self.mesh.centroid(f));
                    let cosine = side * self.normals[f.index()].dot(radial);
                    cosine > 0.0 && cosine * cosine > WALL_COSINE * WALL_COSINE * radial.length_squared()
                }
            };
            let before = faces.len();
            faces.clear();
            if fits(candidate.seed) {
                faces.push(candidate.seed);
                inside[candidate.seed.index()] = true;
            }
            let mut next = 0;
            while next < faces.len() {
                for k in 0..3 {
                    let across = self.connectivity.neighbor(faces[next], k);
                    if across.is_some() && !inside[across.index()] && fits(across) {
                        inside[across.index()] = true;
                        faces.push(across);
                    }
                }
                next += 1;
            }
            faces.iter().for_each(|f| inside[f.index()] = false);
            // Their vertices, each once: those that lie on it are taken for others as they come.
            let mut vertices: Vec<VertexId> = Vec::with_capacity(faces.len());
            for v in faces.iter().flat_map(|f| self.mesh.triangles[f.index()]) {
                if on_it[v.index()] == Some(true) {
                    on_it[v.index()] = Some(false);
                    vertices.push(v);
                }
            }
            looked_at.drain(..).for_each(|v| on_it[v.index()] = None);
            if faces.len() < FEWEST_FACES {
                return Err(faces);
            }
            vertices.sort_unstable();
            let points: Vec<DVec3> = vertices.iter().map(|&v| self.mesh.position(v)).collect();
            // While the tolerance narrows a small part of it will do: with noise the steps never get as short as rounding,
            // and this was a third of the time of the whole stage at a million triangles.
            let refined = if narrowed {
                cylinder.refine(&points, 20)
            } else {
                let some: Vec<DVec3> =
                    points.iter().step_by(points.len().div_ceil(ROUGH_POINTS)).copied().collect();
                cylinder.refine_to(&some, 20, ROUGH * limit / cylinder.radius)
            };
            let Some(refined) = refined else { return Err(faces) };
            cylinder = refined;
            let settled = faces.len() == before;
            if narrowed && settled {
                break;
            }
            if limit <= narrowest {
                let mut distances: Vec<f64> = points.iter().map(|&p| cylinder.distance(p).abs()).collect();
                let middle = distances.len() / 2;
                let median = *distances.select_nth_unstable_by(middle, f64::total_cmp).1;
                limit = (OUTLIER * median).clamp(self.rounding.min(narrowest), narrowest);
                narrowed = true;
            } else {
                limit = (limit / 2.0).max(narrowest);
            }
        }
        faces.sort_unstable();
        Ok((cylinder, faces))
    }

    /// `Some(true)` for a wall all around, `Some(false)` for an arc that is exact, `None` for what is no cylinder.
    fn judge(&self, cylinder: &Cylinder, faces: &[FaceId], edge: f64) -> Option<bool> {
        let (u, v) = cylinder.axis.any_orthonormal_pair();
        let points = points(self.mesh, faces);
        let rms = cylinder.misfit(&points);
        let angle = |p: DVec3| {
            let d = cylinder.radial(p);
            d.dot(v).atan2(d.dot(u))
        };
        let mut angles: Vec<f64> = points.iter().map(|&p| angle(p)).collect();
        angles.sort_by(f64::total_cmp);
        let around = angles[0] + std::f64::consts::TAU - angles[angles.len() - 1];
        let widest = angles.windows(2).map(|w| w[1] - w[0]).fold(around, f64::max);
        if widest > WIDEST_GAP.to_radians() || !winds(self.mesh, self.connectivity, faces, angle) {
            let places =
                1 + angles.windows(2).filter(|w| (w[1] - w[0]) * cylinder.radius > ONE_PLACE * edge).count();
            return (places >= FEWEST_PLACES && rms <= self.rounding).then_some(false);
        }
        // A cone, a barrel, an oval, a bent tube: the radius follows the height or the angle.
        if rms <= self.rounding {
            return Some(true);
        }
        if !ends_sharply(self.mesh, self.connectivity, faces) {
            return None;
        }
        let height = |p: DVec3| cylinder.axis.dot(p - cylinder.point);
        let (low, high) = points
            .iter()
            .map(|&p| height(p))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
        let along = |p: DVec3| 2.0 * (height(p) - low) / (high - low).max(f64::MIN_POSITIVE) - 1.0;
        let off = |p: DVec3| cylinder.distance(p);
        // A slice of a torus bends away to one side with the square of the height.
        let bend: (f64, f64) = points.iter().fold((0.0, 0.0), |(c, s), &p| {
            let (sin, cos) = angle(p).sin_cos();
            let arm = (along(p).powi(2) - 1.0 / 3.0) * off(p);
            (c + arm * cos, s + arm * sin)
        });
        let to = bend.1.atan2(bend.0);
        let wrong = is_systematic(self.mesh, faces, off, |p| [along(p), (2.0 * angle(p)).cos()])
            || is_systematic(self.mesh, faces, off, |p| [along(p), (2.0 * angle(p)).sin()])
            || is_systematic(self.mesh, faces, off, |p| [along(p).powi(2), (angle(p) - to).cos()]);
        (!wrong).then_some(true)
    }
}
