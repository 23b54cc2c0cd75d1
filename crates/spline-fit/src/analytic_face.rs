//! Area of a face of known shape, and the volume under it, by integrals along its border.

use crate::{AnalyticFace, EdgeCurve};
use topipe_mesh::{DVec3, RegionShape};

impl AnalyticFace {
    /// The sum over the border, face on its left, of `f(position, derivative)`.
    fn around(&self, edges: &[EdgeCurve], mut f: impl FnMut(DVec3, DVec3) -> f64) -> f64 {
        let mut sum = 0.0;
        for side in self.loops.iter().flatten() {
            let edge = &edges[side.edge as usize];
            let sign = if side.reversed { -1.0 } else { 1.0 };
            for (t, weight) in edge.quadrature() {
                let at = edge.exact(t);
                sum += sign * weight * f(at.position, at.derivative);
            }
        }
        sum
    }

    /// Area, mm^2: negative where the loops run the wrong way round.
    pub fn area(&self, edges: &[EdgeCurve]) -> f64 {
        match self.shape {
            RegionShape::Plane { point, normal } => {
                self.around(edges, |p, d| (p - point).cross(d).dot(normal)) / 2.0
            }
            RegionShape::Cylinder { hole, .. } => {
                let area = self.unrolled(edges, |_| 1.0);
                if hole { -area } else { area }
            }
        }
    }

    /// The integral over the face of (x - center) . n / 3, mm^3: its share of the volume inside a closed surface.
    pub fn volume(&self, edges: &[EdgeCurve], center: DVec3) -> f64 {
        match self.shape {
            RegionShape::Plane { point, normal } => (point - center).dot(normal) * self.area(edges) / 3.0,
            // Of a hole both the normal and the sense of the loops about the axis are reversed.
            RegionShape::Cylinder { point, radius, .. } => {
                self.unrolled(edges, |out| radius + (point - center).dot(out)) / 3.0
            }
        }
    }

    /// How often the loops go around the axis of a cylinder, counter-clockwise counting up; 0 for a plane.
    pub fn winding(&self, edges: &[EdgeCurve]) -> i64 {
        let RegionShape::Cylinder { point, axis, .. } = self.shape else { return 0 };
        let turns = self.around(edges, |p, d| {
            let from_axis = (p - point).reject_from_normalized(axis);
            axis.cross(from_axis).dot(d) / from_axis.length_squared()
        });
        (turns / std::f64::consts::TAU).round() as i64
    }

