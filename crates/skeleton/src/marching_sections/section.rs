//! Plane sections of a closed mesh: the loops, their area, centroid and second moments (Green's theorem).

use crate::piece::Piece;
use glam::{DVec2, DVec3};
use topipe_mesh::{HalfEdgeId, VertexId};

/// One loop of a plane section.
#[derive(Debug, Clone)]
pub(super) struct Loop {
    /// Enclosed area, mm^2.
    pub(super) area: f64,
    /// Its area centroid.
    pub(super) centroid: DVec3,
    /// Its middle; the centroid unless [`Cutter::centre`] was asked.
    pub(super) middle: DVec3,
    /// The unit normal of the plane.
    pub(super) normal: DVec3,
    /// Principal second moments about the centroid, the larger first, mm^4.
    pub(super) moments: [f64; 2],
    /// The axis of the larger one.
    pub(super) axis: DVec3,
    /// It runs over a closing fan: the section is cut off by an interface.
    pub(super) cut_off: bool,
    /// Share of its crossings at edges of the branch it was cut for.
    pub(super) own: f64,
    /// The point the plane was put through lies within.
    pub(super) holds_origin: bool,
    /// The centroid lies within.
    pub(super) holds_centroid: bool,
}

/// Cuts one piece again and again.
pub(super) struct Cutter<'a> {
    piece: &'a Piece,
    /// The cut that last used a half-edge.
    used: Vec<u32>,
    cuts: u32,
    /// The branch that last claimed a vertex, and how many have.
    claimed: Vec<u32>,
    claims: u32,
    points: Vec<DVec2>,
    /// The outline of the loop last returned, in its plane.
    outline: Vec<DVec2>,
}

impl<'a> Cutter<'a> {
    pub(super) fn new(piece: &'a Piece) -> Self {
        Self {
            piece,
            used: vec![0; piece.mesh.face_count() * 3],
            cuts: 0,
            claimed: vec![0; piece.mesh.vertex_count()],
            claims: 0,
            points: Vec::new(),
            outline: Vec::new(),
        }
    }

    /// The outline of the loop that the last cut returned, in two axes of its plane.
    pub(super) fn outline(&self) -> &[DVec2] {
        &self.outline
    }

    /// Finds the middle of the loop that the last cut, through `origin`, returned.
    pub(super) fn centre(&self, found: &mut Loop, origin: DVec3) {
        let (x, y) = found.normal.any_orthonormal_pair();
        let from = found.centroid - origin;
        let centroid = DVec2::new(from.dot(x), from.dot(y));
        let radius = (found.area / std::f64::consts::PI).sqrt();
        let middle = super::middle::middle(&self.outline, centroid, radius);
        found.middle = found.centroid + (middle.x - centroid.x) * x + (middle.y - centroid.y) * y;
    }

    /// Says whose sections the next cuts are for.
    pub(super) fn claim(&mut self, vertices: &[VertexId]) {
        self.claims += 1;
        for v in vertices {
            self.claimed[v.index()] = self.claims;
        }
    }

    /// The loop of the plane through `origin` that belongs to a branch with the given vertices: the smallest that
    /// holds `origin`, else the one with the nearest centroid within `near`.
    pub(super) fn cut(
        &mut self,
        origin: DVec3,
        normal: DVec3,
        vertices: &[VertexId],
        near: f64,
    ) -> Option<Loop> {
        self.cuts += 1;
        let piece = self.piece;
        let height = |v: VertexId| (piece.mesh.position(v) - origin).dot(normal);
        let mut best: Option<(bool, f64, Loop)> = None;
        for &v in vertices {
            let h = height(v);
            if h > 0.0 || h < -piece.longest_edge[v.index()] {
                continue;
            }
            // Far vertices belong to other windings of the same branch.
            if piece.mesh.position(v).distance_squared(origin) > 4.0 * near * near {
                continue;
            }
            for h in piece.connectivity.outgoing(v) {
                if self.used[h.index()] == self.cuts || height(piece.connectivity.target(h)) <= 0.0 {
                    continue;
                }
                let Some(found) = self.trace(h, origin, normal) else { continue };
                let key = if found.holds_origin { found.area } else { found.centroid.distance(origin) };
                if !found.holds_origin && key > near {
                    continue;
                }
                let better = best.as_ref().is_none_or(|(holds, k, _)| {
                    (found.holds_origin && !holds) || (found.holds_origin == *holds && key < *k)
                });
                if better {
                    std::mem::swap(&mut self.points, &mut self.outline);
                    best = Some((found.holds_origin, key, found));
                }
            }
        }
        best.map(|b| b.2)
    }

