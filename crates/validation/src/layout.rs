//! The quadrilateral layout, by counting and by the angles of its mesh.

use crate::{LayoutFigures, ValidationError, topology};
use std::collections::BTreeMap;
use topipe_mesh::DVec3;
use topipe_quad_matching::{QuadLayout, Side};

fn check(layout: &QuadLayout) -> Result<(), ValidationError> {
    topology::check(&layout.part, "layout")?;
    let refuse = |problem: String| Err(ValidationError::artifact("layout", problem));
    let vertices = layout.part.mesh.vertex_count();
    if let Some(v) = layout.vertices.iter().position(|v| v.index() >= vertices) {
        return refuse(format!("macro-vertex {v} is no vertex of the mesh"));
    }
    let bad_edge = layout.edges.iter().position(|edge| {
        edge.ends.iter().any(|&end| end as usize >= layout.vertices.len())
            || edge.path.iter().any(|v| v.index() >= vertices)
            || edge.path.first() != Some(&layout.vertices[edge.ends[0] as usize])
            || edge.path.last() != Some(&layout.vertices[edge.ends[1] as usize])
    });
    if let Some(edge) = bad_edge {
        return refuse(format!("macro-edge {edge} is no path between its macro-vertices"));
    }
    if let Some(quad) = layout
        .quads
        .iter()
        .position(|sides| sides.iter().any(|side| side.edge as usize >= layout.edges.len()))
    {
        return refuse(format!("quad {quad} names an edge that does not exist"));
    }
    let loops = layout.region_faces.iter().flat_map(|face| &face.loops).flatten();
    if loops.clone().any(|side| side.edge as usize >= layout.edges.len()) {
        return refuse("a region face names an edge that does not exist".to_owned());
    }
    if layout.quad_of_face.len() != layout.part.mesh.face_count() {
        return refuse("it has not one quad per face of its mesh".to_owned());
    }
    Ok(())
}

pub(crate) fn figures(layout: &QuadLayout) -> Result<LayoutFigures, ValidationError> {
    check(layout)?;
    let mut valences = BTreeMap::new();
    for valence in layout.valences() {
        *valences.entry(valence).or_insert(0) += 1;
    }
    Ok(LayoutFigures {
        tiles: layout.tiles,
        macro_triangles: layout.macro_triangles,
        quads: layout.quads.len(),
        genus: genus(layout),
        valences,
        max_corner_angle_deg: max_corner_angle(layout),
        min_scaled_jacobian: (0..layout.quads.len())
            .map(|quad| scaled_jacobian(layout.corners(quad).map(|v| corner(layout, v))))
            .fold(1.0, f64::min),
    })
}

fn corner(layout: &QuadLayout, vertex: u32) -> DVec3 {
    layout.part.mesh.position(layout.vertices[vertex as usize])
}

/// `None` unless each edge has two sides in opposite directions and the sides of each quad and region face form loops.
fn genus(layout: &QuadLayout) -> Option<i64> {
    let along = |sides: &[Side]| sides.iter().map(|side| (side.edge, side.reversed)).collect::<Vec<_>>();
    let quads = layout.quads.iter().map(|quad| vec![along(quad)]);
    let faces = layout.region_faces.iter().map(|face| face.loops.iter().map(|l| along(l)).collect());
    let ends: Vec<[u32; 2]> = layout.edges.iter().map(|edge| edge.ends).collect();
    crate::surface::count_complex(layout.vertices.len(), &ends, quads.chain(faces)).genus
}

/// The largest sum of the angles of a quad's faces at one of its corners, degrees.
fn max_corner_angle(layout: &QuadLayout) -> f64 {
    let mesh = &layout.part.mesh;
    let mut angle_at: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    for quad in 0..layout.quads.len() {
        for v in layout.corners(quad) {
            angle_at.insert((layout.vertices[v as usize].0, quad as u32), 0.0);
        }
    }
    let mut is_corner = vec![false; mesh.vertex_count()];
    for v in &layout.vertices {
        is_corner[v.index()] = true;
    }
    for f in mesh.faces() {
        let (triangle, points) = (mesh.triangles[f.index()], mesh.corners(f));
        for k in (0..3).filter(|&k| is_corner[triangle[k].index()]) {
            if let Some(sum) = angle_at.get_mut(&(triangle[k].0, layout.quad_of_face[f.index()])) {
                let angle = (points[(k + 1) % 3] - points[k]).angle_between(points[(k + 2) % 3] - points[k]);
                // A face without area has no angle.
                *sum += if angle.is_finite() { angle } else { 0.0 };
            }
        }
    }
    angle_at.values().fold(0.0f64, |a, &b| a.max(b)).to_degrees()
}

/// The smallest, over the corners, of the triple product of the two sides (as unit vectors) and the mean normal.
fn scaled_jacobian(corners: [DVec3; 4]) -> f64 {
    let normal = (corners[2] - corners[0]).cross(corners[3] - corners[1]).normalize_or_zero();
    (0..4)
        .map(|k| {
            let ahead = (corners[(k + 1) % 4] - corners[k]).normalize_or_zero();
            let back = (corners[(k + 3) % 4] - corners[k]).normalize_or_zero();
            ahead.cross(back).dot(normal)
        })
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_jacobian_of_known_quads() {
        let of = |c: [[f64; 2]; 4]| scaled_jacobian(c.map(|[x, y]| DVec3::new(x, y, 3.0)));
        assert!((of([[0., 0.], [2., 0.], [2., 1.], [0., 1.]]) - 1.0).abs() < 1e-15);
        let sheared = of([[0., 0.], [1., 0.], [2., 1.], [1., 1.]]);
        assert!((sheared - 0.5f64.sqrt()).abs() < 1e-12, "{sheared}");
        assert!(of([[0., 0.], [2., 0.], [0.5, 0.5], [0., 2.]]) < 0.0, "a reflex corner");
    }
}