    /// The integral over a cylinder of a function of the direction from the axis, by Green's theorem on the unrolled
    /// face: - integral of z f d(angle), times the radius.
    fn unrolled(&self, edges: &[EdgeCurve], f: impl Fn(DVec3) -> f64) -> f64 {
        let RegionShape::Cylinder { point, axis, radius, .. } = self.shape else { return 0.0 };
        -radius
            * self.around(edges, |p, d| {
                let from_axis = (p - point).reject_from_normalized(axis);
                let out = from_axis.normalize_or_zero();
                let turn = axis.cross(out).dot(d) / from_axis.length();
                (p - point).dot(axis) * f(out) * turn
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CurveShape, PatchSide, SplineSurface};
    use std::f64::consts::PI;

    /// A ring of revolution: outer wall, inner wall, two plane rings; all rims are two half circles.
    fn tube(axis: DVec3, center: DVec3, outer: f64, inner: f64, height: f64) -> SplineSurface {
        let (u, _) = axis.any_orthonormal_pair();
        let mut surface = SplineSurface {
            vertices: vec![],
            edges: vec![],
            patches: vec![],
            faces: vec![],
            tolerance: None,
            tolerance_mm: None,
        };
        let mut rim = |radius: f64, z: f64| -> [u32; 2] {
            let first = surface.vertices.len() as u32;
            let c = center + axis * z;
            let p = [c + u * radius, c - u * radius];
            surface.vertices.extend(p);
            let mut ids = [0; 2];
            for k in 0..2u32 {
                ids[k as usize] = surface.edges.len() as u32;
                let ends = [first + k, first + 1 - k];
                let at = [p[k as usize], p[1 - k as usize]];
                surface.edges.push(EdgeCurve::arc(c, axis, radius, ends, at, 1e-9));
            }
            ids
        };
        let (bottom_out, top_out) = (rim(outer, 0.0), rim(outer, height));
        let (bottom_in, top_in) = (rim(inner, 0.0), rim(inner, height));
        let with = |ids: [u32; 2]| ids.map(|edge| PatchSide { edge, reversed: false }).to_vec();
        let against =
            |ids: [u32; 2]| [ids[1], ids[0]].map(|edge| PatchSide { edge, reversed: true }).to_vec();
        let wall = |radius, hole| RegionShape::Cylinder { point: center, axis, radius, hole };
        let plane = |z: f64, normal| RegionShape::Plane { point: center + axis * z, normal };
        surface.faces = vec![
            AnalyticFace { shape: wall(outer, false), loops: vec![with(bottom_out), against(top_out)] },
            AnalyticFace { shape: wall(inner, true), loops: vec![against(bottom_in), with(top_in)] },
            AnalyticFace { shape: plane(0.0, -axis), loops: vec![against(bottom_out), with(bottom_in)] },
            AnalyticFace { shape: plane(height, axis), loops: vec![with(top_out), against(top_in)] },
        ];
        surface
    }

    #[test]
    fn volume_and_areas_of_a_tube() {
        let axis = DVec3::new(2.0, -1.0, 0.5).normalize();
        let center = DVec3::new(10.0, 20.0, -3.0);
        let (outer, inner, height) = (5.0, 3.0, 7.0);
        let surface = tube(axis, center, outer, inner, height);
        let volume = PI * (outer * outer - inner * inner) * height;
        for about in [DVec3::ZERO, center, DVec3::new(-4.0, 30.0, 9.0)] {
            let sum: f64 = surface.faces.iter().map(|f| f.volume(&surface.edges, about)).sum();
            assert!((sum / volume - 1.0).abs() < 1e-12, "{sum} {volume}");
        }
        let ring = PI * (outer * outer - inner * inner);
        let areas = [2.0 * PI * outer * height, 2.0 * PI * inner * height, ring, ring];
        for (face, area) in surface.faces.iter().zip(areas) {
            assert!((face.area(&surface.edges) / area - 1.0).abs() < 1e-12);
        }
        assert!((surface.volume() / volume - 1.0).abs() < 1e-12);
        let length: f64 = surface.edges.iter().map(EdgeCurve::length).sum();
        assert!((length / (4.0 * PI * (outer + inner)) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_tube_is_tessellated_watertight_and_within_its_tolerance() {
        let (axis, center) = (DVec3::new(0.3, 1.0, -2.0).normalize(), DVec3::new(1.0, 2.0, 3.0));
        let surface = tube(axis, center, 5.0, 3.0, 7.0);
        let exact = surface.volume();
        let mut before = f64::INFINITY;
        for tolerance in [2.0, 0.1, 1e-3] {
            let (mesh, face_of_triangle) = surface.tessellate_with(tolerance, f64::INFINITY);
            let connectivity = topipe_mesh::Connectivity::build(&mesh).unwrap();
            assert!(connectivity.is_closed());
            assert_eq!(connectivity.genus(&mesh), Some(1));
            // Every edge of every triangle near its face: at the middle, where chords are farthest off.
            for (triangle, &face) in mesh.triangles.iter().zip(&face_of_triangle) {
                for k in 0..3 {
                    let (a, b) = (mesh.position(triangle[k]), mesh.position(triangle[(k + 1) % 3]));
                    let off = surface.faces[face as usize].shape.distance((a + b) / 2.0).abs();
                    assert!(off <= tolerance * 1.001, "{off} for {tolerance}");
                }
            }
            let error = (mesh.volume() / exact - 1.0).abs();
            assert!(error < before / 4.0 && error < 0.3, "{error}");
            before = error;
        }
        let (mesh, _) = surface.tessellate_with(0.1, 1.0);
        assert!(topipe_mesh::Connectivity::build(&mesh).unwrap().is_closed());
        assert!(mesh.area() > 0.95 * surface.faces.iter().map(|f| f.area(&surface.edges)).sum::<f64>());
    }

    #[test]
    fn rims_become_whole_circles_with_aligned_vertices() {
        let axis = DVec3::new(0.3, 1.0, -2.0).normalize();
        let mut surface = tube(axis, DVec3::ONE, 5.0, 3.0, 7.0);
        let volume = surface.volume();
        // Other vertices on the upper rims than above the lower ones.
        crate::simplify::simplify(&mut surface, 1e-8);
        assert_eq!((surface.vertices.len(), surface.edges.len()), (4, 4));
        for edge in &surface.edges {
            assert_eq!(edge.ends[0], edge.ends[1]);
            assert_eq!(edge.sweep(), Some(2.0 * PI));
        }
        for face in &surface.faces {
            assert!(face.loops.iter().all(|l| l.len() == 1) && face.loops.len() == 2);
            if let RegionShape::Cylinder { .. } = face.shape {
                let [p, q] = [0, 1].map(|l| surface.edges[face.loops[l][0].edge as usize].control[0]);
                assert!((p - q).reject_from_normalized(axis).length() < 1e-12, "one ruling");
                assert_eq!(face.winding(&surface.edges).abs(), 0, "once to and once fro");
            }
        }
        assert!((surface.volume() / volume - 1.0).abs() < 1e-12);
        let mut file = Vec::new();
        crate::step::write(&surface, "tube", crate::step::Protocol::Ap242, &mut file).unwrap();
        let file = String::from_utf8(file).unwrap();
        let count = |what: &str| file.matches(what).count();
        assert_eq!(count("=CIRCLE("), 4);
        // Two seams, each run in both directions.
        assert_eq!((count("=LINE("), count("=EDGE_CURVE("), count("=ORIENTED_EDGE(")), (2, 6, 12));
        assert_eq!((count("=PLANE("), count("=CYLINDRICAL_SURFACE(")), (2, 2));
        assert_eq!((count("'hole 1, diameter 6 mm'"), count("'boss 1, diameter 10 mm'")), (1, 1));
        assert!(file.contains("AP242_MANAGED_MODEL_BASED_3D_ENGINEERING"));

        let mut file = Vec::new();
        crate::iges::write(&surface, "tube", &mut file).unwrap();
        let file = String::from_utf8(file).unwrap();
        let directory = file.lines().filter(|line| line.as_bytes()[72] == b'D').step_by(2);
        let kinds: Vec<u32> = directory.map(|line| line[..8].trim().parse().unwrap()).collect();
        let count = |kind: u32| kinds.iter().filter(|k| **k == kind).count();
        // Solid, shell, faces, loops (of walls one, with its seam twice), lists of edges and vertices.
        assert_eq!([186, 514, 510, 508, 504, 502].map(count), [1, 1, 4, 6, 1, 1]);
        assert_eq!([190, 192, 100, 110, 126, 128].map(count), [2, 2, 4, 2, 0, 0]);
        let wall = |line: &&str| line.starts_with("508,4,0,");
        assert_eq!(file.lines().filter(wall).count(), 2);
    }

    #[test]
    fn control_nets_read_back_bit_for_bit() {
        let surface = tube(DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.1, 0.2, 0.3), 5.0, 3.0, 7.0);
        let mut text = Vec::new();
        crate::control_nets::write(&surface, &mut text).unwrap();
        let json: serde_json::Value = serde_json::from_slice(&text).unwrap();
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        for (edge, read) in surface.edges.iter().zip(json["edges"].as_array().unwrap()) {
            for (p, q) in edge.control.iter().zip(read["control"].as_array().unwrap()) {
                assert_eq!(p.to_array(), [0, 1, 2].map(|k| number(&q[k])));
            }
            let CurveShape::Arc { radius, .. } = edge.shape else { panic!("all rims are arcs") };
            assert_eq!(number(&read["shape"]["radius"]), radius);
        }
        assert_eq!(json["faces"][1]["shape"]["kind"], "hole");
        assert_eq!(json["faces"].as_array().unwrap().len(), 4);
    }
}
