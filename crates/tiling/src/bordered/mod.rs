//! Tiles of a surface with borders: regions of known shape are taken out, features are barriers.
//!
//! The augmented Voronoi tessellation of the source is the dual of a layout: sites become corners, so features have
//! to run from site to site. Here it is the other way round. A tile is itself a macro-face, whose sides are halved and
//! joined to its centre by the layout (midpoint subdivision, which asks for no matching), so features run along the
//! borders of tiles. What is asked of a tile is much less: that it is a disk with a simple border and at least three
//! corners. Nothing is asked of pairs of tiles, nor of the number of tiles that meet at a vertex.
//!
//! - Faces of regions become no tile's ([`regions`]).
//! - Feature edges are cut into segments ([`barriers`]).
//! - Each side of a segment belongs to one tile, so that corners of the tiles on both sides coincide ([`strips`]).
//! - Farthest-point sites fill the rest ([`sites`]).
//! - Tiles that violate a condition get more sites ([`repair`]), and at last are cut to pieces ([`pieces`]).

mod averaging;
mod barriers;
mod check;
mod growth;
mod pieces;
mod polygons;
mod recheck;
mod regions;
mod repair;
mod rest;
mod shortcomings;
mod sites;
mod sizes;
mod strips;
mod surface;

pub use rest::{NotTiled, Rest, SizingField, tile_rest};

use crate::{FeatureSegment, Parameters, TileId, Tiling, TilingError};
use barriers::Segment;
use surface::{NONE, Surface};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{FaceId, Part, RegionId, VertexId};
use topipe_progress::Progress;

/// What a tile grows from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Seed {
    /// Faces along segments, which are fixed.
    Strip,
    /// The faces around a vertex.
    Site(VertexId),
    /// A piece cut from another tile; it is lost when tiles are grown anew.
    Piece,
}

/// Tiles under construction.
pub(crate) struct Construction<'a> {
    pub(crate) surface: Surface,
    pub(crate) segments: Vec<Segment>,
    /// The first of them, which are not to be halved as others rely on them; those with the same number have one tile beside them.
    pub(crate) given: Vec<Option<u32>>,
    /// Those of them that were to be halved nevertheless.
    pub(crate) asked: Vec<usize>,
    /// Per vertex: a segment ends here.
    pub(crate) is_node: Vec<bool>,
    /// Strips first, then sites.
    pub(crate) seeds: Vec<Seed>,
    /// The strip of each segment side, or `NONE` where a region lies there.
    pub(crate) strip_of_side: Vec<u32>,
    pub(crate) parameters: &'a Parameters,
    pub(crate) progress: &'a Progress,
}

/// How near the number of tiles has to come to the one asked for, and after how many tessellations the nearest is taken.
const COUNT: f64 = 0.1;
const TRIES: usize = 6;

/// Tiles a closed part that has been checked. A number of tiles that is asked for is aimed at by tessellations with other sizes:
/// features, bends and topology add tiles, and how many they add is known afterwards only.
pub(crate) fn tile(
    part: &Part,
    parameters: &Parameters,
    progress: &Progress,
    sizes: Option<&[f64]>,
) -> Result<Tiling, TilingError> {
    let tiling = tile_to_count(part, parameters, progress, sizes)?;
    shortcomings::warn(part, parameters, &tiling, progress);
    Ok(tiling)
}

/// As [`tile`], without a word on what is lacking.
fn tile_to_count(
    part: &Part,
    parameters: &Parameters,
    progress: &Progress,
    sizes: Option<&[f64]>,
) -> Result<Tiling, TilingError> {
    if parameters.tiles == 0 {
        return tile_scaled(part, parameters, progress, sizes, 1.0);
    }
    let ratio = |tiling: &Tiling| tiling.tile_count().max(1) as f64 / f64::from(parameters.tiles);
    let mut scale = 1.0;
    let mut nearest = tile_scaled(part, parameters, progress, sizes, scale)?;
    for _ in 1..TRIES {
        let off = ratio(&nearest);
        if off.ln().abs() <= COUNT.ln_1p() {
            break;
        }
        // As many as areas say, in bounded steps.
        scale *= off.sqrt().clamp(0.4, 2.5);
        let next = match tile_scaled(part, parameters, progress, sizes, scale) {
            Ok(next) => next,
            Err(TilingError::NotConverged { .. }) => break,
            Err(error) => return Err(error),
        };
        // Sizes that bring it no nearer are at an end: no fewer tiles for the topology, or no smaller ones.
        if ratio(&next).ln().abs() >= off.ln().abs() {
            break;
        }
        nearest = next;
    }
    progress.remark(&format!("{} tiles where {} were asked for", nearest.tile_count(), parameters.tiles));
    Ok(nearest)
}

