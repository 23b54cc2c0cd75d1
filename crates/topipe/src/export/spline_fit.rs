//! Spline surfaces as STEP, and resampled as STL and OBJ.

use crate::artifacts::SplineSurface;
use topipe_engine::Exporter;
use topipe_mesh::{DVec3, TriangleMesh, write};
use topipe_spline_fit::step::{self, Protocol};

/// Largest distance of a resampled mesh from the surface over the diagonal of its corner points. On the bracket 2e-5
/// gives 8 million triangles (400 MB of STL), which no viewer likes, 5e-4 a file of the order of the input.
const CHORD: f64 = 5e-4;

pub(super) fn exporters() -> Vec<Exporter> {
    let version = env!("TOPIPE_WRITER_SPLINE_FIT");
    vec![
        Exporter::new::<SplineSurface>("step", version, |surface, name, mut file| {
            Ok(step::write(surface, name, Protocol::Ap214, &mut file)?)
        }),
        Exporter::new::<SplineSurface>("stp", version, |surface, name, mut file| {
            Ok(step::write(surface, name, Protocol::Ap214, &mut file)?)
        }),
        Exporter::new::<SplineSurface>("stl", version, |surface, _, mut file| {
            Ok(write::stl(&resample(surface), &mut file)?)
        }),
        Exporter::new::<SplineSurface>("obj", version, |surface, _, mut file| {
            Ok(write::obj(&resample(surface), &mut file)?)
        }),
    ]
}

fn resample(surface: &topipe_spline_fit::SplineSurface) -> TriangleMesh {
    let low = surface.vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = surface.vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    surface.tessellate(CHORD * (high - low).length())
}
