//! Repair: all violations of a round are collected, and an independent set of them is repaired together.
//!
//! A tile has to be a disk with a simple border and three corners or more. It should not bend too much, or a patch can
//! not follow it, and should not have too many sides. In some rounds tiles that violate this get another site, which
//! gives well-shaped tiles but is not sure to end. Then tiles that still are no disks are cut to pieces, which changes
//! no other tile but for new corners, so that it ends; see [`super::pieces`].

use super::check::{Fault, Outline, Stamps, normal_cone, outline, slenderness};
use super::recheck::Recheck;
use super::surface::NONE;
use super::{Construction, Seed};
use crate::TilingError;
use std::collections::BTreeSet;
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, VertexId};

/// Rounds in which sites are added.
const SITE_ROUNDS: usize = 8;
/// Strips more slender than this (see [`slenderness`]) have their segment halved, down to this part of the local size.
const SLENDER: f64 = 45.0;
const LEAST_SEGMENT: f64 = 0.2;
/// Rounds in which tiles of many sides are divided.
const DIVIDE_ROUNDS: usize = 6;
/// How often segments are halved and everything is begun again.
const ATTEMPTS: usize = 8;

/// A site that is asked for may lie this many rings of vertices from the place; the tile is refined else.
const RINGS: usize = 2;

pub(crate) enum Remedy {
    /// A site near this vertex.
    Site(VertexId),
    /// A node in the middle of the longest segment along the tile.
    Halve,
}

