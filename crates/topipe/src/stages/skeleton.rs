//! `kind = "skeleton"`.

use crate::artifacts::{self, Mesh};
use topipe_engine::{InputPort, Stage, StageContext, StageError};
use topipe_skeleton::{Parameters, SkeletonError, skeletonize};

/// Finds the curve skeleton of a mesh.
pub(super) struct Skeleton;

impl Stage for Skeleton {
    type Parameters = Parameters;
    type Output = artifacts::Skeleton;
    const KIND: &'static str = "skeleton";
    const SUMMARY: &'static str = "Finds the curve skeleton of a beam-like part.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_SKELETON").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Mesh>("input", "The mesh.")]
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_skeleton::Skeleton, StageError> {
        let part = context.input::<Mesh>("input")?;
        skeletonize(&part, parameters, context.progress()).map_err(|error| match error {
            SkeletonError::Interrupted(_) => StageError::Interrupted,
            SkeletonError::Parameter { .. } => StageError::BadParameter(error.to_string()),
            error => StageError::Refused(error.to_string()),
        })
    }
}
