//! What the edges of a layout are, and what is fixed before the fit.

use crate::SplineFitError;
use crate::borders::sharpness;
use crate::borders::{Borders, borders, connectivity};
use crate::corners::{Corners, corners};
use crate::fans::{EdgeRole, Sectors, quads_beside};
use crate::frames::{Given, crease_tangents};
use crate::samples::PatchSamples;
use std::sync::Arc;
use topipe_mesh::{FeatureKind, RegionShape};
use topipe_progress::Progress;
use topipe_quad_matching::QuadLayout;

/// Radius of the local fits over the length of a span.
const REACH: f64 = 1.25;
/// From this number of spans on the local fits stay as they are: knots then make the surface follow its normals, and
/// no longer finer waves of the mesh. (With eight, patches pass through each other on monster-lite.)
const FINEST_REACH: usize = 4;

/// Rounds in which corners are looked for: one finds nearly all, the second those at the other ends of its creases.
const CORNER_ROUNDS: usize = 4;

/// Roles of the edges, borders, and the fans around the vertices.
pub(crate) struct Setting<'a> {
    pub(crate) layout: &'a QuadLayout,
    pub(crate) borders: Borders,
    pub(crate) beside: Vec<Vec<(u32, u8)>>,
    pub(crate) roles: Vec<EdgeRole>,
    /// Why each edge is a feature, where the mesh is sharp along it.
    pub(crate) features: Vec<Option<FeatureKind>>,
    /// The shape that a patch meets smoothly along its border.
    pub(crate) tangent_to: Vec<Option<RegionShape>>,
    pub(crate) sectors: Sectors,
    lengths: Vec<f64>,
}

impl<'a> Setting<'a> {
    pub(crate) fn new(layout: &'a QuadLayout) -> Result<Self, SplineFitError> {
        let mesh = &layout.part.mesh;
        let connectivity = connectivity(layout)?;
        let borders = borders(layout, &connectivity)?;
        let beside = quads_beside(layout);
        let (mut roles, mut features) = (Vec::new(), Vec::new());
        for (e, edge) in layout.edges.iter().enumerate() {
            let feature = match &borders.curves[e] {
                Some(curve) => curve.feature,
                // Where a feature fades the mesh is smooth, and so is the surface.
                None if edge.feature.is_some() => {
                    sharpness::feature(layout, &connectivity, e, [None, None], &[]).and(edge.feature)
                }
                None => None,
            };
            features.push(feature);
            roles.push(match beside[e].len() {
                0 => EdgeRole::Inner,
                1 => EdgeRole::Border,
                _ if feature.is_some() => EdgeRole::Crease,
                _ => EdgeRole::Smooth,
            });
        }
        let mut tangent_to = vec![None; layout.edges.len()];
        for face in &borders.faces {
            for side in face.loops.iter().flatten() {
                let e = side.edge as usize;
                if roles[e] == EdgeRole::Border && features[e].is_none() {
                    tangent_to[e] = Some(face.shape);
                }
            }
        }
        let sectors = Sectors::new(layout, &roles);
        let length = |path: &[topipe_mesh::VertexId]| -> f64 {
            path.windows(2).map(|w| mesh.position(w[0]).distance(mesh.position(w[1]))).sum()
        };
        let lengths = layout.edges.iter().map(|e| length(&e.path)).collect();
        for (e, role) in roles.iter().enumerate() {
            if matches!(role, EdgeRole::Border | EdgeRole::Inner) && borders.curves[e].is_none() {
                let at = mesh.position(layout.edges[e].path[0]);
                return Err(SplineFitError::Singular { what: "edge", index: e, x: at.x, y: at.y, z: at.z });
            }
        }
        Ok(Self { layout, borders, beside, roles, features, tangent_to, sectors, lengths })
    }

    /// Radius of the local fits, one per edge.
    pub(crate) fn reach(&self, spans: &[usize]) -> Vec<f64> {
        self.lengths.iter().zip(spans).map(|(l, &k)| REACH * l / k.min(FINEST_REACH) as f64).collect()
    }

