//! Points of the mesh with parameters in a patch.
//!
//! A quad is mapped to the unit square by mean-value coordinates, its sides by arc length, so that the parameters
//! along a macro-edge are the same from both patches. Points are taken inside the faces, weighted by their area:
//! the fit then depends on the surface and not on how densely it is meshed, which varies a lot beside the cuts.

use glam::DVec2;
use std::collections::HashMap;
use topipe_mesh::disk_map::DiskMap;
use topipe_mesh::{DVec3, FaceId, VertexId};
use topipe_quad_matching::QuadLayout;

/// A point to be approximated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) point: DVec3,
    pub(crate) u: f64,
    pub(crate) v: f64,
    /// Share of the patch's area; all shares of a patch add up to 1.
    pub(crate) weight: f64,
}

/// The samples of one quad.
#[derive(Debug, Clone)]
pub(crate) struct PatchSamples {
    pub(crate) samples: Vec<Sample>,
    /// Area of the quad's faces, mm^2.
    pub(crate) area: f64,
}

/// Arc-length positions, 0 to 1, along a path of mesh vertices.
pub(crate) fn arc_length(points: &[DVec3]) -> Vec<f64> {
    let mut along = vec![0.0];
    for pair in points.windows(2) {
        along.push(along[along.len() - 1] + pair[0].distance(pair[1]));
    }
    let total = along[along.len() - 1];
    let count = along.len() - 1;
    for (k, s) in along.iter_mut().enumerate() {
        *s = if total > 0.0 { *s / total } else { k as f64 / count as f64 };
    }
    along
}

/// Inner points of a triangle and their weights: the three-point rule of degree two.
const RULE: [[f64; 3]; 3] =
    [[2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0], [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0]];

/// Parameterizes quad `quad` and samples its faces. `None` when its faces are not a disk.
pub(crate) fn sample(layout: &QuadLayout, quad: usize, faces: &[FaceId]) -> Option<PatchSamples> {
    let mesh = &layout.part.mesh;
    let corner = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
    let mut fixed: HashMap<VertexId, DVec2> = HashMap::new();
    for (k, side) in layout.quads[quad].iter().enumerate() {
        // Along the edge in its own direction, so that both patches get the same parameters bit for bit.
        let path = &layout.edges[side.edge as usize].path;
        let points: Vec<DVec3> = path.iter().map(|&v| mesh.position(v)).collect();
        let (from, to) = (corner[k], corner[(k + 1) % 4]);
        for (&v, t) in path.iter().zip(arc_length(&points)) {
            let t = if side.reversed { 1.0 - t } else { t };
            fixed.insert(v, from.lerp(to, t));
        }
    }
    let map = DiskMap::solve(mesh, faces, &fixed)?;
    let area: f64 = faces.iter().map(|&f| mesh.area_vector(f).length() / 2.0).sum();
    let mut samples = Vec::with_capacity(3 * faces.len());
    for &f in faces {
        let weight = mesh.area_vector(f).length() / 2.0 / (3.0 * area);
        let points = mesh.corners(f);
        let places = mesh.triangles[f.index()].map(|v| map.at(v));
        for shares in RULE {
            let point = (0..3).map(|k| shares[k] * points[k]).sum();
            let place: DVec2 = (0..3).map(|k| shares[k] * places[k]).sum();
            if weight > 0.0 {
                samples.push(Sample { point, u: place.x, v: place.y, weight });
            }
        }
    }
    Some(PatchSamples { samples, area })
}

/// The faces of each quad, in order.
pub(crate) fn faces_by_quad(layout: &QuadLayout) -> Vec<Vec<FaceId>> {
    let mut faces = vec![Vec::new(); layout.quads.len()];
    for (f, &quad) in layout.quad_of_face.iter().enumerate() {
        if let Some(list) = faces.get_mut(quad as usize) {
            list.push(FaceId::new(f));
        }
    }
    faces
}
