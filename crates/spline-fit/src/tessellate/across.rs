//! Where triangles of a surface pass through each other.
//!
//! A patch that is turned over nowhere does not pass through itself, nor do two of them that meet along an edge, unless they are folded
//! back on each other. So triangles that pass through each other are looked for around those that stand across the rest of their face: a
//! few boxes instead of the whole surface. Not found are crossings of parts of the surface that have nothing else to do with each other.

use rayon::prelude::*;
use std::ops::Range;
use topipe_mesh::spatial::{Box3, BoxIndex, Crossing, crossings, extent};
use topipe_mesh::{DVec3, FaceId, TriangleMesh};

/// A triangle stands across its face where the cosine of the angle between its normal and the face's mean normal is less than this.
/// With 0, 0.25 and 0.5 the same pairs were found on the bracket, with chords of 5e-4, 1e-4 and 5e-5 of the diagonal; with 0, seven pairs
/// of cantilever-four of 57 were not.
const ACROSS: f64 = 0.1;

/// By how much of its size the box around such a triangle is widened on all sides. With triangles of 1e-4 of the diagonal and pairs of 2e-5
/// looked for in their boxes, 210, 257, 13, 190, 113 and 57 pairs are found on bracket, bell-crank, monster-lite, beam-two-holes, support
/// and cantilever-four, with 1, too; with 0.25 six of beam-two-holes are not.
const WIDENED: f64 = 0.5;

/// Boxes around triangles of the first `patches` faces that stand across the rest of their face, wide enough for what these may pass
/// through.
pub(crate) fn across(mesh: &TriangleMesh, face_of_triangle: &[u32], patches: usize) -> Vec<Box3> {
    let triangles = || {
        let triangles = mesh.faces().zip(face_of_triangle).map(|(f, &face)| (f, face as usize));
        triangles.take_while(|&(_, face)| face < patches)
    };
    let mut normals = vec![DVec3::ZERO; patches];
    triangles().for_each(|(f, face)| normals[face] += mesh.area_vector(f));
    normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    let is_across = |&(f, face): &(FaceId, usize)| {
        let area = mesh.area_vector(f);
        area.dot(normals[face]) < ACROSS * area.length()
    };
    let widened = |(f, _): (FaceId, usize)| {
        let [low, high] = extent(mesh.corners(f).into_iter());
        let by = DVec3::splat(WIDENED * (high - low).max_element());
        [low - by, high + by]
    };
    triangles().filter(is_across).map(widened).collect()
}

/// The pairs of triangles that pass through each other and reach into one of certain boxes.
pub(crate) fn crossings_in(mesh: &TriangleMesh, face_of_triangle: &[u32], boxes: &BoxIndex) -> Vec<Crossing> {
    if boxes.is_empty() {
        return Vec::new();
    }
    let around = |f: FaceId| extent(mesh.corners(f).into_iter());
    // Triangles of a face follow one another. Most are far from all boxes, and so is their face from most.
    let mut first = 0;
    let faces = face_of_triangle.chunk_by(|a, b| a == b).map(|face| {
        let range = first..first + face.len();
        first = range.end;
        range
    });
    let faces: Vec<Range<usize>> = faces.collect();
    let reaching = faces.into_par_iter().flat_map_iter(|face| {
        let corners = face.clone().flat_map(|f| mesh.corners(FaceId::new(f)));
        let whole = extent(corners);
        let is_near = boxes.meets(&whole);
        let reaches = move |f: &FaceId| is_near && boxes.meets(&around(*f));
        face.map(FaceId::new).filter(reaches)
    });
    let reaching: Vec<FaceId> = reaching.collect();
    let triangles = reaching.iter().map(|f| mesh.triangles[f.index()]).collect();
    let part = TriangleMesh { positions: mesh.positions.clone(), triangles };
    let whole =
        |crossing: Crossing| Crossing { faces: crossing.faces.map(|f| reaching[f.index()]), ..crossing };
    crossings(&part).into_iter().map(whole).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Basis, CurveShape, EdgeCurve, Patch, PatchSide, SplineSurface};

    /// A ribbon along a curve in the plane, over a turn of `t` from 0 to 1.
    fn ribbon(curve: impl Fn(f64) -> [f64; 2]) -> SplineSurface {
        let (basis_u, basis_v) = (Basis::uniform(3, 61).unwrap(), Basis::uniform(1, 1).unwrap());
        let at = |i: usize| {
            let t = i as f64 / (basis_u.len() - 1) as f64;
            let [x, y] = curve(t);
            DVec3::new(x, y, 0.3 * t)
        };
        let low: Vec<DVec3> = (0..basis_u.len()).map(at).collect();
        let high: Vec<DVec3> = low.iter().map(|&p| p + DVec3::Z).collect();
        let vertices = vec![low[0], low[low.len() - 1], high[high.len() - 1], high[0]];
        let edge = |ends: [u32; 2], basis: &Basis, control: Vec<DVec3>| EdgeCurve {
            ends,
            basis: basis.clone(),
            control,
            feature: None,
            shape: CurveShape::Spline,
        };
        let edges = vec![
            edge([0, 1], &basis_u, low.clone()),
            edge([1, 2], &basis_v, vec![vertices[1], vertices[2]]),
            edge([3, 2], &basis_u, high.clone()),
            edge([0, 3], &basis_v, vec![vertices[0], vertices[3]]),
        ];
        let sides = [0, 1, 2, 3].map(|edge| PatchSide { edge, reversed: edge > 1 });
        let patch = Patch { sides, basis_u, basis_v, control: [low, high].concat() };
        SplineSurface {
            vertices,
            edges,
            patches: vec![patch],
            faces: Vec::new(),
            tolerance: None,
            tolerance_mm: None,
        }
    }

    /// A turn and a half around the origin, as far from it as `radius` says of the angle.
    fn around(radius: impl Fn(f64) -> f64) -> impl Fn(f64) -> [f64; 2] {
        move |t| {
            let angle = 9.7 * t;
            [radius(angle) * angle.cos(), radius(angle) * angle.sin()]
        }
    }

    /// One that passes through itself near its ends, where it stands across the rest.
    fn crossed_ribbon() -> SplineSurface {
        ribbon(around(|angle| 1.0 - 0.1 * (0.5 * angle - 0.05).sin()))
    }

    #[test]
    fn triangles_come_apart_where_the_surface_does_not_cross_and_stay_coarse_where_it_does() {
        let spiral = ribbon(around(|angle| 1.0 + 0.003 * angle));
        let coarse = spiral.triangulate(0.2).0;
        assert!(!crossings(&coarse).is_empty());
        let finer = spiral.tessellate(0.2);
        assert!(crossings(&finer).is_empty() && finer.face_count() > coarse.face_count());
        let loops = crossed_ribbon();
        assert!(!crossings(&loops.tessellate(0.01)).is_empty());
        assert_eq!(loops.tessellate(0.01).face_count(), loops.triangulate(0.01).0.face_count());
    }

    #[test]
    fn pairs_have_the_numbers_of_the_whole_mesh() {
        let (mesh, face_of_triangle) = crossed_ribbon().triangulate(0.01);
        let boxes = BoxIndex::build(&across(&mesh, &face_of_triangle, 1));
        assert!(!crossings(&mesh).is_empty());
        assert_eq!(crossings_in(&mesh, &face_of_triangle, &boxes), crossings(&mesh));
        assert_eq!(crossings_in(&mesh, &face_of_triangle, &BoxIndex::build(&[])), []);
        assert!(across(&mesh, &face_of_triangle, 0).is_empty());
    }
}
