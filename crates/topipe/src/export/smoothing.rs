//! The features of a smoothed part as a table.

use crate::artifacts::Mesh;
use topipe_engine::Exporter;
use topipe_mesh::{DVec3, Part, RegionShape};

pub(super) fn exporters() -> Vec<Exporter> {
    vec![Exporter::new::<Mesh>("csv", env!("TOPIPE_WRITER_SMOOTHING"), |part, _, file| {
        Ok(file.write_all(table(part).as_bytes())?)
    })]
}

/// One line per region, lengths in mm. The axis of a plane is its outward normal; a plane has no diameter. The last columns are the
/// corners of the box around its faces, from which a `space` for the overrides of features is written; none without faces.
fn table(part: &Part) -> String {
    let mut text =
        "region,shape,faces,area_mm2,residual_mm,diameter_mm,axis_x,axis_y,axis_z,point_x_mm,point_y_mm,\
                    point_z_mm,min_x_mm,min_y_mm,min_z_mm,max_x_mm,max_y_mm,max_z_mm\n"
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
            _ => corners.map(|p| format!("{},{},{}", p.x, p.y, p.z)).join(","),
        };
        let (name, axis, point, diameter) = match region.shape {
            RegionShape::Plane { point, normal } => ("plane", normal, point, String::new()),
            RegionShape::Cylinder { point, axis, radius, hole } => {
                (if hole { "hole" } else { "boss" }, axis, point, (2.0 * radius).to_string())
            }
        };
        text += &format!(
            "{id},{name},{faces},{},{},{diameter},{},{},{},{},{},{},{around}\n",
            region.area, region.residual, axis.x, axis.y, axis.z, point.x, point.y, point.z
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::{Region, RegionId, TriangleMesh};

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
        assert_eq!(lines[1], "0,plane,1,0.5,0,,0,0,1,0,0,0,0,0,0,1,1,0");
        assert_eq!(lines[2], "1,hole,0,0.5,0,6,0,0,1,1,0,0,,,,,,");
        assert!(lines.iter().all(|l| l.split(',').count() == 18));
    }
}
