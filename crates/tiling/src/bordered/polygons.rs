//! Tiles with many sides, or that bend too much, are divided.
//!
//! The layout joins the centre of a tile to the middles of its sides, so that of n sides leave corners of 360 / n degrees
//! there. The cut runs between two stations of the border: a corner, whose angle it halves, or the middle of a side that
//! is no segment, where three borders meet then. It is the line that is equally far from both parts of the border.

use super::Construction;
use super::check::{Outline, Stamps, normal_cone, outline};
use crate::TilingError;
use std::collections::BTreeMap;
use topipe_mesh::FaceId;

/// Tiles with more sides are divided.
const MOST_SIDES: usize = 9;
/// Tiles of less than this area, in squares of the local size, are not divided because they bend.
const LEAST_AREA: f64 = 0.25;
/// A middle of a side is as good a station as a corner of this angle.
const MIDDLE: f64 = 2.3; // 130 degrees
/// Wider corners are no better stations.
const WIDE: f64 = 3.5; // 200 degrees
/// What each side costs that one part has more than the other.
const UNEVEN: f64 = 0.15;

/// A place where a cut may end.
struct Station {
    /// Index in the border of the half-edge after it.
    at: usize,
    value: f64,
    /// Sides before it, counted from the first corner; halves for middles.
    sides: f64,
}

impl Construction<'_> {
    /// One round; true if a tile was divided.
    pub(crate) fn divide_polygons(&mut self) -> Result<bool, TilingError> {
        self.progress.check()?;
        let by_tile = self.faces_by_tile();
        let is_corner = self.corner_vertices();
        let mut stamps = Stamps::new(is_corner.len());
        let limit = self.parameters.normal_cone.to_radians();
        let mut divided = 0;
        for (tile, faces) in by_tile.iter().enumerate() {
            if faces.is_empty() {
                continue;
            }
            let surface = &self.surface;
            let border = |h| surface.is_border(h);
            let Ok(outline) = outline(surface, faces, border, &is_corner, &mut stamps) else { continue };
            let mesh = &surface.refiner.part().mesh;
            let area: f64 = faces
                .iter()
                .map(|&f| mesh.area_vector(f).length() / 2.0 / surface.size[f.index()].powi(2))
                .sum();
            let bent = area >= LEAST_AREA && normal_cone(surface, faces).0 > limit;
            if (outline.corners.len() > MOST_SIDES || bent) && self.divide(tile as u32, &outline) {
                divided += 1;
            }
        }
        if divided > 0 {
            self.progress.remark(&format!("{divided} tiles with many sides or strong bends are divided"));
        }
        Ok(divided > 0)
    }

    fn stations(&self, outline: &Outline) -> Vec<Station> {
        let surface = &self.surface;
        let border = &outline.border;
        let mut stations = Vec::new();
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
            stations.push(Station { at: start, value: angle.min(WIDE), sides: i as f64 });
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
                stations.push(Station { at: middle, value: MIDDLE, sides: i as f64 + 0.5 });
            }
        }
        stations
    }

    fn divide(&mut self, tile: u32, outline: &Outline) -> bool {
        let stations = self.stations(outline);
        let all = outline.corners.len() as f64;
        let mut best: Option<(f64, usize, usize)> = None;
        for (i, a) in stations.iter().enumerate() {
            for b in &stations[i + 1..] {
                // Sides of the two parts, without the cut; each needs two at least.
                let one = b.sides - a.sides;
                let two = all - one;
                if one.min(two) < 2.0 {
                    continue;
                }
                let value = a.value.min(b.value) - UNEVEN * (one - two).abs();
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
