//! What can go wrong.

use thiserror::Error;
use topipe_mesh::ConnectivityError;
use topipe_progress::Interrupted;

/// Why a part was not smoothed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SmoothingError {
    /// A parameter is outside the range in which the method works.
    #[error("`{name}` is {value}, but must be {range} ({source_of_range})")]
    Parameter {
        /// Name of the field.
        name: &'static str,
        /// What it was set to.
        value: String,
        /// What is allowed.
        range: &'static str,
        /// Why, and who says so.
        source_of_range: &'static str,
    },
    /// What the engineer says about features does not fit the part.
    #[error("entry {entry} of `features`: {problem}")]
    Feature {
        /// Which entry, from 1.
        entry: usize,
        /// What is wrong, and what is there instead.
        problem: String,
    },
    /// A coordinate is not a finite number.
    #[error(
        "vertex {vertex} has a coordinate that is not a finite number; repair the mesh before smoothing it"
    )]
    NotFinite {
        /// The vertex.
        vertex: u32,
    },
    /// The attributes of the part do not fit its mesh.
    #[error("the part has {found} {what}, but its mesh needs {expected}; make it with `Part::new` or import")]
    Attributes {
        /// Which attribute.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// The triangles are not an oriented manifold.
    #[error("the mesh is not an oriented manifold: {0}; import repairs or refuses such meshes")]
    Connectivity(#[from] ConnectivityError),
    /// No vertex may move, but for those that slide in detected planes while the volume is to be kept.
    #[error(
        "all {vertices} vertices are frozen ({non_design} by non-design labels, the others by detected planes and \
         holes, in which they could only slide, by added edges, or by the part itself), so there is nothing to smooth; set `freeze_non_design`, `detect_planes` or \
         `detect_holes` to false, or `iterations` to 0"
    )]
    EverythingFrozen {
        /// Number of vertices.
        vertices: usize,
        /// Number of vertices on non-design faces.
        non_design: usize,
    },
    /// The volume can not be kept because there is none.
    #[error(
        "the volume inside the mesh is {volume:e} mm^3, which is zero beside its size; a volume can be kept only for a \
         solid: repair the mesh, or set `preserve_volume = false`"
    )]
    ZeroVolume {
        /// The volume.
        volume: f64,
    },
    /// The volume can not be kept because the mesh has a border.
    #[error(
        "the mesh has {edges} border edges, so it has no volume that could be kept; close it, or set \
         `preserve_volume = false`"
    )]
    Open {
        /// Number of edges with one face.
        edges: usize,
    },
    /// The free vertices can not make up for the volume that smoothing took.
    #[error(
        "the volume can not be restored after iteration {iteration}: it is {volume:.6e} mm^3 instead of \
         {wanted:.6e} mm^3, and an offset of the {free} free vertices by one edge length does not reach it; lower \
         `lambda`, or set `preserve_volume = false`"
    )]
    VolumeOutOfReach {
        /// Iteration, from 1.
        iteration: u32,
        /// Volume before the correction.
        volume: f64,
        /// Volume of the input.
        wanted: f64,
        /// Number of vertices that can be offset.
        free: usize,
    },
    /// The iteration grows instead of settling.
    #[error(
        "the iteration diverged: after iteration {iteration} the root mean square step was {step:.3e} mean edge \
         lengths; lower `lambda`, or keep `mu` closer to -`lambda`"
    )]
    Diverged {
        /// Iteration, from 1.
        iteration: u32,
        /// RMS step over the mean edge length.
        step: f64,
    },
    /// Triangles pass through each other, and going back to the input does not part them.
    #[error(
        "{pairs} pairs of triangles pass through each other after smoothing, and going back to the input does not part \
         them; set `keep_embedded = false` to have the result as it is"
    )]
    Crossings {
        /// Pairs that were left.
        pairs: usize,
    },
    /// The run was stopped.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}
