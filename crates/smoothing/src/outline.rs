//! Keeps the triangles of regions from turning over while their outlines slide.
//!
//! The inside of a region is frozen, so an outline that straightens can pass a frozen vertex. On tetrahedral
//! results this did not happen once; on marching-cubes surfaces, whose flat faces have slivers along their outlines, it
//! turned triangles over.

use crate::features::Features;
use crate::kernel::Domain;
use topipe_mesh::{DVec3, RegionShape, TriangleMesh};

/// A triangle of a region may lose this much of its first area, not more.
const LEAST_SHARE: f64 = 0.1;

/// The triangles of regions with a sliding vertex.
pub(crate) struct OutlineGuard {
    faces: Vec<Guarded>,
    slides: Vec<bool>,
}

struct Guarded {
    vertices: [usize; 3],
    normal: DVec3,
    least: f64,
}

impl OutlineGuard {
    pub(crate) fn new(mesh: &TriangleMesh, features: &Features, domain: &Domain) -> Self {
        let mut slides = vec![false; mesh.vertex_count()];
        for slide in &domain.slides {
            slides[slide.vertex as usize] = true;
        }
        let mut faces = Vec::new();
        if domain.slides.is_empty() {
            return Self { faces, slides };
        }
        for f in mesh.faces() {
            let vertices = mesh.triangles[f.index()].map(|v| v.index());
            let region = features.region_of_face[f.index()];
            if !region.is_some() || !vertices.iter().any(|&v| slides[v]) {
                continue;
            }
            let area = mesh.area_vector(f);
            let normal = match features.regions[region.index()].shape {
                RegionShape::Plane { normal, .. } => normal,
                RegionShape::Cylinder { .. } => area.normalize_or_zero(),
            };
            // A sliver that is turned over from the start has nothing to lose.
            if normal.dot(area) > 0.0 {
                faces.push(Guarded { vertices, normal, least: LEAST_SHARE * normal.dot(area) });
            }
        }
        Self { faces, slides }
    }

    /// Takes the step of sliding vertices back where it would shrink a triangle too far. `current` has no such
    /// triangle, so this ends at the latest when all of them are back.
    pub(crate) fn hold(&self, current: &[DVec3], next: &mut [DVec3]) {
        loop {
            let mut held = false;
            for face in &self.faces {
                let [a, b, c] = face.vertices.map(|v| next[v]);
                if face.normal.dot((b - a).cross(c - a)) >= face.least {
                    continue;
                }
                for v in face.vertices {
                    if self.slides[v] && next[v] != current[v] {
                        next[v] = current[v];
                        held = true;
                    }
                }
            }
            if !held {
                return;
            }
        }
    }
}
