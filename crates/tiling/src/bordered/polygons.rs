//! Tiles with many sides, with a reflex corner, around the point of a region, or that bend too much, are divided.
//!
//! The layout joins the centre of a tile to the middles of its sides, so that of n sides leave corners of 360 / n degrees
//! there. The cut runs between two stations of the border: a corner, whose angle it halves, or the middle of a side that
//! is no segment, where three borders meet then. It is the line that is equally far from both parts of the border.

use super::Construction;
use super::check::{Outline, Stamps, normal_cone, outline, slenderness};
use super::recheck::Recheck;
use crate::TilingError;
use std::collections::BTreeMap;
use topipe_mesh::{FaceId, HalfEdgeId};

/// Tiles with more sides are divided.
const MOST_SIDES: usize = 9;
/// Tiles of less than this area, in squares of the local size, are not divided because they bend.
const LEAST_AREA: f64 = 0.25;
/// A middle of a side is as good a station as a corner of this angle.
const MIDDLE: f64 = 2.3; // 130 degrees
/// Wider corners are no better stations.
const WIDE: f64 = 3.5; // 200 degrees
/// Tiles with a wider corner between two barriers are cut from it: one quad would lie in it.
const WIDEST: f64 = 2.8; // 160 degrees
/// A region that comes to a point of less than this angle, and one quad below it with both its sides, are a lip: a coarse mesh has
/// the same triangle in the corner of both, as gmsh's of the bridge. A cut from the point leaves two quads there.
const POINTED: f64 = 2.1; // 120 degrees
/// Corners narrower than this are not cut in two.
const LEAST_LIP: f64 = 0.7; // 40 degrees
/// Such a corner is cut like one of this angle.
const LIP: f64 = 1.01 * WIDEST;
/// What each side costs that one part has more than the other.
const UNEVEN: f64 = 0.15;
/// Tiles more slender than this (see [`slenderness`]) are cut across.
const SLENDER: f64 = 48.0;
/// With more sides than [`FEW_SIDES`] these are: several of them crowd at an end, and the quads that reach there from the centre
/// are needles. Corners outside 15 to 165 degrees and crossings of the triangulated surface on bell-crank, bracket, support and
/// bridge: 18 and 680 without this limit, 14 and 662 with 42, 2 and 266 with 36 (a fifth more patches), 12 and 115 with 32 (three
/// fifths more).
const LESS_SLENDER: f64 = 36.0;
const FEW_SIDES: usize = 4;
/// Unless they cover less than this, in squares of the local size: slivers between regions stay in one piece.
const LEAST_SLENDER_AREA: f64 = 0.01;
/// What it costs there that one part has all the border.
const UNEVEN_LENGTH: f64 = 3.0;

/// A place where a cut may end.
struct Station {
    /// Index in the border of the half-edge after it.
    at: usize,
    value: f64,
    /// Angle of a corner between two barriers, radians: there relaxation can not make it narrower. 0 elsewhere.
    fixed_angle: f64,
    /// Length of the border before it, mm.
    along: f64,
    /// Sides before it, counted from the first corner; halves for middles.
    sides: f64,
}

