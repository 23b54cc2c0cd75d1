//! Flat faces by region growing.

use super::border_half_edges;
use super::noise::{Tolerance, is_systematic};
use topipe_mesh::{Connectivity, DVec3, FaceId, HalfEdgeId, RegionShape, TriangleMesh};
use topipe_progress::{Interrupted, Progress};

/// Facets with less than this many squared mean edge lengths of area have normals that say nothing.
const SLIVER: f64 = 0.01;

/// A patch is a terrace of a voxel mesh when more than this share of its border leads over a step of at most
/// `HIGHEST_STEP` mean edge lengths to a parallel facet.
const TERRACE_SHARE: f64 = 0.5;

/// One voxel is 0.88 mean edge lengths high when its faces are cut into two triangles each.
const HIGHEST_STEP: f64 = 1.5;

/// Spread of the distances of a flat face's vertices, in median absolute deviations, that still belong to it: five
/// standard deviations.
const OUTLIER: f64 = 5.0 * 1.4826;

/// Share of the bends of the edges inside, by angle and length, that the curvature of a smooth surface explains, from which on a face is
/// part of one. On a torus it is nearly all. Of flat pieces of a regular mesh with white heights, 8,000 of each size, those with 21 edges
/// have 0.18 on the mean and one was above, with 65 edges 0.07 and none.
const SMOOTH_BENDS: f64 = 0.7;

/// With fewer edges than this the share says too little.
const FEWEST_BENDS: usize = 24;

/// A flat patch that was found.
pub(super) struct Flat {
    pub(super) shape: RegionShape,
    pub(super) faces: Vec<FaceId>,
    /// True when most of its vertices lie in the plane to rounding.
    pub(super) exact: bool,
}

struct Plane {
    point: DVec3,
    normal: DVec3,
}

struct Search<'a> {
    mesh: &'a TriangleMesh,
    connectivity: &'a Connectivity,
    area_vectors: Vec<DVec3>,
    edge: f64,
    tolerance: Tolerance,
    /// Faces of a region found earlier.
    taken: Vec<bool>,
    /// Per face, the last growth that visited it.
    visited: Vec<u32>,
    round: u32,
}

/// All flat patches of at least `least_area`, in the order of their first facets, with their facets.
///
/// Borders are as chance left them; see [`super::borders`].
pub(super) fn planes(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    taken: Vec<bool>,
    tolerance: Tolerance,
    least_area: f64,
    progress: &Progress,
) -> Result<Vec<Flat>, Interrupted> {
    let mut search = Search {
        mesh,
        connectivity,
        area_vectors: mesh.faces().map(|f| mesh.area_vector(f)).collect(),
        edge: mesh.mean_edge_length(),
        tolerance,
        taken,
        visited: vec![0; mesh.face_count()],
        round: 0,
    };
    // A seed inside a patch that failed need not be tried again.
    let mut tried = vec![false; mesh.face_count()];
    let mut found = Vec::new();
    for seed in mesh.faces() {
        if seed.index() % 4096 == 0 {
            progress.check()?;
        }
        if tried[seed.index()] || search.taken[seed.index()] || !search.is_seed(seed) {
            continue;
        }
        let Some((plane, faces)) = search.region(seed) else { continue };
        for f in &faces {
            tried[f.index()] = true;
        }
        if search.area(&faces) < least_area || search.is_terrace(&plane, &faces) {
            continue;
        }
        // Half of the vertices, not all: an isosurface rounds a flat face off where it ends.
        let exact = search.median_distance(&plane, &faces) <= tolerance.rounding;
        if !exact && search.is_curved(&plane, &faces) {
            continue;
        }
        for f in &faces {
            search.taken[f.index()] = true;
        }
        let shape = RegionShape::Plane { point: plane.point, normal: plane.normal };
        found.push(Flat { shape, faces, exact });
    }
    Ok(found)
}

