//! Where strips end: a fillet runs into the ball of a corner, a rod into its round end.
//!
//! Nothing is sharp there, but the surface changes its kind, and what is found on it later ends there: with edges along it, a cylinder
//! ends in an arc instead of in the teeth of triangles that lie on both.

use crate::faces::longest_edge;
use topipe_mesh::{Connectivity, HalfEdgeId, TriangleMesh};

/// A strip is this many times as long as its end is wide, and as the facets beyond.
const STRIP: f64 = 3.0;

/// Marks edges between the ends of strips and small facets beyond as features, as far as they run from feature to feature or in loops,
/// and where nothing is known about the surface on either side.
pub(crate) fn mark_seams(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    is_known: impl Fn(HalfEdgeId) -> bool,
    feature: &mut [bool],
) {
    let ends = |h: HalfEdgeId| [mesh.origin(h), mesh.target(h)];
    let is_end = |h: HalfEdgeId, beyond: HalfEdgeId| {
        let [a, b] = ends(h).map(|v| mesh.position(v));
        let strip = longest_edge(mesh, h.face());
        strip > STRIP * a.distance(b) && strip > STRIP * longest_edge(mesh, beyond.face())
    };
    let mut seams: Vec<HalfEdgeId> = connectivity
        .edges()
        .filter(|&h| !feature[h.index()])
        .filter(|&h| {
            let twin = connectivity.twin(h);
            !is_known(h) && !is_known(twin) && (is_end(h, twin) || is_end(twin, h))
        })
        .collect();
    let mut count = vec![0u32; mesh.vertex_count()];
    for h in connectivity.edges().filter(|h| feature[h.index()]) {
        // What ends at a feature does not dangle.
        ends(h).into_iter().for_each(|v| count[v.index()] = 2);
    }
    seams.iter().flat_map(|&h| ends(h)).for_each(|v| count[v.index()] += 1);
    loop {
        let before = seams.len();
        seams.retain(|&h| {
            let dangles = ends(h).into_iter().any(|v| count[v.index()] < 2);
            if dangles {
                ends(h).into_iter().for_each(|v| count[v.index()] -= 1);
            }
            !dangles
        });
        if seams.len() == before {
            break;
        }
    }
    for h in seams {
        feature[h.index()] = true;
        feature[connectivity.twin(h).index()] = true;
    }
}
