//! Each bad input has one clear message.

use crate::read;
use crate::shapes::{sphere, voxels};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use topipe_mesh::{DVec3, Design, Part, TriangleMesh};
use topipe_progress::{Listener, Progress};
use topipe_smoothing::{Method, Parameters, SmoothingError, smooth};

fn refused(part: &Part, parameters: &Parameters) -> SmoothingError {
    smooth(part, parameters, &Progress::silent()).expect_err("a refusal")
}

#[test]
fn parameters_out_of_range_name_the_range_and_its_source() {
    let part = Part::new(sphere(1, DVec3::ZERO));
    let plain = Parameters::default();
    let cases = [
        (Parameters { alpha: Some(1.5), ..plain.clone() }, ["`alpha` is 1.5", "between 0 and 1", "Vollmer"]),
        (
            Parameters { alpha: Some(f64::NAN), ..plain.clone() },
            ["`alpha` is NaN", "between 0 and 1", "Vollmer"],
        ),
        (Parameters { beta: 0.4, ..plain.clone() }, ["`beta` is 0.4", "between 0.5 and 1", "Vollmer"]),
        (Parameters { lambda: 0.0, ..plain.clone() }, ["`lambda` is 0", "above 0 and at most 1", "Taubin"]),
        (
            Parameters { mu: 0.5, method: Method::Taubin, ..plain.clone() },
            ["`mu` is 0.5", "below 0", "Taubin"],
        ),
        (
            Parameters { tolerance: -1.0, ..plain.clone() },
            ["`tolerance` is -1", "at least 0", "edge lengths"],
        ),
        (
            Parameters { plane_angle: Some(90.0), ..plain.clone() },
            ["`plane_angle` is 90", "at most 45", "degrees"],
        ),
        (Parameters { sharp_angle: 5.0, ..plain.clone() }, ["`sharp_angle` is 5", "20 and 180", "degrees"]),
    ];
    for (parameters, words) in cases {
        let error = refused(&part, &parameters);
        assert!(matches!(error, SmoothingError::Parameter { .. }));
        let message = error.to_string();
        assert!(words.iter().all(|w| message.contains(w)), "{message}");
    }
    // A field that the method does not use is not checked.
    let unused = Parameters { alpha: Some(7.0), method: Method::Laplacian, ..plain };
    assert!(smooth(&part, &unused, &Progress::silent()).is_ok());
}

#[test]
fn everything_frozen_is_refused_unless_nothing_is_to_be_done() {
    let mut part = Part::new(sphere(2, DVec3::ZERO));
    part.design.fill(Design::NonDesign);
    let error = refused(&part, &Parameters::default());
    let vertices = part.mesh.vertex_count();
    assert_eq!(error, SmoothingError::EverythingFrozen { vertices, non_design: vertices });
    assert!(error.to_string().contains("`freeze_non_design`"));
    assert!(
        smooth(&part, &Parameters { iterations: Some(0), ..Parameters::default() }, &Progress::silent())
            .is_ok()
    );

    let block = Part::new(voxels(7, |p| p.abs().max_element() < 6.0));
    assert!(matches!(
        refused(&block, &Parameters::default()),
        SmoothingError::EverythingFrozen { non_design: 0, .. }
    ));

    // Of a block with a step of one voxel askew, the vertices along the step slide in its flat faces, and none is free.
    let step = |p: DVec3| if p.x + 2.0 * p.y > 0.0 { 1.0 } else { 0.0 };
    let stepped = Part::new(voxels(9, |p| p.x.abs().max(p.y.abs()) < 8.0 && p.z > -6.0 && p.z < step(p)));
    assert!(matches!(
        refused(&stepped, &Parameters::default()),
        SmoothingError::EverythingFrozen { non_design: 0, .. }
    ));
    assert!(
        smooth(
            &stepped,
            &Parameters { preserve_volume: Some(false), ..Parameters::default() },
            &Progress::silent()
        )
        .is_ok()
    );
}

#[test]
fn zero_volume_open_meshes_and_nan_are_refused() {
    // Two sheets in one place, joined at their border.
    let sheet = TriangleMesh::from_arrays(
        vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0.4, 0.3, 0.], [0.3, 0.4, 0.]],
        vec![[0, 1, 3], [1, 2, 3], [2, 0, 3], [1, 0, 4], [2, 1, 4], [0, 2, 4]],
    );
    let parameters = Parameters { detect_planes: false, ..Parameters::default() };
    let error = refused(&Part::new(sheet.clone()), &parameters);
    assert!(matches!(error, SmoothingError::ZeroVolume { .. }), "{error}");
    let allowed = Parameters { preserve_volume: Some(false), ..parameters };
    assert!(smooth(&Part::new(sheet), &allowed, &Progress::silent()).is_ok());

    let mut open = sphere(2, DVec3::ZERO);
    open.triangles.pop();
    assert_eq!(refused(&Part::new(open.clone()), &Parameters::default()), SmoothingError::Open { edges: 3 });
    assert!(smooth(&Part::new(open), &allowed, &Progress::silent()).is_ok());

    let mut nan = sphere(2, DVec3::ZERO);
    nan.positions[5].y = f64::NAN;
    assert_eq!(refused(&Part::new(nan), &Parameters::default()), SmoothingError::NotFinite { vertex: 5 });
}

#[test]
fn inconsistent_parts_and_empty_meshes_are_refused() {
    let mut part = Part::new(sphere(1, DVec3::ZERO));
    part.design.pop();
    let message = refused(&part, &Parameters::default()).to_string();
    assert!(message.contains("31 design labels") && message.contains("32"), "{message}");

    assert!(matches!(
        refused(&Part::default(), &Parameters::default()),
        SmoothingError::EverythingFrozen { vertices: 0, .. }
    ));

    let mut fin = sphere(1, DVec3::ZERO);
    fin.triangles.push(fin.triangles[0]);
    assert!(matches!(refused(&Part::new(fin), &Parameters::default()), SmoothingError::Connectivity(_)));
}

struct StopAfter(AtomicU64);

impl Listener for StopAfter {
    fn step(&self, done: u64, total: u64, what: &str) {
        assert_eq!((total, what), (150, "iterations"));
        self.0.store(done, Ordering::Relaxed);
    }
    fn remark(&self, _: &str) {}
    fn interrupted(&self) -> bool {
        self.0.load(Ordering::Relaxed) >= 3
    }
}

#[test]
fn interruption_ends_the_run_at_the_next_iteration() {
    let listener = Arc::new(StopAfter(AtomicU64::new(0)));
    let result = smooth(&read("y-form"), &Parameters::default(), &Progress::new(listener.clone()));
    assert!(matches!(result, Err(SmoothingError::Interrupted(_))));
    assert_eq!(listener.0.load(Ordering::Relaxed), 3);
}
