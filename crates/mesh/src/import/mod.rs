//! Reads a mesh file and makes a closed, oriented, manifold [`Part`] of it, or says why it can not.
//!
//! Formats: STL (binary and ASCII), OFF, OBJ, PLY; density fields in VTU, VTI and legacy VTK; decks of CalculiX and Abaqus. They
//! are told apart by content first and by ending second.
//!
//! Guarantees of a returned part: every edge has two faces, every vertex one fan, faces look out of the material,
//! coordinates are finite and in millimetres, each kept shell encloses volume, and every vertex and every label is
//! traced back to the file. The same bytes and options give the same part. No input makes the reader panic, and none
//! makes it allocate much more than its own size.
//!
//! Repairs are made only where there is one reasonable answer, and each is counted in
//! [`ImportRecord::repairs`](crate::ImportRecord::repairs). Holes are not filled.
//!
//! Non-guarantees: triangles may be badly shaped, and faces may touch or overlap within one plane.
//!
//! ```
//! let cube = "OFF 8 6 0
//! 0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1
//! 4 3 2 1 0\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7";
//! let part = topipe_mesh::import::read("cube.off", cube.as_bytes(), &Default::default())?;
//! assert_eq!(part.mesh.volume(), 1.0);
//! # Ok::<(), topipe_mesh::import::ImportError>(())
//! ```

mod border;
mod crossing;
mod density;
mod draft;
mod error;
mod format;
mod inp;
mod labels;
mod legacy_vtk;
mod manifold;
mod obj;
mod off;
mod options;
mod ply;
mod shells;
mod slivers;
mod soup;
mod stl;
mod vtk;

pub use error::ImportError;
pub use options::{Components, ImportOptions, Inside, NonDesignRegion, Units};

use crate::{Design, ImportRecord, Part};
use std::collections::BTreeMap;
use topipe_progress::Progress;

/// A mesh file with the files that belong to it.
#[derive(Debug, Clone)]
pub struct Source<'a> {
    /// Name for messages; its ending helps to tell the format.
    pub name: &'a str,
    /// Content.
    pub bytes: &'a [u8],
    /// Name and content of the label file: one 0 or 1 per face of the mesh file, in its order; 1 is non-design.
    pub labels: Option<(&'a str, &'a [u8])>,
    /// An earlier version of the mesh, in mm, which lends its labels: see [`read_source`].
    pub earlier: Option<&'a Part>,
    /// Contents of the files named by [`ImportOptions::region_files`].
    pub region_files: BTreeMap<String, &'a [u8]>,
}

impl<'a> Source<'a> {
    /// A mesh file alone.
    pub fn new(name: &'a str, bytes: &'a [u8]) -> Self {
        Self { name, bytes, labels: None, earlier: None, region_files: BTreeMap::new() }
    }
}

/// Reads a mesh file without labels; see [`read_source`].
pub fn read(name: &str, bytes: &[u8], options: &ImportOptions) -> Result<Part, ImportError> {
    read_source(&Source::new(name, bytes), options, &Progress::silent())
}

/// Reads a mesh file, its labels and regions, and repairs what can be repaired.
///
/// Where it has no labels of its own, faces have those that they had in an earlier version, see [`Correspondence`](crate::Correspondence);
/// new ones that lie on a face of it, that of this one, and others are design.
pub fn read_source(
    source: &Source<'_>,
    options: &ImportOptions,
    progress: &Progress,
) -> Result<Part, ImportError> {
    if let Some((field, problem)) = options.problem() {
        return Err(ImportError::Option { field, problem });
    }
    let file = source.name;
    const STEPS: u64 = 4;
    progress.step(0, STEPS, "reading");
    let mut soup = format::parse(file, source.bytes, options)?;
    let own_labels = soup.non_design.take();
    let labels = match source.labels {
        // A field may bring labels of its own.
        None => own_labels
            .map(|list| list.iter().map(|&n| if n { Design::NonDesign } else { Design::Design }).collect()),
        Some((name, bytes)) => {
            let labels = labels::parse(name, bytes)?;
            if labels.len() != soup.face_count {
                return Err(ImportError::LabelCount {
                    file: name.to_owned(),
                    labels: labels.len(),
                    mesh: file.to_owned(),
                    faces: soup.face_count,
                });
            }
            Some(labels)
        }
    };
    if soup.triangles.len() >= (u32::MAX / 3) as usize {
        return Err(ImportError::TooLarge {
            file: file.to_owned(),
            count: 3 * soup.triangles.len(),
            what: "half-edges",
        });
    }
    progress.check()?;

    progress.step(1, STEPS, "welding");
    let format = match soup.taken.as_str() {
        "" => soup.format.to_owned(),
        taken => format!("{}: {taken}", soup.format),
    };
    let tolerance = if options.weld_tolerance > 0.0 {
        let bounds = soup.positions.iter().fold(None, |b: Option<(glam::DVec3, glam::DVec3)>, &p| {
            Some(b.map_or((p, p), |(low, high)| (low.min(p), high.max(p))))
        });
        bounds.map_or(0.0, |(low, high)| options.weld_tolerance * (high - low).length())
    } else {
        0.0
    };
    let mut draft = draft::weld(soup, tolerance);
    if draft.mesh.triangles.is_empty() {
        return Err(ImportError::NoVolume { file: file.to_owned() });
    }
    progress.check()?;

    progress.step(2, STEPS, "repairing");
    let connectivity = manifold::make_manifold(file, &mut draft)?;
    progress.check()?;
    shells::select(file, &mut draft, &connectivity, options.components)?;
    slivers::flip_slivers(&mut draft);
    if !options.allow_self_intersection {
        crossing::refuse_crossings(file, &draft)?;
    }
    progress.check()?;

    progress.step(3, STEPS, "labelling");
    let factor = options.units.in_mm() * options.scale;
    for p in &mut draft.mesh.positions {
        *p *= factor;
        if !soup::in_range(*p) {
            let problem = format!("coordinates times {factor} are beyond all bounds");
            return Err(ImportError::Option { field: "scale", problem });
        }
    }
    let mut part = Part::new(draft.mesh);
    part.provenance = draft.provenance;
    part.import = ImportRecord { format, scale_to_mm: factor, repairs: draft.repairs };
    if let Some(labels) = labels {
        part.design = draft.face_of.iter().map(|&f| labels[f as usize]).collect();
    } else if let Some(earlier) = source.earlier {
        part.design = labels::of_earlier(earlier, &part.mesh);
    }
    labels::mark_regions(&part.mesh, source, options, &mut part.design)?;
    progress.step(STEPS, STEPS, "done");
    Ok(part)
}