impl Search<'_> {
    fn area(&self, faces: &[FaceId]) -> f64 {
        faces.iter().map(|f| self.area_vectors[f.index()].length()).sum::<f64>() / 2.0
    }

    fn is_sliver(&self, face: FaceId) -> bool {
        self.area_vectors[face.index()].length() < 2.0 * SLIVER * self.edge * self.edge
    }

    /// A facet with an area and a neighbour of the same direction.
    fn is_seed(&self, face: FaceId) -> bool {
        if self.is_sliver(face) {
            return false;
        }
        let normal = self.area_vectors[face.index()].normalize_or_zero();
        (0..3).any(|k| {
            let across = self.connectivity.neighbor(face, k);
            across.is_some()
                && !self.taken[across.index()]
                && self.area_vectors[across.index()].normalize_or_zero().dot(normal) >= self.tolerance.cosine
        })
    }

    fn fits(&self, plane: &Plane, face: FaceId, distance: f64) -> bool {
        if self.taken[face.index()] {
            return false;
        }
        let near =
            self.mesh.corners(face).iter().all(|&p| plane.normal.dot(p - plane.point).abs() <= distance);
        near && (self.is_sliver(face)
            || self.area_vectors[face.index()].normalize_or_zero().dot(plane.normal) >= self.tolerance.cosine)
    }

    /// Grows from `seed`, refitting as it grows and at the end, until the set of faces repeats; then once more with
    /// what the vertices themselves deviate, so that chance neighbours of an exact face fall off.
    fn region(&mut self, seed: FaceId) -> Option<(Plane, Vec<FaceId>)> {
        let mut plane = Plane {
            point: self.mesh.centroid(seed),
            normal: self.area_vectors[seed.index()].normalize_or_zero(),
        };
        let mut limit = self.tolerance.distance;
        let mut faces = self.grow(&mut plane, seed, limit, true);
        for round in 0..6 {
            plane = self.fit(&faces)?;
            if round >= 1 {
                limit = (OUTLIER * self.median_distance(&plane, &faces))
                    .clamp(self.tolerance.rounding, self.tolerance.distance);
            }
            if !self.fits(&plane, seed, limit) {
                return None;
            }
            let again = self.grow(&mut plane, seed, limit, false);
            let same = again.len() == faces.len();
            faces = again;
            if same && round >= 1 {
                break;
            }
        }
        plane = self.fit(&faces)?;
        faces.sort_unstable();
        Some((plane, faces))
    }

    fn median_distance(&self, plane: &Plane, faces: &[FaceId]) -> f64 {
        let mut distances: Vec<f64> = faces
            .iter()
            .flat_map(|&f| self.mesh.corners(f))
            .map(|p| plane.normal.dot(p - plane.point).abs())
            .collect();
        let middle = distances.len() / 2;
        *distances.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// True when the facets bulge: part of a sphere, of a fine cylinder, of any smooth surface.
    fn is_curved(&self, plane: &Plane, faces: &[FaceId]) -> bool {
        let (u, v) = plane.normal.any_orthonormal_pair();
        let corners = || faces.iter().flat_map(|&f| self.mesh.corners(f));
        let size = corners().map(|p| p.distance(plane.point)).fold(f64::MIN_POSITIVE, f64::max);
        let height = |p: DVec3| plane.normal.dot(p - plane.point);
        let place = |p: DVec3| [u.dot(p - plane.point) / size, v.dot(p - plane.point) / size];
        self.bends_like_a_surface(plane, faces) || is_systematic(self.mesh, faces, height, place)
    }

    /// True when the edges inside bend as those of a smooth surface do: to one side along each of two directions, as around the top of a
    /// torus, or on its inner side, where the sides differ. Noise bends as much to the one as to the other. The heights of a few rings of
    /// facets are no polynomial of their places.
    ///
    /// The sum of bend times length times the square of the direction is the integral of the curvature tensor over the face
    /// (Cohen-Steiner, Morvan 2003).
    fn bends_like_a_surface(&self, plane: &Plane, faces: &[FaceId]) -> bool {
        let (u, v) = plane.normal.any_orthonormal_pair();
        let (mut tensor, mut absolute, mut count) = ([0.0; 3], 0.0, 0);
        for &f in faces {
            for k in 0..3 {
                let h = HalfEdgeId::of(f, k);
                let across = self.connectivity.neighbor(f, k);
                if !across.is_some() || across < f || faces.binary_search(&across).is_err() {
                    continue;
                }
                let along = self.mesh.position(self.mesh.target(h)) - self.mesh.position(self.mesh.origin(h));
                let length = along.length();
                let (m, n) = (self.area_vectors[f.index()], self.area_vectors[across.index()]);
                let bend = m.cross(n).dot(along).atan2(m.dot(n) * length) * length;
                let direction = along.normalize_or_zero();
                let (x, y) = (direction.dot(u), direction.dot(v));
                for (sum, product) in tensor.iter_mut().zip([x * x, x * y, y * y]) {
                    *sum += bend * product;
                }
                absolute += bend.abs();
                count += 1;
            }
        }
        let [xx, xy, yy] = tensor;
        let (mean, off) = ((xx + yy) / 2.0, ((xx - yy) / 2.0).hypot(xy));
        // Of both principal values.
        let sum = (mean + off).abs() + (mean - off).abs();
        count >= FEWEST_BENDS && sum > SMOOTH_BENDS * absolute
    }

    fn grow(&mut self, plane: &mut Plane, seed: FaceId, limit: f64, refit: bool) -> Vec<FaceId> {
        self.round += 1;
        let mut faces = vec![seed];
        self.visited[seed.index()] = self.round;
        let mut next = 0;
        let mut refit_at = 8;
        while next < faces.len() {
            let face = faces[next];
            next += 1;
            for k in 0..3 {
                let across = self.connectivity.neighbor(face, k);
                if across.is_some()
                    && self.visited[across.index()] != self.round
                    && self.fits(plane, across, limit)
                {
                    self.visited[across.index()] = self.round;
                    faces.push(across);
                }
            }
            if refit && faces.len() >= refit_at {
                refit_at *= 2;
                if let Some(better) = self.fit(&faces) {
                    *plane = better;
                }
            }
        }
        faces
    }

    fn fit(&self, faces: &[FaceId]) -> Option<Plane> {
        topipe_mesh::fit::plane(self.mesh, faces).map(|(point, normal)| Plane { point, normal })
    }

    /// True when most of the border is the edge of a step, as around each layer of a voxel mesh. Its own flat faces
    /// can not be told from its steps by their size: the cap of a ball of 16 voxels has 50 of them.
    fn is_terrace(&self, plane: &Plane, faces: &[FaceId]) -> bool {
        let (mut border, mut steps) = (0.0, 0.0);
        for h in border_half_edges(self.connectivity, faces, |f| faces.binary_search(&f).is_ok()) {
            let (a, b) = (self.mesh.origin(h), self.mesh.target(h));
            let length = self.mesh.position(a).distance(self.mesh.position(b));
            border += length;
            let twin = self.connectivity.twin(h);
            if twin.is_some() && self.leads_over_step(plane, twin.face()) {
                steps += length;
            }
        }
        steps > TERRACE_SHARE * border
    }

    /// True when `riser` is at a right angle to the plane and a facet next to it, or next to a neighbour of it, is
    /// parallel to the plane one step away.
    fn leads_over_step(&self, plane: &Plane, riser: FaceId) -> bool {
        let upright =
            |f: FaceId| self.area_vectors[f.index()].normalize_or_zero().dot(plane.normal).abs() < 0.1;
        let tread = |f: FaceId| {
            let offsets = self.mesh.corners(f).map(|p| plane.normal.dot(p - plane.point).abs());
            let low = offsets.iter().fold(f64::INFINITY, |a, &b| a.min(b));
            let high = offsets.iter().fold(0.0, |a: f64, &b| a.max(b));
            let flat = 0.01 * self.edge;
            low > 10.0 * flat && high - low <= flat && high <= HIGHEST_STEP * self.edge
        };
        let around =
            |f: FaceId| (0..3).map(move |k| self.connectivity.neighbor(f, k)).filter(|g| g.is_some());
        upright(riser) && around(riser).any(|f| tread(f) || (upright(f) && around(f).any(tread)))
    }
}
