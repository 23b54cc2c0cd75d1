//! An earlier layout where the part has not changed, and new quads where it has.
//!
//! Seeds of tiles, their relaxation and that of the layout are global: a vertex that moves by a tenth of a millimetre changes two quads
//! of five. So after an edit the layout is not made anew. It is carried over to the edited mesh, on which it moves with the triangles,
//! and only tiles around what has changed otherwise, faces that belong to other regions or edges that are features now, are laid out
//! again, between borders that stay as they are. What is far from the edit keeps its bits, and a fit of it need not be made again.
//!
//! The rest of the surface is tiled as if what is kept were a region of known shape that is taken out, see
//! [`topipe_tiling::tile_rest`]; its tiles are divided into quads as ever; both are joined along the borders ([`splice`]).

mod carried;
mod restated;
mod splice;
mod tiles;

use crate::cost::GATES;
use crate::verify::verify;
use crate::{Division, QuadLayout, QuadMatchingError, UpdateParameters, divide, match_quads};
use carried::{Carried, carry};
use rustc_hash::FxHashSet;
use splice::{Join, splice};
use std::collections::BTreeSet;
use tiles::{Tile, region_sides, tiles};
use topipe_mesh::{Connectivity, FeatureKind, HalfEdgeId, Lineage, Part, RegionId, VertexId};
use topipe_progress::Progress;
use topipe_tiling::{FeatureSegment, NotTiled, Rest, Tiling, TilingError, tile, tile_rest};

/// Times that more is laid out anew because new tiles need other corners on its borders. Of 90 edits of the nine examples 53 need none,
/// 22 one, and the most five.
const ATTEMPTS: usize = 12;

/// A layout of the past.
#[derive(Debug, Clone, Copy)]
pub struct Earlier<'a> {
    /// The part as it was, smoothed.
    pub part: &'a Part,
    /// Its tiling; none where `layout` is itself what [`update`] returned for `part`.
    pub tiling: Option<&'a Tiling>,
    /// Its layout.
    pub layout: &'a QuadLayout,
}

/// The layout of a part of which there is one from before an edit.
///
/// Guarantees: those of [`QuadLayout`]; quads whose faces, and those of the quads around them, have not moved and belong to the same regions
/// are the same bits as before but for their numbers, unless tiles beside them are laid out anew (then one ring more may be). Provenance
/// refers to `part`.
///
/// Triangles that the earlier part does not have, see [`Correspondence`](topipe_mesh::Correspondence), are laid out anew, with the tiles that lay on those which are
/// gone. Where nothing can be kept the whole part is laid out, and a warning says why.
///
/// # Errors
/// Those of [`tile`] and [`match_quads`].
pub fn update(
    part: &Part,
    earlier: Earlier<'_>,
    parameters: &UpdateParameters,
    progress: &Progress,
) -> Result<QuadLayout, QuadMatchingError> {
    let UpdateParameters { tiles, quads } = parameters;
    quads.validate()?;
    let why = match carry(part, earlier, tiles, progress)? {
        Err(why) => why,
        Ok(carried) => match rebuild(&carried, part, parameters, progress)? {
            Err(why) => why,
            Ok(layout) => {
                layout.check_corners(quads)?;
                return Ok(layout);
            }
        },
    };
    progress.warn(&format!("all of it is laid out anew: {why}"));
    match_quads(&tile(part, tiles, progress)?, quads, progress)
}

/// What becomes of the faces of a layout.
struct Plan {
    tiles: Vec<Tile>,
    /// Per quad; none for quads that are no part of a whole tile.
    tile_of_quad: Vec<Option<usize>>,
    /// Per tile: it is laid out anew.
    anew: Vec<bool>,
}

