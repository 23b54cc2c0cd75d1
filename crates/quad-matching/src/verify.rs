//! An independent check of a layout.

use crate::QuadLayout;
use std::collections::{BTreeSet, HashMap};
use topipe_mesh::{Connectivity, HalfEdgeId, VertexId};

/// Checks what [`QuadLayout`] guarantees; an empty list means that all of it holds.
pub fn verify(layout: &QuadLayout) -> Vec<String> {
    let mesh = &layout.part.mesh;
    let connectivity = match Connectivity::build(mesh) {
        Ok(connectivity) => connectivity,
        Err(error) => return vec![error.to_string()],
    };
    let mut problems = Vec::new();
    let mut uses = vec![[0u32; 2]; layout.edges.len()];
    for (q, quad) in layout.quads.iter().enumerate() {
        for k in 0..4 {
            uses[quad[k].edge as usize][quad[k].reversed as usize] += 1;
            let end = layout.edges[quad[k].edge as usize].ends[!quad[k].reversed as usize];
            if end != layout.start(quad[(k + 1) % 4]) {
                problems.push(format!("side {k} of quad {q} does not end where the next begins"));
            }
        }
    }
    // Which quad borders each directed mesh edge of a macro-edge.
    let mut owner: HashMap<[VertexId; 2], u32> = HashMap::new();
    for (q, quad) in layout.quads.iter().enumerate() {
        for side in quad {
            for pair in layout.path(*side).windows(2) {
                owner.insert([pair[0], pair[1]], q as u32);
            }
        }
    }
    for (e, edge) in layout.edges.iter().enumerate() {
        if uses[e] != [1, 1] {
            problems.push(format!("macro-edge {e} is used {:?} times forwards and backwards", uses[e]));
        }
        let ends = edge.ends.map(|v| layout.vertices[v as usize]);
        if edge.path.first() != Some(&ends[0]) || edge.path.last() != Some(&ends[1]) {
            problems.push(format!("macro-edge {e} does not run between its ends"));
        }
        for pair in edge.path.windows(2) {
            let directions = [[pair[0], pair[1]], [pair[1], pair[0]]];
            for d in directions {
                match connectivity.half_edge(d[0], d[1]) {
                    None => problems.push(format!("macro-edge {e} leaves the mesh")),
                    Some(h) if owner.get(&d) != Some(&layout.quad_of_face[h.face().index()]) => {
                        problems.push(format!("macro-edge {e} has a face of the wrong quad beside it"));
                    }
                    Some(_) => {}
                }
            }
        }
    }
    // Each quad is a disk, and no mesh edge between two quads lies off the macro-edges.
    let mut vertices = vec![BTreeSet::new(); layout.quads.len()];
    let mut faces = vec![0i64; layout.quads.len()];
    let mut inner = vec![0i64; layout.quads.len()];
    for face in mesh.faces() {
        let q = layout.quad_of_face[face.index()] as usize;
        faces[q] += 1;
        for k in 0..3 {
            let h = HalfEdgeId::of(face, k);
            vertices[q].insert(connectivity.origin(h));
            let other = layout.quad_of_face[connectivity.twin(h).face().index()] as usize;
            if other == q {
                inner[q] += 1;
            } else if !owner.contains_key(&[connectivity.origin(h), connectivity.target(h)]) {
                problems.push(format!("quads {q} and {other} meet off a macro-edge"));
            }
        }
    }
    for q in 0..layout.quads.len() {
        let euler = vertices[q].len() as i64 - (3 * faces[q] - inner[q] / 2) + faces[q];
        if euler != 1 {
            problems.push(format!("quad {q} has Euler characteristic {euler}"));
        }
    }
    let euler = layout.vertices.len() as i64 - layout.edges.len() as i64 + layout.quads.len() as i64;
    if euler != connectivity.euler_characteristic(mesh) {
        problems.push(format!(
            "V - E + F is {euler}, that of the mesh {}",
            connectivity.euler_characteristic(mesh)
        ));
    }
    problems
}