    /// Follows a loop from a half-edge that rises through the plane. `None` for a loop without area.
    fn trace(&mut self, start: HalfEdgeId, origin: DVec3, normal: DVec3) -> Option<Loop> {
        let piece = self.piece;
        let (x, y) = normal.any_orthonormal_pair();
        let height = |v: VertexId| (piece.mesh.position(v) - origin).dot(normal);
        self.points.clear();
        let (mut cut_off, mut own) = (false, 0);
        let mut h = start;
        // Each step enters a face through an edge that rises or falls through the plane; exactly one of the other
        // two does as well.
        loop {
            let (a, b) = (piece.connectivity.origin(h), piece.connectivity.target(h));
            let (ha, hb) = (height(a), height(b));
            let t = ha / (ha - hb);
            let p = piece.mesh.position(a).lerp(piece.mesh.position(b), t) - origin;
            self.points.push(DVec2::new(p.dot(x), p.dot(y)));
            self.used[h.index()] = self.cuts;
            self.used[piece.connectivity.twin(h).index()] = self.cuts;
            own += usize::from([a, b].iter().any(|v| self.claimed[v.index()] == self.claims));
            cut_off |= h.face().index() >= piece.own_faces;
            let next = h.next();
            let crossed = (height(piece.connectivity.origin(next)) > 0.0)
                != (height(piece.connectivity.target(next)) > 0.0);
            h = piece.connectivity.twin(if crossed { next } else { h.prev() });
            if h == start || self.points.len() > self.used.len() {
                break;
            }
        }
        let own = own as f64 / self.points.len() as f64;
        measure(&self.points, origin, normal, x, y).map(|found| Loop { cut_off, own, ..found })
    }
}

fn measure(points: &[DVec2], origin: DVec3, normal: DVec3, x: DVec3, y: DVec3) -> Option<Loop> {
    let n = points.len();
    let (mut area, mut first, mut xx, mut yy, mut xy, mut length) = (0.0, DVec2::ZERO, 0.0, 0.0, 0.0, 0.0);
    for k in 0..n {
        let (a, b) = (points[k], points[(k + 1) % n]);
        let w = a.perp_dot(b);
        area += w / 2.0;
        first += w * (a + b) / 6.0;
        xx += w * (a.x * a.x + a.x * b.x + b.x * b.x) / 12.0;
        yy += w * (a.y * a.y + a.y * b.y + b.y * b.y) / 12.0;
        xy += w * (a.x * b.y + 2.0 * a.x * a.y + 2.0 * b.x * b.y + b.x * a.y) / 24.0;
        length += a.distance(b);
    }
    if area.abs() <= 1e-9 * length * length {
        return None;
    }
    let center = first / area;
    let sign = area.signum();
    let area = area.abs();
    let (ixx, iyy, ixy) = (
        sign * yy - area * center.y * center.y,
        sign * xx - area * center.x * center.x,
        sign * xy - area * center.x * center.y,
    );
    // Moments about the axes x and y are ixx and iyy; the tensor is [[ixx, -ixy], [-ixy, iyy]].
    let mean = (ixx + iyy) / 2.0;
    let radius = ((ixx - iyy) / 2.0).hypot(ixy);
    let angle = 0.5 * (-2.0 * ixy).atan2(ixx - iyy);
    Some(Loop {
        area,
        centroid: origin + center.x * x + center.y * y,
        middle: origin + center.x * x + center.y * y,
        normal,
        moments: [mean + radius, (mean - radius).max(0.0)],
        axis: angle.cos() * x + angle.sin() * y,
        cut_off: false,
        own: 1.0,
        holds_origin: holds(points, DVec2::ZERO),
        holds_centroid: holds(points, center),
    })
}

/// Point in polygon by crossings.
fn holds(points: &[DVec2], p: DVec2) -> bool {
    let n = points.len();
    (0..n)
        .filter(|&k| {
            let (a, b) = (points[k] - p, points[(k + 1) % n] - p);
            (a.y > 0.0) != (b.y > 0.0) && a.x + (b.x - a.x) * a.y / (a.y - b.y) > 0.0
        })
        .count()
        % 2
        == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_has_its_textbook_moments() {
        let corners = [(1.0, 2.0), (5.0, 2.0), (5.0, 4.0), (1.0, 4.0)].map(|(x, y)| DVec2::new(x, y));
        let found = measure(&corners, DVec3::ZERO, DVec3::Z, DVec3::X, DVec3::Y).unwrap();
        assert!((found.area - 8.0).abs() < 1e-12);
        assert!(found.centroid.distance(DVec3::new(3.0, 3.0, 0.0)) < 1e-12);
        // b h^3 / 12: 2 * 4^3 / 12 about y, 4 * 2^3 / 12 about x.
        assert!((found.moments[0] - 128.0 / 12.0).abs() < 1e-12);
        assert!((found.moments[1] - 32.0 / 12.0).abs() < 1e-12);
        assert!(found.axis.dot(DVec3::Y).abs() > 1.0 - 1e-12);
        assert!(found.holds_centroid && !found.holds_origin);
    }
}
