//! Tiles that are no disks are cut to pieces.
//!
//! A tile is cut in two by growing two seeds inside it; the other tiles stay as they are but for new corners on their
//! borders. A ring falls into two halves at the first cut. A tile with fewer faces each time ends as a disk, at the
//! latest as a single face. A lens, a disk with two corners only, is joined to the neighbour along its longer side, or
//! that neighbour is cut in two so that the lens gets a corner.

use super::check::{Fault, Outline, Stamps, outline};
use super::growth::Candidate;
use super::recheck::Recheck;
use super::surface::NONE;
use super::{Construction, Seed};
use crate::TilingError;
use std::collections::{BTreeMap, BinaryHeap};
use topipe_mesh::{FaceId, HalfEdgeId, VertexId};

/// Rounds after which it gives up. Cutting needs a few; lenses may ask for some more.
const MOST_ROUNDS: usize = 60;
/// Rounds in which lenses are joined to a neighbour; later neighbours are cut.
const JOIN_ROUNDS: usize = 8;

impl Construction<'_> {
    /// Cuts until all tiles are disks with simple borders and three corners. Returns the tiles that can not be helped
    /// because they are held by their own segments.
    pub(super) fn cut_to_disks(&mut self, recheck: &mut Recheck) -> Result<Vec<u32>, TilingError> {
        let mut held = Vec::new();
        let mut stamps = Stamps::new(0);
        for round in 0..MOST_ROUNDS {
            self.progress.check()?;
            held.clear();
            let mut open = Vec::new();
            recheck.update(self);
            let mut by_tile = Recheck::faces_by_tile(self, &recheck.is_sound);
            stamps.grow(recheck.is_corner.len());
            let is_corner = &recheck.is_corner;
            let mut busy = vec![false; self.seeds.len()];
            let mut changes = 0;
            for tile in 0..by_tile.len() as u32 {
                let faces = std::mem::take(&mut by_tile[tile as usize]);
                if faces.is_empty() || busy[tile as usize] {
                    continue;
                }
                let surface = &self.surface;
                // Faces that were split since still belong to it; they are looked at in the next round.
                let found = outline(surface, &faces, |h| surface.is_border(h), is_corner, &mut stamps);
                if !matches!(&found, Ok(outline) if outline.corners.len() >= 3) {
                    open.push(tile);
                }
                match found {
                    Err(fault) => {
                        let parted = match fault {
                            Fault::Pinch(v) => self.part(tile, v),
                            Fault::NotDisk => false,
                        };
                        if parted
                            || (round >= JOIN_ROUNDS && self.separate(tile, &faces))
                            || self.bisect(tile, &faces, is_corner, &mut stamps)
                        {
                            changes += 1;
                            self.mark_neighbors(&faces, &mut busy);
                        } else {
                            held.push(tile);
                        }
                    }
                    Ok(Outline { border, corners }) if corners.len() < 3 => {
                        match self.relieve_lens(tile, &border, &corners, &busy, round < JOIN_ROUNDS) {
                            Lens::Changed => {
                                changes += 1;
                                self.mark_neighbors(&faces, &mut busy);
                            }
                            Lens::Later => changes += 1,
                        }
                    }
                    Ok(_) => recheck.is_sound[tile as usize] = true,
                }
            }
            if changes == 0 {
                return Ok(held);
            }
            if round + 1 == MOST_ROUNDS {
                held.append(&mut open);
            }
            self.progress.remark(&format!("cutting, round {round}: {changes} tiles changed"));
        }
        Ok(held)
    }

    fn mark_neighbors(&self, faces: &[FaceId], busy: &mut [bool]) {
        for &f in faces {
            for k in 0..3 {
                let other = self.surface.refiner.twin(HalfEdgeId::of(f, k)).face();
                for owner in [self.surface.owner[f.index()], self.surface.owner[other.index()]] {
                    if let Some(slot) = busy.get_mut(owner as usize) {
                        *slot = true;
                    }
                }
            }
        }
    }

    /// Distances inside a tile from some of its faces, and which of them is nearest. Faces that are not reached are
    /// left out.
    fn within(&self, tile: u32, seeds: &[(u32, FaceId)]) -> BTreeMap<FaceId, (f64, u32)> {
        let surface = &self.surface;
        let mut found: BTreeMap<FaceId, (f64, u32)> = BTreeMap::new();
        let mut heap: BinaryHeap<Candidate> =
            seeds.iter().map(|&(piece, face)| Candidate { distance: 0.0, tile: piece, face }).collect();
        while let Some(Candidate { distance, tile: piece, face }) = heap.pop() {
            if found.contains_key(&face) {
                continue;
            }
            found.insert(face, (distance, piece));
            for k in 0..3 {
                let h = HalfEdgeId::of(face, k);
                let next = surface.refiner.twin(h).face();
                if !surface.is_barrier(h) && surface.owner[next.index()] == tile && !found.contains_key(&next)
                {
                    heap.push(Candidate { distance: distance + surface.step(h), tile: piece, face: next });
                }
            }
        }
        found
    }

    /// Cuts a tile that touches itself at a vertex in two, from the two fans it has there.
    fn part(&mut self, tile: u32, v: VertexId) -> bool {
        let surface = &self.surface;
        let fan = surface.refiner.outgoing(v);
        let n = fan.len();
        let own = |i: usize| surface.owner[fan[i % n].face().index()] == tile;
        // A run begins where the half-edge is a border.
        let begins: Vec<usize> = (0..n).filter(|&i| own(i) && surface.is_border(fan[i])).collect();
        let [first, second, ..] = begins[..] else { return false };
        let run = |begin: usize| {
            let mut faces = vec![fan[begin].face()];
            let mut i = begin + 1;
            while i < begin + n && own(i) && !surface.is_border(fan[i % n]) {
                faces.push(fan[i % n].face());
                i += 1;
            }
            faces
        };
        let seeds: Vec<(u32, FaceId)> =
            run(first).into_iter().map(|f| (0, f)).chain(run(second).into_iter().map(|f| (1, f))).collect();
        self.take(tile, &seeds);
        true
    }

    /// Makes each connected part of a tile a tile of its own, all at once: a strip along a ragged border of a fine mesh can have
    /// dozens, of which [`Self::bisect`] cuts off one a round. False where there is one part only.
    fn separate(&mut self, tile: u32, faces: &[FaceId]) -> bool {
        let mut reached = self.within(tile, &[(0, faces[0])]);
        let whole = reached.len() == faces.len();
        for &face in faces {
            if !reached.contains_key(&face) {
                let part = self.within(tile, &[(0, face)]);
                let number = self.seeds.len() as u32;
                self.seeds.push(Seed::Piece);
                for (&f, &(distance, _)) in &part {
                    self.surface.owner[f.index()] = number;
                    self.surface.distance[f.index()] = distance;
                }
                reached.extend(part);
            }
        }
        !whole
    }

    /// Cuts a tile in two; false where it is a single face.
    fn bisect(&mut self, tile: u32, faces: &[FaceId], is_corner: &[bool], stamps: &mut Stamps) -> bool {
        let fixed: Vec<FaceId> = faces.iter().copied().filter(|f| self.surface.fixed[f.index()]).collect();
        // What lies along segments stays together if there is anything else, and if it is a disk by itself.
        let in_own = |f: FaceId| self.surface.fixed[f.index()] && self.surface.owner[f.index()] == tile;
        let ends = |h: HalfEdgeId| self.surface.is_barrier(h) || !in_own(self.surface.refiner.twin(h).face());
        let all_fixed = fixed.len() == faces.len()
            || (!fixed.is_empty() && outline(&self.surface, &fixed, ends, is_corner, stamps).is_err());
        let fixed = if all_fixed { Vec::new() } else { fixed };
        let farthest = |found: &BTreeMap<FaceId, (f64, u32)>| {
            // Not reached at all is farthest.
            let distance = |f: &FaceId| found.get(f).map_or(f64::INFINITY, |e| e.0);
            faces
                .iter()
                .copied()
                .filter(|f| all_fixed || !self.surface.fixed[f.index()])
                .max_by(|a, b| distance(a).total_cmp(&distance(b)).then(b.cmp(a)))
        };
        let first: Vec<FaceId> = if fixed.is_empty() {
            let Some(end) = farthest(&self.within(tile, &[(0, faces[0])])) else { return false };
            vec![end]
        } else {
            fixed
        };
        let seeds: Vec<(u32, FaceId)> = first.iter().map(|&f| (0, f)).collect();
        let Some(second) = farthest(&self.within(tile, &seeds)) else { return false };
        if first.contains(&second) {
            return false;
        }
        let mut seeds = seeds;
        seeds.push((1, second));
        self.take(tile, &seeds);
        true
    }

    /// Gives the faces of a tile that are nearer to the seeds of piece 1 to a new tile.
    pub(crate) fn take(&mut self, tile: u32, seeds: &[(u32, FaceId)]) {
        let number = self.seeds.len() as u32;
        self.seeds.push(Seed::Piece);
        for (face, (distance, piece)) in self.within(tile, seeds) {
            if piece == 1 {
                self.surface.owner[face.index()] = number;
                self.surface.distance[face.index()] = distance;
            }
        }
    }

    fn relieve_lens(
        &mut self,
        tile: u32,
        border: &[HalfEdgeId],
        corners: &[usize],
        busy: &[bool],
        join: bool,
    ) -> Lens {
        let surface = &self.surface;
        let [first, second] = corners[..] else {
            // An island in another tile, or one of two tiles that make a sphere: cut across, it gives corners to both.
            let ends = [border[0].face(), border[border.len() / 2].face()];
            if ends[0] == ends[1] {
                self.surface.split_face(ends[0]);
            } else {
                self.take(tile, &[(0, ends[0]), (1, ends[1])]);
            }
            return Lens::Changed;
        };
        debug_assert_eq!(first, 0);
        let sides = [&border[..second], &border[second..]];
        let across = |side: &[HalfEdgeId]| surface.owner[surface.refiner.twin(side[0]).face().index()];
        let length = |side: &[HalfEdgeId]| side.iter().map(|&h| surface.length(h)).sum::<f64>();
        let mut open: Vec<usize> = (0..2).filter(|&i| !surface.is_barrier(sides[i][0])).collect();
        open.sort_by(|&i, &j| length(sides[j]).total_cmp(&length(sides[i])).then(i.cmp(&j)));
        let neighbors = [across(sides[0]), across(sides[1])];
        let Some(&longest) = open.first() else {
            // Segments on both sides: it is cut across, and they get a corner each.
            let ends = [border[0].face(), border[second].face()];
            if ends[0] == ends[1] {
                self.surface.split_face(ends[0]);
            } else {
                self.take(tile, &[(0, ends[0]), (1, ends[1])]);
            }
            return Lens::Changed;
        };
        let free = |owner: u32| owner != NONE && busy.get(owner as usize) == Some(&false);
        if neighbors.iter().any(|&n| n != NONE && !free(n)) {
            return Lens::Later;
        }
        let neighbor = neighbors[longest];
        if join && neighbors[0] != neighbors[1] {
            for owner in self.surface.owner.iter_mut().filter(|o| **o == tile) {
                *owner = neighbor;
            }
            return Lens::Changed;
        }
        let side = sides[longest];
        if side.len() == 1 {
            self.surface.split_edge(side[0], 0.5);
            return Lens::Changed;
        }
        let ends = [side[0], side[side.len() - 1]].map(|h| self.surface.refiner.twin(h).face());
        if ends[0] == ends[1] {
            self.surface.split_face(ends[0]);
            return Lens::Changed;
        }
        self.take(neighbor, &[(0, ends[0]), (1, ends[1])]);
        Lens::Changed
    }
}

