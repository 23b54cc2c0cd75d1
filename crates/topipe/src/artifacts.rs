//! The kinds of artifacts and the types behind them.
//!
//! Raise a version when the serialized form of its type changes.

use topipe_engine::ArtifactKind;

macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident = $name:literal v $version:literal: $value:ty;)*) => {$(
        $(#[$doc])*
        #[derive(Debug)]
        pub struct $kind;
        impl ArtifactKind for $kind {
            type Value = $value;
            const NAME: &'static str = $name;
            const VERSION: u32 = $version;
        }
    )*};
}

kinds! {
    /// A triangle mesh with its labels, features and provenance.
    Mesh = "mesh" v 3: topipe_mesh::Part;
    /// A partition of a mesh into disks.
    Tiling = "tiling" v 2: topipe_tiling::Tiling;
    /// A partition of a mesh into quadrilaterals.
    QuadLayout = "quad layout" v 3: topipe_quad_matching::QuadLayout;
    /// A closed surface of B-spline patches.
    SplineSurface = "spline surface" v 3: topipe_spline_fit::SplineSurface;
    /// A curve skeleton.
    Skeleton = "skeleton" v 3: topipe_skeleton::Skeleton;
    /// Beams between shared nodes.
    Beams = "beam structure" v 2: topipe_beams::Structure;
    /// A comparison of smoothing methods.
    Study = "smoothing study" v 1: topipe_smoothing::study::Study;
    /// Compliances under the same loads.
    Stiffness = "stiffness" v 2: topipe_stiffness::Stiffness;
    /// The figures of a validation.
    Report = "report" v 7: topipe_validation::Report;
}
