//! Flat faces by region growing.

use super::border_half_edges;
use super::fit::Symmetric;
use crate::Parameters;
use topipe_mesh::{Connectivity, DVec3, FaceId, Region, RegionShape, TriangleMesh};
use topipe_progress::{Interrupted, Progress};

/// A flat face of less than `plane_area` is accepted when it is this share of the whole surface: a coarse CAD box has
/// twelve facets.
const LARGE_SHARE: f64 = 0.05;

/// Facets with less than this many squared mean edge lengths of area have normals that say nothing.
const SLIVER: f64 = 0.01;

/// A patch is a terrace of a voxel mesh when more than this share of its border leads over a step of at most
/// `HIGHEST_STEP` mean edge lengths to a parallel facet.
const TERRACE_SHARE: f64 = 0.5;

/// One voxel is 0.88 mean edge lengths high when its faces are cut into two triangles each.
const HIGHEST_STEP: f64 = 1.5;

struct Plane {
    point: DVec3,
    normal: DVec3,
}

struct Search<'a> {
    mesh: &'a TriangleMesh,
    connectivity: &'a Connectivity,
    area_vectors: Vec<DVec3>,
    edge: f64,
    tolerance: f64,
    cosine: f64,
    /// Faces of a region found earlier.
    taken: Vec<bool>,
    /// Per face, the last growth that visited it.
    visited: Vec<u32>,
    round: u32,
}

/// All flat faces, those with most facets first, with their facets; area and residual are left to measure.
pub(super) fn planes(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    taken: Vec<bool>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Vec<(Region, Vec<FaceId>)>, Interrupted> {
    let edge = mesh.mean_edge_length();
    let mut search = Search {
        mesh,
        connectivity,
        area_vectors: mesh.faces().map(|f| mesh.area_vector(f)).collect(),
        edge,
        tolerance: parameters.plane_tolerance * edge,
        cosine: parameters.plane_angle.to_radians().cos(),
        taken,
        visited: vec![0; mesh.face_count()],
        round: 0,
    };
    let least = parameters.plane_area * edge * edge;
    let large = LARGE_SHARE * mesh.area();
    // Flat faces trimmed to their cores are judged; a seed inside a patch that failed need not be tried again.
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
        let core = search.open(&faces);
        let (whole_area, core_area) = (search.area(&faces), search.area(&core));
        // Opening removes teeth from a large face; a coarse face would lose itself.
        let kept = if core_area >= 0.7 * whole_area { core } else { faces.clone() };
        if (core_area < least && whole_area < large) || search.is_terrace(&plane, &kept) {
            continue;
        }
        for f in &kept {
            search.taken[f.index()] = true;
        }
        let dropped = faces.into_iter().filter(|f| !search.taken[f.index()]).collect();
        found.push(Found { plane, faces: kept, dropped });
    }
    search.return_corners(&mut found);
    // By number of faces: unlike areas, counts are the same after a rotation.
    found.sort_by(|a, b| b.faces.len().cmp(&a.faces.len()).then(a.faces[0].cmp(&b.faces[0])));
    Ok(found
        .into_iter()
        .map(|Found { plane, faces, .. }| {
            let shape = RegionShape::Plane { point: plane.point, normal: plane.normal };
            (Region { shape, area: 0.0, residual: 0.0 }, faces)
        })
        .collect())
}

