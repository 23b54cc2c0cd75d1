//! Spline surfaces as STEP and IGES, resampled as STL and OBJ, and as control nets in JSON.
//!
//! `.step` and `.stp` follow AP214, `.ap242.step` and `.ap242.stp` AP242. `.fine.stl` and `.fine.obj` are ten times
//! nearer to the surface than `.stl` and `.obj`.

use crate::artifacts::SplineSurface;
use std::io::Write;
use topipe_engine::{ExportError, Exporter};
use topipe_mesh::{DVec3, TriangleMesh, write};
use topipe_spline_fit::step::{self, Protocol};
use topipe_spline_fit::{SplineSurface as Surface, control_nets, iges};

/// Largest distance of a resampled mesh from the surface over the diagonal of its corner points. On the bracket 2e-5
/// gives 8 million triangles (400 MB of STL), which no viewer likes, 5e-4 a file of the order of the input.
const CHORD: f64 = 5e-4;
/// The same for the fine ones.
const FINE_CHORD: f64 = 5e-5;

type Writer = fn(&Surface, &str, &mut dyn Write) -> Result<(), ExportError>;

const WRITERS: [(&str, Writer); 11] = [
    ("step", |surface, name, mut file| Ok(step::write(surface, name, Protocol::Ap214, &mut file)?)),
    ("stp", |surface, name, mut file| Ok(step::write(surface, name, Protocol::Ap214, &mut file)?)),
    ("ap242.step", |surface, name, mut file| Ok(step::write(surface, name, Protocol::Ap242, &mut file)?)),
    ("ap242.stp", |surface, name, mut file| Ok(step::write(surface, name, Protocol::Ap242, &mut file)?)),
    ("iges", |surface, name, mut file| Ok(iges::write(surface, name, &mut file)?)),
    ("igs", |surface, name, mut file| Ok(iges::write(surface, name, &mut file)?)),
    ("stl", |surface, _, mut file| Ok(write::stl(&resample(surface, CHORD), &mut file)?)),
    ("obj", |surface, _, mut file| Ok(write::obj(&resample(surface, CHORD), &mut file)?)),
    ("fine.stl", |surface, _, mut file| Ok(write::stl(&resample(surface, FINE_CHORD), &mut file)?)),
    ("fine.obj", |surface, _, mut file| Ok(write::obj(&resample(surface, FINE_CHORD), &mut file)?)),
    ("json", |surface, _, mut file| Ok(control_nets::write(surface, &mut file)?)),
];

pub(super) fn exporters() -> Vec<Exporter> {
    let version = env!("TOPIPE_WRITER_SPLINE_FIT");
    WRITERS
        .into_iter()
        .map(|(ending, write)| Exporter::new::<SplineSurface>(ending, version, write))
        .collect()
}

fn resample(surface: &Surface, chord: f64) -> TriangleMesh {
    let low = surface.vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = surface.vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    surface.tessellate(chord * (high - low).length())
}
