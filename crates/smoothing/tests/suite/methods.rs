//! What each method is known for.

use crate::shapes::{shake, sphere};
use crate::{Noise, read, smoothed};
use proptest::prelude::*;
use topipe_mesh::{DVec3, Part, TriangleMesh};
use topipe_smoothing::{Method, Parameters, Weights};

/// Root mean square distance from the sphere of radius 10.
fn roughness(mesh: &TriangleMesh) -> f64 {
    let sum: f64 = mesh.positions.iter().map(|p| (p.length() - 10.0).powi(2)).sum();
    (sum / mesh.vertex_count() as f64).sqrt()
}

fn noisy_sphere() -> Part {
    let mut mesh = sphere(4, DVec3::ZERO);
    shake(&mut mesh, 0.4, 42);
    Part::new(mesh)
}

#[test]
fn a_noisy_sphere_comes_closer_to_the_sphere() {
    let part = noisy_sphere();
    let before = roughness(&part.mesh);
    for weights in [Weights::Constant, Weights::Updated] {
        let result = smoothed(&part, &Parameters { weights, ..Parameters::default() });
        let after = roughness(&result.mesh);
        assert!(after < 0.4 * before, "{weights:?}: {before} before, {after} after");
    }
    for method in [Method::Hc, Method::Taubin] {
        let after = roughness(&smoothed(&part, &Parameters { method, ..Parameters::default() }).mesh);
        assert!(after < 0.6 * before, "{method:?}: {before} before, {after} after");
    }
}

#[test]
fn laplacian_methods_shrink_with_every_iteration() {
    let part = Part::new(sphere(3, DVec3::ZERO));
    for method in [Method::Laplacian, Method::Sdu, Method::Contract] {
        let mut last = part.mesh.volume();
        for iterations in 1..=30 {
            let parameters =
                Parameters { method, iterations: Some(iterations), tolerance: 0.0, ..Parameters::default() };
            let result = smoothed(&part, &parameters);
            let record = result.smoothing.expect("a record");
            assert_eq!((record.iterations, record.converged), (iterations, false));
            let volume = result.mesh.volume();
            assert!(volume < last, "{method:?}");
            assert!((record.volumes[record.volumes.len() - 1] / volume - 1.0).abs() < 1e-12);
            last = volume;
        }
        assert!(last < 0.9 * part.mesh.volume(), "{method:?}");
    }
}

#[test]
fn taubin_keeps_the_volume_only_within_its_rule() {
    let part = Part::new(sphere(3, DVec3::ZERO));
    let volume = |mu| {
        let method = Method::Taubin;
        let parameters =
            Parameters { method, mu, iterations: Some(10), tolerance: 0.0, ..Parameters::default() };
        (parameters.obeys_taubin_rule(), smoothed(&part, &parameters).mesh.volume() / part.mesh.volume())
    };
    let (obeys, kept) = volume(-0.6732);
    assert!(obeys && (kept - 1.0).abs() < 0.03, "{kept}");
    let (obeys, shrunk) = volume(-0.53);
    assert!(!obeys && shrunk < 0.95, "{shrunk}");
}

#[test]
fn humphreys_classes_shrink_less_than_laplacian() {
    let part = noisy_sphere();
    let change = |method| {
        let parameters = Parameters {
            method,
            iterations: Some(50),
            tolerance: 0.0,
            preserve_volume: Some(false),
            ..Parameters::default()
        };
        smoothed(&part, &parameters).mesh.volume() / part.mesh.volume() - 1.0
    };
    let (hc, hc_sdu, laplacian) = (change(Method::Hc), change(Method::HcSdu), change(Method::Laplacian));
    assert!(
        hc.abs() < 0.2 * laplacian.abs() && hc_sdu.abs() < 0.2 * laplacian.abs(),
        "{hc} {hc_sdu} {laplacian}"
    );
}

/// With part of the mesh frozen every method comes to rest: its steps fall below the tolerance and to a small share of the first.
#[test]
fn every_method_comes_to_rest() {
    let mut part = noisy_sphere();
    for v in part.mesh.vertices().filter(|&v| part.mesh.position(v).z < 0.0) {
        part.frozen[v.index()] = true;
    }
    let plain = || Parameters { iterations: Some(400), tolerance: 0.01, ..Parameters::default() };
    let runs = [
        ("laplacian", Parameters { method: Method::Laplacian, ..plain() }),
        ("sdu", Parameters { method: Method::Sdu, ..plain() }),
        ("sdu updated", Parameters { method: Method::Sdu, weights: Weights::Updated, ..plain() }),
        ("hc", Parameters { method: Method::Hc, ..plain() }),
        ("taubin -0.6732", Parameters { method: Method::Taubin, ..plain() }),
        ("taubin -0.53", Parameters { method: Method::Taubin, mu: -0.53, ..plain() }),
        ("hc-sdu", plain()),
        ("hc-sdu updated", Parameters { weights: Weights::Updated, ..plain() }),
        ("contract", Parameters { method: Method::Contract, ..plain() }),
    ];
    for (name, parameters) in runs {
        let record = smoothed(&part, &parameters).smoothing.expect("a record");
        let (first, last) = (record.rms_steps[0], record.rms_steps[record.rms_steps.len() - 1]);
        assert!(record.converged, "{name}: steps {first} to {last} in {} iterations", record.iterations);
        assert!(last < 0.01 && last < 0.1 * first, "{name}: {first} to {last}");
    }
}

