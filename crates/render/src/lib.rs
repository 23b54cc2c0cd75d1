//! A small deterministic software renderer for parts, layouts and skeletons.
//!
//! A [`Scene`] is a list of layers: triangle meshes with a colour per face or vertex, and lines of a width in pixels
//! or a radius in millimetres. [`render`] draws it orthographically into an [`Image`]:
//!
//! 1. every layer is projected and rasterized into a buffer of depth and primitive at several samples a pixel,
//! 2. horizon-based ambient occlusion is computed from the depths, once a pixel (after Bavoil, Sainz, Dimitrov 2008,
//!    *Image-space horizon-based ambient occlusion*),
//! 3. the samples are shaded and averaged in linear light.
//!
//! Guarantees: the same bytes for any number of threads (work is split by fixed bands of rows, ties in depth go to
//! the primitive that was added first); no input panics (coordinates that are not finite are left out). Faces seen
//! from behind are tinted, so that an inverted mesh is noticed.
//!
//! Not guaranteed: the same bytes on another processor architecture; sorting of several translucent layers (they are
//! laid over each other in the order of the scene, each with its nearest surface only).
//!
//! ```
//! use topipe_mesh::TriangleMesh;
//! use topipe_render::{Camera, MeshLayer, Options, Scene, render};
//! let triangle = TriangleMesh::from_arrays(
//!     vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
//!     vec![[0, 1, 2]],
//! );
//! let mut scene = Scene::default();
//! scene.add_mesh(MeshLayer::new(&triangle));
//! let image = render(&scene, &Camera::TOP, &Options { width: 64, height: 64, ..Options::default() })?;
//! assert!(image.encode_png()?.starts_with(b"\x89PNG"));
//! # Ok::<(), topipe_render::RenderError>(())
//! ```

mod annotate;
mod camera;
mod color;
mod crease_normals;
mod image;
mod occlusion;
pub mod palette;
mod raster;
mod scene;
mod shade;

pub use annotate::Legend;
pub use camera::Camera;
pub use color::Color;
pub use image::Image;
pub use scene::{Coloring, EdgeOverlay, LineLayer, LineWidth, MeshLayer, Scene, Shading};

use thiserror::Error;

/// Size and quality of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Samples per pixel along each axis, 1 to 8.
    pub supersampling: usize,
    /// Strength of the ambient occlusion: 0 is none, 1 the full darkening.
    pub occlusion: f32,
    /// Reach of the ambient occlusion as a fraction of the diagonal of the scene.
    pub occlusion_reach: f64,
    /// Free space around the scene as a fraction of the picture.
    pub margin: f64,
    /// What is seen where nothing is.
    pub background: Color,
    /// A bar of known length at the lower left.
    pub scale_bar: bool,
    /// What the colours mean, at the lower right.
    pub legend: Option<Legend>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            width: 1200,
            height: 900,
            supersampling: 3,
            occlusion: 0.9,
            occlusion_reach: 0.06,
            margin: 0.04,
            background: Color::WHITE,
            scale_bar: false,
            legend: None,
        }
    }
}

/// Why a picture could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The list of colours does not fit the layer.
    #[error("layer {layer} has {colors} colours for {elements} {what}: give one for each")]
    ColorCount {
        /// Place of the layer in the scene.
        layer: usize,
        /// Colours given.
        colors: usize,
        /// Elements that need one.
        elements: usize,
        /// What they are.
        what: &'static str,
    },
    /// A picture without pixels, or with more than memory is meant for.
    #[error(
        "a picture of {width} x {height} pixels with {supersampling} x {supersampling} samples can not be made: use 1 to 16384 pixels a side and 1 to 8 samples"
    )]
    Size {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
        /// Samples along each axis.
        supersampling: usize,
    },
    /// PNG encoding failed.
    #[error("the picture could not be encoded as PNG: {0}")]
    Png(#[from] png::EncodingError),
    /// The file could not be written.
    #[error("can not write {path}: {source}")]
    Write {
        /// The file.
        path: std::path::PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// Draws `scene` as seen by `camera`.
pub fn render(scene: &Scene<'_>, camera: &Camera, options: &Options) -> Result<Image, RenderError> {
    let &Options { width, height, supersampling, .. } = options;
    let fits = |n: usize, most: usize| (1..=most).contains(&n);
    if !fits(width, 16384) || !fits(height, 16384) || !fits(supersampling, 8) {
        return Err(RenderError::Size { width, height, supersampling });
    }
    scene.check()?;
    let projection = camera.project(scene, options);
    let layers = scene.project(&projection);
    let (solid, translucent): (Vec<_>, Vec<_>) = layers.iter().partition(|layer| layer.opacity >= 1.0);
    let solid = raster::rasterize(&solid, &projection);
    let translucent: Vec<_> =
        translucent.into_iter().map(|layer| raster::rasterize(&[layer], &projection)).collect();
    let occlusion = (options.occlusion > 0.0).then(|| occlusion::ambient_occlusion(&solid, &projection));
    let mut image = shade::shade(&solid, &translucent, occlusion.as_deref(), &projection, options);
    if options.scale_bar {
        annotate::scale_bar(&mut image, &projection);
    }
    if let Some(legend) = &options.legend {
        annotate::legend(&mut image, legend);
    }
    Ok(image)
}

/// Draws `scene` from several sides and puts the pictures beside each other, `columns` to a row.
pub fn render_views(
    scene: &Scene<'_>,
    cameras: &[Camera],
    columns: usize,
    options: &Options,
) -> Result<Image, RenderError> {
    let images: Vec<_> =
        cameras.iter().map(|camera| render(scene, camera, options)).collect::<Result<_, _>>()?;
    Ok(Image::grid(&images, columns, 0, options.background))
}
