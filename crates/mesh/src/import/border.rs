//! Says where a surface is open.

use super::ImportError;
use super::draft::Draft;
use crate::{HalfEdgeId, VertexId};
use glam::DVec3;

/// The refusal for a surface whose half-edges `open` have no partner.
pub(super) fn describe(file: &str, draft: &Draft, open: &[HalfEdgeId]) -> ImportError {
    let mesh = &draft.mesh;
    // Borders that share a vertex count as one. Label propagation by union of the vertices.
    let mut parent: std::collections::BTreeMap<VertexId, VertexId> = std::collections::BTreeMap::new();
    fn root(parent: &mut std::collections::BTreeMap<VertexId, VertexId>, mut v: VertexId) -> VertexId {
        loop {
            let up = *parent.entry(v).or_insert(v);
            if up == v {
                return v;
            }
            let above = parent.get(&up).copied().unwrap_or(up);
            parent.insert(v, above);
            v = up;
        }
    }
    for &h in open {
        let (a, b) = (root(&mut parent, mesh.origin(h)), root(&mut parent, mesh.target(h)));
        parent.insert(a.max(b), a.min(b));
    }
    struct Border {
        edges: usize,
        length: f64,
        area: DVec3,
        first: HalfEdgeId,
    }
    let mut borders: std::collections::BTreeMap<VertexId, Border> = std::collections::BTreeMap::new();
    for &h in open {
        let (p, q) = (mesh.position(mesh.origin(h)), mesh.position(mesh.target(h)));
        let vertex = root(&mut parent, mesh.origin(h));
        let center = mesh.position(vertex);
        let border =
            borders.entry(vertex).or_insert(Border { edges: 0, length: 0.0, area: DVec3::ZERO, first: h });
        border.edges += 1;
        border.length += p.distance(q);
        border.area += (p - center).cross(q - center) / 2.0;
    }
    let count = borders.len();
    let longest = borders
        .into_values()
        .reduce(|best, b| if b.length > best.length { b } else { best })
        // `open` is never empty; an empty border is still better than a panic.
        .unwrap_or(Border { edges: 0, length: 0.0, area: DVec3::ZERO, first: HalfEdgeId(0) });
    let h = longest.first;
    ImportError::Open {
        file: file.to_owned(),
        borders: count,
        edges: longest.edges,
        length: longest.length,
        point: (mesh.position(mesh.origin(h)) + mesh.position(mesh.target(h))) / 2.0,
        face: draft.face_of[h.face().index()],
        slit: longest.area.length() <= 1e-6 * longest.length * longest.length,
    }
}
