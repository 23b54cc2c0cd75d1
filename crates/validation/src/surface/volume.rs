//! The volume inside a closed spline surface by the divergence theorem, exactly.
//!
//! V = 1/3 of the integral of S . (S_u x S_v). On a knot span the integrand is a polynomial of degree 3 p - 1 in
//! each parameter, which Gauss-Legendre quadrature with ceil(3 p / 2) points integrates without error. Planes and
//! cylinders are integrated along their borders.

use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::OnceLock;
use topipe_mesh::DVec3;
use topipe_spline_fit::{Basis, SplineSurface};

/// Nodes and weights of Gauss-Legendre quadrature on [0, 1].
pub(super) fn gauss(count: usize) -> Vec<(f64, f64)> {
    (0..count)
        .map(|k| {
            // Newton from the asymptotic root; it converges to the last digit in a few steps.
            let mut x = (PI * (k as f64 + 0.75) / (count as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..20 {
                let (mut p, mut before) = (1.0, 0.0);
                for n in 0..count {
                    let n = n as f64;
                    (p, before) = (((2.0 * n + 1.0) * x * p - n * before) / (n + 1.0), p);
                }
                slope = count as f64 * (x * p - before) / (x * x - 1.0);
                x -= p / slope;
            }
            ((1.0 - x) / 2.0, 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Rules that are asked for once for each curve and patch.
static RULES: [OnceLock<Vec<(f64, f64)>>; 24] = [const { OnceLock::new() }; 24];

/// Nodes and weights on all knot spans of a basis.
pub(super) fn composite(basis: &Basis, count: usize) -> Vec<(f64, f64)> {
    let other;
    let rule = match RULES.get(count) {
        Some(known) => known.get_or_init(|| gauss(count)),
        None => {
            other = gauss(count);
            &other
        }
    };
    let breaks = basis.breaks();
    breaks
        .windows(2)
        .flat_map(|span| {
            let (a, h) = (span[0], span[1] - span[0]);
            rule.iter().map(move |&(x, w)| (a + h * x, h * w))
        })
        .collect()
}

/// The signed volume: positive where S_u x S_v points outward. Exact up to rounding.
pub fn volume_by_quadrature(surface: &SplineSurface) -> f64 {
    let (low, high) = surface
        .vertices
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    // About the middle of the part, so that one far from the origin keeps its digits.
    let center = if low.is_finite() { (low + high) / 2.0 } else { DVec3::ZERO };
    let pieces: Vec<f64> = surface
        .patches
        .par_iter()
        .map(|patch| {
            let nodes = |basis: &Basis| -> Vec<_> {
                let nodes = composite(basis, (3 * basis.degree()).div_ceil(2));
                nodes.into_iter().map(|(t, weight)| (basis.evaluate(t), weight)).collect()
            };
            let (u, v) = (nodes(&patch.basis_u), nodes(&patch.basis_v));
            let u: Vec<_> = u.iter().map(|(u, weight)| (patch.column(u), weight)).collect();
            let mut sum = 0.0;
            for (v, weight_v) in &v {
                for (u, weight_u) in &u {
                    let s = u.evaluate(v);
                    sum += *weight_u * weight_v * (s.position - center).dot(s.du.cross(s.dv));
                }
            }
            sum
        })
        .collect();
    let faces: f64 = surface.faces.iter().map(|face| face.volume(&surface.edges, center)).sum();
    pieces.iter().sum::<f64>() / 3.0 + faces
}

#[cfg(test)]
mod tests {
    use super::gauss;

    #[test]
    fn gauss_integrates_powers_up_to_its_degree() {
        for count in 1..=12 {
            let rule = gauss(count);
            for power in 0..2 * count as i32 {
                let integral: f64 = rule.iter().map(|(x, w)| w * x.powi(power)).sum();
                let exact = 1.0 / f64::from(power + 1);
                assert!((integral - exact).abs() < 1e-14, "{count} points, power {power}: {integral}");
            }
            let beyond: f64 = rule.iter().map(|(x, w)| w * x.powi(2 * count as i32)).sum();
            assert!((beyond - 1.0 / (2 * count + 1) as f64).abs() > 1e-16, "the next power is not exact");
        }
    }
}
