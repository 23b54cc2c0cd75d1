//! Curvature of the patches beside that of the mesh they were fitted to: a fit that oscillates between the vertices is as near to them
//! as one that does not, but it is bent more.
//!
//! Mean curvature, by absolute value and weighted by area. Of the patches from their first and second derivatives, at the middles of the
//! polynomial pieces; of the mesh by the cotangent formula at its vertices ([`topipe_mesh::TriangleMesh::mean_curvature`]), where no face of known
//! shape and no feature edge is. On fine meshes of smooth surfaces both are the same; where the mesh has facets, its own is larger, as
//! the bends of a facet are all at its edges.

use crate::CurvatureFigures;
use rayon::prelude::*;
use topipe_mesh::{DVec3, Part};
use topipe_spline_fit::basis::Local;
use topipe_spline_fit::{Basis, Patch, SplineSurface};

/// The figures; `None` where there are no patches, or no vertex of the mesh is free.
pub(super) fn figures(surface: &SplineSurface, reference: &Part) -> Option<CurvatureFigures> {
    let (patches, mesh) = rayon::join(|| of_patches(surface), || of_mesh(reference));
    let (patches, mesh) = (Distribution::of(patches)?, Distribution::of(mesh)?);
    Some(CurvatureFigures {
        rms_per_mm: patches.rms,
        p95_per_mm: patches.p95,
        p99_per_mm: patches.p99,
        mesh_rms_per_mm: mesh.rms,
        mesh_p95_per_mm: mesh.p95,
        mesh_p99_per_mm: mesh.p99,
    })
}

/// Absolute mean curvatures and the area of each, of all patches.
fn of_patches(surface: &SplineSurface) -> Vec<(f64, f64)> {
    surface.patches.par_iter().flat_map_iter(of_patch).collect()
}

fn of_patch(patch: &Patch) -> impl Iterator<Item = (f64, f64)> {
    let middles = |basis: &Basis| -> Vec<(Local, f64)> {
        let breaks = basis.breaks();
        breaks.windows(2).map(|span| (basis.evaluate((span[0] + span[1]) / 2.0), span[1] - span[0])).collect()
    };
    let (us, vs) = (middles(&patch.basis_u), middles(&patch.basis_v));
    vs.into_iter().flat_map(move |(v, height)| {
        us.iter()
            .filter_map(|(u, width)| bend(patch, u, &v).map(|(h, area)| (h, area * width * height)))
            .collect::<Vec<_>>()
    })
}

/// The absolute mean curvature at a point of a patch, and the factor from parameters to area there; `None` where it has no normal.
fn bend(patch: &Patch, u: &Local, v: &Local) -> Option<(f64, f64)> {
    // S_u, S_v, S_uu, S_uv, S_vv: derivatives by u in each row of control points, then by v across.
    let mut s = [DVec3::ZERO; 5];
    let width = patch.basis_u.len();
    for j in 0..v.count {
        let row = &patch.control[(v.first + j) * width + u.first..];
        let mut along = [DVec3::ZERO; 3];
        for (i, control) in row[..u.count].iter().enumerate() {
            (0..3).for_each(|k| along[k] += u.derivatives[k][i] * *control);
        }
        let across = [0, 1, 2].map(|k| v.derivatives[k][j]);
        s[0] += across[0] * along[1];
        s[1] += across[1] * along[0];
        s[2] += across[0] * along[2];
        s[3] += across[1] * along[1];
        s[4] += across[2] * along[0];
    }
    let [su, sv, suu, suv, svv] = s;
    let cross = su.cross(sv);
    let area = cross.length();
    // do Carmo, Differential Geometry of Curves and Surfaces, 3-3: (e G - 2 f F + g E) / (2 (E G - F^2)).
    let (e, f, g) = (suu.dot(cross) / area, suv.dot(cross) / area, svv.dot(cross) / area);
    let h = (e * sv.length_squared() - 2.0 * f * su.dot(sv) + g * su.length_squared()) / (2.0 * area * area);
    h.is_finite().then_some((h.abs(), area))
}

