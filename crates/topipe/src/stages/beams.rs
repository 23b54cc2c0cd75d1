//! `kind = "beams"`.

use crate::artifacts::{self, Mesh, Skeleton};
use topipe_beams::{BeamError, Parameters, frame};
use topipe_engine::{InputPort, Stage, StageContext, StageError};

/// Makes a beam structure of a skeleton.
pub(super) struct Beams;

impl Stage for Beams {
    type Parameters = Parameters;
    type Output = artifacts::Beams;
    const KIND: &'static str = "beams";
    const SUMMARY: &'static str = "Turns a skeleton into beams with sections and standard profiles.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_BEAMS").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![
            InputPort::required::<Skeleton>("input", "The skeleton."),
            InputPort::optional::<Mesh>("mesh", "The mesh of the skeleton: says which beams leave the part."),
        ]
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_beams::Structure, StageError> {
        let skeleton = context.input::<Skeleton>("input")?;
        let part = context.optional_input::<Mesh>("mesh")?;
        frame(&skeleton, part.as_ref().map(|p| &p.mesh), parameters, context.progress()).map_err(|error| {
            match error {
                BeamError::Interrupted(_) => StageError::Interrupted,
                BeamError::Parameter { .. } | BeamError::Profile { .. } => {
                    StageError::BadParameter(error.to_string())
                }
                error => StageError::Refused(error.to_string()),
            }
        })
    }
}
