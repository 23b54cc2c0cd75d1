//! Conjugate gradients in double precision.

use super::vector::{add_scaled, dot, scale_and_add};
use topipe_progress::{Interrupted, Progress};

/// How a solution went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convergence {
    /// Steps that were made.
    pub iterations: u32,
    /// Norm of the residual in the preconditioner over that of the load: about the relative error in the norm of energy.
    pub residual: f64,
    /// Whether the residual is as small as was asked.
    pub converged: bool,
}

/// Improves `x` until the residual of `A x = b` is small.
pub(crate) fn solve(
    product: impl Fn(&[f64], &mut [f64]),
    precondition: impl Fn(&[f64], &mut [f64]),
    b: &[f64],
    x: &mut [f64],
    tolerance: f64,
    most: u32,
    progress: &Progress,
) -> Result<Convergence, Interrupted> {
    let n = b.len();
    let (mut r, mut z, mut p, mut ap) = (b.to_vec(), vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    precondition(b, &mut z);
    let reference = dot(b, &z);
    // Nothing is loaded.
    if reference <= 0.0 || !reference.is_finite() {
        x.fill(0.0);
        return Ok(Convergence { iterations: 0, residual: 0.0, converged: reference == 0.0 });
    }
    if x.iter().any(|&x| x != 0.0) {
        product(x, &mut ap);
        add_scaled(&mut r, -1.0, &ap);
        precondition(&r, &mut z);
    }
    let mut rz = dot(&r, &z);
    p.copy_from_slice(&z);
    let mut iterations = 0;
    loop {
        let residual = (rz.max(0.0) / reference).sqrt();
        if residual <= tolerance || iterations == most || !residual.is_finite() {
            return Ok(Convergence { iterations, residual, converged: residual <= tolerance });
        }
        progress.check()?;
        product(&p, &mut ap);
        let curvature = dot(&p, &ap);
        if curvature <= 0.0 || !curvature.is_finite() {
            return Ok(Convergence { iterations, residual, converged: false });
        }
        let step = rz / curvature;
        add_scaled(x, step, &p);
        add_scaled(&mut r, -step, &ap);
        // The preconditioner is single precision and so not quite linear: this form of Polak and Ribiere does not mind, for
        // one scalar product more.
        let before = dot(&r, &z);
        precondition(&r, &mut z);
        let after = dot(&r, &z);
        scale_and_add(&mut p, (after - before) / rz, &z);
        rz = after;
        iterations += 1;
    }
}
