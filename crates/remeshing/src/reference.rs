//! Where a point of the new mesh belongs on the lifted surface.

use crate::faces::Faces;
use crate::surface::Surface;
use rustc_hash::FxHashMap;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{DVec3, FaceId, RegionShape, TriangleMesh, VertexId, meet};

/// Facets are cut until each piece turns by about this, radians: then the point of a piece nearest to another is near enough to the one
/// of the surface.
const PIECE_TURN: f64 = 0.1;

/// Most pieces along a side.
const MOST_PIECES: u32 = 8;

/// Two shapes touch where the sine of the angle between them is smaller.
const TOUCH: f64 = 0.05;

/// One chart, for projection.
enum Chart {
    Known(RegionShape),
    Curved { index: SurfaceIndex, mesh: TriangleMesh, origin: Vec<(FaceId, [[f64; 3]; 3])> },
}

/// The lifted surface of a part, chart by chart: a point near a thin wall is not drawn to its other side.
pub(crate) struct Reference<'a> {
    surface: &'a Surface<'a>,
    charts: Vec<Chart>,
}

impl<'a> Reference<'a> {
    pub(crate) fn new(mesh: &TriangleMesh, faces: &Faces, surface: &'a Surface<'a>) -> Self {
        let mut own: Vec<Vec<FaceId>> = vec![Vec::new(); faces.shape.len()];
        for f in mesh.faces() {
            own[faces.chart[f.index()] as usize].push(f);
        }
        let chart = |(own, shape): (&Vec<FaceId>, &Option<RegionShape>)| match shape {
            Some(shape) => Chart::Known(*shape),
            None => curved(own, surface),
        };
        let charts = own.iter().zip(&faces.shape).map(chart).collect();
        Self { surface, charts }
    }

    /// A point near `p` on the border of two charts, on the shapes of both as far as they are known. Where they touch, on the first:
    /// rounding would decide where they meet.
    pub(crate) fn between(&self, charts: [u32; 2], p: DVec3) -> DVec3 {
        let known = charts.map(|c| match &self.charts[c as usize] {
            Chart::Known(shape) => Some(shape),
            Chart::Curved { .. } => None,
        });
        match known {
            [Some(a), Some(b)] if a.normal(p).cross(b.normal(p)).length() > TOUCH => {
                let on_both = meet(&[a, b], p);
                if on_both.is_finite() { on_both } else { p }
            }
            [Some(shape), _] | [_, Some(shape)] => shape.project(p),
            _ => p,
        }
    }

    /// The point of the lifted `chart` near `p`.
    pub(crate) fn project(&self, chart: u32, p: DVec3) -> DVec3 {
        match &self.charts[chart as usize] {
            Chart::Known(shape) => shape.project(p),
            Chart::Curved { index, mesh, origin } => {
                let Some(nearest) = index.nearest(p) else { return p };
                let local = barycentric(nearest.point, mesh.corners(nearest.face));
                let (facet, corners) = &origin[nearest.face.index()];
                let weights = [0, 1, 2].map(|i| (0..3).map(|k| local[k] * corners[k][i]).sum());
                self.surface.on_facet(*facet, weights)
            }
        }
    }
}

fn curved(own: &[FaceId], surface: &Surface<'_>) -> Chart {
    let mut lifted = TriangleMesh::default();
    let mut origin = Vec::new();
    let mut places: FxHashMap<(u32, u32), VertexId> = FxHashMap::default();
    for &f in own {
        let n = ((surface.turn(f) / PIECE_TURN).ceil() as u32).clamp(1, MOST_PIECES);
        places.clear();
        let at = |i: u32, j: u32| {
            let (v, w) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            [1.0 - v - w, v, w]
        };
        let mut vertex = |lifted: &mut TriangleMesh, i: u32, j: u32| {
            *places.entry((i, j)).or_insert_with(|| {
                lifted.positions.push(surface.on_facet(f, at(i, j)));
                VertexId::new(lifted.positions.len() - 1)
            })
        };
        for i in 0..n {
            for j in 0..n - i {
                let mut pieces = vec![[(i, j), (i + 1, j), (i, j + 1)]];
                if i + j + 2 <= n {
                    pieces.push([(i + 1, j), (i + 1, j + 1), (i, j + 1)]);
                }
                for piece in pieces {
                    let corners = piece.map(|(i, j)| vertex(&mut lifted, i, j));
                    lifted.triangles.push(corners);
                    origin.push((f, piece.map(|(i, j)| at(i, j))));
                }
            }
        }
    }
    Chart::Curved { index: SurfaceIndex::build(&lifted), mesh: lifted, origin }
}

/// Weights of the corners at a point of a triangle; those of the middle where it has no area.
pub(crate) fn barycentric(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (e, f, g) = (b - a, c - a, p - a);
    let (ee, ef, ff) = (e.dot(e), e.dot(f), f.dot(f));
    let (ge, gf) = (g.dot(e), g.dot(f));
    let det = ee * ff - ef * ef;
    if det <= 1e-14 * ee * ff {
        return [1.0 / 3.0; 3];
    }
    let v = ((ff * ge - ef * gf) / det).clamp(0.0, 1.0);
    let w = ((ee * gf - ef * ge) / det).clamp(0.0, 1.0 - v);
    [1.0 - v - w, v, w]
}
