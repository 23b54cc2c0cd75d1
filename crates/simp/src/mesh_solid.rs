//! A closed mesh as a solid of the design space.

use crate::shape::Face;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{DVec3, TriangleMesh};

/// A closed mesh whose faces look outwards.
#[derive(Debug, Clone)]
pub(crate) struct MeshSolid {
    pub(crate) mesh: TriangleMesh,
    index: SurfaceIndex,
}

impl MeshSolid {
    pub(crate) fn new(mesh: &TriangleMesh) -> Self {
        Self { index: SurfaceIndex::build(mesh), mesh: mesh.clone() }
    }

    /// What it is made of, for keys.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let places = self.mesh.positions.iter().flat_map(|p| p.to_array()).flat_map(f64::to_le_bytes);
        let corners = self.mesh.triangles.iter().flatten().flat_map(|v| (v.index() as u32).to_le_bytes());
        places.chain(corners).collect()
    }

    /// How far outside a point is (negative inside), and the plane of the face nearest to it.
    pub(crate) fn nearest_face(&self, p: DVec3) -> (f64, Face) {
        let Some(near) = self.index.nearest(p) else {
            return (f64::INFINITY, Face::Plane(DVec3::ZERO, DVec3::Z));
        };
        let normal = self.mesh.normal(near.face);
        let above = (p - near.point).dot(normal);
        // Above the middle of a face its normal tells the side; at edges and corners that of one face may tell the wrong one.
        let outside =
            if above.abs() > 0.999 * near.distance { above >= 0.0 } else { !self.index.contains(p) };
        let distance = if outside { near.distance } else { -near.distance };
        (distance, Face::Plane(near.point, normal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cuboid_of_triangles_is_a_box() {
        let (low, high) = (DVec3::ZERO, DVec3::new(4.0, 3.0, 2.0));
        let solid = MeshSolid::new(&TriangleMesh::cuboid(low, high));
        let box_of = crate::Shape::Box { min: low.to_array(), max: high.to_array() };
        for k in 0..1000 {
            let p = DVec3::new(
                (k % 10) as f64 * 0.63 - 0.9,
                (k / 10 % 10) as f64 * 0.51 - 0.8,
                (k / 100) as f64 * 0.37 - 0.7,
            );
            let (distance, face) = solid.nearest_face(p);
            let exact = box_of.nearest_face(p).0;
            assert_eq!(distance > 0.0, exact > 0.0, "{p}");
            // That of the box is exact inside, and a lower bound outside.
            assert!(if exact < 0.0 { (distance - exact).abs() < 1e-12 } else { distance >= exact - 1e-12 });
            assert!((face.normal(p).length() - 1.0).abs() < 1e-12);
        }
    }
}
