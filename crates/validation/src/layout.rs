//! The quadrilateral layout, by counting and by the angles of its mesh.

use crate::{LayoutFigures, ValidationError, topology};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
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
    let angles = corner_angles(layout);
    Ok(LayoutFigures {
        tiles: layout.tiles,
        macro_triangles: layout.macro_triangles,
        quads: layout.quads.len(),
        genus: genus(layout),
        valences,
        max_corner_angle_deg: angles.iter().flatten().fold(0.0f64, |a, &b| a.max(b)).to_degrees(),
        min_corner_angle_deg: angles.iter().flatten().fold(TAU, |a, &b| a.min(b)).to_degrees(),
        irregular_quads: angles.iter().filter(|corners| corners.iter().any(|&a| !regular(a))).count(),
        min_scaled_jacobian: angles.iter().flatten().map(|&a| scaled_jacobian(a)).fold(1.0, f64::min),
    })
}

/// `None` unless each edge has two sides in opposite directions and the sides of each quad and region face form loops.
fn genus(layout: &QuadLayout) -> Option<i64> {
    let along = |sides: &[Side]| sides.iter().map(|side| (side.edge, side.reversed)).collect::<Vec<_>>();
    let quads = layout.quads.iter().map(|quad| vec![along(quad)]);
    let faces = layout.region_faces.iter().map(|face| face.loops.iter().map(|l| along(l)).collect());
    let ends: Vec<[u32; 2]> = layout.edges.iter().map(|edge| edge.ends).collect();
    crate::surface::count_complex(layout.vertices.len(), &ends, quads.chain(faces)).genus
}

/// A corner at which a patch is regular: 15 to 165 degrees.
fn regular(angle: f64) -> bool {
    (PI / 12.0..=11.0 * PI / 12.0).contains(&angle)
}

/// The scaled Jacobian of a patch at a corner, from the angle of its two sides there: the length of the cross product of
/// the unit tangents of the sides, negative where the corner is reflex and the patch folds over. Chords between the
/// corners of a quad say little on a curved surface: a patch around half a strut has sides of any direction, and is
/// regular all the same.
fn scaled_jacobian(angle: f64) -> f64 {
    angle.min(1.5 * PI).sin()
}

/// The angles at the corners of each quad, radians: the sums of the angles of its faces there.
fn corner_angles(layout: &QuadLayout) -> Vec<[f64; 4]> {
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
    (0..layout.quads.len())
        .map(|quad| layout.corners(quad).map(|v| angle_at[&(layout.vertices[v as usize].0, quad as u32)]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_jacobian_of_known_corners() {
        let of = |degrees: f64| scaled_jacobian(degrees.to_radians());
        assert!((of(90.0) - 1.0).abs() < 1e-15);
        assert!((of(45.0) - 0.5f64.sqrt()).abs() < 1e-15);
        assert!(of(180.0).abs() < 1e-15);
        assert!(of(200.0) < 0.0 && of(350.0) == -1.0, "a reflex corner");
        assert!(regular(15.1f64.to_radians()) && !regular(165.1f64.to_radians()));
    }
}
