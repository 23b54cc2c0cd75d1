//! Mean curvature at the vertices of a mesh.

use crate::TriangleMesh;
use glam::DVec3;

impl TriangleMesh {
    /// The mean curvature at each vertex, 1/mm: positive where the surface is convex, 1/r on a sphere of radius r, 1/(2 r)
    /// on a cylinder.
    ///
    /// By the cotangent formula over a third of the area of the faces around the vertex (Meyer, Desbrun, Schroeder, Barr
    /// 2003, *Discrete Differential-Geometry Operators for Triangulated 2-Manifolds*, eq. 8, with the barycentric area).
    /// Exact in the limit on smooth, regular meshes; on slivers and at sharp edges it is what the formula gives, which grows
    /// as the mesh gets finer. Faces without area count for nothing; 0 at a vertex without area around it. At the border
    /// of an open mesh the value has no meaning.
    pub fn mean_curvature(&self) -> Vec<f64> {
        let mut laplacian = vec![DVec3::ZERO; self.vertex_count()];
        let mut area = vec![0.0; self.vertex_count()];
        for f in self.faces() {
            let corners = self.corners(f);
            let double_area = self.area_vector(f).length();
            if !(double_area > 0.0 && double_area.is_finite()) {
                continue;
            }
            let ids = self.triangles[f.index()].map(|v| v.index());
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                let (u, v) = (corners[i] - corners[k], corners[j] - corners[k]);
                let half_cotangent = 0.5 * u.dot(v) / double_area;
                let across = (corners[j] - corners[i]) * half_cotangent;
                laplacian[ids[i]] += across;
                laplacian[ids[j]] -= across;
                area[ids[k]] += double_area / 6.0;
            }
        }
        let normals = self.vertex_normals();
        let value =
            |v: usize| if area[v] > 0.0 { -0.5 * laplacian[v].dot(normals[v]) / area[v] } else { 0.0 };
        (0..self.vertex_count()).map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid over two angles, as a torus of revolution; the inner radius may vary with the first.
    fn torus(n: u32, large: f64, small: f64) -> TriangleMesh {
        let angle = |k: u32| f64::from(k) / f64::from(n) * std::f64::consts::TAU;
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let ((su, cu), (sv, cv)) = (angle(i).sin_cos(), angle(j).sin_cos());
                let r = large + small * cv;
                positions.push([r * cu, r * su, small * sv]);
                let at = |i: u32, j: u32| i % n * n + j % n;
                triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        TriangleMesh::from_arrays(positions, triangles)
    }

    #[test]
    fn of_a_torus() {
        let (n, large, small) = (120, 5.0, 2.0);
        let mesh = torus(n, large, small);
        assert!(mesh.volume() > 0.0);
        for (k, value) in mesh.mean_curvature().into_iter().enumerate() {
            let cv = (f64::from(k as u32 % n) / f64::from(n) * std::f64::consts::TAU).cos();
            let exact = (large + 2.0 * small * cv) / (2.0 * small * (large + small * cv));
            assert!((value - exact).abs() < 0.01 * exact.abs().max(0.1), "{value} for {exact}");
        }
    }

    #[test]
    fn scales_and_survives_faces_without_area() {
        let mut mesh = torus(24, 5.0, 2.0);
        let before = mesh.mean_curvature();
        mesh.positions.iter_mut().for_each(|p| *p *= 10.0);
        mesh.triangles.push([mesh.triangles[0][0]; 3]);
        let after = mesh.mean_curvature();
        assert!(before.iter().zip(&after).all(|(b, a)| (b - 10.0 * a).abs() < 1e-9));
        assert_eq!(TriangleMesh::default().mean_curvature(), Vec::<f64>::new());
    }
}
