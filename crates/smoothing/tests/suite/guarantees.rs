//! Volume, frozen vertices, holes, flat faces, same bits for any number of threads.

use crate::{facts, file, read, smoothed};
use topipe_mesh::import::ImportOptions;
use topipe_mesh::{Connectivity, DVec3, Design, FeatureKind, Part, RegionShape, TriangleMesh};
use topipe_progress::{Progress, Recorder};
use topipe_smoothing::{Method, Parameters, smooth};

#[test]
fn volume_is_kept_to_twelve_digits() {
    for case in ["bracket", "y-form"] {
        let part = read(case);
        let result = smoothed(&part, &Parameters::default());
        let volume = part.mesh.volume();
        assert!((result.mesh.volume() / volume - 1.0).abs() <= 1e-12, "{case}");
        let record = result.smoothing.expect("a record");
        assert!(record.volumes.iter().all(|v| (v / volume - 1.0).abs() <= 1e-12), "{case}");
        assert_eq!(record.volumes.len(), record.iterations as usize);
        assert_eq!(record.rms_steps.len(), record.iterations as usize);
    }
}

#[test]
fn volume_is_kept_far_from_the_origin() {
    let mut part = read("y-form");
    let near = smoothed(&part, &Parameters::default());
    let shift = DVec3::new(1000.0, -2000.0, 3000.0);
    part.mesh.positions.iter_mut().for_each(|p| *p += shift);
    let far = smoothed(&part, &Parameters::default());
    assert!((far.mesh.volume() / part.mesh.volume() - 1.0).abs() <= 1e-12);
    for (p, q) in near.mesh.positions.iter().zip(&far.mesh.positions) {
        assert!(p.distance(*q - shift) < 1e-8);
    }
}

#[test]
fn every_method_can_keep_the_volume() {
    let part = read("y-form");
    for method in [Method::Laplacian, Method::Sdu, Method::Hc, Method::Taubin] {
        let parameters =
            Parameters { method, iterations: Some(10), preserve_volume: Some(true), ..Parameters::default() };
        let result = smoothed(&part, &parameters);
        assert!((result.mesh.volume() / part.mesh.volume() - 1.0).abs() <= 1e-12, "{method:?}");
    }
}

#[test]
fn frozen_vertices_keep_their_bits() {
    let part = read("y-form");
    for method in
        [Method::Laplacian, Method::Sdu, Method::Hc, Method::Taubin, Method::HcSdu, Method::Contract]
    {
        let result = smoothed(&part, &Parameters { method, iterations: Some(5), ..Parameters::default() });
        let mut moved = 0;
        for v in part.mesh.vertices() {
            let (before, after) = (part.mesh.position(v), result.mesh.position(v));
            if result.frozen[v.index()] {
                assert_eq!(before.to_array().map(f64::to_bits), after.to_array().map(f64::to_bits));
            } else {
                moved += usize::from(before != after);
            }
        }
        assert!(moved > part.mesh.vertex_count() / 3, "{method:?} moved {moved} vertices");
        for (triangle, design) in part.mesh.triangles.iter().zip(&part.design) {
            if *design == Design::NonDesign {
                assert!(triangle.iter().all(|v| result.frozen[v.index()]));
            }
        }
    }
}

#[test]
fn holes_of_the_bracket_keep_their_diameters() {
    let part = read("bracket");
    let result = smoothed(&part, &Parameters::default());
    let facts = facts("bracket");
    for hole in facts["holes"].as_array().expect("holes") {
        let number = |v: &serde_json::Value| v.as_f64().expect("a number");
        let vector = |v: &serde_json::Value| DVec3::new(number(&v[0]), number(&v[1]), number(&v[2]));
        let (start, axis) = (vector(&hole["point"]), vector(&hole["axis"]));
        let (length, radius) = (number(&hole["length"]), number(&hole["diameter"]) / 2.0);
        let (mut sum, mut count) = (0.0, 0);
        for p in &result.mesh.positions {
            let along = axis.dot(*p - start);
            let distance = (*p - start - axis * along).length();
            if (-1e-3..=length + 1e-3).contains(&along) && (distance - radius).abs() < 1e-4 {
                sum += distance;
                count += 1;
            }
        }
        // The 18 mm cylinder is one hole through two lugs.
        let vertices = hole["wall_vertices"].as_u64().expect("a count") as usize;
        assert!(count >= vertices);
        assert!((sum / count as f64 / radius - 1.0).abs() < 1e-6);
    }
}