/// The tessellation with sizes scaled by a factor.
fn tile_scaled(
    part: &Part,
    parameters: &Parameters,
    progress: &Progress,
    sizes: Option<&[f64]>,
    scale: f64,
) -> Result<Tiling, TilingError> {
    let refiner = Refiner::new(part)?;
    let choice = regions::choose(&refiner, least_area(part, parameters));
    let region_of_face = choice.region;
    let (filled, depth) = choice.filled;
    if filled > 0 {
        progress.remark(&format!(
            "{filled} faces smaller than the mesh's own are taken into the regions beside them, at most {depth:.2e} mm away"
        ));
    }
    if choice.handed_back > 0 {
        let handed_back = choice.handed_back;
        progress.remark(&format!(
            "{handed_back} faces of regions too small or pinched are tiled like free surface"
        ));
    }
    let spacing = scale * spacing(part, &region_of_face, parameters);
    let bends = bends(&refiner, &region_of_face, spacing, parameters);
    let factor = |f: usize| sizes.and_then(|s| s.get(f)).copied().filter(|s| *s > 0.0).unwrap_or(1.0);
    let size: Vec<f64> = (0..part.mesh.face_count()).map(|f| spacing * factor(f) * bends[f]).collect();
    let mut surface = Surface::new(refiner, region_of_face, size);
    surface.densify(parameters.faces_per_tile, None, progress)?;
    let segments = match parameters.follow_features {
        true => barriers::segments(&mut surface, Vec::new()),
        false => Vec::new(),
    };
    progress.remark(&format!("size {spacing:.3} mm, {} segments of features", segments.len()));
    let mut construction = Construction {
        is_node: Vec::new(),
        surface,
        segments,
        given: Vec::new(),
        asked: Vec::new(),
        seeds: Vec::new(),
        strip_of_side: Vec::new(),
        parameters,
        progress,
    };
    construction.tile()?;
    Ok(construction.finish())
}

/// The mean thickness of a part, mm: twice its volume over its area.
fn wall(part: &Part) -> f64 {
    2.0 * part.mesh.volume().abs() / part.mesh.area()
}

/// Smaller regions are not taken out, mm2.
fn least_area(part: &Part, parameters: &Parameters) -> f64 {
    if parameters.follow_features { (parameters.least_region * wall(part)).powi(2) } else { f64::INFINITY }
}

/// The distance wanted between neighbouring sites where the surface is flat, mm.
fn spacing(part: &Part, region_of_face: &[RegionId], parameters: &Parameters) -> f64 {
    if parameters.tiles == 0 {
        return parameters.tile_size * wall(part);
    }
    let mesh = &part.mesh;
    let is_free = |f: &FaceId| region_of_face[f.index()] == RegionId::NONE;
    let free_area: f64 = mesh.faces().filter(is_free).map(|f| mesh.area_vector(f).length() / 2.0).sum();
    // Hexagonal tiles of equal area.
    (2.0 * free_area.max(1e-3 * mesh.area()) / (3f64.sqrt() * f64::from(parameters.tiles))).sqrt()
}

/// Factors on the size of tiles, per face, where the surface bends.
fn bends(refiner: &Refiner, region: &[RegionId], spacing: f64, parameters: &Parameters) -> Vec<f64> {
    match parameters.bend {
        bend if bend > 0.0 => sizes::factors(refiner, region, spacing, bend.to_radians()),
        _ => vec![1.0; refiner.part().mesh.face_count()],
    }
}

impl Construction<'_> {
    /// Strips, sites, and repair.
    fn tile(&mut self) -> Result<(), TilingError> {
        self.lay_strips();
        self.fill()?;
        for _ in 0..self.parameters.lloyd_rounds {
            self.progress.check()?;
            self.relax();
        }
        self.repair()
    }

    pub(crate) fn faces_by_tile(&self) -> Vec<Vec<FaceId>> {
        let mut faces = vec![Vec::new(); self.seeds.len()];
        for (f, &owner) in self.surface.owner.iter().enumerate() {
            if owner != NONE {
                faces[owner as usize].push(FaceId::new(f));
            }
        }
        faces
    }

    fn finish(self) -> Tiling {
        let by_tile = self.faces_by_tile();
        let mut number = vec![TileId::NONE; self.seeds.len()];
        let mut sites = Vec::new();
        for (tile, faces) in by_tile.iter().enumerate() {
            let nearest = faces.iter().copied().min_by(|a, b| {
                let d = |f: &FaceId| self.surface.distance[f.index()];
                d(a).total_cmp(&d(b)).then(a.cmp(b))
            });
            if let Some(face) = nearest {
                number[tile] = TileId(sites.len() as u32);
                sites.push(face);
            }
        }
        let tile_of_face = self
            .surface
            .owner
            .iter()
            .map(|&owner| if owner == NONE { TileId::NONE } else { number[owner as usize] })
            .collect();
        let segments =
            self.segments.into_iter().map(|s| FeatureSegment { path: s.path, kind: s.kind }).collect();
        let region_of_face = self.surface.region;
        let mut regions: Vec<RegionId> = region_of_face.iter().copied().filter(|r| r.is_some()).collect();
        regions.sort_unstable();
        regions.dedup();
        let (mut part, _) = self.surface.refiner.finish();
        // A face that was handed back is no longer part of a region that is a face of its own.
        for (own, chosen) in part.region_of_face.iter_mut().zip(&region_of_face) {
            if chosen.is_some() {
                *own = *chosen;
            } else if own.is_some() && regions.binary_search(own).is_ok() {
                *own = RegionId::NONE;
            }
        }
        let anchors = vec![None; sites.len()];
        Tiling { part, tile_of_face, sites, anchors, bordered: true, regions, segments }
    }
}
