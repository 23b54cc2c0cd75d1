//! Which tiles have to be looked at again after some were cut.
//!
//! A round of cuts changes few tiles, and on a fine mesh looking at all of them took most of its time. A tile that was found sound
//! stays so while no face at its vertices gets another owner or is split: its border, its corners and the tiles beyond are the same.

use super::Construction;
use super::surface::NONE;
use topipe_mesh::{FaceId, VertexId};

/// What is known about tiles from one round to the next.
pub(super) struct Recheck {
    /// Owners when it was last brought up to date.
    owner: Vec<u32>,
    /// See [`Construction::corner_vertices`].
    pub(super) is_corner: Vec<bool>,
    /// Per tile: a disk with three corners, and nothing has changed around it since.
    pub(super) is_sound: Vec<bool>,
    /// Per tile: it need not be divided, see [`super::polygons`], and nothing has changed around it since.
    pub(super) is_small: Vec<bool>,
}

impl Recheck {
    /// All tiles are to be looked at.
    pub(super) fn new(construction: &Construction<'_>) -> Self {
        Self {
            owner: construction.surface.owner.clone(),
            is_corner: construction.corner_vertices(),
            is_sound: vec![false; construction.seeds.len()],
            is_small: vec![false; construction.seeds.len()],
        }
    }

    /// Follows what was changed since.
    pub(super) fn update(&mut self, construction: &Construction<'_>) {
        let surface = &construction.surface;
        let mesh = &surface.refiner.part().mesh;
        self.is_sound.resize(construction.seeds.len(), false);
        self.is_small.resize(construction.seeds.len(), false);
        self.is_corner.resize(mesh.vertex_count(), false);
        // Of a face that was split all new vertices are corners of new faces, too.
        let changed = (0..surface.owner.len()).filter(|&f| self.owner.get(f) != Some(&surface.owner[f]));
        let mut vertices: Vec<VertexId> =
            changed.flat_map(|f| mesh.triangles[FaceId::new(f).index()]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        for v in vertices {
            let around = surface.refiner.outgoing(v);
            let borders = around.iter().filter(|&&h| surface.is_border(h)).count();
            self.is_corner[v.index()] = borders > 2 || construction.is_node.get(v.index()) == Some(&true);
            for h in around {
                let owner = surface.owner[h.face().index()] as usize;
                for known in [&mut self.is_sound, &mut self.is_small] {
                    if let Some(known) = known.get_mut(owner) {
                        *known = false;
                    }
                }
            }
        }
        debug_assert_eq!(self.is_corner, construction.corner_vertices());
        self.owner.clone_from(&surface.owner);
    }

    /// The faces of the tiles that are not `known`; the lists of the others are empty.
    pub(super) fn faces_by_tile(construction: &Construction<'_>, known: &[bool]) -> Vec<Vec<FaceId>> {
        let mut faces = vec![Vec::new(); construction.seeds.len()];
        for (f, &owner) in construction.surface.owner.iter().enumerate() {
            if owner != NONE && !known[owner as usize] {
                faces[owner as usize].push(FaceId::new(f));
            }
        }
        faces
    }
}
