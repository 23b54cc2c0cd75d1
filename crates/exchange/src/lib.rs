//! Triangle meshes with numbers and groups on them, in the formats that other programs read.
//!
//! | function | format | for |
//! |---|---|---|
//! | [`glb`] | glTF 2.0, binary | viewers, office programs, the web |
//! | [`three_mf`] | 3MF core | printing |
//! | [`vtp`] | VTK polygonal data, XML | ParaView, PyVista |
//! | [`legacy_vtk`] | VTK legacy, text | older VTK readers |
//! | [`inp`] | CalculiX / Abaqus deck with element and node sets | preprocessors |
//!
//! Guarantees: the same bytes for the same model (no dates, no names of machines); lengths stay millimetres where the
//! format has no unit of its own (glTF has: metres, and y up; a node turns and scales). A list of numbers that does not
//! fit the mesh is refused before anything is written.
//!
//! Not guaranteed: f64 coordinates in glTF (f32).

mod corners;
mod glb;
mod inp;
mod three_mf;
mod vtk;

pub use glb::glb;
pub use inp::inp;
pub use three_mf::three_mf;
pub use vtk::{legacy_vtk, vtp};

use std::io;
use topipe_mesh::TriangleMesh;

/// One number for each vertex or face.
#[derive(Debug, Clone, PartialEq)]
pub enum Numbers {
    /// Measures.
    Real(Vec<f64>),
    /// Ids and switches; -1 stands for none.
    Whole(Vec<i32>),
}

impl Numbers {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Real(values) => values.len(),
            Self::Whole(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A named set of faces or vertices.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Set {
    /// Letters, digits, `-` and `_`.
    pub name: String,
    /// Indices.
    pub members: Vec<u32>,
}

/// A mesh and what is known on it.
#[derive(Debug, Clone)]
pub struct Model<'a> {
    /// What it is called in the file.
    pub name: &'a str,
    /// The mesh, mm.
    pub mesh: &'a TriangleMesh,
    /// Numbers at vertices.
    pub vertex_data: Vec<(String, Numbers)>,
    /// Numbers on faces.
    pub face_data: Vec<(String, Numbers)>,
    /// A colour for each face (sRGB), or none.
    pub face_colors: Vec<[u8; 3]>,
    /// Sets of faces.
    pub face_sets: Vec<Set>,
    /// Sets of vertices.
    pub vertex_sets: Vec<Set>,
}

impl<'a> Model<'a> {
    /// A mesh without anything on it.
    pub fn new(name: &'a str, mesh: &'a TriangleMesh) -> Self {
        Self {
            name,
            mesh,
            vertex_data: Vec::new(),
            face_data: Vec::new(),
            face_colors: Vec::new(),
            face_sets: Vec::new(),
            vertex_sets: Vec::new(),
        }
    }

    /// Every list fits the mesh.
    fn check(&self) -> io::Result<()> {
        let (vertices, faces) = (self.mesh.vertex_count(), self.mesh.face_count());
        let refuse = |what: String| Err(io::Error::new(io::ErrorKind::InvalidInput, what));
        for (data, count, kind) in
            [(&self.vertex_data, vertices, "vertices"), (&self.face_data, faces, "faces")]
        {
            if let Some((name, numbers)) = data.iter().find(|(_, numbers)| numbers.len() != count) {
                return refuse(format!("`{name}` has {} numbers for {count} {kind}", numbers.len()));
            }
        }
        if !self.face_colors.is_empty() && self.face_colors.len() != faces {
            return refuse(format!("{} colours for {faces} faces", self.face_colors.len()));
        }
        for (sets, count) in [(&self.vertex_sets, vertices), (&self.face_sets, faces)] {
            if let Some(set) = sets.iter().find(|set| set.members.iter().any(|&m| m as usize >= count)) {
                return refuse(format!("set `{}` has members that the mesh has not", set.name));
            }
        }
        if self.mesh.triangles.iter().flatten().any(|v| v.index() >= vertices) {
            return refuse("a triangle has a corner that is no vertex".into());
        }
        Ok(())
    }
}

/// Text in XML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