#[test]
fn a_higher_alpha_stays_closer_to_the_input() {
    let part = noisy_sphere();
    let change = |alpha| {
        smoothed(&part, &Parameters { alpha: Some(alpha), ..Parameters::default() })
            .smoothing
            .expect("a record")
            .total_change
    };
    assert!(change(0.05) > change(0.27) && change(0.27) > change(0.8));
}

#[test]
fn contraction_takes_the_design_part_and_leaves_the_interfaces() {
    let part = read("cantilever");
    let result = smoothed(&part, &Parameters { method: Method::Contract, ..Parameters::default() });
    let record = result.smoothing.expect("a record");
    assert_eq!(record.iterations, 20);
    assert!(result.mesh.volume() < 0.9 * part.mesh.volume());
    assert!(result.regions.is_empty());
    assert!(result.frozen.iter().any(|f| *f) && result.frozen.iter().any(|f| !*f));
}

#[test]
fn no_iterations_leave_the_mesh_but_report_its_features() {
    let part = read("y-form");
    let result = smoothed(&part, &Parameters { iterations: Some(0), ..Parameters::default() });
    assert_eq!(result.mesh, part.mesh);
    assert!(!result.regions.is_empty() && !result.feature_edges.is_empty());
    assert_eq!(result.smoothing.expect("a record").total_change, 0.0);
}

#[test]
fn the_record_adds_up() {
    let part = read("y-form");
    let result = smoothed(&part, &Parameters::default());
    let record = result.smoothing.expect("a record");
    let moved: f64 =
        part.mesh.positions.iter().zip(&result.mesh.positions).map(|(a, b)| a.distance(*b)).sum();
    assert!((record.total_change / moved - 1.0).abs() < 1e-12);
    assert!(record.cumulative_change >= record.total_change);
    assert!(record.rms_steps.last().is_some_and(|s| *s < Parameters::default().tolerance));
    assert_eq!(record.method, "hc-sdu");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// For any parameters within the ranges of HC-SDU: converges or stops, keeps the volume, moves nothing frozen.
    #[test]
    fn any_allowed_parameters_keep_the_promises(
        alpha in 0.0..=1.0f64, beta in 0.5..=1.0f64, lambda in 0.01..=1.0f64, floor in 0.0..=1.0f64,
        seed in 0..1000u64, size in 0.0..0.5f64,
    ) {
        let mut mesh = sphere(3, DVec3::new(5.0, 0.0, -3.0));
        shake(&mut mesh, size, seed);
        let mut part = Part::new(mesh);
        part.frozen.iter_mut().step_by(7).for_each(|f| *f = true);
        let parameters = Parameters { alpha: Some(alpha), beta, lambda, weight_floor: floor, iterations: Some(20), ..Parameters::default() };
        let result = smoothed(&part, &parameters);
        prop_assert!((result.mesh.volume() / part.mesh.volume() - 1.0).abs() <= 1e-12);
        for v in part.mesh.vertices().filter(|v| part.frozen[v.index()]) {
            prop_assert_eq!(part.mesh.position(v), result.mesh.position(v));
        }
    }
}

#[test]
fn a_large_mesh_stops_at_the_same_iteration_and_state() {
    // So many vertices that iterations are made several at a time; the step is small enough in the middle of them.
    let (width, length) = (110, 950);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let mut noise = Noise(5);
    for i in 0..length {
        for j in 0..width {
            positions.push([i as f64, j as f64, 0.3 * noise.next()]);
            if i > 0 && j > 0 {
                let v = i * width + j;
                let [a, b, c, d] = [v, v - 1, v - width - 1, v - width].map(|v| v as u32);
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    let part = Part::new(TriangleMesh::from_arrays(positions, triangles));
    let parameters = Parameters {
        method: Method::Taubin,
        detect_planes: false,
        detect_holes: false,
        detect_bosses: false,
        spike_angle: 180.0,
        keep_embedded: false,
        iterations: Some(30),
        tolerance: 0.008,
        ..Parameters::default()
    };
    let stopped = smoothed(&part, &parameters);
    let record = stopped.smoothing.as_ref().expect("a record");
    assert!(record.converged && !record.iterations.is_multiple_of(8), "{}", record.iterations);
    assert_eq!(record.rms_steps.len(), record.iterations as usize);
    assert!(record.rms_steps.iter().rev().skip(1).all(|r| *r >= 0.008));
    let counted = Parameters { iterations: Some(record.iterations), tolerance: 0.0, ..parameters };
    assert!(smoothed(&part, &counted).mesh == stopped.mesh);
}
