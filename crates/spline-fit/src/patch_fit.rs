//! One patch: the inside of its control net, between given borders.
//!
//! Least squares of the distance to the samples and of the bending energy (source, section 2.3). Where a side has a
//! ribbon (see [`crate::ribbon`]) the control points beside it are given too. So the coordinates do not depend on each
//! other, and a patch knows nothing of its neighbours: this is what makes it a unit of work of its own.

use crate::banded::Banded;
use crate::bending::{Products, Stiffness, add_bending};
use crate::breaks::Breaks;
use crate::distances::add_distances;
use crate::hermite;
use crate::samples::PatchSamples;
use crate::{Basis, SurfacePoint};
use glam::DVec2;
use topipe_mesh::DVec3;

/// A side of a patch as the patch runs along it: v = 0, u = 1, v = 1 (backwards), u = 0 (backwards).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Border {
    /// Control points of the curve.
    pub(crate) control: Vec<DVec3>,
    /// Spans of the patch along this side: those of the curve or more.
    pub(crate) spans: usize,
    /// From each control point of the patch's side to the one beside it; none at a crease.
    pub(crate) ribbon: Option<Vec<DVec3>>,
}

/// Control net of a patch: u fastest.
#[derive(Debug, Clone)]
pub(crate) struct Net {
    pub(crate) basis_u: Basis,
    pub(crate) basis_v: Basis,
    pub(crate) control: Vec<DVec3>,
}

impl Net {
    /// The largest distance of a sample from the point with its parameters, mm.
    pub(crate) fn farthest(&self, samples: &PatchSamples) -> f64 {
        self.each_distance(samples).fold(0.0, f64::max)
    }

    /// True where no sample is farther than this from the point with its parameters, mm.
    pub(crate) fn is_within(&self, distance: f64, samples: &PatchSamples) -> bool {
        !self.each_distance(samples).any(|off| off > distance)
    }

    /// The distance of each sample from the point with its parameters, mm.
    pub(crate) fn distances(&self, samples: &PatchSamples) -> Vec<f64> {
        self.each_distance(samples).collect()
    }

    fn each_distance(&self, samples: &PatchSamples) -> impl Iterator<Item = f64> {
        samples.samples.iter().map(|s| self.position(s.u, s.v).distance(s.point))
    }

    /// The point alone: the same bits as [`Self::evaluate`] gives, in half of the time.
    pub(crate) fn position(&self, u: f64, v: f64) -> DVec3 {
        let width = self.basis_u.len();
        let ([i, j], values, _) = hermite::local_pair([width / 2 - 1, self.basis_v.len() / 2 - 1], [u, v]);
        let mut position = DVec3::ZERO;
        for l in 0..4 {
            let row = &self.control[(j + l) * width + i..][..4];
            let mut along = DVec3::ZERO;
            (0..4).for_each(|k| along += values[k].x * row[k]);
            position += values[l].y * along;
        }
        position
    }

    pub(crate) fn evaluate(&self, u: f64, v: f64) -> SurfacePoint {
        let width = self.basis_u.len();
        self.combine(hermite::local_pair([width / 2 - 1, self.basis_v.len() / 2 - 1], [u, v]))
    }

    /// The point where the functions have the given indices, values and slopes.
    #[inline]
    pub(crate) fn combine(
        &self,
        ([i, j], values, slopes): ([usize; 2], [DVec2; 4], [DVec2; 4]),
    ) -> SurfacePoint {
        let width = self.basis_u.len();
        // Coordinate by coordinate, what has the factors of the value and of the slope in u side by side.
        let (mut both, mut dv) = ([DVec2::ZERO; 3], [0.0; 3]);
        for l in 0..4 {
            let row = &self.control[(j + l) * width + i..][..4];
            let mut along = [DVec2::ZERO; 3];
            for k in 0..4 {
                let factors = DVec2::new(values[k].x, slopes[k].x);
                let point = row[k].to_array();
                (0..3).for_each(|c| along[c] += factors * point[c]);
            }
            for c in 0..3 {
                both[c] += values[l].y * along[c];
                dv[c] += slopes[l].y * along[c].x;
            }
        }
        let [x, y, z] = both;
        SurfacePoint {
            position: DVec3::new(x.x, y.x, z.x),
            du: DVec3::new(x.y, y.y, z.y),
            dv: DVec3::from_array(dv),
        }
    }
}

/// Indices of the control points along side `k`, and of the row beside it, in the direction of the patch.
pub(crate) fn side_rows(k: usize, nu: usize, nv: usize) -> Vec<(usize, usize)> {
    match k {
        0 => (0..nu).map(|i| (i, nu + i)).collect(),
        1 => (0..nv).map(|j| (j * nu + nu - 1, j * nu + nu - 2)).collect(),
        2 => (0..nu).rev().map(|i| ((nv - 1) * nu + i, (nv - 2) * nu + i)).collect(),
        _ => (0..nv).rev().map(|j| (j * nu, j * nu + 1)).collect(),
    }
}

fn on_side(at: usize, nu: usize, nv: usize) -> bool {
    let (i, j) = (at % nu, at / nu);
    i == 0 || j == 0 || i == nu - 1 || j == nv - 1
}

/// Fits the inside. `None` when the equations are singular.
pub(crate) fn fit_patch(
    samples: &PatchSamples,
    borders: &[Border; 4],
    products: [&Products; 2],
    stiffness: &Stiffness,
) -> Option<Net> {
    let (ku, kv) = (borders[0].spans, borders[1].spans);
    let (basis_u, basis_v) = (hermite::basis(ku), hermite::basis(kv));
    let (nu, nv) = (basis_u.len(), basis_v.len());
    let mut control = vec![DVec3::ZERO; nu * nv];
    let mut given = vec![false; nu * nv];
    for (k, border) in borders.iter().enumerate() {
        let own = Breaks::uniform(border.control.len() / 2 - 1);
        let row = own.refine(&border.control, &Breaks::uniform(if k % 2 == 0 { ku } else { kv }));
        for ((at, _), point) in side_rows(k, nu, nv).into_iter().zip(row) {
            control[at] = point;
            given[at] = true;
        }
    }
    for (k, border) in borders.iter().enumerate() {
        let Some(ribbon) = &border.ribbon else { continue };
        for (&(on, beside), step) in side_rows(k, nu, nv).iter().zip(ribbon) {
            // The first and the last lie on the sides before and after, which are given.
            if !on_side(beside, nu, nv) {
                control[beside] = control[on] + *step;
                given[beside] = true;
            }
        }
    }

    // Unknowns by the shorter direction first: a narrower band.
    let mut slots: Vec<Option<usize>> = vec![None; nu * nv];
    let mut count = 0;
    let by_rows = nu <= nv;
    let (outer, inner) = if by_rows { (nv, nu) } else { (nu, nv) };
    for a in 0..outer {
        for b in 0..inner {
            let at = if by_rows { a * nu + b } else { b * nu + a };
            if !given[at] {
                slots[at] = Some(count);
                count += 1;
            }
        }
    }
    let band = 3 * inner + 3;
    let mut matrix = Banded::zero(count, band);
    let mut right = vec![DVec3::ZERO; count];

    add_distances(&samples.samples, [ku, kv], &control, &slots, &mut matrix, &mut right);
    add_bending(stiffness, products, &control, &slots, &mut matrix, &mut right);
    matrix.solve(&mut right)?;
    for (at, slot) in slots.iter().enumerate() {
        if let Some(slot) = slot {
            control[at] = right[*slot];
        }
    }
    Some(Net { basis_u, basis_v, control })
}
