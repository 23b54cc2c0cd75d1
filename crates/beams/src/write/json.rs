//! Everything about a structure, for other programs.

use crate::{Axis, Structure};
use glam::DVec3;
use serde_json::{Value, json};

/// Nodes, beams, links, clearances, supports, loads and remarks.
pub fn json(structure: &Structure) -> Value {
    let vector = |v: DVec3| json!([v.x, v.y, v.z]);
    let nodes: Vec<_> = structure
        .nodes
        .iter()
        .map(|n| json!({"position": vector(n.position), "kind": n.kind.name()}))
        .collect();
    let beams: Vec<_> = structure
        .beams
        .iter()
        .map(|beam| {
            let s = &beam.section;
            let profile = beam.profile.as_ref().map(|c| {
                json!({
                    "name": c.profile.name, "shape": c.profile.shape, "dimensions": c.profile.dimensions,
                    "properties": c.profile.properties(), "error": c.error
                })
            });
            json!({
                "nodes": beam.ends,
                "axis": match &beam.axis {
                    Axis::Straight => json!("straight"),
                    Axis::Spline(control) => {
                        json!({"degree": 3, "control": control.iter().map(|&p| vector(p)).collect::<Vec<_>>()})
                    }
                },
                "length": structure.length(beam),
                "section": {
                    "area": s.area, "moments": s.moments, "axis": vector(s.axis), "torsion": s.torsion,
                    "area_variation": s.variation, "sections": s.count
                },
                "profile": profile,
                "rms": beam.rms, "bow": beam.bow, "protrusion": beam.protrusion,
            })
        })
        .collect();
    let clearances: Vec<_> = structure
        .clearances
        .iter()
        .map(|c| json!({"beams": c.beams, "distance": c.distance, "at": vector(c.at)}))
        .collect();
    json!({
        "units": "mm",
        "nodes": nodes,
        "beams": beams,
        "links": structure.links,
        "clearances": clearances,
        "supports": structure.supports,
        "loads": structure.loads.iter().map(|(n, f)| json!({"node": n, "force_N": vector(*f)})).collect::<Vec<_>>(),
        "remarks": structure.remarks,
    })
}