#[test]
fn flat_faces_stay_in_their_planes() {
    for case in ["bracket", "cantilever"] {
        let part = read(case);
        let result = smoothed(&part, &Parameters::default());
        let diagonal = part.mesh.diagonal();
        let mut slid = 0;
        for f in part.mesh.faces() {
            let id = result.region_of_face[f.index()];
            if !id.is_some() {
                continue;
            }
            let RegionShape::Plane { point, normal } = result.regions[id.index()].shape else { continue };
            assert!(normal.dot(result.mesh.area_vector(f)) > 0.0, "{case}: {f:?} turned over");
            for v in part.mesh.triangles[f.index()] {
                let height = normal.dot(result.mesh.position(v) - point).abs();
                assert!(height <= result.regions[id.index()].residual);
                slid += usize::from(!result.frozen[v.index()]);
            }
        }
        assert!(slid > 100, "no outline slides on {case}");
        assert!(result.regions.iter().all(|r| r.residual < 1e-7 * diagonal), "{case}");
    }
}

/// Folds: facets whose normal is more than 120 degrees off the mean of their neighbours'.
fn folds(mesh: &TriangleMesh) -> usize {
    let connectivity = Connectivity::build(mesh).expect("a manifold");
    mesh.faces()
        .filter(|&f| {
            let around: DVec3 = (0..3).map(|k| mesh.normal(connectivity.neighbor(f, k))).sum();
            mesh.normal(f).dot(around.normalize_or_zero()) < -0.5
        })
        .count()
}

/// The share `share` of dihedral angles in the free surface lies below this, degrees.
fn dihedral(part: &Part, mesh: &TriangleMesh, share: f64) -> f64 {
    let connectivity = Connectivity::build(mesh).expect("a manifold");
    let free = |f: topipe_mesh::FaceId| {
        !part.region_of_face[f.index()].is_some()
            && part.mesh.triangles[f.index()].iter().any(|v| !part.frozen[v.index()])
    };
    let mut angles: Vec<f64> = connectivity
        .edges()
        .map(|h| (h.face(), connectivity.twin(h).face()))
        .filter(|&(f, g)| free(f) && free(g))
        .map(|(f, g)| mesh.normal(f).dot(mesh.normal(g)).clamp(-1.0, 1.0).acos().to_degrees())
        .collect();
    angles.sort_by(f64::total_cmp);
    angles[(angles.len() as f64 * share) as usize]
}

#[test]
fn spikes_are_gone() {
    for case in ["bracket", "beam-two-holes", "cantilever"] {
        let part = read(case);
        let result = smoothed(&part, &Parameters::default());
        let record = result.smoothing.as_ref().expect("a record");
        assert!(record.converged && record.iterations <= 96, "{case}: {} iterations", record.iterations);
        let (before, after) = (dihedral(&result, &part.mesh, 0.5), dihedral(&result, &result.mesh, 0.5));
        assert!(before > 40.0 && after < 20.0, "{case}: median dihedral {before} before, {after} after");
        let (before, after) = (folds(&part.mesh), folds(&result.mesh));
        assert!(before > 100 && after * 20 < before, "{case}: {before} folds before, {after} after");
    }
}

#[test]
fn feature_edges_are_closed_rims_and_real_edges() {
    let part = read("bracket");
    let result = smoothed(&part, &Parameters::default());
    let connectivity = Connectivity::build(&result.mesh).expect("a manifold");
    let mut rim_degree = vec![0; result.mesh.vertex_count()];
    for edge in &result.feature_edges {
        let [a, b] = edge.vertices;
        assert!(a < b);
        let h = connectivity.half_edge(a, b).expect("an edge of the mesh");
        let (f, g) = (h.face(), connectivity.twin(h).face());
        match edge.kind {
            FeatureKind::HoleRim => {
                rim_degree[a.index()] += 1;
                rim_degree[b.index()] += 1;
            }
            FeatureKind::Sharp => {
                let angle = result.mesh.normal(f).dot(result.mesh.normal(g)).clamp(-1.0, 1.0).acos();
                assert!(angle.to_degrees() >= Parameters::default().sharp_angle - 1e-9);
                assert!([a, b].iter().all(|v| result.frozen[v.index()]));
            }
            kind => panic!("{kind:?} is not listed unless asked for"),
        }
    }
    assert!(rim_degree.iter().all(|d| *d == 0 || *d == 2), "a rim is not a closed line");
    // Six holes with two rims each; a ring has as many edges as vertices.
    let on_rim = |v: &usize| rim_degree[*v] == 2;
    let mut seen = vec![false; rim_degree.len()];
    let mut rims = 0;
    for start in (0..rim_degree.len()).filter(on_rim) {
        if seen[start] {
            continue;
        }
        rims += 1;
        let mut stack = vec![start];
        while let Some(v) = stack.pop() {
            if std::mem::replace(&mut seen[v], true) {
                continue;
            }
            for edge in result.feature_edges.iter().filter(|e| e.kind == FeatureKind::HoleRim) {
                let [a, b] = edge.vertices.map(|w| w.index());
                if a == v {
                    stack.push(b);
                } else if b == v {
                    stack.push(a);
                }
            }
        }
    }
    assert_eq!(rims, 12);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let part = read("cantilever");
    let mut results = Vec::new();
    for threads in [1, 2, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        results.push(pool.install(|| smoothed(&part, &Parameters::default())));
    }
    let bits = |part: &Part| -> Vec<[u64; 3]> {
        part.mesh.positions.iter().map(|p| p.to_array().map(f64::to_bits)).collect()
    };
    for other in &results[1..] {
        assert_eq!(bits(&results[0]), bits(other));
        assert!(results[0] == *other);
    }
}