    pub(crate) fn given<'b>(&'b self, samples: &'b [Arc<PatchSamples>], reach: &'b [f64]) -> Given<'b> {
        Given {
            layout: self.layout,
            roles: &self.roles,
            sectors: &self.sectors,
            samples,
            curves: &self.borders.curves,
            vertices: &self.borders.vertices,
            tangent_to: &self.tangent_to,
            reach,
        }
    }

    /// Gives up tangency where the mesh has corners.
    pub(crate) fn make_corners(&mut self, samples: &[Arc<PatchSamples>], spans: usize, progress: &Progress) {
        let reach = self.reach(&vec![spans; self.lengths.len()]);
        let mut creases = 0;
        // A crease may end at another border, and need another one there.
        for _ in 0..CORNER_ROUNDS {
            let given = self.given(samples, &reach);
            let corners = corners(&given, &crease_tangents(&given));
            if corners == Corners::default() {
                break;
            }
            for &e in &corners.creases {
                self.roles[e] = EdgeRole::Crease;
                self.features[e] = Some(FeatureKind::Sharp);
            }
            for &e in &corners.sharp_borders {
                self.tangent_to[e] = None;
                self.features[e] = Some(FeatureKind::RegionBorder);
                if let Some(curve) = &mut self.borders.curves[e] {
                    curve.feature = self.features[e];
                }
            }
            creases += corners.creases.len();
            self.sectors = Sectors::new(self.layout, &self.roles);
        }
        if creases > 0 {
            progress
                .remark(&format!("{creases} edges run into corners of borders and are creases that fade"));
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::samples::{faces_by_quad, sample};
    use topipe_mesh::import::{ImportOptions, Source, read_source};
    use topipe_progress::Progress;

    /// The layout of a part among the fixtures, with what is fitted.
    pub(crate) fn layout(name: &str) -> (QuadLayout, Vec<Arc<PatchSamples>>) {
        let place = format!("{}/../../fixtures/{name}/{name}", env!("CARGO_MANIFEST_DIR"));
        let silent = Progress::silent();
        let [bytes, labels] =
            [".stl", ".labels.csv"].map(|ending| std::fs::read(place.clone() + ending).unwrap());
        let source = Source { labels: Some(("labels.csv", &labels)), ..Source::new("part.stl", &bytes) };
        let part = read_source(&source, &ImportOptions::default(), &silent).unwrap();
        let part = topipe_smoothing::smooth(&part, &Default::default(), &silent).unwrap();
        let tiling = topipe_tiling::tile(&part, &Default::default(), &silent).unwrap();
        let layout = topipe_quad_matching::match_quads(&tiling, &Default::default(), &silent).unwrap();
        let faces = faces_by_quad(&layout);
        let samples = faces.iter().enumerate().map(|(quad, faces)| sample(&layout, quad, faces).unwrap());
        let samples = samples.map(Arc::new).collect();
        (layout, samples)
    }

    /// Where two borders fix a tangent plane that is far from the mesh's, an edge between them becomes a crease; afterwards no
    /// corner of that kind is left, and nothing else has changed.
    #[test]
    fn corners_of_borders_become_creases_until_none_is_left() {
        for name in ["y-form", "bracket"] {
            let (layout, samples) = layout(name);
            let mut setting = Setting::new(&layout).unwrap();
            let (roles, tangent_to) = (setting.roles.clone(), setting.tangent_to.clone());
            let found = |setting: &Setting<'_>| {
                let reach = setting.reach(&vec![4; roles.len()]);
                let given = setting.given(&samples, &reach);
                corners(&given, &crease_tangents(&given))
            };
            assert_ne!(found(&setting), Corners::default(), "{name}: nothing to do");
            setting.make_corners(&samples, 4, &Progress::silent());
            assert_eq!(found(&setting), Corners::default(), "{name}");
            let on_border = |v: u32| {
                let ends = layout.edges.iter().zip(&roles).filter(|(edge, _)| edge.ends.contains(&v));
                ends.into_iter().any(|(_, role)| *role == EdgeRole::Border)
            };
            let changed: Vec<usize> = (0..roles.len()).filter(|&e| roles[e] != setting.roles[e]).collect();
            assert!(!changed.is_empty(), "{name}");
            for e in changed {
                assert_eq!((roles[e], setting.roles[e]), (EdgeRole::Smooth, EdgeRole::Crease));
                assert!(layout.edges[e].ends.iter().any(|&v| on_border(v)), "{name}: edge {e}");
            }
            let lost =
                (0..roles.len()).filter(|&e| tangent_to[e].is_some() && setting.tangent_to[e].is_none());
            assert!(lost.count() > 0, "{name}");
            assert!((0..roles.len()).all(|e| setting.tangent_to[e].is_none() || tangent_to[e].is_some()));
        }
    }
}
