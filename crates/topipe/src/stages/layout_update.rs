//! `kind = "layout-update"`.

use super::bad_value;
use crate::artifacts::{Mesh, QuadLayout, Tiling};
use topipe_engine::{BadValue, InputPort, Stage, StageContext, StageError};
use topipe_quad_matching::{Earlier, QuadMatchingError, UpdateParameters, update};
use topipe_tiling::TilingError;

/// Carries a layout over to an edited mesh.
pub(super) struct LayoutUpdate;

impl Stage for LayoutUpdate {
    type Parameters = UpdateParameters;
    type Output = QuadLayout;
    const KIND: &'static str = "layout-update";
    const SUMMARY: &'static str =
        "Carries a layout over to an edited mesh; only what has changed is laid out anew.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_LAYOUT_UPDATE").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![
            InputPort::required::<Mesh>("input", "The edited mesh, smoothed."),
            InputPort::required::<Mesh>("earlier_mesh", "The mesh before the edit, smoothed."),
            InputPort::required::<QuadLayout>("earlier_layout", "Its layout."),
            InputPort::optional::<Tiling>(
                "earlier_tiling",
                "The tiling of that layout; none if it is itself one of kind \"layout-update\".",
            ),
        ]
    }

    fn check(&self, parameters: &UpdateParameters) -> Result<(), BadValue> {
        parameters.tiles.validate().map_err(|error| match &error {
            TilingError::Parameter { field, .. } => bad_value(&format!("tiles.{field}"), &error),
            error => bad_value("tiles", error),
        })?;
        parameters.quads.validate().map_err(|error| match &error {
            QuadMatchingError::Parameter { field, .. } => bad_value(&format!("quads.{field}"), &error),
            error => bad_value("quads", error),
        })
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &UpdateParameters,
    ) -> Result<topipe_quad_matching::QuadLayout, StageError> {
        let part = context.input::<Mesh>("input")?;
        let mesh = context.input::<Mesh>("earlier_mesh")?;
        let layout = context.input::<QuadLayout>("earlier_layout")?;
        let tiling = context.optional_input::<Tiling>("earlier_tiling")?;
        let earlier = Earlier { part: &mesh, tiling: tiling.as_deref(), layout: &layout };
        update(&part, earlier, parameters, context.progress()).map_err(|error| match error {
            QuadMatchingError::Interrupted(_) | QuadMatchingError::NotTiled(TilingError::Interrupted(_)) => {
                StageError::Interrupted
            }
            QuadMatchingError::Parameter { .. } => StageError::BadParameter(error.to_string()),
            QuadMatchingError::ReflexCorner { .. } | QuadMatchingError::NotTiled(_) => {
                StageError::Refused(error.to_string())
            }
            error => StageError::Failed(error.to_string()),
        })
    }
}
