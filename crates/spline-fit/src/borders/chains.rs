//! Edges between one region and the free surface, joined to chains between corners.

use super::Beside;
use crate::EdgeCurve;
use topipe_mesh::{DVec3, RegionId};
use topipe_quad_matching::{QuadLayout, Side};

/// Consecutive edges along the border of one region, the region on their left.
pub(super) struct Chain {
    pub(super) region: RegionId,
    pub(super) sides: Vec<Side>,
    /// Whether the last side ends where the first begins, without a corner there.
    pub(super) closed: bool,
}

/// A border turns a corner where its directions before and after, each over a length of this many edges of the mesh, differ
/// by more than `CORNER_ANGLE` degrees. Shorter and smaller turns are the teeth of the mesh, unless a quad has its corner there.
const CORNER_REACH: f64 = 3.0;
const CORNER_ANGLE: f64 = 60.0;

/// All chains of edges beside a region that have no curve yet.
pub(super) fn chains(
    layout: &QuadLayout,
    sides: &[Beside],
    curves: &[Option<EdgeCurve>],
    grain: f64,
) -> Vec<Chain> {
    // Regions around each vertex: where there is more than one, the vertex is where shapes meet and stays.
    let mut regions: Vec<Vec<RegionId>> = vec![Vec::new(); layout.vertices.len()];
    // How many border sides leave each vertex: more than one of the same region where it touches itself.
    let mut leaving = vec![0u32; layout.vertices.len()];
    for face in &layout.region_faces {
        for &side in face.loops.iter().flatten() {
            let v = layout.start(side) as usize;
            leaving[v] += 1;
            if !regions[v].contains(&face.region) {
                regions[v].push(face.region);
            }
        }
    }
    // One quad lies in the corner there: a curve without a kink would leave it an angle of 180 degrees.
    let mut cornered = vec![false; layout.vertices.len()];
    for quad in &layout.quads {
        for k in 0..4 {
            let on_border = |side: Side| sides[side.edge as usize].iter().any(Option::is_some);
            if on_border(quad[k]) && on_border(quad[(k + 3) % 4]) {
                cornered[layout.start(quad[k]) as usize] = true;
            }
        }
    }
    let reach = CORNER_REACH * grain;
    let mut done = vec![false; layout.edges.len()];
    let mut chains = Vec::new();
    for face in &layout.region_faces {
        for around in &face.loops {
            let n = around.len();
            let open = |k: usize| {
                let e = around[k % n].edge as usize;
                // An edge with the region on both sides is taken once.
                curves[e].is_none() && (sides[e][0] != sides[e][1] || !around[k % n].reversed)
            };
            let corner = |k: usize| {
                let v = layout.start(around[k % n]) as usize;
                let before = (k + n - 1) % n;
                regions[v].len() > 1
                    || leaving[v] > 1
                    || cornered[v]
                    || !open(before)
                    || turns(layout, around[before], around[k % n], reach)
            };
            let first = (0..n).find(|&k| open(k) && corner(k));
            let closed = first.is_none();
            let Some(first) = first.or_else(|| (0..n).find(|&k| open(k))) else { continue };
            let mut chain: Vec<Side> = Vec::new();
            for k in first..first + n {
                let side = around[k % n];
                if !open(k) || done[side.edge as usize] {
                    continue;
                }
                if !chain.is_empty() && corner(k) {
                    let sides = std::mem::take(&mut chain);
                    chains.push(Chain { region: face.region, sides, closed: false });
                }
                done[side.edge as usize] = true;
                chain.push(side);
            }
            if !chain.is_empty() {
                chains.push(Chain { region: face.region, sides: chain, closed });
            }
        }
    }
    chains
}

fn turns(layout: &QuadLayout, before: Side, after: Side, reach: f64) -> bool {
    let positions = |path: Vec<topipe_mesh::VertexId>| -> Vec<DVec3> {
        path.iter().map(|&v| layout.part.mesh.position(v)).collect()
    };
    let mut back = positions(layout.path(before));
    back.reverse();
    let ahead = positions(layout.path(after));
    let direction = |points: &[DVec3]| {
        let length: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
        // A long way along a round border turns too: no more than a third of an edge.
        walked(points, reach.min((length / 3.0).max(reach / CORNER_REACH))) - points[0]
    };
    let angle = direction(&ahead).angle_between(-direction(&back)).to_degrees();
    angle > CORNER_ANGLE
}

/// The point of the polyline at this length, or its end.
fn walked(points: &[DVec3], mut length: f64) -> DVec3 {
    for w in points.windows(2) {
        let piece = w[0].distance(w[1]);
        if piece >= length && piece > 0.0 {
            return w[0].lerp(w[1], length / piece);
        }
        length -= piece;
    }
    points[points.len() - 1]
}
