//! `kind = "tiling"`.

use super::bad_value;
use crate::artifacts::{self, Mesh};
use topipe_engine::{BadValue, InputPort, Stage, StageContext, StageError};
use topipe_tiling::{Parameters, TilingError, tile};

/// Partitions a mesh into disks.
pub(super) struct Tiling;

impl Stage for Tiling {
    type Parameters = Parameters;
    type Output = artifacts::Tiling;
    const KIND: &'static str = "tiling";
    const SUMMARY: &'static str =
        "Partitions the free surface of a mesh into disks; holes, flat faces and edges are borders.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_TILING").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Mesh>("input", "The mesh.")]
    }

    fn check(&self, parameters: &Parameters) -> Result<(), BadValue> {
        parameters.validate().map_err(|error| match &error {
            TilingError::Parameter { field, .. } => bad_value(field, &error),
            error => bad_value("", error),
        })
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_tiling::Tiling, StageError> {
        let part = context.input::<Mesh>("input")?;
        tile(&part, parameters, context.progress()).map_err(|error| match error {
            TilingError::Interrupted(_) => StageError::Interrupted,
            TilingError::Parameter { .. } => StageError::BadParameter(error.to_string()),
            TilingError::NotConverged { .. } => StageError::Failed(error.to_string()),
            error => StageError::Refused(error.to_string()),
        })
    }
}
