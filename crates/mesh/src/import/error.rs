//! Why a file was refused.

use glam::DVec3;
use thiserror::Error;

/// Why [`super::read`] did not return a part. Coordinates and lengths are those of the file, before conversion to
/// millimetres; faces and vertices are counted from 0 in the order of the file.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// An option has a value that makes no sense.
    #[error("{field}: {problem}")]
    Option {
        /// Name of the option.
        field: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// A region names a file that was not handed in.
    #[error("non_design: the file {path} of a region is missing")]
    MissingRegionFile {
        /// The file.
        path: String,
    },
    /// Neither the content nor the ending is that of a known format.
    #[error("{file}: this is not a mesh that can be read; STL, OFF, OBJ, PLY, VTU, VTI, VTK and INP can")]
    UnknownFormat {
        /// The file.
        file: String,
    },
    /// The file holds no faces.
    #[error("{file}: there are no faces in this file")]
    Empty {
        /// The file.
        file: String,
    },
    /// The file ends too early.
    #[error(
        "{file}: the file is cut off: {expected} should be there, but only {found}; copy or export it again"
    )]
    Truncated {
        /// The file.
        file: String,
        /// What its header announces.
        expected: String,
        /// What is there.
        found: String,
    },
    /// The file does not follow its format.
    #[error("{file}, {place}: {problem}")]
    Malformed {
        /// The file.
        file: String,
        /// A line or an element.
        place: String,
        /// What is wrong there.
        problem: String,
    },
    /// More elements than 32-bit indices can number.
    #[error("{file}: {count} {what} are more than this program can number (2^32 - 2)")]
    TooLarge {
        /// The file.
        file: String,
        /// How many.
        count: usize,
        /// Of what.
        what: &'static str,
    },
    /// A coordinate is not a finite number, or its cube would not be.
    #[error("{file}: {place} has a coordinate that is not a number, or beyond all bounds: {}", at(.point))]
    NotFinite {
        /// The file.
        file: String,
        /// The vertex or the face and corner.
        place: String,
        /// The coordinates.
        point: DVec3,
    },
    /// A face names a vertex that does not exist.
    #[error("{file}: face {face} names vertex {vertex}, but there are only {count} vertices")]
    VertexOutOfRange {
        /// The file.
        file: String,
        /// The face.
        face: u32,
        /// What it names.
        vertex: u32,
        /// How many vertices there are.
        count: usize,
    },
    /// The surface has a border.
    #[error(
        "{file}: the surface is not closed: {}; the longest, {} edges and {length:.4} long, passes {} beside face {face}; \
         close the holes in the program that made the mesh{}",
        count_borders(*.borders), .edges, at(.point), if *.slit { "; nothing is missing there, but its two sides do not share their vertices; where these nearly coincide, weld_tolerance helps" } else { "" }
    )]
    Open {
        /// The file.
        file: String,
        /// Number of border curves.
        borders: usize,
        /// Edges of the longest.
        edges: usize,
        /// Length of the longest.
        length: f64,
        /// A point of the longest.
        point: DVec3,
        /// A face beside that point.
        face: u32,
        /// Whether the sides of the longest border lie on each other, as where vertices fail to meet.
        slit: bool,
    },
    /// An edge with an odd number of faces, or one around which inside and outside can not be told apart.
    #[error(
        "{file}: {count} faces meet at the edge from {} to {} ({}) and do not separate inside from outside; \
         remove inner walls in the program that made the mesh", at(.from), at(.to), name_faces(.faces)
    )]
    NonManifoldEdge {
        /// The file.
        file: String,
        /// Number of faces.
        count: usize,
        /// One end.
        from: DVec3,
        /// Other end.
        to: DVec3,
        /// The first of the faces.
        faces: Vec<u32>,
    },
    /// Two faces lie on each other without being the same.
    #[error(
        "{file}: faces {first} and {second} lie on each other at {}; unite the touching bodies in the program \
         that made the mesh", at(.point)
    )]
    Overlap {
        /// The file.
        file: String,
        /// One face.
        first: u32,
        /// The other.
        second: u32,
        /// Where.
        point: DVec3,
    },
    /// The surface passes through itself.
    #[error(
        "{file}: the surface passes through itself in {pairs} place(s), the first at {} between faces {first} and \
         {second}; unite the bodies in the program that made the mesh, or set allow_self_intersection", at(.point)
    )]
    SelfIntersection {
        /// The file.
        file: String,
        /// Pairs of faces that cross.
        pairs: usize,
        /// One face of the first pair.
        first: u32,
        /// The other.
        second: u32,
        /// Where they cross.
        point: DVec3,
    },
    /// A one-sided surface.
    #[error(
        "{file}: the surface has only one side (like a Moebius strip): faces {first} and {second} can not be \
         turned to agree at {}", at(.point)
    )]
    NotOrientable {
        /// The file.
        file: String,
        /// One face.
        first: u32,
        /// The other.
        second: u32,
        /// Where they meet.
        point: DVec3,
    },
    /// Nothing is enclosed.
    #[error("{file}: the surface encloses no volume; a solid is needed")]
    NoVolume {
        /// The file.
        file: String,
    },
    /// The label file has a line that is no label.
    #[error("{file}, line {line}: a label is 0 or 1, not \"{found}\"")]
    BadLabel {
        /// The label file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// What stands there.
        found: String,
    },
    /// The label file does not have as many labels as the mesh has faces.
    #[error(
        "{file}: {labels} labels for the {faces} faces of {mesh}; one per face, in the order of the file, is needed"
    )]
    LabelCount {
        /// The label file.
        file: String,
        /// Labels in it.
        labels: usize,
        /// The mesh file.
        mesh: String,
        /// Faces in that.
        faces: usize,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Interrupted(#[from] topipe_progress::Interrupted),
}

impl ImportError {
    /// True where the options are at fault, not the data.
    pub fn is_bad_option(&self) -> bool {
        matches!(self, Self::Option { .. } | Self::MissingRegionFile { .. })
    }
}

/// A point with as many digits as a person needs to find it.
fn at(p: &DVec3) -> String {
    let digits = |x: f64| {
        let text = format!("{x:.4}");
        let text = text.trim_end_matches('0').trim_end_matches('.').to_owned();
        if text == "-0" { "0".to_owned() } else { text }
    };
    format!("({}, {}, {})", digits(p.x), digits(p.y), digits(p.z))
}

fn count_borders(count: usize) -> String {
    if count == 1 { "it has 1 border".to_owned() } else { format!("it has {count} borders") }
}

fn name_faces(list: &[u32]) -> String {
    let names: Vec<String> = list.iter().map(u32::to_string).collect();
    format!("faces {}", names.join(", "))
}
