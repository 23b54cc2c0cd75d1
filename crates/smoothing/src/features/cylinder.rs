//! Round holes of any orientation: rings of facets that lie on a cylinder and face its axis.
//!
//! A patch of three rings around each facet that lies in a hollow gives an axis (the direction in which its normals
//! vary least) and a circle. Gauss-Newton on the vertices, which lie on the cylinder even where the facets are
//! coarse chords, makes both exact. The region then grows over all facets with vertices on the cylinder and is a hole
//! if one of its borders runs once around the axis.

use super::border_half_edges;
use super::fit::{Cylinder, Symmetric};
use rayon::prelude::*;
use topipe_mesh::{Connectivity, DVec3, FaceId, Region, RegionShape, TriangleMesh, VertexId};
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

struct Candidate {
    score: f64,
    seed: FaceId,
    cylinder: Cylinder,
    edge: f64,
}

/// All holes, those with most faces first, with the faces of their walls; area and residual are left to measure.
pub(super) fn holes(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    mut taken: Vec<bool>,
    tolerance: f64,
    progress: &Progress,
) -> Result<Vec<(Region, Vec<FaceId>)>, Interrupted> {
    let normals: Vec<DVec3> = mesh.faces().map(|f| mesh.normal(f)).collect();
    let largest = mesh.diagonal() / 2.0;
    progress.check()?;
    let mut candidates: Vec<Candidate> = (0..mesh.face_count())
        .into_par_iter()
        .filter_map(|f| candidate(mesh, connectivity, &normals, &taken, FaceId::new(f), largest))
        .collect();
    candidates.sort_by(|a, b| a.score.total_cmp(&b.score).then(a.seed.cmp(&b.seed)));
    let mut found = Vec::new();
    // Faces of rings that were grown and refused; most candidates of one false ring are neighbours.
    let mut refused = vec![false; mesh.face_count()];
    let mut inside = vec![false; mesh.face_count()];
    for (k, candidate) in candidates.iter().enumerate() {
        if k % 64 == 0 {
            progress.check()?;
        }
        if taken[candidate.seed.index()] || refused[candidate.seed.index()] {
            continue;
        }
        let grown = grow(mesh, connectivity, &normals, &taken, candidate, tolerance, &mut inside);
        let Some((cylinder, faces)) = grown else { continue };
        if !is_ring(mesh, connectivity, &cylinder, &faces) {
            for f in &faces {
                refused[f.index()] = true;
            }
            continue;
        }
        for f in &faces {
            taken[f.index()] = true;
        }
        found.push((region(mesh, cylinder, &faces), faces));
    }
    // By number of faces: unlike areas, counts are the same after a rotation.
    found.sort_by(|a, b| b.1.len().cmp(&a.1.len()).then(a.1[0].cmp(&b.1[0])));
    Ok(found)
}

fn region(mesh: &TriangleMesh, cylinder: Cylinder, faces: &[FaceId]) -> Region {
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
    let shape = RegionShape::Cylinder { point, axis, radius: cylinder.radius, hole: true };
    Region { shape, area: 0.0, residual: 0.0 }
}

