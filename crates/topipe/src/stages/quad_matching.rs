//! `kind = "quad-matching"`.

use super::bad_value;
use crate::artifacts;
use topipe_engine::{BadValue, InputPort, Stage, StageContext, StageError};
use topipe_quad_matching::{Parameters, QuadMatchingError, match_quads};

/// Makes quadrilaterals of tiles.
pub(super) struct QuadMatching;

impl Stage for QuadMatching {
    type Parameters = Parameters;
    type Output = artifacts::QuadLayout;
    const KIND: &'static str = "quad-matching";
    const SUMMARY: &'static str = "Dualizes a tiling and pairs its triangles to a layout of quadrilaterals.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_QUAD_MATCHING").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<artifacts::Tiling>("input", "The tiling.")]
    }

    fn check(&self, parameters: &Parameters) -> Result<(), BadValue> {
        parameters.validate().map_err(|error| match &error {
            QuadMatchingError::Parameter { field, .. } => bad_value(field, &error),
            error => bad_value("", error),
        })
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_quad_matching::QuadLayout, StageError> {
        let tiling = context.input::<artifacts::Tiling>("input")?;
        match_quads(&tiling, parameters, context.progress()).map_err(|error| match error {
            QuadMatchingError::Interrupted(_) => StageError::Interrupted,
            QuadMatchingError::Parameter { .. } => StageError::BadParameter(error.to_string()),
            QuadMatchingError::ReflexCorner { .. } => StageError::Refused(error.to_string()),
            // What tiling hands over has been verified: everything else is ours.
            error => StageError::Failed(error.to_string()),
        })
    }
}
