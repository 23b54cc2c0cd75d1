//! A boundary representation with planes, cylinders, lines and arcs.

use glam::DVec3;
use std::collections::BTreeMap;

/// The curve of an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Curve {
    /// Straight.
    Line,
    /// Part of a circle, from the first vertex counterclockwise about `axis` to the second.
    Arc {
        /// Its centre.
        center: DVec3,
        /// Unit normal of its plane.
        axis: DVec3,
    },
}

/// The surface of a face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// With its normal, out of the material.
    Plane {
        /// A point of it.
        origin: DVec3,
        /// Unit, outwards.
        normal: DVec3,
    },
    /// A round bar or a round hole.
    Cylinder {
        /// A point of the axis.
        origin: DVec3,
        /// Unit.
        axis: DVec3,
        /// Radius.
        radius: f64,
        /// The material is outside.
        hole: bool,
    },
}

/// An edge, shared by two faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Vertices.
    pub ends: [u32; 2],
    /// Its course.
    pub curve: Curve,
}

/// A face.
#[derive(Debug, Clone, PartialEq)]
pub struct Face {
    /// Its surface.
    pub surface: Surface,
    /// Closed loops of edges with their senses, the outer first; the material is to the left, seen from outside.
    pub loops: Vec<Vec<(u32, bool)>>,
}

/// One closed body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Body {
    /// Faces of its outer shell.
    pub outer: Vec<u32>,
    /// Faces of each cavity.
    pub voids: Vec<Vec<u32>>,
}

/// Bodies with shared vertices and edges.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Brep {
    /// Points, mm.
    pub vertices: Vec<DVec3>,
    /// Edges.
    pub edges: Vec<Edge>,
    /// Faces.
    pub faces: Vec<Face>,
    /// Bodies.
    pub bodies: Vec<Body>,
    lines: BTreeMap<[u32; 2], u32>,
}

impl Brep {
    pub(super) fn vertex(&mut self, p: DVec3) -> u32 {
        self.vertices.push(p);
        self.vertices.len() as u32 - 1
    }

    /// The straight edge between two vertices, made once, and whether it runs this way.
    pub(super) fn line(&mut self, a: u32, b: u32) -> (u32, bool) {
        let key = [a.min(b), a.max(b)];
        let next = self.edges.len() as u32;
        let edge = *self.lines.entry(key).or_insert(next);
        if edge == next {
            self.edges.push(Edge { ends: key, curve: Curve::Line });
        }
        (edge, a < b)
    }

    pub(super) fn arc(&mut self, ends: [u32; 2], center: DVec3, axis: DVec3) -> u32 {
        self.edges.push(Edge { ends, curve: Curve::Arc { center, axis } });
        self.edges.len() as u32 - 1
    }

    pub(super) fn face(&mut self, surface: Surface, loops: Vec<Vec<(u32, bool)>>) -> u32 {
        self.faces.push(Face { surface, loops });
        self.faces.len() as u32 - 1
    }

    /// Straight edges around given vertices.
    pub(super) fn polygon(&mut self, vertices: &[u32]) -> Vec<(u32, bool)> {
        let n = vertices.len();
        (0..n).map(|k| self.line(vertices[k], vertices[(k + 1) % n])).collect()
    }

    /// True when each edge is used by exactly two faces of one shell, once each way: the shells are closed.
    pub fn is_closed(&self) -> bool {
        let mut uses = vec![[0u32; 2]; self.edges.len()];
        for (edge, forwards) in self.faces.iter().flat_map(|f| f.loops.iter().flatten()) {
            uses[*edge as usize][usize::from(*forwards)] += 1;
        }
        uses.iter().all(|u| *u == [1, 1])
    }

    /// Points along an edge, both ends included; an arc gets at most `turn` radians between two.
    pub(super) fn points(&self, edge: u32, turn: f64) -> Vec<DVec3> {
        let Edge { ends, curve } = self.edges[edge as usize];
        let [a, b] = ends.map(|v| self.vertices[v as usize]);
        match curve {
            Curve::Line => vec![a, b],
            Curve::Arc { center, axis } => {
                let u = a - center;
                let v = axis.cross(u);
                let end = b - center;
                let mut angle = end.dot(v).atan2(end.dot(u));
                if angle <= 1e-9 {
                    angle += std::f64::consts::TAU;
                }
                let count = (angle / turn).ceil().max(1.0) as usize;
                let inner = (1..count).map(|k| {
                    let (s, c) = (angle * k as f64 / count as f64).sin_cos();
                    center + c * u + s * v
                });
                [a].into_iter().chain(inner).chain([b]).collect()
            }
        }
    }
}