/// Fits a cylinder to the patch around `seed`, if it lies in a hollow.
fn candidate(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    normals: &[DVec3],
    taken: &[bool],
    seed: FaceId,
    largest: f64,
) -> Option<Candidate> {
    if taken[seed.index()] || !is_hollow(mesh, connectivity, normals, seed) {
        return None;
    }
    let mut patch = vec![seed];
    let mut first = 0;
    for _ in 0..3 {
        let last = patch.len();
        for i in first..last {
            let face = patch[i];
            for k in 0..3 {
                let across = connectivity.neighbor(face, k);
                if across.is_some()
                    && !taken[across.index()]
                    && normals[across.index()].dot(normals[face.index()]) > WALL_COSINE
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
    let mut vertices: Vec<VertexId> = Vec::with_capacity(3 * patch.len());
    for &f in &patch {
        let area = mesh.area_vector(f).length();
        moments.add(normals[f.index()], area);
        weight += area;
        let [a, b, c] = mesh.corners(f);
        length += a.distance(b) + b.distance(c) + c.distance(a);
        vertices.extend(mesh.triangles[f.index()]);
    }
    vertices.sort_unstable();
    vertices.dedup();
    let points: Vec<DVec3> = vertices.iter().map(|&v| mesh.position(v)).collect();
    let edge = length / (3 * patch.len()) as f64;
    let (values, vectors) = moments.eigen();
    // Flat (all normals alike) or curved in all directions: no cylinder.
    if values[1] < 0.005 * weight || values[0] > 0.12 * weight {
        return None;
    }
    let rough = Cylinder::along(vectors[0], &points)?;
    // Nearly all patches of a noisy surface end here, before the costly part.
    if rough.misfit(&points) > 2.0 * FIRST_TOLERANCE * edge {
        return None;
    }
    let cylinder = rough.refine(&points, 5)?;
    if cylinder.radius > largest {
        return None;
    }
    let score = cylinder.misfit(&points) / edge;
    let inward: f64 = patch.iter().map(|&f| mesh.area_vector(f).dot(cylinder.radial(mesh.centroid(f)))).sum();
    (score < FIRST_TOLERANCE && inward < 0.0).then_some(Candidate { score, seed, cylinder, edge })
}

/// True when a neighbour lies on the outer side of the facet and none of the same wall on the inner side.
fn is_hollow(mesh: &TriangleMesh, connectivity: &Connectivity, normals: &[DVec3], face: FaceId) -> bool {
    let (normal, here) = (normals[face.index()], mesh.centroid(face));
    let mut hollow = false;
    for k in 0..3 {
        let across = connectivity.neighbor(face, k);
        if !across.is_some() || normals[across.index()].dot(normal) <= WALL_COSINE {
            continue;
        }
        let there = mesh.centroid(across) - here;
        let height = normal.dot(there);
        let distance = there.length();
        if height < -0.02 * distance {
            return false;
        }
        hollow |= height > 0.02 * distance;
    }
    hollow
}

/// Grows from the seed over facets with all vertices on the cylinder, refits, and repeats until nothing changes.
///
/// `inside` is all false before and after: clearing what was set costs the size of the wall, not of the mesh.
fn grow(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    normals: &[DVec3],
    taken: &[bool],
    candidate: &Candidate,
    tolerance: f64,
    inside: &mut [bool],
) -> Option<(Cylinder, Vec<FaceId>)> {
    let mut cylinder = candidate.cylinder;
    let mut faces: Vec<FaceId> = Vec::new();
    let mut share = FIRST_TOLERANCE.max(tolerance);
    for _ in 0..16 {
        let limit = share * candidate.edge;
        let fits = |f: FaceId| {
            let radial = cylinder.radial(mesh.centroid(f)).normalize_or_zero();
            !taken[f.index()]
                && normals[f.index()].dot(radial) < -WALL_COSINE
                && mesh.corners(f).iter().all(|&p| cylinder.distance(p).abs() <= limit)
        };
        if !fits(candidate.seed) {
            return None;
        }
        let before = faces.len();
        faces.clear();
        faces.push(candidate.seed);
        inside[candidate.seed.index()] = true;
        let mut next = 0;
        while next < faces.len() {
            for k in 0..3 {
                let across = connectivity.neighbor(faces[next], k);
                if across.is_some() && !inside[across.index()] && fits(across) {
                    inside[across.index()] = true;
                    faces.push(across);
                }
            }
            next += 1;
        }
        for f in &faces {
            inside[f.index()] = false;
        }
        if faces.len() < FEWEST_FACES {
            return None;
        }
        let settled = share <= tolerance && faces.len() == before;
        share = (share / 2.0).max(tolerance);
        let mut vertices: Vec<VertexId> = faces.iter().flat_map(|f| mesh.triangles[f.index()]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let points: Vec<DVec3> = vertices.iter().map(|&v| mesh.position(v)).collect();
        cylinder = cylinder.refine(&points, 20)?;
        if settled {
            break;
        }
    }
    faces.sort_unstable();
    Some((cylinder, faces))
}

/// True when the wall goes all around: no wide gap between its vertices, and a border that winds once about the axis.
fn is_ring(mesh: &TriangleMesh, connectivity: &Connectivity, cylinder: &Cylinder, faces: &[FaceId]) -> bool {
    let (u, v) = cylinder.axis.any_orthonormal_pair();
    let angle = |p: DVec3| {
        let d = cylinder.radial(p);
        d.dot(v).atan2(d.dot(u))
    };
    let mut angles: Vec<f64> = faces.iter().flat_map(|&f| mesh.corners(f)).map(angle).collect();
    angles.sort_by(f64::total_cmp);
    let around = angles[0] + std::f64::consts::TAU - angles[angles.len() - 1];
    let widest = angles.windows(2).map(|w| w[1] - w[0]).fold(around, f64::max);
    if widest > WIDEST_GAP.to_radians() {
        return false;
    }
    let inside = |f: FaceId| faces.binary_search(&f).is_ok();
    let border = border_half_edges(connectivity, faces, inside);
    let mut seen = std::collections::BTreeSet::new();
    for &start in &border {
        let mut winding = 0.0;
        let mut h = start;
        while seen.insert(h) {
            let step =
                angle(mesh.position(connectivity.target(h))) - angle(mesh.position(connectivity.origin(h)));
            let tau = std::f64::consts::TAU;
            winding += step - tau * (step / tau).round();
            // The next border half-edge: turn about the target inside the set.
            h = h.next();
            loop {
                let twin = connectivity.twin(h);
                if !twin.is_some() || !inside(twin.face()) {
                    break;
                }
                h = twin.next();
            }
        }
        if (winding.abs() - std::f64::consts::TAU).abs() < 0.1 {
            return true;
        }
    }
    false
}
