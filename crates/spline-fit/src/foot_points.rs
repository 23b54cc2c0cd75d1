//! Foot-point correction: the parameters of a sample move to the nearest point of the last fit.
//!
//! Hoschek's intrinsic parameterization: a few Gauss-Newton steps on |S(u, v) - p|^2 inside the patch. A step that
//! does not bring the point nearer is not taken.

use crate::SurfacePoint;
use crate::samples::PatchSamples;
use topipe_mesh::DVec3;

/// Steps per correction: the next fit moves the surface again, so more would be wasted.
const STEPS: usize = 3;

/// Moves the samples to their foot points on a patch, given by its position and first derivatives at (u, v).
pub(crate) fn correct(samples: &mut PatchSamples, patch: impl Fn(f64, f64) -> SurfacePoint) {
    for sample in &mut samples.samples {
        [sample.u, sample.v] = nearer(sample.point, [sample.u, sample.v], &patch);
    }
}

/// The parameters of a point of the patch that is nearer to `point` than the one with the parameters `from`, or these themselves.
pub(crate) fn nearer(point: DVec3, from: [f64; 2], patch: impl Fn(f64, f64) -> SurfacePoint) -> [f64; 2] {
    let [mut u, mut v] = from;
    let mut at = patch(u, v);
    for _ in 0..STEPS {
        let off = point - at.position;
        let (a, b, c) = (at.du.length_squared(), at.du.dot(at.dv), at.dv.length_squared());
        let determinant = a * c - b * b;
        // Derivatives that are parallel or vanish give no direction.
        if determinant.is_nan() || determinant <= 1e-12 * a * c {
            break;
        }
        let (p, q) = (off.dot(at.du), off.dot(at.dv));
        let next_u = (u + (c * p - b * q) / determinant).clamp(0.0, 1.0);
        let next_v = (v + (a * q - b * p) / determinant).clamp(0.0, 1.0);
        let next = patch(next_u, next_v);
        if next.position.distance_squared(point) >= off.length_squared() {
            break;
        }
        (u, v, at) = (next_u, next_v, next);
    }
    [u, v]
}
