//! How far points are from the middle of their sections (the thesis on skeletonization of beam-like topology
//! optimization results, eq. 2.2 and section 4.4).
//!
//! From each point of a branch 36 rays leave in the plane across the branch. The measure of the point is the largest
//! difference of two opposite rays; E_center is its mean over the radius of the smallest sphere around the model.
//! Inside, the nearest hit counts, clipped to a cube of twice the largest interface radius. For a point outside the
//! far hit counts and a ray that misses is 0: in a unit circle, a point at 0.5 from the middle measures 1, one on the
//! circle 2, one at 2 measures 3.
//!
//! **The first ray and the cube belong to the part.** The thesis sends the first ray through any corner of the contour and
//! takes a cube along the global axes. Rays ten degrees apart see a facet or not depending on where the first one goes, so
//! with an axis of the world as reference E_center of fixed points changes by 8 % when the space frame is turned. Here
//! the first ray goes along a principal axis of the area inside the nearest contour, of its second moments about the
//! *skeletal point*: for a point off the middle of a circle that is the direction of the middle, so the examples above are
//! exact wherever the corners of the circle are. (The nearest or farthest corner would also turn with the part, but a single
//! vertex decides it.) The cube has edges along the branch and the first ray. E_center so depends on nothing but the
//! shape: turning, moving, scaling and renumbering change it by rounding only.

use super::section::{RAYS, Section, turn};
use rayon::prelude::*;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{DVec3, TriangleMesh};

/// A point on a branch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BranchPoint {
    /// Where it is.
    pub position: DVec3,
    /// Unit direction of the branch.
    pub tangent: DVec3,
    /// Length of branch it stands for.
    pub length: f64,
}

/// The largest difference of opposite rays at each point, in the unit of the mesh. `clip` is half the edge of the
/// cube to which sections are clipped. `index` is that of `mesh`.
pub fn off_center(
    mesh: &TriangleMesh,
    index: &SurfaceIndex,
    points: &[BranchPoint],
    clip: Option<f64>,
) -> Vec<f64> {
    let measure = |point: &BranchPoint| {
        let section = Section::cut(mesh, point.position, point.tangent);
        let inside = index.contains(point.position);
        let hits = section.rays();
        let reach: [f64; RAYS] = std::array::from_fn(|k| match hits[k] {
            Some(hits) if !inside => hits.farthest,
            None if !inside => 0.0,
            hits => {
                let (sin, cos) = turn(k).sin_cos();
                let limit = clip.map_or(f64::INFINITY, |half| half / sin.abs().max(cos.abs()));
                // Only an open surface lets a ray escape from inside.
                let nearest = hits.map_or(if clip.is_some() { limit } else { 0.0 }, |h| h.nearest);
                nearest.min(limit)
            }
        });
        (0..RAYS / 2).map(|k| (reach[k] - reach[k + RAYS / 2]).abs()).fold(0.0, f64::max)
    };
    points.par_iter().map(measure).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cylinder() -> TriangleMesh {
        prism(3600)
    }

    /// A closed prism along z over a regular polygon of `n` corners on the unit circle.
    fn prism(n: u32) -> TriangleMesh {
        let ring = |z: f64| {
            (0..n).map(move |k| {
                let (s, c) = (f64::from(k) / f64::from(n) * std::f64::consts::TAU).sin_cos();
                [c, s, z]
            })
        };
        let positions = ring(-2.0).chain(ring(2.0)).chain([[0.0, 0.0, -2.0], [0.0, 0.0, 2.0]]).collect();
        let mut triangles = Vec::new();
        for k in 0..n {
            let next = (k + 1) % n;
            triangles.push([k, next, n + next]);
            triangles.push([k, n + next, n + k]);
            triangles.push([2 * n, next, k]);
            triangles.push([2 * n + 1, n + k, n + next]);
        }
        TriangleMesh::from_arrays(positions, triangles)
    }

    fn at(x: f64, y: f64) -> BranchPoint {
        BranchPoint { position: DVec3::new(x, y, 0.1), tangent: DVec3::Z, length: 1.0 }
    }

    #[test]
    fn the_unit_circle_of_the_definition() {
        let mesh = cylinder();
        let index = SurfaceIndex::build(&mesh);
        let points = [at(0.0, 0.0), at(0.5, 0.0), at(1.0 - 1e-7, 0.0), at(2.0, 0.0), at(0.0, -0.5)];
        let measured = off_center(&mesh, &index, &points, None);
        for (value, expected) in measured.iter().zip([0.0, 1.0, 2.0, 3.0, 1.0]) {
            assert!((value - expected).abs() < 1e-5, "{value} for {expected}");
        }
        // Whichever way the point is off the middle.
        for degrees in [3.0f64, 47.3, 95.01, 261.8] {
            let (s, c) = degrees.to_radians().sin_cos();
            let points = [0.5, 1.0 - 1e-7, 2.0].map(|off| at(off * c, off * s));
            for (value, expected) in off_center(&mesh, &index, &points, None).iter().zip([1.0, 2.0, 3.0]) {
                assert!((value - expected).abs() < 1e-5, "{value} for {expected} at {degrees} degrees");
            }
        }
    }

    /// In the middle of a triangle all axes are principal; a ray goes through a corner, at 1 with 1/2 opposite.
    #[test]
    fn regular_sections_measure_the_same_however_they_lie() {
        let mesh = prism(3);
        for k in 0..50 {
            let axis = DVec3::new(f64::from(k).sin(), f64::from(3 * k).cos(), 0.3).normalize();
            let (s, c) = (0.37 * f64::from(k)).sin_cos();
            let turn = |p: DVec3| c * p + s * axis.cross(p) + (1.0 - c) * axis.dot(p) * axis;
            let mut turned = mesh.clone();
            turned.positions.iter_mut().for_each(|p| *p = turn(*p));
            let middle = BranchPoint { position: DVec3::ZERO, tangent: turn(DVec3::Z), length: 1.0 };
            let value = off_center(&turned, &SurfaceIndex::build(&turned), &[middle], None)[0];
            assert!((value - 0.5).abs() < 1e-9, "{value} after turn {k}");
        }
    }

    #[test]
    fn the_cube_clips_inside_only() {
        let mesh = cylinder();
        let index = SurfaceIndex::build(&mesh);
        let clipped = off_center(&mesh, &index, &[at(0.5, 0.0), at(2.0, 0.0)], Some(0.75));
        // The distance to the circle from (0.5, 0), cut at a square of half width 0.75. Outside nothing is cut.
        let reach = |degrees: f64| {
            let (s, c) = degrees.to_radians().sin_cos();
            let limit = 0.75 / s.abs().max(c.abs());
            (-0.5 * c + (1.0 - 0.25 * s * s).sqrt()).min(limit)
        };
        let opposite = |k| (reach(10.0 * f64::from(k)) - reach(10.0 * f64::from(k) + 180.0)).abs();
        let expected = (0..18).map(opposite).fold(0.0, f64::max);
        assert!(expected < 0.9 && (clipped[0] - expected).abs() < 1e-5, "{} for {expected}", clipped[0]);
        assert!((clipped[1] - 3.0).abs() < 1e-5);
    }

    #[test]
    fn a_centre_of_symmetry_is_in_the_middle_whatever_the_section() {
        let mesh = cylinder();
        let index = SurfaceIndex::build(&mesh);
        let tangent = DVec3::new(0.3, -0.2, 0.9).normalize();
        let middle = BranchPoint { position: DVec3::ZERO, tangent, length: 1.0 };
        assert!(off_center(&mesh, &index, &[middle], None)[0] < 1e-5);
    }
}
