//! Any artifact that has a shape as PNG.

use crate::artifacts::{Beams, Mesh, QuadLayout, Skeleton, SplineSurface, Tiling};
use crate::picture::{self, View};
use std::io::Write;
use topipe_engine::{ExportError, Exporter};
use topipe_render::{Image, RenderError};

pub(super) fn exporters() -> Vec<Exporter> {
    // The shape comes from the artifact, but a surface is cut into triangles by the crate that knows it.
    let version = |stage: &str| format!("{}-{stage}", env!("TOPIPE_WRITER_PICTURE"));
    vec![
        Exporter::new::<Mesh>("png", version(""), |part, _, file| {
            png(picture::mesh(part, &View::default()), file)
        }),
        Exporter::new::<Tiling>("png", version(""), |tiling, _, file| {
            png(picture::tiling(tiling, &View::default()), file)
        }),
        Exporter::new::<QuadLayout>("png", version(""), |layout, _, file| {
            png(picture::layout(layout, &View::default()), file)
        }),
        Exporter::new::<SplineSurface>(
            "png",
            version(env!("TOPIPE_WRITER_SPLINE_FIT")),
            |surface, _, file| png(picture::surface(surface, &View::default()), file),
        ),
        Exporter::new::<Skeleton>("png", version(""), |skeleton, _, file| {
            png(picture::skeleton(skeleton, &View::default()), file)
        }),
        Exporter::new::<Beams>("png", version(env!("TOPIPE_WRITER_BEAMS")), |structure, _, file| {
            png(picture::beams(structure, &View::default()), file)
        }),
    ]
}

fn png(image: Result<Image, RenderError>, file: &mut dyn Write) -> Result<(), ExportError> {
    let refused = |error: RenderError| ExportError::Refused(error.to_string());
    Ok(file.write_all(&image.map_err(refused)?.encode_png().map_err(refused)?)?)
}
