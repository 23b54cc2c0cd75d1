//! Vertices split where normals or colours differ, as graphics formats want them.

use topipe_mesh::{DVec3, TriangleMesh};

/// Edges that turn by more than this many degrees stay sharp.
const CREASE: f64 = 35.0;

/// A vertex of one place, one normal and one colour.
pub(crate) struct Corners {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) normals: Vec<DVec3>,
    pub(crate) colors: Vec<[u8; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// Normals are area-weighted means of the faces around a vertex that turn by less than a crease from the face of the
/// corner. Without colours the list of colours stays empty.
pub(crate) fn split(mesh: &TriangleMesh, colors: &[[u8; 3]]) -> Corners {
    let normals: Vec<DVec3> = mesh.faces().map(|f| mesh.normal(f)).collect();
    let areas: Vec<f64> = mesh.faces().map(|f| mesh.area_vector(f).length()).collect();
    let mut around: Vec<Vec<(usize, usize)>> = vec![Vec::new(); mesh.vertex_count()];
    for (f, triangle) in mesh.triangles.iter().enumerate() {
        for (k, v) in triangle.iter().enumerate() {
            around[v.index()].push((f, k));
        }
    }
    let cosine = CREASE.to_radians().cos();
    let mut split = Corners {
        positions: Vec::new(),
        normals: Vec::new(),
        colors: Vec::new(),
        triangles: vec![[0; 3]; mesh.face_count()],
    };
    for (v, corners) in around.iter().enumerate() {
        let start = split.positions.len();
        for &(f, k) in corners {
            let near = |g: usize| g == f || normals[f].dot(normals[g]) >= cosine;
            let sum: DVec3 = corners.iter().filter(|c| near(c.0)).map(|c| normals[c.0] * areas[c.0]).sum();
            // A face without area has no direction; the format wants a unit vector all the same.
            let normal = sum.normalize_or(DVec3::Z);
            let color = colors.get(f);
            let same = |s: &usize| {
                split.normals[*s].dot(normal) > 0.9995 && color.is_none_or(|color| split.colors[*s] == *color)
            };
            let found = (start..split.positions.len()).find(same);
            split.triangles[f][k] = found.unwrap_or_else(|| {
                split.positions.push(mesh.positions[v]);
                split.normals.push(normal);
                split.colors.extend(color);
                split.positions.len() - 1
            }) as u32;
        }
    }
    split
}
