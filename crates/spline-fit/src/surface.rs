//! The spline surface: vertices, edge curves and tensor-product patches that share them.

use crate::basis::{Basis, Local};
use serde::{Deserialize, Serialize};
use topipe_mesh::{DVec3, FeatureKind, RegionShape};

/// A side of a patch: an edge curve and the direction in which the patch runs along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PatchSide {
    /// Index into [`SplineSurface::edges`].
    pub edge: u32,
    /// True when the patch runs from the curve's end to its start.
    pub reversed: bool,
}

/// What a curve is beside a B-spline.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub enum CurveShape {
    /// Nothing else.
    #[default]
    Spline,
    /// The straight line between its ends.
    Line,
    /// An arc of a circle from the first end to the last, counter-clockwise about the axis; a whole circle where both
    /// are the same vertex.
    Arc {
        /// Centre of the circle, mm.
        center: DVec3,
        /// Unit normal of its plane.
        axis: DVec3,
        /// Radius, mm.
        radius: f64,
    },
}

/// A B-spline curve between two vertices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EdgeCurve {
    /// Start and end, as indices into [`SplineSurface::vertices`].
    pub ends: [u32; 2],
    /// Degree and knots.
    pub basis: Basis,
    /// Control points; the first and last are the positions of the end vertices, bit for bit.
    pub control: Vec<DVec3>,
    /// Set when the curve follows a feature of the mesh.
    pub feature: Option<FeatureKind>,
    /// The exact shape where it is a simple one; the B-spline then agrees with it to within 1e-7 mm or 1e-9 of its
    /// length, whichever is more.
    pub shape: CurveShape,
}

/// A face of known shape, trimmed by edge curves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AnalyticFace {
    /// Plane or cylinder, with the outward normal or the side on which the material lies.
    pub shape: RegionShape,
    /// Its borders; the face lies on their left seen from outside.
    pub loops: Vec<Vec<PatchSide>>,
}

/// A tensor-product B-spline patch over [0, 1]^2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Patch {
    /// Its four sides, counter-clockwise from outside: v = 0 (u rising), u = 1 (v rising), v = 1 (u falling),
    /// u = 0 (v falling).
    pub sides: [PatchSide; 4],
    /// Degree and knots in u.
    pub basis_u: Basis,
    /// Degree and knots in v.
    pub basis_v: Basis,
    /// Control points, u fastest: point (i, j) at `i + j * basis_u.len()`. Each border row is the edge curve there:
    /// the same control points bit for bit where the knots are the same, else the curve with knots inserted.
    pub control: Vec<DVec3>,
}

/// A closed surface of patches and analytic faces. Each edge curve is shared by exactly two of them that run along it
/// in opposite directions, and S_u x S_v points out of the material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SplineSurface {
    /// Corner points, mm.
    pub vertices: Vec<DVec3>,
    /// Edge curves.
    pub edges: Vec<EdgeCurve>,
    /// Patches.
    pub patches: Vec<Patch>,
    /// Faces that are exactly plane or cylindrical.
    pub faces: Vec<AnalyticFace>,
    /// The largest distance from the mesh that the fit was asked for, over the diagonal of the part; none where it was asked for none.
    /// Whether it holds is measured by the validation.
    pub tolerance: Option<f64>,
    /// The same in mm; the narrower of both counts.
    pub tolerance_mm: Option<f64>,
}

/// Position and first derivatives of a patch at a parameter.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    /// S, mm.
    pub position: DVec3,
    /// S_u.
    pub du: DVec3,
    /// S_v.
    pub dv: DVec3,
}

impl SurfacePoint {
    /// The unit normal, or zero where the patch is singular.
    pub fn normal(&self) -> DVec3 {
        self.du.cross(self.dv).normalize_or_zero()
    }
}

impl Patch {
    /// Position and first derivatives at `(u, v)`.
    pub fn evaluate(&self, u: f64, v: f64) -> SurfacePoint {
        evaluate(&self.basis_u, &self.basis_v, &self.control, u, v)
    }

