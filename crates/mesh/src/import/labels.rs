//! Which faces are non-design: from a label file and from regions of space.

use super::{ImportError, ImportOptions, NonDesignRegion, Source, soup};
use crate::spatial::SurfaceIndex;
use crate::{Correspondence, Design, FaceId, Part, TriangleMesh, VertexId};
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

/// Over the mean edge length of the earlier mesh: a new face whose middle is nearer to a face of it may lie on that. Holes of twelve edges
/// around, made anew with six, are a fifth of an edge from where they were.
const ON: f64 = 0.25;

/// The cosine of the angle, 30 degrees, by which their normals may differ.
const TURNED: f64 = 0.866;

/// The labels that the faces of `mesh` had in an earlier version. New ones have that of the face on which they lie, if there is one.
pub(super) fn of_earlier(earlier: &Part, mesh: &TriangleMesh) -> Vec<Design> {
    let same = Correspondence::new(&earlier.mesh, mesh).ok();
    let mut index = None;
    let limit = ON * earlier.mesh.mean_edge_length();
    mesh.faces()
        .map(|f| {
            let was = same.as_ref().map_or(FaceId::NONE, |same| same.face_was(f));
            if was.is_some() {
                return earlier.design[was.index()];
            }
            let index = index.get_or_insert_with(|| SurfaceIndex::build(&earlier.mesh));
            let below = index.nearest_within(mesh.centroid(f), limit).map(|nearest| nearest.face);
            let along = |g: &FaceId| mesh.normal(f).dot(earlier.mesh.normal(*g)) > TURNED;
            below.filter(along).map_or(Design::Design, |g| earlier.design[g.index()])
        })
        .collect()
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
