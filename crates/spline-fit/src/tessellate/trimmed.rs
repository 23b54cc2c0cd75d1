//! Triangles of a trimmed plane or cylinder, between given points of its borders.
//!
//! The face is developed into the plane (a cylinder that goes all around is cut along its axis first) and triangulated
//! there: a constrained Delaunay triangulation of the border, by the crate `spade`, of which the part inside is kept.
//! On a cylinder, edges that turn through more than the chord allows are divided.

use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, PositionInTriangulation, Triangulation};
use std::collections::{HashMap, HashSet};
use std::f64::consts::TAU;
use topipe_mesh::{DVec3, RegionShape, TriangleMesh, VertexId};

type Place = [f64; 2];

/// A point of the developed face and its vertex of the mesh.
#[derive(Debug, Clone, Copy)]
struct Corner {
    at: Place,
    vertex: VertexId,
}

impl HasPosition for Corner {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

/// The development of a shape: orientation is kept seen from outside.
struct Development {
    shape: RegionShape,
    u: DVec3,
    v: DVec3,
}

impl Development {
    fn new(shape: &RegionShape) -> Self {
        let axis = match *shape {
            RegionShape::Plane { normal, .. } => normal,
            RegionShape::Cylinder { axis, .. } => axis,
        };
        let u = axis.any_orthonormal_vector();
        Self { shape: *shape, u, v: axis.cross(u) }
    }

    /// Circumference, of a cylinder.
    fn period(&self) -> Option<f64> {
        match self.shape {
            RegionShape::Plane { .. } => None,
            RegionShape::Cylinder { radius, .. } => Some(TAU * radius),
        }
    }

    /// Place of `p`, on a cylinder on the sheet nearest to the place `near`.
    fn develop(&self, p: DVec3, near: Option<Place>) -> Place {
        match self.shape {
            RegionShape::Plane { point, .. } => [(p - point).dot(self.u), (p - point).dot(self.v)],
            RegionShape::Cylinder { point, axis, radius, hole } => {
                let d = p - point;
                let x = radius * d.dot(self.v).atan2(d.dot(self.u));
                let x = if hole { -x } else { x };
                let turn = TAU * radius;
                [near.map_or(x, |near| x + turn * ((near[0] - x) / turn).round()), d.dot(axis)]
            }
        }
    }

