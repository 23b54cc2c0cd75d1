//! Which faces are non-design: from a label file and from regions of space.

use super::{ImportError, ImportOptions, NonDesignRegion, Source, soup};
use crate::spatial::SurfaceIndex;
use crate::{Design, TriangleMesh, VertexId};
use glam::DVec3;

/// Reads one 0 or 1 per line.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Vec<Design>, ImportError> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_end();
    if text.is_empty() {
        return Ok(Vec::new());
    }
    let mut labels = Vec::with_capacity(text.len() / 2 + 1);
    for (line, word) in soup::lines(text) {
        labels.push(match word {
            b"0" => Design::Design,
            b"1" => Design::NonDesign,
            other => {
                return Err(ImportError::BadLabel {
                    file: name.to_owned(),
                    line,
                    found: soup::excerpt(other),
                });
            }
        });
    }
    Ok(labels)
}

/// A region, ready to be asked.
enum Space {
    Box { min: DVec3, max: DVec3 },
    Cylinder { point: DVec3, axis: DVec3, length: f64, radius: f64 },
    Mesh(SurfaceIndex),
}

impl Space {
    /// Whether `p` is in the region or nearer to it than about `slack`.
    fn contains(&self, p: DVec3, slack: f64) -> bool {
        match self {
            Self::Box { min, max } => {
                let slack = DVec3::splat(slack);
                p.cmpge(*min - slack).all() && p.cmple(*max + slack).all()
            }
            Self::Cylinder { point, axis, length, radius } => {
                let along = (p - *point).dot(*axis);
                let off = (p - *point - *axis * along).length();
                (-slack..=length + slack).contains(&along) && off <= radius + slack
            }
            Self::Mesh(index) => index.is_within(p, slack) || index.contains(p),
        }
    }
}

/// Marks the faces of `mesh` (in mm) whose corners and centroid lie in one of the regions.
pub(super) fn mark_regions(
    mesh: &TriangleMesh,
    source: &Source<'_>,
    options: &ImportOptions,
    design: &mut [Design],
) -> Result<(), ImportError> {
    let slack = options.region_tolerance * mesh.diagonal();
    for region in &options.non_design {
        let space = match region {
            NonDesignRegion::Box { min, max } => {
                Space::Box { min: DVec3::from_array(*min), max: DVec3::from_array(*max) }
            }
            NonDesignRegion::Cylinder { point, axis, length, diameter } => Space::Cylinder {
                point: DVec3::from_array(*point),
                axis: DVec3::from_array(*axis).normalize_or_zero(),
                length: *length,
                radius: diameter / 2.0,
            },
            NonDesignRegion::Stl { path } => {
                let bytes = source
                    .region_files
                    .get(path)
                    .ok_or_else(|| ImportError::MissingRegionFile { path: path.clone() })?;
                let plain = ImportOptions {
                    units: options.units,
                    scale: options.scale,
                    components: super::Components::All,
                    ..ImportOptions::default()
                };
                Space::Mesh(SurfaceIndex::build(&super::read(path, bytes, &plain)?.mesh))
            }
        };
        let inside: Vec<bool> = mesh.positions.iter().map(|&p| space.contains(p, slack)).collect();
        for f in mesh.faces() {
            let corners: [VertexId; 3] = mesh.triangles[f.index()];
            if corners.iter().all(|v| inside[v.index()]) && space.contains(mesh.centroid(f), slack) {
                design[f.index()] = Design::NonDesign;
            }
        }
    }
    Ok(())
}