enum Lens {
    /// Something was done.
    Changed,
    /// A neighbour was changed in this round; look again in the next.
    Later,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameters;
    use crate::bordered::surface::Surface;
    use topipe_mesh::refine::Refiner;
    use topipe_mesh::{Part, RegionId, TriangleMesh};
    use topipe_progress::Progress;

    /// A torus of `columns` columns of eight squares.
    fn torus(columns: u32) -> Part {
        let turn = |k: u32, of: u32| f64::from(k) / f64::from(of) * std::f64::consts::TAU;
        let points = (0..8 * columns)
            .map(|k| {
                let ((s, c), (t, d)) = (turn(k / 8, columns).sin_cos(), turn(k % 8, 8).sin_cos());
                [(3.0 + d) * c, (3.0 + d) * s, t]
            })
            .collect();
        let at = |i: u32, j: u32| (i % columns) * 8 + j % 8;
        let triangles = (0..columns)
            .flat_map(|i| (0..8).map(move |j| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]))
            .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
        Part::new(TriangleMesh::from_arrays(points, triangles))
    }

    #[test]
    fn all_parts_of_a_tile_become_tiles_at_once() {
        let part = torus(12);
        let faces = part.mesh.face_count();
        let surface =
            Surface::new(Refiner::new(&part).unwrap(), vec![RegionId::NONE; faces], vec![1.0; faces]);
        let (parameters, progress) = (Parameters::default(), Progress::silent());
        let mut construction = Construction {
            surface,
            segments: Vec::new(),
            given: Vec::new(),
            asked: Vec::new(),
            is_node: Vec::new(),
            seeds: vec![Seed::Piece; 2],
            strip_of_side: Vec::new(),
            parameters: &parameters,
            progress: &progress,
        };
        // Every other column belongs to tile 0: six rings that touch nowhere.
        for f in 0..faces {
            construction.surface.owner[f] = (f / 16 % 2) as u32;
        }
        let own = construction.faces_by_tile().swap_remove(0);
        assert!(construction.separate(0, &own));
        let by_tile = construction.faces_by_tile();
        assert_eq!(by_tile.len(), 7);
        assert_eq!(by_tile[1].len(), faces / 2, "the other tile is as it was");
        for faces in by_tile.iter().enumerate().filter(|(tile, _)| *tile != 1).map(|(_, faces)| faces) {
            let column = faces[0].index() / 16;
            assert!(faces.len() == 16 && faces.iter().all(|f| f.index() / 16 == column));
        }
        let own = construction.faces_by_tile().swap_remove(0);
        assert!(!construction.separate(0, &own), "one part is whole");
    }
}
