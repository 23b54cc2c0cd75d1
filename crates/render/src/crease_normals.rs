//! One normal per corner: smooth where the surface is, broken at creases.

use rayon::prelude::*;
use topipe_mesh::{DVec3, TriangleMesh};

/// For each corner of some faces, the mean of the normals of the faces at its vertex that turn from this face by less
/// than `crease` degrees, weighted by area. Needs no connectivity: works on any triangle soup with shared vertices.
pub(crate) fn crease_normals(mesh: &TriangleMesh, crease: f64, of: &[u32]) -> Vec<[DVec3; 3]> {
    let count = mesh.vertex_count();
    let valid = |t: &[topipe_mesh::VertexId; 3]| t.iter().all(|v| v.index() < count);
    let area: Vec<DVec3> = mesh
        .faces()
        .map(|f| if valid(&mesh.triangles[f.index()]) { mesh.area_vector(f) } else { DVec3::ZERO })
        .collect();
    // Each is looked at from all corners of all faces around it, some twenty times.
    let unit: Vec<DVec3> = area.iter().map(|n| n.normalize_or_zero()).collect();
    let mut start = vec![0u32; count + 1];
    for triangle in mesh.triangles.iter().filter(|t| valid(t)) {
        for v in triangle {
            start[v.index() + 1] += 1;
        }
    }
    for v in 0..count {
        start[v + 1] += start[v];
    }
    let mut fill = start.clone();
    let mut faces = vec![0u32; start[count] as usize];
    for (f, triangle) in mesh.triangles.iter().enumerate().filter(|(_, t)| valid(t)) {
        for v in triangle {
            faces[fill[v.index()] as usize] = f as u32;
            fill[v.index()] += 1;
        }
    }
    let limit = crease.to_radians().cos();
    of.par_iter()
        .map(|&f| {
            let f = f as usize;
            let own = unit[f];
            if !valid(&mesh.triangles[f]) {
                return [own; 3];
            }
            mesh.triangles[f].map(|v| {
                let around = &faces[start[v.index()] as usize..start[v.index() + 1] as usize];
                let sum: DVec3 = around
                    .iter()
                    .filter(|g| unit[**g as usize].dot(own) >= limit)
                    .map(|&g| area[g as usize])
                    .sum();
                sum.try_normalize().unwrap_or(own)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_right_angle_is_kept_and_a_gentle_fold_is_smoothed() {
        let fold = |angle: f64| {
            let (s, c) = angle.to_radians().sin_cos();
            TriangleMesh::from_arrays(
                vec![[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [c, 0.0, -s]],
                vec![[0, 1, 2], [0, 3, 1]],
            )
        };
        let sharp = crease_normals(&fold(90.0), 40.0, &[0]);
        assert!((sharp[0][0] - DVec3::Z).length() < 1e-12);
        let gentle = crease_normals(&fold(20.0), 40.0, &[0]);
        let expected = DVec3::new(10f64.to_radians().sin(), 0.0, 10f64.to_radians().cos());
        assert!((gentle[0][0] - expected).length() < 1e-12);
        assert!((gentle[0][2] - DVec3::Z).length() < 1e-12, "the far corner sees one face only");
    }
}
