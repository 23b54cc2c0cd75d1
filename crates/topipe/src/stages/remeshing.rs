//! `kind = "remeshing"`.

use super::bad_value;
use crate::artifacts::Mesh;
use topipe_engine::{BadValue, InputPort, Stage, StageContext, StageError};
use topipe_remeshing::{Parameters, RemeshingError, remesh};

/// Makes even triangles of the facets of a CAD part.
pub(super) struct Remeshing;

impl Stage for Remeshing {
    type Parameters = Parameters;
    type Output = Mesh;
    const KIND: &'static str = "remeshing";
    const SUMMARY: &'static str =
        "Makes even triangles of the facets of a tessellated CAD part; keeps its edges and flat faces.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_REMESHING").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Mesh>("input", "The mesh.")]
    }

    fn check(&self, parameters: &Parameters) -> Result<(), BadValue> {
        parameters.validate().map_err(|error| match &error {
            RemeshingError::Parameter { field, .. } => bad_value(field, &error),
            error => bad_value("", error),
        })
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_mesh::Part, StageError> {
        let part = context.input::<Mesh>("input")?;
        remesh(&part, parameters, context.progress()).map_err(|error| match error {
            RemeshingError::Interrupted(_) => StageError::Interrupted,
            RemeshingError::Parameter { .. } | RemeshingError::TooFine { .. } => {
                StageError::BadParameter(error.to_string())
            }
            error => StageError::Refused(error.to_string()),
        })
    }
}
