//! `kind = "stiffness"`.

use super::bad_value;
use crate::artifacts::{Beams, Mesh, SplineSurface, Stiffness};
use topipe_engine::{BadValue, InputPort, Stage, StageContext, StageError};
use topipe_fem::FemError;
use topipe_stiffness::{Inputs, Parameters, StiffnessError, compare};

/// Compares the compliance of a part's models.
pub(super) struct CompareStiffness;

impl Stage for CompareStiffness {
    type Parameters = Parameters;
    type Output = Stiffness;
    const KIND: &'static str = "stiffness";
    const SUMMARY: &'static str =
        "Compliance, volume and stress of mesh, surface and beams under the same loads on the same grid.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_STIFFNESS").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![
            InputPort::required::<Mesh>("original", "The mesh as it was imported."),
            InputPort::optional::<Mesh>("mesh", "The smoothed mesh."),
            InputPort::optional::<SplineSurface>("surface", "The spline surface."),
            InputPort::optional::<Beams>("beams", "The beams."),
        ]
    }

    fn check(&self, parameters: &Parameters) -> Result<(), BadValue> {
        parameters.check().map_err(|error| bad_value(field_of(&error), &error))
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_stiffness::Stiffness, StageError> {
        let original = context.input::<Mesh>("original")?;
        let mesh = context.optional_input::<Mesh>("mesh")?;
        let surface = context.optional_input::<SplineSurface>("surface")?;
        let beams = context.optional_input::<Beams>("beams")?;
        let inputs = Inputs {
            original: &original,
            mesh: mesh.as_deref(),
            surface: surface.as_deref(),
            beams: beams.as_deref(),
        };
        compare(&inputs, parameters, context.progress()).map_err(stage_error)
    }
}

/// The parameter that an error is about.
pub(super) fn field_of(error: &FemError) -> &'static str {
    match error {
        FemError::Parameter { name, .. } => name,
        FemError::Entry { list, .. } => list,
        FemError::NoLoad => "loads",
        _ => "supports",
    }
}

pub(super) fn stage_error(error: StiffnessError) -> StageError {
    match error {
        StiffnessError::Interrupted(_) => StageError::Interrupted,
        error if error.is_bad_parameter() => StageError::BadParameter(error.to_string()),
        error if error.is_failure() => StageError::Failed(error.to_string()),
        error => StageError::Refused(error.to_string()),
    }
}