impl Plan {
    /// Lays out anew what is touched, the tiles with a vertex of the mesh in common with that, and what is no tile. A ring of tiles
    /// more would not help: along the border of what is kept there are tiles of their own anyway.
    fn new(carried: &Carried) -> Self {
        let layout = &carried.layout;
        let tiles = tiles(layout);
        let mut tile_of_quad = vec![None; layout.quads.len()];
        for (t, tile) in tiles.iter().enumerate() {
            tile_of_quad[tile.quads.clone()].fill(Some(t));
        }
        let mut plan = Self { anew: vec![false; tiles.len()], tiles, tile_of_quad };
        let mesh = &layout.part.mesh;
        let mut near = vec![false; mesh.vertex_count()];
        let touched = |f: usize| {
            let quad = layout.quad_of_face[f];
            carried.touched[f]
                || (quad != QuadLayout::NO_QUAD && plan.tile_of_quad[quad as usize].is_none())
                || carried.misshapen.get(quad as usize) == Some(&true)
        };
        for f in (0..mesh.face_count()).filter(|&f| touched(f)) {
            mesh.triangles[f].iter().for_each(|v| near[v.index()] = true);
        }
        let mut anew = vec![false; plan.tiles.len()];
        for (t, &quad) in mesh.triangles.iter().zip(&layout.quad_of_face) {
            if let Some(Some(tile)) = plan.tile_of_quad.get(quad as usize) {
                anew[*tile] |= t.iter().any(|v| near[v.index()]);
            }
        }
        plan.anew = anew;
        plan
    }

    /// The tile with a side that is laid out anew, where the other is not.
    fn anew_beside(&self, side: u32) -> Option<u32> {
        let has = |tile: &Tile| tile.sides.contains(&side);
        (0..self.tiles.len()).find(|&t| self.anew[t] && has(&self.tiles[t])).map(|t| t as u32)
    }

    fn is_kept(&self, quad: u32) -> bool {
        matches!(self.tile_of_quad.get(quad as usize), Some(Some(tile)) if !self.anew[*tile])
    }

    /// Kept tiles with some of these sides.
    fn beside(&self, sides: &BTreeSet<u32>) -> Vec<usize> {
        let has = |t: &usize| !self.anew[*t] && self.tiles[*t].sides.iter().any(|side| sides.contains(side));
        (0..self.tiles.len()).filter(has).collect()
    }
}

/// The layout with new quads where they are needed, or why that can not be.
fn rebuild(
    carried: &Carried,
    part: &Part,
    parameters: &UpdateParameters,
    progress: &Progress,
) -> Result<Result<QuadLayout, String>, QuadMatchingError> {
    let layout = &carried.layout;
    let mut plan = Plan::new(carried);
    let of_regions = region_sides(layout);
    if plan.tiles.is_empty() {
        return Ok(Err("the earlier layout is not one of bordered tiles".into()));
    }
    for _ in 0..ATTEMPTS {
        progress.check()?;
        let zones = zones(carried, &plan);
        let is_whole = !zones.contains(&RegionId::NONE) && !carried.touched.contains(&true);
        let kept = plan.anew.iter().filter(|anew| !**anew).count();
        if is_whole && carried.lost > 0 {
            return Ok(Err("triangles of the earlier mesh are gone, and there are no others instead".into()));
        }
        if is_whole {
            progress.remark(&format!("all {kept} tiles are kept"));
            return Ok(Ok(layout.clone()));
        }
        if kept == 0 {
            return Ok(Err("no tile could be kept".into()));
        }
        let connectivity = Connectivity::build(&layout.part.mesh)?;
        let given = given_sides(layout, &connectivity, &plan, &of_regions, &zones);
        let segments = given
            .iter()
            .map(|&side| {
                let [first, second] = [2 * side, 2 * side + 1].map(|e| &layout.edges[e as usize]);
                let path = first.path.iter().chain(&second.path[1..]).copied().collect();
                let kind = first.feature.unwrap_or(FeatureKind::RegionBorder);
                (FeatureSegment { path, kind }, plan.anew_beside(side))
            })
            .collect();
        let kept_region = RegionId::new(part.regions.len());
        let rest = Rest {
            part: &layout.part,
            region_of_face: zones.clone(),
            size: carried.size.clone(),
            kept: kept_region,
            given: segments,
        };
        let asked: BTreeSet<u32> = match tile_rest(rest, &parameters.tiles, progress) {
            Err(NotTiled::Failed(TilingError::Interrupted(error))) => return Err(error.into()),
            Err(NotTiled::Held(segments)) => segments.into_iter().map(|s| given[s]).collect(),
            Err(NotTiled::Failed(error)) => return Ok(Err(error.to_string())),
            Err(_) => return Ok(Err("the rest could not be tiled".into())),
            Ok(tiling) => {
                let middles: FxHashSet<VertexId> = given
                    .iter()
                    .map(|&side| layout.vertices[layout.edges[2 * side as usize].ends[1] as usize])
                    .collect();
                let rest =
                    match crate::midpoint::subdivide(&tiling, Some(&middles), &parameters.quads, progress) {
                        Err(QuadMatchingError::Interrupted(error)) => return Err(error.into()),
                        Err(error) => return Ok(Err(error.to_string())),
                        Ok(rest) => rest,
                    };
                let join = Join {
                    carried,
                    part,
                    tiling: &tiling,
                    rest: &rest,
                    given: &given,
                    kept: kept_region,
                    zones: &zones,
                };
                match splice(&join, |quad| plan.is_kept(quad), kept as u32) {
                    Ok(joined) => {
                        let joined = share_wide_corners(joined, part, progress)?;
                        return Ok(match verify(&joined).first() {
                            None => {
                                progress.remark(&format!(
                                    "{kept} of {} tiles are kept, the others laid out anew",
                                    plan.tiles.len()
                                ));
                                Ok(joined)
                            }
                            Some(problem) => Err(problem.clone()),
                        });
                    }
                    Err(sides) => sides,
                }
            }
        };
        let beside = plan.beside(&asked);
        beside.iter().for_each(|&tile| plan.anew[tile] = true);
        if beside.is_empty() {
            return Ok(Err("new tiles do not fit between regions as they are divided now".into()));
        }
    }
    Ok(Err("new tiles do not fit between those that were to be kept".into()))
}

