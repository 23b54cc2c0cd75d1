//! How the normals turn along the edges as they leave a vertex.
//!
//! Two things must hold there, or a patch can not meet the normals along both of its sides near its corner. Along a
//! curve the normal turns as the curve bends: n'.c' = -n.c''. And at a corner the mixed derivative of the patch, asked
//! for by both sides, must be the same: e_j . n_i' = e_i . n_j' for the legs e_i, e_j. For curves on one smooth surface
//! both hold by themselves, with n' = -W c' for the shape operator W; curves that interpolate a noisy mesh bend a
//! little differently. So n' takes its part along each curve from the curve, and its part across (the geodesic
//! torsion) such that the corners agree: with angle phi between edges i and j,
//! (torsion_i + torsion_j) sin phi = (curvature_j - curvature_i) cos phi.
//! Around an odd number of edges that has a solution, around an even number up to one condition (the vertex
//! enclosure problem, Peters 1991); it is solved by least squares, held weakly to the shape operator.

use crate::banded::Banded;
use crate::local_surface::LocalSurface;
use topipe_mesh::DVec3;

/// An edge as it leaves the vertex.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leg {
    /// First derivative of the curve, out of the vertex.
    pub(crate) first: DVec3,
    /// Second derivative.
    pub(crate) second: DVec3,
    /// The derivative of the normal, where it is given: along the border of a shape.
    pub(crate) turning: Option<DVec3>,
}

/// A curve as it leaves its start, or backwards its end, from its control points over a basis with double knots.
pub(crate) fn leg(control: &[DVec3], reversed: bool) -> Leg {
    let last = control.len() - 1;
    let point = |k: usize| control[if reversed { last - k } else { k }];
    let spans = (control.len() / 2 - 1) as f64;
    Leg {
        first: 3.0 * spans * (point(1) - point(0)),
        second: 6.0 * spans * spans * (point(0) - 2.0 * point(1) + point(2)),
        turning: None,
    }
}

/// Weight of the torsions of the shape operator against those that make the corners agree.
const HOLD: f64 = 1e-4;
/// The same for torsions that are given.
const GIVEN: f64 = 1e6;

/// Derivatives of the normal along each leg. `legs` are in order around the vertex, `None` for creases, where nothing
/// is asked for; `closed` tells whether the last and the first bound a corner.
pub(crate) fn turning(surface: &LocalSurface, legs: &[Option<Leg>], closed: bool) -> Vec<Option<DVec3>> {
    let n = legs.len();
    let normal = surface.normal;
    struct Datum {
        along: DVec3,
        across: DVec3,
        curvature: f64,
        /// Of the shape operator.
        torsion: f64,
        length: f64,
        hold: f64,
    }
    let data: Vec<Option<Datum>> = legs
        .iter()
        .map(|leg| {
            let leg = (*leg)?;
            let length = leg.first.length();
            let along = (leg.first - leg.first.dot(normal) * normal).try_normalize()?;
            let across = normal.cross(along);
            let curvature = leg.second.dot(normal) / (length * length);
            let (torsion, hold) = match leg.turning {
                Some(turning) => (-across.dot(turning) / length, GIVEN),
                None => (across.dot(surface.form * along), HOLD),
            };
            Some(Datum { along, across, curvature, torsion, length, hold })
        })
        .collect();
    let corners: Vec<(usize, usize)> = (0..n)
        .map(|i| (i, (i + 1) % n))
        .take(if closed && n > 2 { n } else { n.saturating_sub(1) })
        .collect();
    let mut matrix = Banded::zero(n, n);
    let mut right = vec![0.0; n];
    for (i, datum) in data.iter().enumerate() {
        let (hold, torsion) = datum.as_ref().map_or((HOLD, 0.0), |d| (d.hold, d.torsion));
        matrix.add(i, i, hold);
        right[i] += hold * torsion;
    }
    for (i, j) in corners {
        let (Some(a), Some(b)) = (&data[i], &data[j]) else { continue };
        let (cos, sin) = (a.along.dot(b.along), a.across.dot(b.along));
        let goal = (b.curvature - a.curvature) * cos;
        for row in [i, j] {
            right[row] += sin * goal;
            for column in [i, j] {
                matrix.add(row, column, sin * sin);
            }
        }
    }
    let solved = matrix.solve(&mut right).is_some();
    data.iter()
        .enumerate()
        .map(|(i, datum)| {
            let datum = datum.as_ref()?;
            let torsion = if solved { right[i] } else { datum.torsion };
            Some(-datum.length * (datum.curvature * datum.along + torsion * datum.across))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    /// Curves on a saddle: the shape operator's own derivatives come out.
    #[test]
    fn curves_on_a_smooth_surface_turn_with_its_shape_operator() {
        let form = DMat3::from_cols(DVec3::new(0.7, 0.2, 0.0), DVec3::new(0.2, -0.4, 0.0), DVec3::ZERO);
        let surface = LocalSurface { position: DVec3::ZERO, normal: DVec3::Z, form };
        for n in 3..8 {
            let legs: Vec<Option<Leg>> = (0..n)
                .map(|k| {
                    let angle = k as f64 / n as f64 * std::f64::consts::TAU + 0.1 * (k as f64).sin();
                    let first = DVec3::new(angle.cos(), angle.sin(), 0.0) * (1.0 + 0.1 * k as f64);
                    let second = DVec3::new(0.3, 0.1 * k as f64, first.dot(form * first));
                    Some(Leg { first, second, turning: None })
                })
                .collect();
            for (leg, turn) in legs.iter().zip(turning(&surface, &legs, true)) {
                let expected = -(form * leg.unwrap().first);
                assert!(turn.unwrap().distance(expected) < 1e-9, "{n} legs");
            }
        }
    }

    /// Curves that bend as they like: around an odd number of them the corners agree all the same.
    #[test]
    fn corners_agree_around_an_odd_number_of_curves() {
        let surface = LocalSurface { position: DVec3::ZERO, normal: DVec3::Z, form: DMat3::ZERO };
        for n in [3, 5, 7] {
            let legs: Vec<Option<Leg>> = (0..n)
                .map(|k| {
                    let angle = k as f64 / n as f64 * std::f64::consts::TAU;
                    let first = DVec3::new(angle.cos(), angle.sin(), 0.0);
                    Some(Leg { first, second: DVec3::Z * (k as f64 * 1.7).sin(), turning: None })
                })
                .collect();
            let turns = turning(&surface, &legs, true);
            for i in 0..n {
                let j = (i + 1) % n;
                let (a, b) = (legs[i].unwrap(), legs[j].unwrap());
                let difference = b.first.dot(turns[i].unwrap()) - a.first.dot(turns[j].unwrap());
                assert!(difference.abs() < 1e-2, "{n} legs: {difference}");
            }
        }
    }
}