/// A flat face, with the teeth that opening took from it.
struct Found {
    plane: Plane,
    faces: Vec<FaceId>,
    dropped: Vec<FaceId>,
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
                && self.area_vectors[across.index()].normalize_or_zero().dot(normal) >= self.cosine
        })
    }

    fn fits(&self, plane: &Plane, face: FaceId) -> bool {
        if self.taken[face.index()] {
            return false;
        }
        let near = self
            .mesh
            .corners(face)
            .iter()
            .all(|&p| plane.normal.dot(p - plane.point).abs() <= self.tolerance);
        near && (self.is_sliver(face)
            || self.area_vectors[face.index()].normalize_or_zero().dot(plane.normal) >= self.cosine)
    }

    /// Grows from `seed`, refitting as it grows and at the end, until the set of faces repeats.
    fn region(&mut self, seed: FaceId) -> Option<(Plane, Vec<FaceId>)> {
        let mut plane = Plane {
            point: self.mesh.centroid(seed),
            normal: self.area_vectors[seed.index()].normalize_or_zero(),
        };
        let mut faces = self.grow(&mut plane, seed, true);
        for _ in 0..4 {
            plane = self.fit(&faces)?;
            if !self.fits(&plane, seed) {
                return None;
            }
            let again = self.grow(&mut plane, seed, false);
            let same = again.len() == faces.len();
            faces = again;
            if same {
                break;
            }
        }
        faces.sort_unstable();
        Some((plane, faces))
    }

    fn grow(&mut self, plane: &mut Plane, seed: FaceId, refit: bool) -> Vec<FaceId> {
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
                if across.is_some() && self.visited[across.index()] != self.round && self.fits(plane, across)
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

    /// The plane of least squares through the vertices, weighted by area.
    fn fit(&self, faces: &[FaceId]) -> Option<Plane> {
        let mut direction = DVec3::ZERO;
        let mut point = DVec3::ZERO;
        let mut weight = 0.0;
        for &f in faces {
            let area = self.area_vectors[f.index()];
            direction += area;
            point += area.length() * self.mesh.centroid(f);
            weight += area.length();
        }
        if weight <= 0.0 {
            return None;
        }
        point /= weight;
        let mut moments = Symmetric::default();
        for &f in faces {
            let area = self.area_vectors[f.index()].length();
            for p in self.mesh.corners(f) {
                moments.add((p - point) / self.edge, area / weight);
            }
        }
        let normal = moments.eigen().1[0];
        Some(Plane { point, normal: if normal.dot(direction) < 0.0 { -normal } else { normal } })
    }

    /// Gives facets back that opening took although they are no teeth: at the corner of a block one facet may have
    /// all its vertices on edges. All faces around such a vertex are flat, those around the tip of a tooth are not.
    fn return_corners(&mut self, found: &mut [Found]) {
        let mut flat = self.taken.clone();
        for f in found.iter().flat_map(|p| &p.dropped) {
            flat[f.index()] = true;
        }
        for region in found {
            self.round += 1;
            for f in &region.faces {
                self.visited[f.index()] = self.round;
            }
            let (connectivity, visited, round) = (self.connectivity, &self.visited, self.round);
            let returned: Vec<FaceId> = region
                .dropped
                .iter()
                .copied()
                .filter(|&f| {
                    self.mesh.triangles[f.index()].iter().all(|&v| {
                        connectivity.outgoing(v).any(|h| visited[h.face().index()] == round)
                            || connectivity.outgoing(v).all(|h| flat[h.face().index()])
                    })
                })
                .collect();
            for f in &returned {
                self.taken[f.index()] = true;
            }
            region.faces.extend(returned);
            region.faces.sort_unstable();
        }
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
            low > 10.0 * self.tolerance && high - low <= self.tolerance && high <= HIGHEST_STEP * self.edge
        };
        let around =
            |f: FaceId| (0..3).map(move |k| self.connectivity.neighbor(f, k)).filter(|g| g.is_some());
        upright(riser) && around(riser).any(|f| tread(f) || (upright(f) && around(f).any(tread)))
    }

    /// Faces with a vertex whose whole ring is in `faces` (a morphological opening): drops teeth and strips of one
    /// facet's width.
    fn open(&mut self, faces: &[FaceId]) -> Vec<FaceId> {
        self.round += 1;
        for f in faces {
            self.visited[f.index()] = self.round;
        }
        let (connectivity, visited, round) = (self.connectivity, &self.visited, self.round);
        faces
            .iter()
            .copied()
            .filter(|&f| {
                self.mesh.triangles[f.index()].iter().any(|&v| {
                    !connectivity.is_border(v)
                        && connectivity.outgoing(v).all(|h| visited[h.face().index()] == round)
                })
            })
            .collect()
    }
}