/// Divides quads with corners beyond the upper gate, as [`crate::midpoint`] does.
fn share_wide_corners(
    layout: QuadLayout,
    part: &Part,
    progress: &Progress,
) -> Result<QuadLayout, QuadMatchingError> {
    let mut wanted = Vec::new();
    for (quad, angles) in layout.corner_angles().iter().enumerate() {
        let wide = (0..4).filter(|&k| angles[k] > GATES[1]);
        wanted.extend(wide.map(|k| vec![layout.corners(quad)[(k + 2) % 4]]));
    }
    if wanted.is_empty() {
        return Ok(layout);
    }
    let Some(Division { layout: mut finer, .. }) = divide(&layout, &wanted, progress)? else {
        return Ok(layout);
    };
    let lineage = Lineage::new(&layout.part, &part.mesh).and_then(|of_layout| {
        of_layout.of_child(&finer.part, &Lineage::new(&finer.part, &layout.part.mesh)?, &part.mesh)
    });
    // Without a lineage the layout is as good, and not divided.
    let Some(lineage) = lineage else { return Ok(layout) };
    finer.part.provenance = lineage.provenance(&part.mesh);
    Ok(finer)
}

/// Per face: the region it belongs to, that of what is kept, or none where it is to be tiled.
fn zones(carried: &Carried, plan: &Plan) -> Vec<RegionId> {
    let kept = RegionId::new(carried.layout.part.regions.len());
    let zone = |(&quad, &region): (&u32, &RegionId)| if plan.is_kept(quad) { kept } else { region };
    carried.layout.quad_of_face.iter().zip(&carried.region).map(zone).collect()
}

/// The sides of earlier tiles that are borders still, of what is kept or between regions, in order.
fn given_sides(
    layout: &QuadLayout,
    connectivity: &Connectivity,
    plan: &Plan,
    of_regions: &[u32],
    zones: &[RegionId],
) -> Vec<u32> {
    let sides: BTreeSet<u32> =
        plan.tiles.iter().flat_map(|tile| &tile.sides).chain(of_regions).copied().collect();
    let beside = |a: VertexId, b: VertexId| -> Option<[RegionId; 2]> {
        let sides = [(a, b), (b, a)].map(|(a, b)| connectivity.half_edge(a, b));
        let [Some(left), Some(right)] = sides else { return None };
        Some([left, right].map(|h: HalfEdgeId| zones[h.face().index()]))
    };
    let kept = RegionId::new(layout.part.regions.len());
    let is_border = |side: &u32| {
        let halves = [2 * side, 2 * side + 1].map(|e| &layout.edges[e as usize].path);
        // One that lay on what is gone has no path.
        if halves.iter().any(|path| path.len() < 2) {
            return false;
        }
        let mut pairs = halves.into_iter().flat_map(|path| path.windows(2)).map(|w| beside(w[0], w[1]));
        let Some(Some([left, right])) = pairs.next() else { return false };
        let stays = left == kept || right == kept || (left.is_some() && right.is_some());
        left != right && stays && pairs.all(|pair| pair == Some([left, right]))
    };
    sides.into_iter().filter(is_border).collect()
}
