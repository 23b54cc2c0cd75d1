//! The design space: solids added and taken away, and those that stay as they are.

use crate::Shape;
use crate::mesh_solid::MeshSolid;
use crate::shape::Face;
use rayon::prelude::*;
use topipe_fem::{Body, Cuts, Grid, Moments, Selector, Surface, SurfacePoint, moments_of_points};
use topipe_mesh::{DVec3, TriangleMesh};

/// Points per axis at which a cell at the border of the domain is looked at.
const SAMPLES: usize = 6;

/// A domain made of solids.
#[derive(Debug, Clone)]
pub(crate) struct Domain {
    /// Counts as the first of the solids that are added.
    pub(crate) mesh: Option<MeshSolid>,
    pub(crate) add: Vec<Shape>,
    pub(crate) subtract: Vec<Shape>,
    pub(crate) non_design: Vec<Shape>,
}

impl Domain {
    /// How far outside of the domain a point is (negative inside), and the face that decides it. The normal of a face that was
    /// taken away points into it; the sign is for that.
    pub(crate) fn outside(&self, p: DVec3) -> (f64, Face, f64) {
        let mut best = (f64::INFINITY, Face::Plane(DVec3::ZERO, DVec3::Z), 1.0);
        if let Some(mesh) = &self.mesh {
            let (distance, face) = mesh.nearest_face(p);
            best = (distance, face, 1.0);
        }
        for shape in &self.add {
            let (distance, face) = shape.nearest_face(p);
            if distance < best.0 {
                best = (distance, face, 1.0);
            }
        }
        for shape in &self.subtract {
            let (distance, face) = shape.nearest_face(p);
            if -distance > best.0 {
                best = (-distance, face, -1.0);
            }
        }
        best
    }

    /// How far outside of the non-design solids a point is.
    pub(crate) fn outside_non_design(&self, p: DVec3) -> (f64, Face, f64) {
        let mut best = (f64::INFINITY, Face::Plane(DVec3::ZERO, DVec3::Z), 1.0);
        for shape in &self.non_design {
            let (distance, face) = shape.nearest_face(p);
            if distance < best.0 {
                best = (distance, face, 1.0);
            }
        }
        best
    }

    /// What of each cell of the grid lies in the domain.
    pub(crate) fn body(&self, grid: Grid) -> Body {
        let of_cell = |index: usize| {
            let middle = grid.middle(grid.place(index));
            let distance = self.outside(middle).0;
            // Half of a cell's diagonal.
            let reach = 0.8661 * grid.size;
            if distance.abs() > reach {
                return (if distance < 0.0 { 1.0 } else { 0.0 }, None);
            }
            let at = |k: usize| {
                let at = [k % SAMPLES, k / SAMPLES % SAMPLES, k / SAMPLES / SAMPLES];
                DVec3::from_array(at.map(|i| (2 * i + 1) as f64 / SAMPLES as f64 - 1.0))
            };
            let is_inside = |p: &DVec3| self.outside(middle + 0.5 * grid.size * *p).0 < 0.0;
            let inside: Vec<DVec3> = (0..SAMPLES.pow(3)).map(at).filter(is_inside).collect();
            let fraction = inside.len() as f32 / SAMPLES.pow(3) as f32;
            let is_cut = !inside.is_empty() && inside.len() < SAMPLES.pow(3);
            (fraction, is_cut.then(|| moments_of_points(inside, 1.0 / SAMPLES.pow(3) as f64)))
        };
        let cells: Vec<(f32, Option<Moments>)> = (0..grid.count()).into_par_iter().map(of_cell).collect();
        let mut cuts = Cuts::default();
        for (cell, (_, moments)) in cells.iter().enumerate() {
            if let Some(moments) = moments {
                cuts.cells.push(cell as u32);
                cuts.moments.push(*moments);
            }
        }
        Body { grid, fraction: cells.into_iter().map(|c| c.0).collect(), cuts }
    }
}

impl Surface for Domain {
    fn points(&self, selector: &Selector, size: f64) -> Vec<SurfacePoint> {
        let mut points = Vec::new();
        let step = 1e-4 * size;
        if let Some(solid) = &self.mesh {
            let border = |p: &SurfacePoint| {
                self.outside(p.point - step * p.normal).0 < 0.0
                    && self.outside(p.point + step * p.normal).0 > 0.0
            };
            points.extend(solid.mesh.points(selector, size).into_iter().filter(border));
        }
        let solids = self.add.iter().map(|s| (s, 1.0)).chain(self.subtract.iter().map(|s| (s, -1.0)));
        for (k, (shape, sign)) in solids.enumerate() {
            shape.surface_points(size, |point, normal, area| {
                let normal = normal * sign;
                // On the border, and not on a face that another solid covers; of two faces in one place the first counts.
                let border = self.outside(point - step * normal).0 < 0.0
                    && self.outside(point + step * normal).0 > 0.0;
                if border && selector.contains(point) && !self.covered(k, point, step) {
                    points.push(SurfacePoint { point, normal, area });
                }
            });
        }
        // Loads act on non-design parts, whose surface may lie within the domain.
        for shape in &self.non_design {
            shape.surface_points(size, |point, normal, area| {
                let within = self.outside(point + step * normal).0 < 0.0
                    && self.outside(point - step * normal).0 < 0.0;
                if within
                    && selector.contains(point)
                    && self.outside_non_design(point + step * normal).0 > 0.0
                {
                    points.push(SurfacePoint { point, normal, area });
                }
            });
        }
        points
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let mesh = self.mesh.iter().map(|solid| TriangleMesh::bounds(&solid.mesh));
        mesh.chain(self.add.iter().map(Shape::bounds))
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), (a, b)| (l.min(a), h.max(b)))
    }
}

impl Domain {
    /// Whether a point of the surface of solid `k` also lies on that of an earlier one.
    fn covered(&self, k: usize, p: DVec3, step: f64) -> bool {
        let shapes = self.add.iter().chain(&self.subtract).take(k).map(|shape| shape.nearest_face(p).0);
        self.mesh
            .iter()
            .map(|mesh| mesh.nearest_face(p).0)
            .chain(shapes)
            .any(|distance| distance.abs() < step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plate_with_a_hole() {
        let domain = Domain {
            mesh: None,
            add: vec![
                Shape::Box { min: [0.0; 3], max: [10.0, 10.0, 2.0] },
                Shape::Box { min: [5.0, 0.0, 0.0], max: [12.0, 10.0, 2.0] },
            ],
            subtract: vec![Shape::Cylinder {
                point: [4.0, 5.0, 0.0],
                axis: [0.0, 0.0, 1.0],
                length: 2.0,
                diameter: 3.0,
            }],
            non_design: vec![],
        };
        let grid = Grid::around(DVec3::ZERO, DVec3::new(12.0, 10.0, 2.0), 0.5, 0);
        let volume = domain.body(grid).volume();
        let exact = 240.0 - 2.0 * std::f64::consts::PI * 2.25;
        assert!((volume / exact - 1.0).abs() < 2e-3, "{volume} {exact}");
        let all = Selector::Box(DVec3::splat(-1.0), DVec3::splat(20.0));
        let points = domain.points(&all, 0.1);
        let area: f64 = points.iter().map(|p| p.area).sum();
        let walls = 2.0 * 44.0 + 2.0 * 3.0 * std::f64::consts::PI;
        let faces = 2.0 * (120.0 - std::f64::consts::PI * 2.25);
        assert!((area / (walls + faces) - 1.0).abs() < 0.02, "{area} {}", walls + faces);
    }
}