impl Construction<'_> {
    /// One round; true if a tile was divided.
    pub(super) fn divide_polygons(&mut self, recheck: &mut Recheck) -> Result<bool, TilingError> {
        self.progress.check()?;
        recheck.update(self);
        let by_tile = Recheck::faces_by_tile(self, &recheck.is_small);
        let is_corner = &recheck.is_corner;
        let mut stamps = Stamps::new(is_corner.len());
        let limit = self.parameters.normal_cone.to_radians();
        let mut divided = 0;
        for (tile, faces) in by_tile.iter().enumerate() {
            if faces.is_empty() {
                continue;
            }
            let surface = &self.surface;
            let border = |h| surface.is_border(h);
            let Ok(outline) = outline(surface, faces, border, is_corner, &mut stamps) else { continue };
            let mesh = &surface.refiner.part().mesh;
            let area: f64 = faces
                .iter()
                .map(|&f| mesh.area_vector(f).length() / 2.0 / surface.size[f.index()].powi(2))
                .sum();
            let bent = area >= LEAST_AREA && normal_cone(surface, faces).0 > limit;
            let most = if outline.corners.len() > FEW_SIDES { LESS_SLENDER } else { SLENDER };
            let slender = area >= LEAST_SLENDER_AREA && slenderness(surface, faces, &outline.border) > most;
            let stations = self.stations(&outline);
            let mut wide = None;
            for (i, station) in stations.iter().enumerate() {
                if station.fixed_angle > wide.map_or(WIDEST, |w: usize| stations[w].fixed_angle) {
                    wide = Some(i);
                }
            }
            if (outline.corners.len() > MOST_SIDES || bent || slender || wide.is_some())
                && self.divide(tile as u32, &outline, &stations, wide, slender)
            {
                divided += 1;
            } else {
                recheck.is_small[tile] = true;
            }
        }
        if divided > 0 {
            self.progress.remark(&format!(
                "{divided} tiles with many sides, reflex corners or strong bends are divided"
            ));
        }
        Ok(divided > 0)
    }

    fn stations(&self, outline: &Outline) -> Vec<Station> {
        let surface = &self.surface;
        let border = &outline.border;
        let mut stations = Vec::new();
        let mut reach = vec![0.0];
        border.iter().for_each(|&h| reach.push(reach[reach.len() - 1] + surface.length(h)));
        for (i, &start) in outline.corners.iter().enumerate() {
            let mut angle = 0.0;
            let mut h = border[start];
            loop {
                angle += surface.angle(h);
                if surface.is_border(h.prev()) {
                    break;
                }
                h = surface.refiner.twin(h.prev());
            }
            let before = border[(start + border.len() - 1) % border.len()];
            let between_barriers = surface.is_barrier(border[start]) && surface.is_barrier(before);
            let fixed_angle = match between_barriers {
                true if angle > LEAST_LIP && self.is_lip(border[start]) => angle.max(LIP),
                true => angle,
                false => 0.0,
            };
            stations.push(Station {
                at: start,
                value: angle.min(WIDE),
                fixed_angle,
                along: reach[start],
                sides: i as f64,
            });
            let end = outline.corners.get(i + 1).copied().unwrap_or(border.len());
            if end >= start + 2 && !surface.is_barrier(border[start]) {
                let total: f64 = border[start..end].iter().map(|&h| surface.length(h)).sum();
                let mut along = 0.0;
                let mut middle = start + 1;
                for k in start..end - 1 {
                    along += surface.length(border[k]);
                    middle = k + 1;
                    if along >= total / 2.0 {
                        break;
                    }
                }
                stations.push(Station {
                    at: middle,
                    value: MIDDLE,
                    fixed_angle: 0.0,
                    along: reach[middle],
                    sides: i as f64 + 0.5,
                });
            }
        }
        stations
    }

    /// Whether a region comes to a point at the corner of a tile that `start` leaves, and the tile is all that is around it.
    fn is_lip(&self, start: HalfEdgeId) -> bool {
        let surface = &self.surface;
        let tile = surface.owner[start.face().index()];
        let mut region = None;
        let mut angle = 0.0;
        for h in surface.refiner.outgoing(surface.refiner.origin(start)) {
            let f = h.face().index();
            if surface.owner[f] != tile {
                if surface.is_free(h.face()) || *region.get_or_insert(surface.region[f]) != surface.region[f]
                {
                    return false;
                }
                angle += surface.angle(h);
            }
        }
        angle < POINTED
    }

    /// Cuts the tile between two of its stations, one of them `through` if that is given.
    fn divide(
        &mut self,
        tile: u32,
        outline: &Outline,
        stations: &[Station],
        through: Option<usize>,
        slender: bool,
    ) -> bool {
        let all = outline.corners.len() as f64;
        let total: f64 = outline.border.iter().map(|&h| self.surface.length(h)).sum();
        let mut best: Option<(f64, usize, usize)> = None;
        for (i, a) in stations.iter().enumerate() {
            for (j, b) in stations.iter().enumerate().skip(i + 1) {
                if through.is_some_and(|t| t != i && t != j) {
                    continue;
                }
                // Sides of the two parts, without the cut; each needs two at least.
                let one = b.sides - a.sides;
                let two = all - one;
                if one.min(two) < 2.0 {
                    continue;
                }
                let uneven = if slender {
                    UNEVEN_LENGTH * (1.0 - 2.0 * (b.along - a.along) / total).abs()
                } else {
                    UNEVEN * (one - two).abs()
                };
                let value = a.value.min(b.value) - uneven;
                if best.is_none_or(|(most, ..)| value > most) {
                    best = Some((value, a.at, b.at));
                }
            }
        }
        let Some((_, from, to)) = best else { return false };
        let mut seeds: BTreeMap<FaceId, u32> = BTreeMap::new();
        for (k, h) in outline.border.iter().enumerate() {
            seeds.entry(h.face()).or_insert((from..to).contains(&k) as u32);
        }
        let seeds: Vec<(u32, FaceId)> = seeds.into_iter().map(|(f, piece)| (piece, f)).collect();
        if seeds.iter().all(|s| s.0 == seeds[0].0) {
            return false;
        }
        self.take(tile, &seeds);
        true
    }
}
