//! No thread, no spike, no fold, no triangle through another.

use crate::{CASES, read, smoothed};
use topipe_mesh::spatial::crossings;
use topipe_mesh::{Connectivity, DVec3, FaceId, Part, TriangleMesh, VertexId};
use topipe_smoothing::{Method, Parameters};

/// Edges with a dihedral angle of more than 120 degrees, and the largest angle.
fn sharp(mesh: &TriangleMesh) -> (usize, f64) {
    let connectivity = Connectivity::build(mesh).expect("a manifold");
    let angles = connectivity
        .edges()
        .map(|h| mesh.normal(h.face()).angle_between(mesh.normal(connectivity.twin(h).face())).to_degrees());
    angles.fold((0, 0.0), |(count, largest), a| (count + usize::from(a > 120.0), f64::max(largest, a)))
}

/// Faces whose normal is more than 120 degrees from the mean of their neighbours'.
fn folded(mesh: &TriangleMesh) -> Vec<FaceId> {
    let connectivity = Connectivity::build(mesh).expect("a manifold");
    let is_folded = |f: &FaceId| {
        let around: DVec3 = (0..3).map(|k| mesh.normal(connectivity.neighbor(*f, k))).sum();
        mesh.normal(*f).dot(around.normalize_or_zero()) < -0.5
    };
    mesh.faces().filter(is_folded).collect()
}

#[test]
fn no_triangle_passes_through_another_or_is_folded() {
    for case in CASES {
        let part = read(case);
        assert!(folded(&part.mesh).len() > 5, "{case}");
        let result = smoothed(&part, &Parameters::default());
        assert_eq!(crossings(&result.mesh), [], "{case}");
        // What lies between frozen vertices and outlines of faces is the input's.
        let mut free: Vec<bool> = result.frozen.iter().map(|f| !f).collect();
        for (t, region) in result.mesh.triangles.iter().zip(&result.region_of_face) {
            t.iter().for_each(|v| free[v.index()] &= !region.is_some());
        }
        let moved = |f: &FaceId| result.mesh.triangles[f.index()].iter().any(|v| free[v.index()]);
        let mut left = folded(&result.mesh);
        assert!(left.len() <= 2, "{case}: {left:?}");
        left.retain(moved);
        assert_eq!(left, [], "{case}");
    }
}

#[test]
fn crossings_go_back_towards_the_input_until_there_is_none() {
    // Collapsing thin struts pass through each other.
    let part = read("bracket");
    let parameters = Parameters {
        method: Method::Laplacian,
        iterations: Some(60),
        preserve_volume: Some(true),
        keep_embedded: false,
        spike_angle: 180.0,
        ..Parameters::default()
    };
    let torn = smoothed(&part, &parameters);
    assert!(!crossings(&torn.mesh).is_empty());
    let whole = smoothed(&part, &Parameters { keep_embedded: true, ..parameters });
    assert_eq!(crossings(&whole.mesh), []);
    assert!((whole.mesh.volume() / part.mesh.volume() - 1.0).abs() <= 1e-12);
    assert_eq!(torn.frozen, whole.frozen);
    let moved =
        |a: &Part, b: &Part| a.mesh.positions.iter().zip(&b.mesh.positions).filter(|(p, q)| p != q).count();
    assert!(moved(&torn, &whole) > 0);
}

/// Vertices whose faces have all shrunk to less than a quarter of their lengths and turn around something.
fn threads(before: &TriangleMesh, after: &TriangleMesh) -> usize {
    let connectivity = Connectivity::build(after).expect("a manifold");
    let longest = |mesh: &TriangleMesh, f: FaceId| {
        let [a, b, c] = mesh.corners(f);
        a.distance(b).max(b.distance(c)).max(c.distance(a))
    };
    let is_thread = |v: &VertexId| {
        let star: Vec<FaceId> = connectivity.outgoing(*v).map(|h| h.face()).collect();
        let normals: Vec<DVec3> = star.iter().map(|f| after.normal(*f)).collect();
        star.iter().all(|f| longest(after, *f) < 0.25 * longest(before, *f))
            && normals.iter().any(|n| normals.iter().any(|m| n.dot(*m) < 0.0))
    };
    (0..after.vertex_count()).map(VertexId::new).filter(is_thread).count()
}

#[test]
fn threads_are_drawn_in() {
    for case in CASES {
        let part = read(case);
        let result = smoothed(&part, &Parameters::default());
        assert_eq!(threads(&part.mesh, &result.mesh), 0, "{case}");
        // The faces of a membrane are no dust.
        let mean = result.mesh.area() / result.mesh.face_count() as f64;
        let least = result.mesh.faces().map(|f| result.mesh.area_vector(f).length() / 2.0 / mean);
        assert!(least.fold(f64::INFINITY, f64::min) > 1e-4, "{case}");
        if case == "bracket" {
            let left = smoothed(&part, &Parameters { spike_angle: 180.0, ..Parameters::default() });
            assert!(threads(&part.mesh, &left.mesh) > 0);
        }
    }
}

/// What restores the volume turns faces. It must not close again what was opened to the limit.
#[test]
fn few_edges_are_left_beyond_the_limit() {
    for (case, most) in [("bracket", 10), ("y-form", 1)] {
        let part = read(case);
        let result = smoothed(&part, &Parameters::default());
        let connectivity = Connectivity::build(&result.mesh).expect("a manifold");
        let limit = Parameters::default().spike_angle.to_radians().cos();
        let can_move = |f: FaceId| result.mesh.triangles[f.index()].iter().any(|v| !result.frozen[v.index()]);
        let sharp = |mesh: &TriangleMesh| {
            let is_sharp = |h: &topipe_mesh::HalfEdgeId| {
                let (f, g) = (h.face(), connectivity.twin(*h).face());
                mesh.normal(f).dot(mesh.normal(g)) < limit && (can_move(f) || can_move(g))
            };
            connectivity.edges().filter(is_sharp).count()
        };
        let (before, after) = (sharp(&part.mesh), sharp(&result.mesh));
        assert!(after <= most && before > 500, "{case}: {after} of {before}");
    }
}

#[test]
fn spikes_are_blunted() {
    for case in ["bracket", "support", "beam-two-holes", "y-form"] {
        let part = read(case);
        let left = smoothed(&part, &Parameters { spike_angle: 180.0, ..Parameters::default() });
        let blunt = smoothed(&part, &Parameters::default());
        let (before, with, without) = (sharp(&part.mesh), sharp(&blunt.mesh), sharp(&left.mesh));
        assert!(with.0 * 2 <= without.0, "{case}: {} of {} edges", with.0, without.0);
        assert!(with.0 * 20 <= before.0, "{case}: {} of {} edges", with.0, before.0);
        assert!(with.1 < before.1 && with.1 < 160.0, "{case}: largest angle {} of {}", with.1, before.1);
    }
}
