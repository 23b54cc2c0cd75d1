//! `kind = "sizing"`.

use super::bad_value;
use super::stiffness::{field_of, stage_error};
use crate::artifacts::{Beams, Mesh};
use topipe_engine::{BadValue, InputPort, Stage, StageContext, StageError};
use topipe_stiffness::{SizingParameters, enlarge};

/// Enlarges beams that are too weak.
pub(super) struct Sizing;

impl Stage for Sizing {
    type Parameters = SizingParameters;
    type Output = Beams;
    const KIND: &'static str = "sizing";
    const SUMMARY: &'static str =
        "Enlarges the profiles of beams until their frame is strong and stiff enough.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_SIZING").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![
            InputPort::required::<Beams>("input", "The beams, with profiles."),
            InputPort::required::<Mesh>(
                "original",
                "The mesh as it was imported: where supports and loads act.",
            ),
            InputPort::optional::<Mesh>("mesh", "The smoothed mesh: for regions that name its features."),
        ]
    }

    fn check(&self, parameters: &SizingParameters) -> Result<(), BadValue> {
        parameters.check().map_err(|error| bad_value(field_of(&error), &error))
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &SizingParameters,
    ) -> Result<topipe_beams::Structure, StageError> {
        let structure = context.input::<Beams>("input")?;
        let original = context.input::<Mesh>("original")?;
        let mesh = context.optional_input::<Mesh>("mesh")?;
        enlarge(&structure, &original, mesh.as_deref(), parameters, context.progress()).map_err(stage_error)
    }
}
