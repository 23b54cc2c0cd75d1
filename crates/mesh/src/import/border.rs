//! Says where a surface is open.

use super::ImportError;
use super::draft::Draft;
use crate::spatial::closest_point_on_triangle;
use crate::{HalfEdgeId, VertexId};
use glam::DVec3;
use std::collections::BTreeMap;

/// The refusal for a surface whose half-edges `open` have no partner.
pub(super) fn describe(file: &str, draft: &Draft, open: &[HalfEdgeId]) -> ImportError {
    let mesh = &draft.mesh;
    // Borders that share a vertex count as one. Label propagation by union of the vertices.
    let mut parent: BTreeMap<VertexId, VertexId> = BTreeMap::new();
    fn root(parent: &mut BTreeMap<VertexId, VertexId>, mut v: VertexId) -> VertexId {
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
    let mut borders: BTreeMap<VertexId, (f64, Vec<HalfEdgeId>)> = BTreeMap::new();
    for &h in open {
        let border = borders.entry(root(&mut parent, mesh.origin(h))).or_default();
        let [p, q] = ends(draft, h);
        border.0 += p.distance(q);
        border.1.push(h);
    }
    let count = borders.len();
    let (length, longest) =
        borders.into_values().reduce(|best, b| if b.0 > best.0 { b } else { best }).unwrap_or_default();
    // `open` is never empty; a wrong place is still better than a panic.
    let first = longest.first().copied().unwrap_or_default();
    let [p, q] = ends(draft, first);
    ImportError::Open {
        file: file.to_owned(),
        borders: count,
        edges: longest.len(),
        length,
        point: (p + q) / 2.0,
        face: draft.face_of[first.face().index()],
        slit: is_slit(draft, &longest, open),
    }
}

fn ends(draft: &Draft, h: HalfEdgeId) -> [DVec3; 2] {
    [draft.mesh.origin(h), draft.mesh.target(h)].map(|v| draft.mesh.position(v))
}

/// Whether beside the middle of each edge of `border` there is another open edge: then nothing is missing, only
/// vertices do not meet.
fn is_slit(draft: &Draft, border: &[HalfEdgeId], open: &[HalfEdgeId]) -> bool {
    // All pairs: where that is too much work, the hint is left out.
    if border.len().saturating_mul(open.len()) > 20_000_000 {
        return false;
    }
    border.iter().all(|&h| {
        let [p, q] = ends(draft, h);
        let near = 1e-3 * p.distance(q);
        open.iter().filter(|&&g| g != h).any(|&g| {
            let [a, b] = ends(draft, g);
            let middle = (p + q) / 2.0;
            closest_point_on_triangle(middle, [a, b, b]).distance(middle) <= near
        })
    })
}
