//! A plane section of a mesh, and rays in it.

use std::collections::BTreeMap;
use topipe_mesh::{DVec3, TriangleMesh};

/// Rays of a full turn.
pub(super) const RAYS: usize = 36;
/// Principal moments that differ by less than this share of their sum are equal: the section is as symmetric as a regular
/// polygon about its middle, and rounding would choose the axis. Sections of a faceted circle, at random heights, differ by
/// 1e-4 to 1e-2.
const EQUAL_MOMENTS: f64 = 1e-9;

/// Where the plane cuts one triangle.
struct Segment {
    /// In coordinates of the plane, the origin at the point of the section, in the order of the contour.
    ends: [[f64; 2]; 2],
    /// The edges of the mesh on which the ends lie.
    edges: [[u32; 2]; 2],
}

/// The segments in which a plane through a point cuts the triangles, and 36 directions in that plane which turn with the
/// surface.
pub(super) struct Section {
    segments: Vec<Segment>,
    /// Angle of the first ray in the coordinates of the segments, radians.
    first: f64,
}

/// Nearest and farthest hit of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hits {
    pub(super) nearest: f64,
    pub(super) farthest: f64,
}

impl Section {
    /// A vertex in the plane counts as above it, so a closed mesh always has closed sections.
    pub(super) fn cut(mesh: &TriangleMesh, point: DVec3, normal: DVec3) -> Self {
        let (u, v) = normal.any_orthonormal_pair();
        let height: Vec<f64> = mesh.positions.iter().map(|&p| (p - point).dot(normal)).collect();
        let mut segments = Vec::new();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|v| height[v.index()] >= 0.0);
            if a == b && b == c {
                continue;
            }
            let (mut ends, mut edges) = ([[0.0; 2]; 2], [[0; 2]; 2]);
            for k in 0..3 {
                let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
                let rises = height[to.index()] >= 0.0;
                if (height[from.index()] >= 0.0) == rises {
                    continue;
                }
                // From the lower to the higher index, so that both faces at an edge find the same bits.
                let (p, q) = (from.min(to), from.max(to));
                let (hp, hq) = (height[p.index()], height[q.index()]);
                let r = mesh.position(p).lerp(mesh.position(q), hp / (hp - hq)) - point;
                // The rising edge of a triangle is the falling one of its neighbour: segments follow one another.
                ends[usize::from(!rises)] = [r.dot(u), r.dot(v)];
                edges[usize::from(!rises)] = [p.0, q.0];
            }
            segments.push(Segment { ends, edges });
        }
        let first = first_ray(&segments);
        Self { segments, first }
    }

    /// What the rays from the point hit, one every ten degrees from the first; `None` for a ray that misses.
    pub(super) fn rays(&self) -> [Option<Hits>; RAYS] {
        std::array::from_fn(|k| {
            let (sin, cos) = (self.first + turn(k)).sin_cos();
            let mut hits: Option<Hits> = None;
            for Segment { ends: [a, b], .. } in &self.segments {
                let (ya, yb) = (cos * a[1] - sin * a[0], cos * b[1] - sin * b[0]);
                if (ya >= 0.0) == (yb >= 0.0) {
                    continue;
                }
                let (xa, xb) = (cos * a[0] + sin * a[1], cos * b[0] + sin * b[1]);
                let x = xa + (xb - xa) * (ya / (ya - yb));
                if x >= 0.0 {
                    let so_far = hits.unwrap_or(Hits { nearest: x, farthest: x });
                    hits = Some(Hits { nearest: so_far.nearest.min(x), farthest: so_far.farthest.max(x) });
                }
            }
            hits
        })
    }
}

/// The angle of ray `k` from the first, radians.
pub(super) fn turn(k: usize) -> f64 {
    (k as f64 * (360.0 / RAYS as f64)).to_radians()
}

/// The angle of the principal axis of the nearest contour's area about the origin. Which of the two axes, and which way, is
/// the same for rays at every ten degrees. Where all axes are principal the farthest corner is taken: there all farthest
/// corners are alike.
fn first_ray(segments: &[Segment]) -> f64 {
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    let mut farthest = [0.0; 2];
    let square = |p: [f64; 2]| p[0] * p[0] + p[1] * p[1];
    for Segment { ends: [a, b], .. } in nearest_contour(segments) {
        let w = a[0] * b[1] - a[1] * b[0];
        xx += w * (a[0] * a[0] + a[0] * b[0] + b[0] * b[0]);
        yy += w * (a[1] * a[1] + a[1] * b[1] + b[1] * b[1]);
        xy += w * (a[0] * a[1] + 0.5 * (a[0] * b[1] + a[1] * b[0]) + b[0] * b[1]);
        if square(*a) > square(farthest) {
            farthest = *a;
        }
    }
    if (xx - yy).hypot(2.0 * xy) > EQUAL_MOMENTS * (xx + yy).abs() {
        0.5 * (2.0 * xy).atan2(xx - yy)
    } else {
        farthest[1].atan2(farthest[0])
    }
}

/// The segments that hang together with the one nearest to the origin.
fn nearest_contour(segments: &[Segment]) -> Vec<&Segment> {
    let distance = |Segment { ends: [a, b], .. }: &Segment| {
        let d = [b[0] - a[0], b[1] - a[1]];
        let length = d[0] * d[0] + d[1] * d[1];
        let t = if length > 0.0 { (-(a[0] * d[0] + a[1] * d[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
        (a[0] + t * d[0]).hypot(a[1] + t * d[1])
    };
    let Some(start) =
        (0..segments.len()).min_by(|&a, &b| distance(&segments[a]).total_cmp(&distance(&segments[b])))
    else {
        return Vec::new();
    };
    let mut on_edge: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (k, segment) in segments.iter().enumerate() {
        segment.edges.iter().for_each(|&edge| on_edge.entry(edge).or_default().push(k));
    }
    let (mut contour, mut stack) = (Vec::new(), vec![start]);
    let mut seen = vec![false; segments.len()];
    while let Some(k) = stack.pop() {
        if !std::mem::replace(&mut seen[k], true) {
            contour.push(&segments[k]);
            segments[k]
                .edges
                .iter()
                .for_each(|edge| stack.extend(on_edge.remove(edge).into_iter().flatten()));
        }
    }
    contour
}