    fn position(&self, [x, y]: Place) -> DVec3 {
        match self.shape {
            RegionShape::Plane { point, .. } => point + self.u * x + self.v * y,
            RegionShape::Cylinder { point, axis, radius, hole } => {
                let (s, c) = (if hole { -x } else { x } / radius).sin_cos();
                point + (self.u * c + self.v * s) * radius + axis * y
            }
        }
    }
}

/// Adds the triangles of a face to `mesh`. `loops` are its borders, closed chains of vertices with the face on their
/// left; `widest` is the largest angle about the axis that an edge inside a cylinder may span, `longest` the longest
/// an edge inside may be at all (infinite for no limit).
///
/// False, with `mesh` as it was, where the borders cross each other in the development: they were sampled too coarsely.
pub(super) fn add(
    mesh: &mut TriangleMesh,
    shape: &RegionShape,
    loops: &[Vec<VertexId>],
    widest: f64,
    longest: f64,
) -> bool {
    let development = Development::new(shape);
    let Some(polygons) = polygons(mesh, &development, loops) else { return false };
    let mut triangulation: ConstrainedDelaunayTriangulation<Corner> = ConstrainedDelaunayTriangulation::new();
    let mut borders: Vec<(FixedVertexHandle, FixedVertexHandle)> = Vec::new();
    let mut taken: HashMap<[u64; 2], VertexId> = HashMap::new();
    for polygon in &polygons {
        let mut handles = Vec::with_capacity(polygon.len());
        for corner in polygon {
            // Of two vertices in the same place one would be lost.
            let known = taken.insert(corner.at.map(f64::to_bits), corner.vertex);
            if known.is_some_and(|known| known != corner.vertex) {
                return false;
            }
            let Ok(handle) = triangulation.insert(*corner) else { return false };
            handles.push(handle);
        }
        for k in 0..handles.len() {
            borders.push((handles[k], handles[(k + 1) % handles.len()]));
        }
    }
    for &(from, to) in &borders {
        if from == to || !triangulation.can_add_constraint(from, to) {
            return false;
        }
        triangulation.add_constraint(from, to);
        // A vertex on the way would divide the edge on this side only.
        if triangulation.get_edge_from_neighbors(from, to).is_none() {
            return false;
        }
    }
    let before = mesh.positions.len();
    divide(mesh, &development, &mut triangulation, &borders, widest, longest);
    let Some(inside) = inside(&triangulation, &borders) else {
        mesh.positions.truncate(before);
        return false;
    };
    for face in triangulation.inner_faces() {
        if inside[face.fix().index()] {
            mesh.triangles.push(face.vertices().map(|v| v.data().vertex));
        }
    }
    true
}

/// The borders in the development. Two borders around a cylinder become one polygon, cut where they are nearest in
/// angle.
fn polygons(
    mesh: &TriangleMesh,
    development: &Development,
    loops: &[Vec<VertexId>],
) -> Option<Vec<Vec<Corner>>> {
    let mut closed = Vec::new();
    let mut around = Vec::new();
    for vertices in loops {
        let mut corners: Vec<Corner> = Vec::with_capacity(vertices.len() + 1);
        for &vertex in vertices.iter().chain(vertices.first()) {
            let near = corners.last().map(|c| c.at);
            // Spade refuses numbers that are nothing but rounding.
            let at = development
                .develop(mesh.position(vertex), near)
                .map(|x| if x.abs() < 1e-100 { 0.0 } else { x });
            corners.push(Corner { at, vertex });
        }
        let (first, last) = (corners.first()?.at, corners.pop()?.at);
        let turned = development.period().map_or(0.0, |period| ((last[0] - first[0]) / period).round());
        if turned == 0.0 { closed.push(corners) } else { around.push((corners, turned)) }
    }
    let Some(period) = development.period().filter(|_| !around.is_empty()) else { return Some(closed) };
    let [(a, turn_a), (b, turn_b)] = &around[..] else { return None };
    if turn_a + turn_b != 0.0 || turn_a.abs() != 1.0 {
        return None;
    }
    let (i, j) = cut(a, b, &around, &closed, period);
    // Each border from the cut once around to it again, unrolled from `start`.
    let unrolled = |corners: &[Corner], first: usize, turn: f64, start: Option<Place>| -> Vec<Corner> {
        let n = corners.len();
        let base = corners[first].at[0];
        let shift = start.map_or(0.0, |start| period * ((start[0] - base) / period).round());
        (0..=n)
            .map(|k| {
                let Corner { at: [x, y], vertex } = corners[(first + k) % n];
                let lap = if first + k >= n { turn * period } else { 0.0 };
                Corner { at: [x + lap + shift, y], vertex }
            })
            .collect()
    };
    let mut polygon = unrolled(a, i, *turn_a, None);
    let middle = (polygon[0].at[0] + polygon[polygon.len() - 1].at[0]) / 2.0;
    let end = polygon[polygon.len() - 1].at;
    polygon.extend(unrolled(b, j, *turn_b, Some(end)));
    // Holes in the wall onto the same sheet.
    for corners in &mut closed {
        let mean = corners.iter().map(|c| c.at[0]).sum::<f64>() / corners.len() as f64;
        let shift = period * ((middle - mean) / period).round();
        corners.iter_mut().for_each(|c| c.at[0] += shift);
    }
    closed.insert(0, polygon);
    Some(closed)
}

/// Where to cut: the corners of two borders around a cylinder most nearly on one ruling between which no border lies. A ragged
/// border can reach over itself; where it does everywhere, the pair nearest in angle.
fn cut(
    a: &[Corner],
    b: &[Corner],
    around: &[(Vec<Corner>, f64)],
    closed: &[Vec<Corner>],
    period: f64,
) -> (usize, usize) {
    let angle = |x: f64| (x / period).rem_euclid(1.0);
    let mut order: Vec<usize> = (0..b.len()).collect();
    order.sort_by(|&i, &j| angle(b[i].at[0]).total_cmp(&angle(b[j].at[0])));
    let mut pairs: Vec<(f64, usize, usize)> = Vec::with_capacity(2 * a.len());
    for (i, corner) in a.iter().enumerate() {
        let wanted = angle(corner.at[0]);
        let k = order.partition_point(|&j| angle(b[j].at[0]) < wanted);
        for j in [order[k % order.len()], order[(k + order.len() - 1) % order.len()]] {
            let off = angle(b[j].at[0]) - wanted;
            pairs.push(((off - off.round()).abs(), i, j));
        }
    }
    pairs.sort_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let borders = || around.iter().map(|(corners, _)| corners).chain(closed);
    let is_free = |&&(_, i, j): &&(f64, usize, usize)| {
        let from = a[i].at;
        let to = [b[j].at[0] + period * ((from[0] - b[j].at[0]) / period).round(), b[j].at[1]];
        borders().all(|corners| {
            (0..corners.len()).all(|k| {
                let (p, q) = (corners[k], corners[(k + 1) % corners.len()]);
                let ends = [a[i].vertex, b[j].vertex];
                let start = [p.at[0] + period * ((from[0] - p.at[0]) / period).round(), p.at[1]];
                let end = [q.at[0] + period * ((start[0] - q.at[0]) / period).round(), q.at[1]];
                ends.contains(&p.vertex) || ends.contains(&q.vertex) || !meet([from, to], [start, end])
            })
        })
    };
    let best = pairs.iter().find(is_free).or(pairs.first());
    best.map_or((0, 0), |&(_, i, j)| (i, j))
}

/// Whether two segments touch or cross.
fn meet([a, b]: [Place; 2], [c, d]: [Place; 2]) -> bool {
    let turn = |p: Place, q: Place, r: Place| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    turn(a, b, c) * turn(a, b, d) <= 0.0 && turn(c, d, a) * turn(c, d, b) <= 0.0
}

type Faces = ConstrainedDelaunayTriangulation<Corner>;

/// Which faces lie inside the borders: those on the left of a border, and what can be reached from them.
fn inside(triangulation: &Faces, borders: &[(FixedVertexHandle, FixedVertexHandle)]) -> Option<Vec<bool>> {
    let mut inside = vec![false; triangulation.num_all_faces()];
    let mut stack = Vec::new();
    for &(from, to) in borders {
        let edge = triangulation.get_edge_from_neighbors(from, to)?;
        let face = edge.face().as_inner()?;
        if !std::mem::replace(&mut inside[face.fix().index()], true) {
            stack.push(face.fix());
        }
    }
    while let Some(face) = stack.pop() {
        for edge in triangulation.face(face).adjacent_edges() {
            if edge.is_constraint_edge() {
                continue;
            }
            // Reaching the outside means that a border runs the wrong way round.
            let next = edge.rev().face().as_inner()?;
            if !std::mem::replace(&mut inside[next.fix().index()], true) {
                stack.push(next.fix());
            }
        }
    }
    // The right of a border is outside, unless the face has it on both sides.
    let all: HashSet<(FixedVertexHandle, FixedVertexHandle)> = borders.iter().copied().collect();
    let clean = borders.iter().all(|&(from, to)| {
        let across = triangulation.get_edge_from_neighbors(to, from).and_then(|e| e.face().as_inner());
        across.is_none_or(|face| !inside[face.fix().index()]) || all.contains(&(to, from))
    });
    clean.then_some(inside)
}

/// Rounds of division at the most: each halves the longest edges.
const ROUNDS: usize = 12;

fn divide(
    mesh: &mut TriangleMesh,
    development: &Development,
    triangulation: &mut Faces,
    borders: &[(FixedVertexHandle, FixedVertexHandle)],
    widest: f64,
    longest: f64,
) {
    let across = match development.shape {
        RegionShape::Plane { .. } => f64::INFINITY,
        RegionShape::Cylinder { radius, .. } => widest * radius,
    };
    if across.is_infinite() && longest.is_infinite() {
        return;
    }
    for _ in 0..ROUNDS {
        let Some(inside) = inside(triangulation, borders) else { return };
        // Each with an end of its edge, from which the way to it is short; the point before it may lie anywhere.
        let mut points: Vec<(Place, FixedVertexHandle)> = Vec::new();
        for edge in triangulation.undirected_edges() {
            let [a, b] = edge.vertices().map(|v| v.data().at);
            let (x, y) = ((b[0] - a[0]).abs(), (b[1] - a[1]).abs());
            let within = edge.as_directed().face().as_inner().is_some_and(|f| inside[f.fix().index()]);
            if !edge.is_constraint_edge() && within && (x > across * 1.000_001 || x.hypot(y) > longest) {
                let middle = [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
                points.push((middle, edge.vertices()[0].fix()));
            }
        }
        if points.is_empty() {
            return;
        }
        for (at, near) in points {
            // Earlier points of the round may have come to lie there.
            let free = match triangulation.locate_with_hint(Point2::new(at[0], at[1]), near) {
                PositionInTriangulation::OnFace(_) => true,
                PositionInTriangulation::OnEdge(edge) => {
                    !triangulation.directed_edge(edge).is_constraint_edge()
                }
                _ => false,
            };
            let vertex = VertexId::new(mesh.positions.len());
            if free && triangulation.insert_with_hint(Corner { at, vertex }, near).is_ok() {
                mesh.positions.push(development.position(at));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The wall between a circle and a border that reaches over itself where both have a corner on the same ruling.
    #[test]
    fn a_wall_is_cut_where_no_border_lies_between() {
        let quarter = TAU / 4.0;
        let circle: Vec<Place> = (0..4).map(|k| [quarter * f64::from(k), 0.0]).collect();
        // Clockwise seen from outside, with a fold below the corner at a quarter of a turn.
        let folded = [[5.0, 2.0], [4.0, 2.0], [2.5, 2.0], [quarter, 2.0], [quarter + 0.3, 1.5]]
            .into_iter()
            .chain([[quarter - 0.3, 1.0], [0.4, 2.0]]);
        let folded: Vec<Place> = folded.collect();
        let corners = |places: &[Place], first: usize| -> Vec<Corner> {
            let at = places.iter().enumerate();
            at.map(|(k, &at)| Corner { at, vertex: VertexId::new(first + k) }).collect()
        };
        let around = [(corners(&circle, 0), 1.0), (corners(&folded, 4), -1.0)];
        let (i, j) = cut(&around[0].0, &around[1].0, &around, &[], TAU);
        assert_ne!((i, j), (1, 3), "the fold lies between");

        let shape = RegionShape::Cylinder { point: DVec3::ZERO, axis: DVec3::Z, radius: 1.0, hole: false };
        let development = Development::new(&shape);
        let positions: Vec<[f64; 3]> =
            circle.iter().chain(&folded).map(|&at| development.position(at).to_array()).collect();
        let mut mesh = TriangleMesh::from_arrays(positions, Vec::new());
        let loops = [(0..4).map(VertexId::new).collect(), (4..11).map(VertexId::new).collect()];
        assert!(add(&mut mesh, &shape, &loops, f64::INFINITY, f64::INFINITY));
        // A ring without inner vertices has as many triangles as corners.
        assert_eq!(mesh.triangles.len(), 11);
    }
}
