//! Volume, area, bounds, Euler characteristic.
//!
//! Sums run in a fixed order or over fixed chunks, so the same mesh gives the same bits for any number of threads.

use crate::{Connectivity, TriangleMesh, VertexId};
use glam::DVec3;
use rayon::prelude::*;

/// Faces whose sum is one task. Part of the result's last digits, so it is fixed.
const CHUNK: usize = 1 << 14;

impl TriangleMesh {
    /// The signed volume inside a closed mesh, by the divergence theorem: positive when it is oriented outward.
    ///
    /// Summed about the centre of the bounding box, so that a part far from the origin keeps its digits.
    pub fn volume(&self) -> f64 {
        let (low, high) = self.bounds();
        let center = (low + high) / 2.0;
        self.faces()
            .map(|f| {
                let [a, b, c] = self.corners(f).map(|p| p - center);
                a.dot(b.cross(c))
            })
            .sum::<f64>()
            / 6.0
    }

    /// The total area of the triangles.
    pub fn area(&self) -> f64 {
        self.faces().map(|f| self.area_vector(f).length()).sum::<f64>() / 2.0
    }

    /// The corners of the axis-aligned bounding box of all vertices; zeros for an empty mesh.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        match self.positions.split_first() {
            None => (DVec3::ZERO, DVec3::ZERO),
            Some((&p, rest)) => rest.iter().fold((p, p), |(low, high), &q| (low.min(q), high.max(q))),
        }
    }

    /// The length of the diagonal of the bounding box: the length to which deviations are relative.
    pub fn diagonal(&self) -> f64 {
        let (low, high) = self.bounds();
        (high - low).length()
    }

    /// The mean length of the half-edges; 0 without faces.
    pub fn mean_edge_length(&self) -> f64 {
        if self.triangles.is_empty() {
            return 0.0;
        }
        let around = |t: &[VertexId; 3]| {
            let [a, b, c] = t.map(|v| self.position(v));
            a.distance(b) + b.distance(c) + c.distance(a)
        };
        let sum_of = |chunk: &[[VertexId; 3]]| -> f64 { chunk.iter().map(around).sum() };
        // A single chunk starts no threads.
        let chunks: Vec<f64> = if self.face_count() <= CHUNK {
            vec![sum_of(&self.triangles)]
        } else {
            self.triangles.par_chunks(CHUNK).map(sum_of).collect()
        };
        let sum: f64 = chunks.iter().sum();
        sum / (3 * self.face_count()) as f64
    }

    /// One unit normal per vertex: the mean of the face normals, weighted by the angle at the vertex, or zero where
    /// that vanishes.
    pub fn vertex_normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.vertex_count()];
        for f in self.faces() {
            let normal = self.normal(f);
            let corners = self.corners(f);
            for k in 0..3 {
                let (p, q, r) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
                let angle = (q - p).angle_between(r - p);
                if angle.is_finite() {
                    normals[self.triangles[f.index()][k].index()] += angle * normal;
                }
            }
        }
        normals.iter().map(|n| n.normalize_or_zero()).collect()
    }
}

impl Connectivity {
    /// V - E + F over the vertices that have faces.
    pub fn euler_characteristic(&self, mesh: &TriangleMesh) -> i64 {
        let used = mesh.vertices().filter(|&v| self.outgoing(v).next().is_some()).count();
        used as i64 - self.edge_count() as i64 + mesh.face_count() as i64
    }

    /// The genus of a closed surface, summed over its components: `components - euler / 2`. `None` with a border.
    pub fn genus(&self, mesh: &TriangleMesh) -> Option<i64> {
        if !self.is_closed() {
            return None;
        }
        let (_, components) = self.components();
        Some(components as i64 - self.euler_characteristic(mesh) / 2)
    }
}
