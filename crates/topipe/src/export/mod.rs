//! The writers: one file per kind of artifact, one line each in [`exporters`].

mod mesh;
mod quad_matching;
mod skeleton;
mod spline_fit;
mod validation;

use topipe_engine::Exporter;

/// All writers.
pub(crate) fn exporters() -> impl Iterator<Item = Exporter> {
    mesh::exporters()
        .into_iter()
        .chain(spline_fit::exporters())
        .chain(quad_matching::exporters())
        .chain(skeleton::exporters())
        .chain(validation::exporters())
}
