//! Foot-point correction: the parameters of a sample move to the nearest point of the last fit.
//!
//! Hoschek's intrinsic parameterization: a few Gauss-Newton steps on |S(u, v) - p|^2 inside the patch. A step that
//! does not bring the point nearer is not taken.

use crate::SurfacePoint;
use crate::samples::PatchSamples;

/// Steps per correction: the next fit moves the surface again, so more would be wasted.
const STEPS: usize = 3;

/// Moves the samples to their foot points on a patch, given by its position and first derivatives at (u, v).
pub(crate) fn correct(samples: &mut PatchSamples, patch: impl Fn(f64, f64) -> SurfacePoint) {
    for sample in &mut samples.samples {
        let (mut u, mut v) = (sample.u, sample.v);
        let mut at = patch(u, v);
        for _ in 0..STEPS {
            let off = sample.point - at.position;
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
            let nearer = next.position.distance_squared(sample.point) < off.length_squared();
            if !nearer {
                break;
            }
            (u, v, at) = (next_u, next_v, next);
        }
        (sample.u, sample.v) = (u, v);
    }
}
