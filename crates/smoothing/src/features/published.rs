//! The two detectors of Bacciaglia, Ceruti, Liverani 2021, as published (sections 3.1 and 3.2), for comparison.
//!
//! *detect_flat_surfaces* compares the three components of the normals of neighbouring facets with 1e-4, so what it
//! finds depends on the noise of the file; the text freezes the facet, the pseudo-code its neighbours: here the
//! facet. *detect_holes_edges* follows edges whose normals are 80 to 100 degrees apart (the text says 85 to 95) and keeps
//! loops that no other such edge touches. A loop may be the outline of a face as well as the rim of a hole, the wall of a
//! hole is not found, and a hole that is oblique to its face is not either.

use topipe_mesh::{Connectivity, TriangleMesh, VertexId};

/// Of the components of two normals that are called the same.
const SAME: f64 = 1e-4;

/// A facet is flat when more than its number of neighbours less this have its normal.
const L: usize = 2;

/// Angle between normals across an edge of a hole, degrees.
const SHARP: std::ops::Range<f64> = 80.0..100.0;

/// What the published detectors find.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Published {
    /// One per vertex: on a flat facet.
    pub flat: Vec<bool>,
    /// One per vertex: on a closed loop of sharp edges.
    pub on_loop: Vec<bool>,
    /// Number of such loops.
    pub loops: usize,
}

/// Runs both detectors.
pub fn detect(mesh: &TriangleMesh, connectivity: &Connectivity) -> Published {
    let mut found = Published {
        flat: vec![false; mesh.vertex_count()],
        on_loop: vec![false; mesh.vertex_count()],
        loops: 0,
    };
    for f in mesh.faces() {
        let n = mesh.normal(f);
        let across = (0..3).map(|k| connectivity.neighbor(f, k)).filter(|g| g.is_some());
        let (mut count, mut same) = (0, 0);
        for g in across {
            count += 1;
            same += usize::from((mesh.normal(g) - n).abs().max_element() < SAME);
        }
        if same + L > count && same > 0 {
            mesh.triangles[f.index()].iter().for_each(|v| found.flat[v.index()] = true);
        }
    }
    let mut linked: Vec<Vec<VertexId>> = vec![Vec::new(); mesh.vertex_count()];
    for h in connectivity.edges() {
        let twin = connectivity.twin(h);
        if twin.is_some() {
            let angle = mesh.normal(h.face()).angle_between(mesh.normal(twin.face())).to_degrees();
            if SHARP.contains(&angle) {
                let (a, b) = (connectivity.origin(h), connectivity.target(h));
                linked[a.index()].push(b);
                linked[b.index()].push(a);
            }
        }
    }
    let mut seen = vec![false; mesh.vertex_count()];
    for start in mesh.vertices() {
        if seen[start.index()] || linked[start.index()].is_empty() {
            continue;
        }
        let mut chain = vec![start];
        seen[start.index()] = true;
        let mut next = 0;
        while next < chain.len() {
            for &w in &linked[chain[next].index()] {
                if !std::mem::replace(&mut seen[w.index()], true) {
                    chain.push(w);
                }
            }
            next += 1;
        }
        if chain.iter().all(|v| linked[v.index()].len() == 2) {
            found.loops += 1;
            chain.iter().for_each(|v| found.on_loop[v.index()] = true);
        }
    }
    found
}
