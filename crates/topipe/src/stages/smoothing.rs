//! `kind = "smoothing"`.

use super::bad_value;
use crate::artifacts::Mesh;
use topipe_engine::{BadValue, InputPort, Stage, StageContext, StageError};
use topipe_remeshing::Tessellation;
use topipe_smoothing::{Earlier, Parameters, SmoothingError, smooth, smooth_after};

/// Smooths a mesh.
pub(super) struct Smoothing;

impl Stage for Smoothing {
    type Parameters = Parameters;
    type Output = Mesh;
    const KIND: &'static str = "smoothing";
    const SUMMARY: &'static str =
        "Smooths a mesh; keeps its volume, its holes, its flat and its non-design faces.";

    fn code_version(&self) -> String {
        env!("TOPIPE_CODE_SMOOTHING").into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![
            InputPort::required::<Mesh>("input", "The mesh."),
            InputPort::optional::<Mesh>(
                "earlier",
                "What an earlier version of the mesh was smoothed to: what was not edited since stays as it is there.",
            ),
            InputPort::optional::<Mesh>("earlier_input", "That earlier version, before it was smoothed."),
        ]
    }

    fn check(&self, parameters: &Parameters) -> Result<(), BadValue> {
        parameters.check().map_err(|error| match &error {
            SmoothingError::Parameter { name, .. } => bad_value(name, &error),
            SmoothingError::Feature { .. } => bad_value("features", &error),
            error => bad_value("", error),
        })
    }

    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Parameters,
    ) -> Result<topipe_mesh::Part, StageError> {
        let part = context.input::<Mesh>("input")?;
        let earlier =
            [context.optional_input::<Mesh>("earlier")?, context.optional_input::<Mesh>("earlier_input")?];
        if let Some(tessellation) = Tessellation::of(&part.mesh) {
            let was_one = earlier[1].as_ref().map(|earlier| Tessellation::of(&earlier.mesh).is_some());
            match was_one {
                None => context.progress().warn(&format!(
                    "the mesh looks like one of a CAD system ({tessellation}): smoothing may round its edges off, and the fit takes long; \
                     put a stage of kind \"remeshing\" before this one"
                )),
                // Remeshing would leave none of the triangles that are to stay.
                Some(false) => context.progress().warn(&format!(
                    "what was edited looks as if a CAD system had made it ({tessellation}): but for flat faces, holes and bosses that are found, \
                     its edges may be rounded off, and many small patches come of long triangles; in the modeller, give it triangles as large as the others"
                )),
                Some(true) => {}
            }
        }
        let smoothed = match &earlier {
            [None, None] => smooth(&part, parameters, context.progress()),
            [Some(smoothed), Some(original)] => {
                smooth_after(&part, Earlier { original, smoothed }, parameters, context.progress())
            }
            _ => {
                let message = "`earlier` and `earlier_input` belong together: name both, or none";
                return Err(StageError::BadParameter(message.into()));
            }
        };
        smoothed.map_err(|error| match error {
            SmoothingError::Interrupted(_) => StageError::Interrupted,
            SmoothingError::Parameter { .. } => StageError::BadParameter(error.to_string()),
            SmoothingError::Diverged { .. } | SmoothingError::VolumeOutOfReach { .. } => {
                StageError::Failed(error.to_string())
            }
            error => StageError::Refused(error.to_string()),
        })
    }
}
