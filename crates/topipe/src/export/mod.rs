//! The writers: one file per kind of artifact, named like the stage that makes it, and one line each in
//! [`exporters`].

mod beams;
mod exchange;
mod import;
mod picture;
mod plot;
mod quad_matching;
mod skeleton;
mod smoothing;
mod smoothing_study;
mod spline_fit;
mod stiffness;
mod validation;

use topipe_engine::Exporter;

/// All writers.
pub(crate) fn exporters() -> impl Iterator<Item = Exporter> {
    import::exporters()
        .into_iter()
        .chain(smoothing::exporters())
        .chain(smoothing_study::exporters())
        .chain(spline_fit::exporters())
        .chain(quad_matching::exporters())
        .chain(skeleton::exporters())
        .chain(beams::exporters())
        .chain(stiffness::exporters())
        .chain(validation::exporters())
        .chain(picture::exporters())
        .chain(exchange::exporters())
}