/// Absolute mean curvatures of the mesh, and the area of each, where nothing but free surface is around.
fn of_mesh(part: &Part) -> Vec<(f64, f64)> {
    let mesh = &part.mesh;
    let mut free = vec![true; mesh.vertex_count()];
    let mut area = vec![0.0; mesh.vertex_count()];
    for f in mesh.faces() {
        let third = mesh.area_vector(f).length() / 6.0;
        for v in mesh.triangles[f.index()] {
            free[v.index()] &= !part.region_of_face[f.index()].is_some();
            area[v.index()] += third;
        }
    }
    for v in part.feature_edges.iter().flat_map(|edge| edge.vertices) {
        free[v.index()] = false;
    }
    let curvature = mesh.mean_curvature();
    (0..free.len()).filter(|&v| free[v] && area[v] > 0.0).map(|v| (curvature[v].abs(), area[v])).collect()
}

/// Of values weighted by area.
struct Distribution {
    rms: f64,
    p95: f64,
    p99: f64,
}

impl Distribution {
    fn of(mut samples: Vec<(f64, f64)>) -> Option<Self> {
        samples.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let whole: f64 = samples.iter().map(|s| s.1).sum();
        if !(whole > 0.0 && whole.is_finite()) {
            return None;
        }
        let squares: f64 = samples.iter().map(|(h, area)| h * h * area).sum();
        let quantile = |share: f64| {
            let mut below = 0.0;
            let at = samples.iter().find(|(_, area)| {
                below += area;
                below >= share * whole
            });
            at.or(samples.last()).map_or(0.0, |s| s.0)
        };
        Some(Self { rms: (squares / whole).sqrt(), p95: quantile(0.95), p99: quantile(0.99) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_spline_fit::PatchSide;

    /// A patch over the square from 0 to `side`, of degree 4: `height(x, y)` at its control points, which for a paraboloid given by its
    /// polar form is the surface itself.
    fn paraboloid(side: f64, radii: [f64; 2]) -> Patch {
        let basis = Basis::clamped(4, &[]).unwrap();
        // The polar form of x^2 of degree 4 at the argument bag of control point k: k ones among four.
        let square = |k: f64| k * (k - 1.0) / 12.0 * side * side;
        let control = (0..25).map(|k| {
            let (i, j) = (f64::from(k % 5), f64::from(k / 5));
            let z = square(i) / (2.0 * radii[0]) + square(j) / (2.0 * radii[1]);
            DVec3::new(i / 4.0 * side, j / 4.0 * side, z)
        });
        let sides = [PatchSide { edge: 0, reversed: false }; 4];
        Patch { sides, basis_u: basis.clone(), basis_v: basis, control: control.collect() }
    }

    #[test]
    fn a_paraboloid_has_its_curvature() {
        // At the apex the mean of 1/r1 and 1/r2, of either sign; a saddle of equal radii has none.
        for (radii, mean) in [([2.0, 8.0], 0.3125), ([-2.0, -8.0], 0.3125), ([5.0, -5.0], 0.0)] {
            let patch = paraboloid(1.0, radii);
            let (h, area) = bend(&patch, &patch.basis_u.evaluate(0.0), &patch.basis_v.evaluate(0.0)).unwrap();
            assert!((h - mean).abs() < 1e-12 && (area - 1.0).abs() < 1e-12, "{h} {area}");
        }
        // And with the unit: a tenth of the size, ten times the curvature.
        let patch = paraboloid(0.1, [0.2, 0.8]);
        let (h, _) = bend(&patch, &patch.basis_u.evaluate(0.0), &patch.basis_v.evaluate(0.0)).unwrap();
        assert!((h - 3.125).abs() < 1e-11);
    }

    #[test]
    fn a_patch_without_area_counts_for_nothing() {
        let mut patch = paraboloid(1.0, [2.0, 2.0]);
        patch.control.fill(DVec3::ONE);
        assert_eq!(of_patch(&patch).count(), 0);
        assert!(Distribution::of(Vec::new()).is_none());
    }

    #[test]
    fn quantiles_are_of_the_area() {
        let samples = vec![(5.0, 1.0), (1.0, 94.5), (2.0, 4.5)];
        let found = Distribution::of(samples).unwrap();
        assert_eq!((found.p95, found.p99), (2.0, 2.0));
        assert!((found.rms - ((94.5 + 18.0 + 25.0f64) / 100.0).sqrt()).abs() < 1e-12);
    }
}
