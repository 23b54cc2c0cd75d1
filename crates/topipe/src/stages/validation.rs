//! `kind = "validation"`.

use crate::artifacts::{Mesh, QuadLayout, Report, Skeleton, SplineSurface, Stiffness};
use topipe_engine::{InputPort, Stage, StageContext, StageError};
use topipe_validation::{Inputs, Parameters, ValidationError, validate};

/// Measures artifacts against the original.
pub(super) struct Validation;

impl Stage for Validation {
    type Parameters = Parameters;
    type Output = Report;
    const KIND: &'static str = "validation";
    const SUMMARY: &'static str =
        "Measures mesh, layout, surface and skeleton against the original: report.json.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_VALIDATION").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![
            InputPort::required::<Mesh>("original", "The mesh as it was imported."),
            InputPort::optional::<Mesh>("mesh", "The smoothed mesh."),
            InputPort::optional::<QuadLayout>("layout", "The layout of quadrilaterals."),
            InputPort::optional::<SplineSurface>("surface", "The spline surface."),
            InputPort::optional::<Skeleton>("skeleton", "The skeleton."),
            InputPort::optional::<Stiffness>("stiffness", "The comparison of stiffness, to be taken over."),
        ]
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_validation::Report, StageError> {
        let original = context.input::<Mesh>("original")?;
        let mesh = context.optional_input::<Mesh>("mesh")?;
        let layout = context.optional_input::<QuadLayout>("layout")?;
        let surface = context.optional_input::<SplineSurface>("surface")?;
        let skeleton = context.optional_input::<Skeleton>("skeleton")?;
        let stiffness = context.optional_input::<Stiffness>("stiffness")?;
        let inputs = Inputs {
            original: &original,
            mesh: mesh.as_deref(),
            layout: layout.as_deref(),
            surface: surface.as_deref(),
            skeleton: skeleton.as_deref(),
            stiffness: stiffness.as_deref(),
        };
        validate(&inputs, parameters, context.progress()).map_err(|error| match error {
            ValidationError::Interrupted(_) => StageError::Interrupted,
            ValidationError::Parameter { .. } => StageError::BadParameter(error.to_string()),
            error => StageError::Failed(error.to_string()),
        })
    }
}
