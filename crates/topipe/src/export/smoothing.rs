//! The features of a smoothed part as a table.

use crate::artifacts::Mesh;
use topipe_engine::Exporter;
use topipe_mesh::{Connectivity, DVec3, Part, RegionShape};
use topipe_smoothing::features::{EdgeChain, edge_chains};

pub(super) fn exporters() -> Vec<Exporter> {
    vec![Exporter::new::<Mesh>("csv", env!("TOPIPE_WRITER_SMOOTHING"), |part, _, file| {
        Ok(file.write_all(table(part).as_bytes())?)
    })]
}

/// One line per region, then one per chain of sharp edges or of edges named by the user, longest first; lengths in mm. The axis of
/// a plane is its outward normal; a plane has no diameter. `min` and `max` are the corners of the box around faces or edges, from
/// which a `space` for the overrides of features is written; none without faces. The last columns are of edges only: their
/// number, the length of the chain, its largest dihedral angle in degrees, and whether it is "sharp" or "user".
fn table(part: &Part) -> String {
    let mut text =
        "region,shape,faces,area_mm2,residual_mm,diameter_mm,axis_x,axis_y,axis_z,point_x_mm,point_y_mm,\
                    point_z_mm,min_x_mm,min_y_mm,min_z_mm,max_x_mm,max_y_mm,max_z_mm,\
                    edges,length_mm,dihedral_deg,edge_kind\n"
            .to_owned();
    let mut faces = vec![(0usize, [DVec3::INFINITY, DVec3::NEG_INFINITY]); part.regions.len()];
    for (face, region) in part.mesh.faces().zip(&part.region_of_face).filter(|(_, region)| region.is_some()) {
        let (count, [low, high]) = &mut faces[region.index()];
        *count += 1;
        for p in part.mesh.corners(face) {
            (*low, *high) = (low.min(p), high.max(p));
        }
    }
    for (id, (region, (faces, corners))) in part.regions.iter().zip(faces).enumerate() {
        let around = match faces {
            0 => ",".repeat(5),
            _ => corners.map(coordinates).join(","),
        };
        let (name, axis, point, diameter) = match region.shape {
            RegionShape::Plane { point, normal } => ("plane", normal, point, String::new()),
            RegionShape::Cylinder { point, axis, radius, hole } => {
                (if hole { "hole" } else { "boss" }, axis, point, (2.0 * radius).to_string())
            }
        };
        text += &format!(
            "{id},{name},{faces},{},{},{diameter},{},{},{},{},{},{},{around},,,,\n",
            region.area, region.residual, axis.x, axis.y, axis.z, point.x, point.y, point.z
        );
    }
    for chain in chains(part) {
        let around = [chain.min, chain.max].map(coordinates).join(",");
        text += &format!(
            ",edge,,,,,,,,,,,{around},{},{},{},{}\n",
            chain.edges(),
            chain.length,
            chain.angle,
            chain.kind_name()
        );
    }
    text
}

fn coordinates(p: DVec3) -> String {
    format!("{},{},{}", p.x, p.y, p.z)
}

/// Chains of feature edges; none of a mesh that is no manifold.
fn chains(part: &Part) -> Vec<EdgeChain> {
    if part.feature_edges.is_empty() {
        return Vec::new();
    }
    Connectivity::build(&part.mesh)
        .map_or_else(|_| Vec::new(), |connectivity| edge_chains(part, &connectivity))
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::{FeatureEdge, FeatureKind, Region, RegionId, TriangleMesh, VertexId};

    #[test]
    fn a_line_for_each_region() {
        let mesh =
            TriangleMesh::from_arrays(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]);
        let mut part = Part::new(mesh);
        let plane = RegionShape::Plane { point: DVec3::ZERO, normal: DVec3::Z };
        let hole = RegionShape::Cylinder { point: DVec3::X, axis: DVec3::Z, radius: 3.0, hole: true };
        part.regions = [plane, hole].map(|shape| Region { shape, area: 0.5, residual: 0.0 }).to_vec();
        part.region_of_face = vec![RegionId::new(0)];
        let text = table(&part);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "0,plane,1,0.5,0,,0,0,1,0,0,0,0,0,0,1,1,0,,,,");
        assert_eq!(lines[2], "1,hole,0,0.5,0,6,0,0,1,1,0,0,,,,,,,,,,");
        assert!(lines.iter().all(|l| l.split(',').count() == 22));
    }

    #[test]
    fn a_line_for_each_chain_of_edges() {
        let corners = vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = TriangleMesh::from_arrays(corners, vec![[0, 1, 2], [1, 0, 3], [0, 2, 3], [1, 3, 2]]);
        let mut part = Part::new(mesh);
        part.feature_edges = [([0, 1], FeatureKind::Sharp), ([2, 3], FeatureKind::HoleRim)]
            .map(|(ends, kind)| FeatureEdge { vertices: ends.map(VertexId), kind })
            .to_vec();
        let text = table(&part);
        let lines: Vec<&str> = text.lines().collect();
        // Rims go with their hole.
        assert_eq!(lines.len(), 2);
        assert_eq!(lines[1], ",edge,,,,,,,,,,,0,0,0,2,0,0,1,2,90,sharp");
        assert_eq!(lines[1].split(',').count(), lines[0].split(',').count());
    }
}
