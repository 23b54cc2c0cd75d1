//! The kinds of stages. A new one is one file here and one line in [`registry`].

mod import;
mod quad_matching;
mod skeleton;
mod smoothing;
mod spline_fit;
mod tiling;
mod validation;

use topipe_engine::Registry;

/// All kinds of stages and all writers.
pub fn registry() -> Registry {
    Registry::new()
        .with_stage(import::Import)
        .with_stage(smoothing::Smoothing)
        .with_stage(tiling::Tiling)
        .with_stage(quad_matching::QuadMatching)
        .with_stage(spline_fit::SplineFit)
        .with_stage(skeleton::Skeleton)
        .with_stage(validation::Validation)
        .with_exporters(crate::export::exporters())
}

/// The field and the text of a parameter error, for messages that point at the field.
fn bad_value(field: &str, error: &impl std::error::Error) -> topipe_engine::BadValue {
    topipe_engine::BadValue { field: field.to_owned(), message: error.to_string() }
}
