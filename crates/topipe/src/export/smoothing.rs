//! The features of a smoothed part as a table.

use crate::artifacts::Mesh;
use topipe_engine::Exporter;
use topipe_mesh::{Part, RegionShape};

pub(super) fn exporters() -> Vec<Exporter> {
    vec![Exporter::new::<Mesh>("csv", env!("TOPIPE_WRITER_SMOOTHING"), |part, _, file| {
        Ok(file.write_all(table(part).as_bytes())?)
    })]
}

/// One line per region, lengths in mm. The axis of a plane is its outward normal; a plane has no diameter.
fn table(part: &Part) -> String {
    let mut text =
        "region,shape,faces,area_mm2,residual_mm,diameter_mm,axis_x,axis_y,axis_z,point_x_mm,point_y_mm,\
                    point_z_mm\n"
            .to_owned();
    let mut faces = vec![0usize; part.regions.len()];
    part.region_of_face.iter().filter(|r| r.is_some()).for_each(|r| faces[r.index()] += 1);
    for (id, (region, faces)) in part.regions.iter().zip(faces).enumerate() {
        let (name, axis, point, diameter) = match region.shape {
            RegionShape::Plane { point, normal } => ("plane", normal, point, String::new()),
            RegionShape::Cylinder { point, axis, radius, hole } => {
                (if hole { "hole" } else { "boss" }, axis, point, (2.0 * radius).to_string())
            }
        };
        text += &format!(
            "{id},{name},{faces},{},{},{diameter},{},{},{},{},{},{}\n",
            region.area, region.residual, axis.x, axis.y, axis.z, point.x, point.y, point.z
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::{DVec3, Region, RegionId, TriangleMesh};

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
        assert_eq!(lines[1], "0,plane,1,0.5,0,,0,0,1,0,0,0");
        assert_eq!(lines[2], "1,hole,0,0.5,0,6,0,0,1,1,0,0");
        assert!(lines.iter().all(|l| l.split(',').count() == 12));
    }
}
