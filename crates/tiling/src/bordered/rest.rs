//! The rest of a surface of which parts are tiled already.

use super::barriers::Segment;
use super::surface::Surface;
use super::{Construction, barriers, bends, least_area, regions, spacing};
use crate::{FeatureSegment, Method, Parameters, Tiling, TilingError};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{Part, RegionId};
use topipe_progress::Progress;

/// A surface, and what of it is not to be tiled.
#[derive(Debug, Clone)]
pub struct Rest<'a> {
    /// The part. Its edges are features where they are to be followed.
    pub part: &'a Part,
    /// Per face: the region that is taken out it belongs to, [`Self::kept`], or [`RegionId::NONE`] where tiles are wanted.
    pub region_of_face: Vec<RegionId>,
    /// Per face: the distance wanted between neighbouring sites, mm.
    pub size: Vec<f64>,
    /// Stands for what is tiled already; no region of the part.
    pub kept: RegionId,
    /// Segments whose ends are to be corners of tiles, and nothing between them: the borders of what is kept. Those with the same
    /// number are to be sides of one tile.
    pub given: Vec<(FeatureSegment, Option<u32>)>,
}

/// Why the rest could not be tiled.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum NotTiled {
    /// Tiles are held by some of the given segments, which are too long for them or meet at too narrow angles: their numbers.
    Held(Vec<usize>),
    /// Anything else.
    Failed(TilingError),
}

impl From<TilingError> for NotTiled {
    fn from(error: TilingError) -> Self {
        Self::Failed(error)
    }
}

/// What [`crate::tile`] goes by, per face of a part.
#[derive(Debug, Clone, PartialEq)]
pub struct SizingField {
    /// The region that is taken out of the free surface it belongs to, or [`RegionId::NONE`].
    pub region_of_face: Vec<RegionId>,
    /// The distance wanted between neighbouring sites, mm.
    pub size: Vec<f64>,
}

impl SizingField {
    /// Of a closed part. Where a number of tiles is asked for, of the size that gives it by area alone.
    ///
    /// # Errors
    /// When the mesh is not an oriented manifold.
    pub fn of(part: &Part, parameters: &Parameters) -> Result<Self, TilingError> {
        let refiner = Refiner::new(part)?;
        let region_of_face = regions::choose(&refiner, least_area(part, parameters)).region;
        let spacing = spacing(part, &region_of_face, parameters);
        let bends = bends(&refiner, &region_of_face, spacing, parameters);
        Ok(Self { size: bends.iter().map(|factor| factor * spacing).collect(), region_of_face })
    }
}

/// Tiles what is neither kept nor taken out, as [`Method::Bordered`] does.
///
/// Guarantees: as for [`Tiling`]; what is kept is one region more, [`Rest::kept`], whose borders have a corner at each end of a given
/// segment. Faces of it are not split but along its borders.
///
/// # Errors
/// [`NotTiled::Held`] where more corners are needed on given segments; those of [`crate::tile`].
pub fn tile_rest(rest: Rest<'_>, parameters: &Parameters, progress: &Progress) -> Result<Tiling, NotTiled> {
    parameters.validate()?;
    let Rest { part, region_of_face, size, kept, given } = rest;
    let parameters = &Parameters { method: Method::Bordered, ..parameters.clone() };
    let refiner = Refiner::new(part).map_err(TilingError::from)?;
    let mut surface = Surface::new(refiner, region_of_face, size);
    surface.densify(parameters.faces_per_tile, Some(kept), progress)?;
    let (segments, given) = given
        .into_iter()
        .map(|(FeatureSegment { path, kind }, number)| (Segment { path, kind }, number))
        .unzip();
    let segments = barriers::segments(&mut surface, segments);
    let mut construction = Construction {
        is_node: Vec::new(),
        surface,
        segments,
        given,
        asked: Vec::new(),
        seeds: Vec::new(),
        strip_of_side: Vec::new(),
        parameters,
        progress,
    };
    match construction.tile() {
        Err(TilingError::NotConverged { .. }) if !construction.asked.is_empty() => {
            construction.asked.sort_unstable();
            construction.asked.dedup();
            Err(NotTiled::Held(construction.asked))
        }
        tiled => {
            tiled?;
            Ok(construction.finish())
        }
    }
}
