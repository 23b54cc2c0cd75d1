//! `kind = "smoothing-study"`.

use super::bad_value;
use crate::artifacts::{self, Mesh};
use topipe_engine::{BadValue, InputPort, Stage, StageContext, StageError};
use topipe_smoothing::SmoothingError;
use topipe_smoothing::study::{Study, StudyParameters, study};

/// Compares smoothing methods on a mesh.
pub(super) struct SmoothingStudy;

impl Stage for SmoothingStudy {
    type Parameters = StudyParameters;
    type Output = artifacts::Study;
    const KIND: &'static str = "smoothing-study";
    const SUMMARY: &'static str = "Compares all smoothing methods on a mesh: tables 1 to 4 and figures 7 and 10 of \
                                   Bacciaglia, Ceruti, Liverani 2021.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_SMOOTHING_STUDY").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Mesh>("input", "The mesh.")]
    }

    fn check(&self, parameters: &StudyParameters) -> Result<(), BadValue> {
        parameters.check().map_err(|error| match &error {
            SmoothingError::Parameter { name, .. } => bad_value(name, &error),
            error => bad_value("", error),
        })
    }

    fn run(&self, context: &StageContext<'_>, parameters: &StudyParameters) -> Result<Study, StageError> {
        let part = context.input::<Mesh>("input")?;
        study(&part, parameters, context.progress()).map_err(|error| match error {
            SmoothingError::Interrupted(_) => StageError::Interrupted,
            SmoothingError::Parameter { .. } => StageError::BadParameter(error.to_string()),
            error => StageError::Refused(error.to_string()),
        })
    }
}