    /// The same where the functions of [`Self::basis_u`] and [`Self::basis_v`] are known: on a grid those of each row and
    /// column are needed once.
    pub fn evaluate_at(&self, u: &Local, v: &Local) -> SurfacePoint {
        evaluate_at(u, v, &self.control, self.basis_u.len())
    }

    /// What all points with the same first parameter share. On a grid it is needed once for each column, and
    /// [`Column::evaluate`] then takes a third of the time of [`Self::evaluate_at`], with the same bits.
    pub fn column(&self, u: &Local) -> Column {
        let width = self.basis_u.len();
        let row = |row: &[DVec3]| weighted(u, &row[u.first..]);
        Column { rows: self.control.chunks_exact(width).map(row).collect() }
    }

    /// The parameters of the point at fraction `t` of side `side`, in the direction of the patch.
    pub fn side_parameters(side: usize, t: f64) -> (f64, f64) {
        match side {
            0 => (t, 0.0),
            1 => (1.0, t),
            2 => (1.0 - t, 1.0),
            _ => (0.0, 1.0 - t),
        }
    }
}

/// Position and first derivatives of a tensor-product spline, control points with u fastest.
pub(crate) fn evaluate(basis_u: &Basis, basis_v: &Basis, control: &[DVec3], u: f64, v: f64) -> SurfacePoint {
    evaluate_at(&basis_u.evaluate(u), &basis_v.evaluate(v), control, basis_u.len())
}

fn evaluate_at(bu: &Local, bv: &Local, control: &[DVec3], width: usize) -> SurfacePoint {
    across(bv, |j| weighted(bu, &control[(bv.first + j) * width + bu.first..]))
}

/// Value and slope along a row of control points that begins with the first one that counts.
#[inline]
fn weighted(basis: &Local, control: &[DVec3]) -> (DVec3, DVec3) {
    let (mut value, mut slope) = (DVec3::ZERO, DVec3::ZERO);
    for i in 0..basis.count {
        let c = control[i];
        value += basis.derivatives[0][i] * c;
        slope += basis.derivatives[1][i] * c;
    }
    (value, slope)
}

/// The point of a surface from value and slope of each row that counts.
#[inline]
fn across(bv: &Local, row: impl Fn(usize) -> (DVec3, DVec3)) -> SurfacePoint {
    let (mut position, mut du, mut dv) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for j in 0..bv.count {
        let (value, slope) = row(j);
        position += bv.derivatives[0][j] * value;
        du += bv.derivatives[0][j] * slope;
        dv += bv.derivatives[1][j] * value;
    }
    SurfacePoint { position, du, dv }
}

/// A patch along one of its parameters, the other being given: value and slope of each row of control points.
#[derive(Debug, Clone)]
pub struct Column {
    rows: Vec<(DVec3, DVec3)>,
}

impl Column {
    /// Position and first derivatives at the second parameter, in the functions of [`Patch::basis_v`]: those of
    /// [`Patch::evaluate_at`], bit for bit.
    pub fn evaluate(&self, v: &Local) -> SurfacePoint {
        across(v, |j| self.rows[v.first + j])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_gives_the_same_bits() {
        let (basis_u, basis_v) = (Basis::double(3), Basis::clamped(3, &[0.1, 0.4, 0.45]).unwrap());
        let count = basis_u.len() * basis_v.len();
        let control = (0..count)
            .map(|k| DVec3::new((0.7 * k as f64).sin(), (0.31 * k as f64).cos(), (k as f64).sqrt()))
            .collect();
        let sides = [PatchSide { edge: 0, reversed: false }; 4];
        let patch = Patch { sides, basis_u, basis_v, control };
        for i in 0..=20 {
            let u = patch.basis_u.evaluate(f64::from(i) / 20.0);
            let column = patch.column(&u);
            for j in 0..=20 {
                let v = patch.basis_v.evaluate(f64::from(j) / 20.0);
                let (alone, of_column) = (patch.evaluate_at(&u, &v), column.evaluate(&v));
                let bits =
                    |s: &SurfacePoint| [s.position, s.du, s.dv].map(|x| x.to_array().map(f64::to_bits));
                assert_eq!(bits(&alone), bits(&of_column), "{i} {j}");
            }
        }
    }
}