#[test]
fn an_outline_does_not_pass_the_frozen_inside_of_its_face() {
    // A prism whose top has a deep notch next to frozen vertices: straightening the outline would cross them.
    let part = Part::new(notched_prism());
    let parameters = Parameters { alpha: Some(0.0), tolerance: 0.0, ..Parameters::default() };
    let result = smoothed(&part, &parameters);
    let mut slid = 0;
    for f in part.mesh.faces() {
        let id = result.region_of_face[f.index()];
        if !id.is_some() {
            continue;
        }
        let RegionShape::Plane { normal, .. } = result.regions[id.index()].shape else { continue };
        let (before, after) = (part.mesh.area_vector(f), result.mesh.area_vector(f));
        assert!(normal.dot(after) >= 0.09 * normal.dot(before), "{f:?} turned over");
        slid += usize::from(before != after);
    }
    assert!(slid > 10);
}

/// A solid of two height fields over a grid: flat on top within a ragged outline, wavy elsewhere.
fn notched_prism() -> TriangleMesh {
    let n = 24;
    let mut noise = crate::Noise(9);
    let at = |i: usize, j: usize| i * (n + 1) + j;
    let layer = (n + 1) * (n + 1);
    let mut positions = Vec::new();
    for top in [true, false] {
        for i in 0..=n {
            for j in 0..=n {
                let ragged = 4 + 3 * (j % 2) + (j % 3);
                let flat = i > ragged && i < n - 2 && j > 2 && j < n - 2;
                let bump = if flat { 0.0 } else { 0.6 + 0.3 * noise.next() };
                let (x, y) = (i as f64, j as f64);
                positions.push(if top { [x, y, 5.0 - bump] } else { [x, y, bump] });
            }
        }
    }
    let mut triangles: Vec<[usize; 3]> = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
            triangles.extend([[layer + a, layer + c, layer + b], [layer + a, layer + d, layer + c]]);
        }
    }
    for k in 0..n {
        for (a, b) in [
            (at(k, 0), at(k + 1, 0)),
            (at(n, k), at(n, k + 1)),
            (at(k + 1, n), at(k, n)),
            (at(0, k + 1), at(0, k)),
        ] {
            triangles.extend([[a, layer + a, layer + b], [a, layer + b, b]]);
        }
    }
    let triangles = triangles.into_iter().map(|t| t.map(|v| v as u32)).collect();
    TriangleMesh::from_arrays(positions, triangles)
}

/// One free vertex beside outlines that slide: it can not make up for what they take.
#[test]
fn a_mesh_whose_volume_would_be_lost_is_left_as_it_is() {
    let bytes = std::fs::read(file("voxels", "stl")).unwrap();
    let part = topipe_mesh::import::read("voxels.stl", &bytes, &ImportOptions::default()).unwrap();
    let warnings = std::sync::Arc::new(Recorder::default());
    let progress = Progress::new(warnings.clone());
    let smoothed = smooth(&part, &Parameters::default(), &progress).unwrap();
    let record = smoothed.smoothing.as_ref().unwrap();
    assert_eq!((record.iterations, record.total_change), (0, 0.0));
    assert_eq!(smoothed.mesh, part.mesh);
    assert!(!smoothed.regions.is_empty());
    let said = warnings.warnings();
    assert_eq!(said.iter().filter(|text| text.contains("left as it is")).count(), 1, "{said:?}");
    // Without sliding it is smoothed, and keeps its volume.
    let parameters = Parameters { slide_outlines: false, ..Parameters::default() };
    let smoothed = smooth(&part, &parameters, &Progress::silent()).unwrap();
    assert!((smoothed.mesh.volume() / part.mesh.volume() - 1.0).abs() < 1e-12);
}
