//! For each vertex the middle of the largest ball inside that touches the surface there: what the sources take from the
//! Voronoi diagram of the vertices, by shrinking balls (Ma, Bae, Choi 2012, *3D medial axis point approximation*).

use glam::DVec3;
use topipe_mesh::TriangleMesh;
use topipe_mesh::spatial::SurfaceIndex;

pub(super) fn poles(mesh: &TriangleMesh) -> Vec<DVec3> {
    let index = SurfaceIndex::build(mesh);
    let normals = mesh.vertex_normals();
    let start = mesh.diagonal() / 2.0;
    (mesh.positions.iter().zip(normals))
        .map(|(&p, normal)| {
            let mut radius = start;
            for _ in 0..40 {
                let center = p - radius * normal;
                let Some(nearest) = index.nearest(center) else { break };
                // Within a hundredth the ball touches nothing but the vertex and its faces.
                if nearest.distance >= 0.99 * radius {
                    break;
                }
                let to = nearest.point - p;
                let along = -to.dot(normal);
                let next = if along > 0.0 { to.length_squared() / (2.0 * along) } else { 0.0 };
                if next <= 1e-9 * start || next >= radius {
                    break;
                }
                radius = next;
            }
            p - radius * normal
        })
        .collect()
}
