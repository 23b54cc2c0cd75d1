//! `kind = "simp"`.

use super::bad_value;
use crate::artifacts::Mesh;
use topipe_engine::{BadValue, InputPort, Stage, StageContext, StageError};
use topipe_fem::FemError;
use topipe_simp::{Parameters, SimpError, optimize};

/// Optimizes a part.
pub(super) struct Simp;

impl Stage for Simp {
    type Parameters = Parameters;
    type Output = Mesh;
    const KIND: &'static str = "simp";
    const SUMMARY: &'static str =
        "Topology optimization: from a design space, supports and loads to a part with labels.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_SIMP").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::optional::<Mesh>(
            "space",
            "A closed mesh that may be shaped, beside the solids in `domain`. Its labels do not count.",
        )]
    }

    fn check(&self, parameters: &Parameters) -> Result<(), BadValue> {
        parameters.check().map_err(|error| {
            let field = match &error {
                SimpError::Shape { list, .. } => list,
                SimpError::Fem(FemError::Parameter { name, .. }) => name,
                SimpError::Fem(FemError::Entry { list, .. }) => list,
                SimpError::Fem(FemError::NoLoad) => "loads",
                _ => "supports",
            };
            bad_value(field, &error)
        })
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_mesh::Part, StageError> {
        let space = context.optional_input::<Mesh>("space")?;
        let space = space.as_ref().map(|part| &part.mesh);
        let result = optimize(parameters, space, context.units(), context.progress());
        result.map(|optimized| optimized.part).map_err(|error| match error {
            SimpError::Interrupted(_) => StageError::Interrupted,
            SimpError::Fem(FemError::NotConverged { .. }) => StageError::Failed(error.to_string()),
            SimpError::FractionTooSmall { .. } | SimpError::NoDomain => {
                StageError::BadParameter(error.to_string())
            }
            error => StageError::Refused(error.to_string()),
        })
    }
}
