//! An independent check of a layout.

use crate::{QuadLayout, Side};
use std::collections::{BTreeSet, HashMap};
use topipe_mesh::{Connectivity, HalfEdgeId, VertexId};

/// Checks what [`QuadLayout`] guarantees; an empty list means that all of it holds.
///
/// Faces are counted with their own Euler characteristic, found from the mesh: 1 for a disk, 0 for the wall of a hole,
/// so that `V - E + F` has to be that of the mesh also where faces have more than one border.
pub fn verify(layout: &QuadLayout) -> Vec<String> {
    let mesh = &layout.part.mesh;
    let connectivity = match Connectivity::build(mesh) {
        Ok(connectivity) => connectivity,
        Err(error) => return vec![error.to_string()],
    };
    if layout.quad_of_face.len() != mesh.face_count() {
        return vec!["it has not one quad per face of its mesh".into()];
    }
    let quads = layout.quads.len();
    let name = |cell: usize| {
        if cell < quads { format!("quad {cell}") } else { format!("region face {}", cell - quads) }
    };
    // Cells: the quads, then the region faces. The borders of each as closed chains of sides.
    let borders: Vec<Vec<Vec<Side>>> = layout
        .quads
        .iter()
        .map(|quad| vec![quad.to_vec()])
        .chain(layout.region_faces.iter().map(|face| face.loops.clone()))
        .collect();
    let region_cell: HashMap<_, _> =
        layout.region_faces.iter().enumerate().map(|(i, face)| (face.region, quads + i)).collect();
    let mut problems = Vec::new();
    let mut cell_of_face = vec![usize::MAX; mesh.face_count()];
    for face in mesh.faces() {
        let quad = layout.quad_of_face[face.index()];
        let cell = if quad != QuadLayout::NO_QUAD {
            Some(quad as usize).filter(|&q| q < quads)
        } else {
            region_cell.get(&layout.part.region_of_face[face.index()]).copied()
        };
        match cell {
            Some(cell) => cell_of_face[face.index()] = cell,
            None => return vec![format!("face {} lies in no quad and in no region face", face.0)],
        }
    }

    let mut uses = vec![[0u32; 2]; layout.edges.len()];
    // Which cell borders each directed mesh edge of a macro-edge.
    let mut owner: HashMap<[VertexId; 2], usize> = HashMap::new();
    for (cell, loops) in borders.iter().enumerate() {
        for sides in loops {
            for (k, side) in sides.iter().enumerate() {
                if side.edge as usize >= layout.edges.len() {
                    return vec![format!("{} names an edge that does not exist", name(cell))];
                }
                uses[side.edge as usize][side.reversed as usize] += 1;
                let end = layout.edges[side.edge as usize].ends[!side.reversed as usize];
                if end != layout.start(sides[(k + 1) % sides.len()]) {
                    problems.push(format!("side {k} of {} does not end where the next begins", name(cell)));
                }
                for pair in layout.path(*side).windows(2) {
                    owner.insert([pair[0], pair[1]], cell);
                }
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
            for d in [[pair[0], pair[1]], [pair[1], pair[0]]] {
                match connectivity.half_edge(d[0], d[1]) {
                    None => problems.push(format!("macro-edge {e} leaves the mesh")),
                    Some(h) if owner.get(&d) != Some(&cell_of_face[h.face().index()]) => {
                        problems.push(format!("macro-edge {e} has a face of the wrong cell beside it"));
                    }
                    Some(_) => {}
                }
            }
        }
    }
    // Macro-edges meet at macro-vertices only.
    let mut inside: BTreeSet<VertexId> = BTreeSet::new();
    let corners: BTreeSet<VertexId> = layout.vertices.iter().copied().collect();
    for (e, edge) in layout.edges.iter().enumerate() {
        for v in edge.path.iter().skip(1).take(edge.path.len().saturating_sub(2)) {
            if !inside.insert(*v) || corners.contains(v) {
                problems.push(format!("macro-edge {e} meets another one at vertex {}", v.0));
            }
        }
    }
    // Each quad is a disk, and no mesh edge between two cells lies off the macro-edges.
    let mut vertices = vec![BTreeSet::new(); borders.len()];
    let mut faces = vec![0i64; borders.len()];
    let mut inner = vec![0i64; borders.len()];
    for face in mesh.faces() {
        let cell = cell_of_face[face.index()];
        faces[cell] += 1;
        for k in 0..3 {
            let h = HalfEdgeId::of(face, k);
            vertices[cell].insert(connectivity.origin(h));
            let other = connectivity.twin(h);
            if !other.is_some() {
                return vec!["the mesh has a border".into()];
            }
            let other = cell_of_face[other.face().index()];
            if other == cell {
                inner[cell] += 1;
            } else if !owner.contains_key(&[connectivity.origin(h), connectivity.target(h)]) {
                problems.push(format!("{} and {} meet off a macro-edge", name(cell), name(other)));
            }
        }
    }
    let mut all = layout.vertices.len() as i64 - layout.edges.len() as i64;
    for cell in 0..borders.len() {
        let euler = vertices[cell].len() as i64 - (3 * faces[cell] - inner[cell] / 2) + faces[cell];
        if cell < quads && euler != 1 {
            problems.push(format!("{} has Euler characteristic {euler}", name(cell)));
        }
        // Planes and walls of holes are pieces of a sphere: a disk less one for each further border.
        let expected = 2 - borders[cell].len() as i64;
        if cell >= quads && euler != expected {
            problems.push(format!(
                "{} has Euler characteristic {euler}, with {} borders {expected} is expected",
                name(cell),
                borders[cell].len()
            ));
        }
        all += euler;
    }
    if all != connectivity.euler_characteristic(mesh) {
        problems.push(format!(
            "V - E + F is {all}, that of the mesh {}",
            connectivity.euler_characteristic(mesh)
        ));
    }
    problems
}
