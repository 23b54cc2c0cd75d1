//! `kind = "spline-fit"`.

use super::bad_value;
use crate::artifacts;
use topipe_engine::{BadValue, InputPort, NeededUnits, Stage, StageContext, StageError};
use topipe_spline_fit::{Parameters, SplineFitError, first_patches, fit};

/// Fits a B-spline surface to a layout.
pub(super) struct SplineFit;

impl Stage for SplineFit {
    type Parameters = Parameters;
    type Output = artifacts::SplineSurface;
    const KIND: &'static str = "spline-fit";
    const SUMMARY: &'static str = "Fits a closed surface of B-spline patches to a layout of quadrilaterals.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_SPLINE_FIT").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<artifacts::QuadLayout>("input", "The layout.")]
    }

    fn check(&self, parameters: &Parameters) -> Result<(), BadValue> {
        parameters.basis().map(drop).map_err(|error| match &error {
            SplineFitError::Parameter { field, .. } => bad_value(field, &error),
            error => bad_value("", error),
        })
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_spline_fit::SplineSurface, StageError> {
        let layout = context.input::<artifacts::QuadLayout>("input")?;
        fit(&layout, parameters, context.units(), context.progress()).map_err(failure)
    }

    const NAMES_UNITS: bool = true;

    fn needed_units(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<Vec<NeededUnits>, StageError> {
        let layout = context.input::<artifacts::QuadLayout>("input")?;
        let keys = first_patches(&layout, parameters).map_err(failure)?;
        Ok(vec![NeededUnits { what: "patches".into(), keys }])
    }
}

fn failure(error: SplineFitError) -> StageError {
    match error {
        SplineFitError::Interrupted(_) => StageError::Interrupted,
        SplineFitError::Parameter { .. } => StageError::BadParameter(error.to_string()),
        error => StageError::Failed(error.to_string()),
    }
}