impl Construction<'_> {
    pub(crate) fn remedy(
        &self,
        tile: u32,
        faces: &[FaceId],
        is_corner: &[bool],
        stamps: &mut Stamps,
        quality: bool,
    ) -> Option<Remedy> {
        let surface = &self.surface;
        let Outline { border, corners } =
            match outline(surface, faces, |h| surface.is_border(h), is_corner, stamps) {
                Ok(outline) => outline,
                Err(Fault::Pinch(v)) if !surface.on_barrier[v.index()] => return Some(Remedy::Site(v)),
                Err(_) => return Some(self.unfold(tile, faces, is_corner, stamps)),
            };
        let far = |face: FaceId| surface.refiner.part().mesh.triangles[face.index()][0];
        if corners.len() < 3 {
            // The longest stretch along a neighbour is cut in two by a tile in its middle.
            let mut best: Option<(f64, usize)> = None;
            let starts = if corners.is_empty() { vec![0] } else { corners.clone() };
            for (i, &start) in starts.iter().enumerate() {
                let end = if i + 1 < starts.len() { starts[i + 1] } else { border.len() };
                if border[start..end].iter().any(|&h| surface.is_barrier(h)) {
                    continue;
                }
                let length: f64 = border[start..end].iter().map(|&h| surface.length(h)).sum();
                if best.is_none_or(|(longest, _)| length > longest) {
                    best = Some((length, (start + end) / 2));
                }
            }
            return Some(match best {
                Some((_, middle)) => Remedy::Site(surface.refiner.origin(border[middle])),
                None => Remedy::Halve,
            });
        }
        if !quality {
            return None;
        }
        let (angle, face) = normal_cone(surface, faces);
        if angle > self.parameters.normal_cone.to_radians() {
            return Some(Remedy::Site(far(face)));
        }
        // A strip along a segment much longer than it is deep.
        if slenderness(surface, faces, &border) > SLENDER {
            let perimeter: f64 = border.iter().map(|&h| surface.length(h)).sum();
            let longest = self.longest_segment(faces).map_or(0.0, |(length, _)| length);
            if longest > 0.3 * perimeter && longest > LEAST_SEGMENT * surface.size[faces[0].index()] {
                return Some(Remedy::Halve);
            }
        }
        None
    }

    /// The remedy for a tile that is no disk with a simple border.
    fn unfold(&self, tile: u32, faces: &[FaceId], is_corner: &[bool], stamps: &mut Stamps) -> Remedy {
        let surface = &self.surface;
        let own: Vec<FaceId> = faces.iter().copied().filter(|f| surface.fixed[f.index()]).collect();
        let in_own = |f: FaceId| surface.fixed[f.index()] && surface.owner[f.index()] == tile;
        let border = |h: HalfEdgeId| surface.is_barrier(h) || !in_own(surface.refiner.twin(h).face());
        if !own.is_empty() && outline(surface, &own, border, is_corner, stamps).is_err() {
            return Remedy::Halve;
        }
        match farthest(self, faces) {
            Some(face) => Remedy::Site(surface.refiner.part().mesh.triangles[face.index()][0]),
            None => Remedy::Halve,
        }
    }

    /// Violating tiles with their remedies, no two of them neighbours.
    fn violations(&self, quality: bool) -> Vec<(u32, Remedy)> {
        let by_tile = self.faces_by_tile();
        let is_corner = self.corner_vertices();
        let mut stamps = Stamps::new(is_corner.len());
        let mut busy = vec![false; self.seeds.len()];
        let mut found = Vec::new();
        for tile in 0..self.seeds.len() as u32 {
            let faces = &by_tile[tile as usize];
            if busy[tile as usize] || faces.is_empty() {
                continue;
            }
            if let Some(remedy) = self.remedy(tile, faces, &is_corner, &mut stamps, quality) {
                busy[tile as usize] = true;
                for &f in faces {
                    for k in 0..3 {
                        let other = self.surface.refiner.twin(HalfEdgeId::of(f, k)).face();
                        if let Some(slot) = busy.get_mut(self.surface.owner[other.index()] as usize) {
                            *slot = true;
                        }
                    }
                }
                found.push((tile, remedy));
            }
        }
        found
    }

    /// First strips, then sites, then pieces; see the head of this file.
    pub(crate) fn repair(&mut self) -> Result<(), TilingError> {
        let mut left = Vec::new();
        let mut near = DVec3::ZERO;
        for attempt in 0..ATTEMPTS {
            self.add_sites_where_asked(if attempt == 0 { SITE_ROUNDS } else { 2 })?;
            let mut recheck = Recheck::new(self);
            left = self.cut_to_disks(&mut recheck)?;
            for _ in 0..DIVIDE_ROUNDS {
                if !left.is_empty() || !self.divide_polygons(&mut recheck)? {
                    break;
                }
                left = self.cut_to_disks(&mut recheck)?;
            }
            if left.is_empty() {
                return Ok(());
            }
            self.progress
                .remark(&format!("{} tiles are held by their segments, which are halved", left.len()));
            let by_tile = self.faces_by_tile();
            let first = left.first().and_then(|&tile| by_tile[tile as usize].first());
            near = first.map_or(DVec3::ZERO, |f| self.surface.centroid[f.index()]);
            for &tile in &left {
                self.halve_segment_of(&by_tile[tile as usize]);
            }
            self.seeds.retain(|seed| *seed != Seed::Piece);
            self.lay_strips();
        }
        Err(TilingError::NotConverged {
            violations: left.len(),
            rounds: ATTEMPTS,
            x: near.x,
            y: near.y,
            z: near.z,
        })
    }

    /// Rounds in which violating tiles get sites near what is wrong with them, and tiles are grown anew.
    fn add_sites_where_asked(&mut self, rounds: usize) -> Result<(), TilingError> {
        for round in 0..rounds {
            self.progress.check()?;
            let violations = self.violations(true);
            if violations.is_empty() {
                return Ok(());
            }
            self.progress.remark(&format!("round {round}: {} tiles to split", violations.len()));
            let mut halved = false;
            let by_tile = self.faces_by_tile();
            let mut occupied = self.occupied();
            for (tile, remedy) in violations {
                match remedy {
                    Remedy::Site(place) => {
                        if let Some(v) = self.free_vertex_near(place, tile, &occupied) {
                            self.add_site(v, &mut occupied);
                        }
                    }
                    Remedy::Halve => halved |= self.halve_segment_of(&by_tile[tile as usize]),
                }
            }
            if halved {
                self.lay_strips();
            }
        }
        Ok(())
    }

    /// The vertex nearest to `place`, by breadth-first search inside a tile, where a site may be placed.
    fn free_vertex_near(&self, place: VertexId, tile: u32, occupied: &[bool]) -> Option<VertexId> {
        let surface = &self.surface;
        let mut seen = BTreeSet::from([place]);
        let mut ring = vec![place];
        for _ in 0..=RINGS {
            let free = ring.iter().copied().filter(|&v| self.may_be_site(v, occupied)).min();
            if free.is_some() {
                return free;
            }
            let mut next = Vec::new();
            for v in ring {
                for h in surface.refiner.outgoing(v) {
                    let inside = surface.owner[h.face().index()] == tile;
                    for w in [surface.refiner.target(h), surface.refiner.origin(h.prev())] {
                        if inside && seen.insert(w) {
                            next.push(w);
                        }
                    }
                }
            }
            ring = next;
        }
        None
    }

    /// The longest segment along some faces, and its length.
    fn longest_segment(&self, faces: &[FaceId]) -> Option<(f64, usize)> {
        let surface = &self.surface;
        let mut beside: Vec<usize> = faces
            .iter()
            .flat_map(|&f| (0..3).map(move |k| HalfEdgeId::of(f, k)))
            .map(|h| surface.side[h.index()])
            .filter(|&side| side != NONE)
            .map(|side| side as usize / 2)
            .collect();
        beside.sort_unstable();
        beside.dedup();
        let mut longest: Option<(f64, usize)> = None;
        for i in beside {
            let Some(segment) = self.segments.get(i) else { continue };
            let at = |v: VertexId| surface.position(v);
            let length: f64 = segment.path.windows(2).map(|w| at(w[0]).distance(at(w[1]))).sum();
            if longest.is_none_or(|(most, _)| length > most) {
                longest = Some((length, i));
            }
        }
        longest
    }

    /// Halves the longest segment along some faces; false if there is none.
    fn halve_segment_of(&mut self, faces: &[FaceId]) -> bool {
        let Some((_, segment)) = self.longest_segment(faces) else { return false };
        if segment < self.given.len() {
            self.asked.push(segment);
            return false;
        }
        match self.segments[segment].halve(&mut self.surface) {
            Some(second) => {
                self.segments.push(second);
                true
            }
            None => false,
        }
    }
}

/// The free face of a tile that is farthest from where it grew from.
fn farthest(construction: &Construction<'_>, faces: &[FaceId]) -> Option<FaceId> {
    let surface = &construction.surface;
    faces.iter().copied().filter(|f| !surface.fixed[f.index()]).max_by(|a, b| {
        let d = |f: &FaceId| surface.distance[f.index()];
        d(a).total_cmp(&d(b)).then(b.cmp(a))
    })
}
