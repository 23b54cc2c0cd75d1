//! The construction: seeds, relaxation, and rounds of repair until all conditions hold.
//!
//! The source adds one random site at a time and starts over. Here all violations of a round are collected and an
//! independent set of them is repaired together, and only the faces nearer to a new site change owner. The result
//! depends on nothing but the mesh and the parameters.

use crate::curves::segments;
use crate::densify::densify;
use crate::growth::{Growth, NONE};
use crate::{Method, Parameters, TileId, Tiling, TilingError};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{DVec3, FaceId, Part, VertexId};
use topipe_progress::Progress;

/// A site: a vertex, and the faces it starts from.
#[derive(Debug, Clone)]
pub(crate) struct Site {
    pub(crate) vertex: VertexId,
    /// On a feature curve: the layout must place its corner here, relaxation must not move it.
    pub(crate) anchor: bool,
    /// Faces along the curves through an anchor, with their distances.
    pub(crate) along: Vec<(FaceId, f64)>,
    /// The faces around the vertex can not be taken by another site; see [`Tessellation::hold`].
    pub(crate) held: bool,
}

/// A tessellation under construction.
pub(crate) struct Tessellation<'a> {
    pub(crate) refiner: Refiner,
    pub(crate) growth: Growth,
    pub(crate) sites: Vec<Site>,
    /// Faces in the star of a site: no second site may be placed there.
    pub(crate) occupied: Vec<bool>,
    pub(crate) spacing: f64,
    pub(crate) progress: &'a Progress,
}

/// Tiles a closed part; see the crate's documentation.
pub fn tile(part: &Part, parameters: &Parameters, progress: &Progress) -> Result<Tiling, TilingError> {
    tile_sized(part, parameters, None, progress)
}

/// Like [`tile`], with a size field: one factor per face of the part by which tiles shall be smaller (below 1) or larger
/// there. The source's tessellation knows one size only and ignores it.
pub fn tile_sized(
    part: &Part,
    parameters: &Parameters,
    sizes: Option<&[f64]>,
    progress: &Progress,
) -> Result<Tiling, TilingError> {
    parameters.validate()?;
    check(part)?;
    if parameters.method == Method::Bordered {
        return crate::bordered::tile(part, parameters, progress, sizes);
    }
    let mut refiner = Refiner::new(part)?;
    let area = part.mesh.area();
    let spacing = if parameters.tiles > 0 {
        // Hexagonal tiles of equal area.
        (2.0 * area / (3f64.sqrt() * f64::from(parameters.tiles))).sqrt()
    } else {
        parameters.tile_size * 2.0 * part.mesh.volume().abs() / area
    };
    densify(&mut refiner, area, spacing, parameters.faces_per_tile, progress)?;
    let curves = if parameters.follow_features { segments(&mut refiner, spacing) } else { Vec::new() };
    let growth = Growth::new(&refiner, spacing, !curves.is_empty());
    let mut tessellation =
        Tessellation { refiner, growth, sites: Vec::new(), occupied: Vec::new(), spacing, progress };
    tessellation.anchor(&curves);
    tessellation.seed(parameters.tiles as usize)?;
    for _ in 0..parameters.lloyd_rounds {
        progress.check()?;
        tessellation.relax();
    }
    tessellation.repair()?;
    Ok(tessellation.finish())
}

fn check(part: &Part) -> Result<(), TilingError> {
    let mesh = &part.mesh;
    if mesh.face_count() == 0 {
        return Err(TilingError::Degenerate("it has no faces"));
    }
    if mesh.positions.iter().any(|p| !p.is_finite()) {
        return Err(TilingError::Degenerate("a coordinate is not a finite number"));
    }
    if !(mesh.area() > 0.0 && mesh.volume() != 0.0) {
        return Err(TilingError::Degenerate("it encloses no volume"));
    }
    let connectivity = topipe_mesh::Connectivity::build(mesh)?;
    if !connectivity.is_closed() {
        let first = connectivity.edges().find(|&h| !connectivity.twin(h).is_some());
        let p = first.map_or(DVec3::ZERO, |h| mesh.position(connectivity.origin(h)));
        return Err(TilingError::Border { edges: connectivity.border_edge_count(), x: p.x, y: p.y, z: p.z });
    }
    Ok(())
}

impl Tessellation<'_> {
    pub(crate) fn star(&self, vertex: VertexId) -> Vec<FaceId> {
        self.refiner.outgoing(vertex).iter().map(|h| h.face()).collect()
    }

    /// True when no face around `vertex` lies in another site's star.
    pub(crate) fn is_free(&self, vertex: VertexId) -> bool {
        self.refiner.outgoing(vertex).iter().all(|h| !self.occupied[h.face().index()])
    }

    pub(crate) fn add_site(&mut self, vertex: VertexId, anchor: bool) -> u32 {
        for face in self.star(vertex) {
            self.occupied[face.index()] = true;
        }
        self.sites.push(Site { vertex, anchor, along: Vec::new(), held: false });
        self.sites.len() as u32 - 1
    }

    pub(crate) fn seeds_of(&self, site: u32) -> Vec<(u32, FaceId, f64)> {
        let s = &self.sites[site as usize];
        let mut star = self.growth.star(&self.refiner, s.vertex);
        if s.held {
            star.iter_mut().for_each(|(_, distance)| *distance = 0.0);
        }
        star.into_iter().chain(s.along.iter().copied()).map(|(f, d)| (site, f, d)).collect()
    }

    /// Grows all tiles anew from their sites.
    pub(crate) fn regrow(&mut self) {
        self.growth.distance.fill(f64::INFINITY);
        self.growth.owner.fill(NONE);
        let seeds: Vec<_> = (0..self.sites.len() as u32).flat_map(|s| self.seeds_of(s)).collect();
        self.growth.insert(&self.refiner, seeds);
    }

    pub(crate) fn faces_by_tile(&self) -> Vec<Vec<FaceId>> {
        let mut faces = vec![Vec::new(); self.sites.len()];
        for (f, &owner) in self.growth.owner.iter().enumerate() {
            if owner != NONE {
                faces[owner as usize].push(FaceId::new(f));
            }
        }
        faces
    }

    /// A face of each tile to stand for it: one around its site where the tile has any of these, else its nearest.
    /// None for a tile whose faces all went to others.
    pub(crate) fn representatives(&self) -> Vec<Option<FaceId>> {
        let mut nearest: Vec<Option<FaceId>> = vec![None; self.sites.len()];
        for (f, &owner) in self.growth.owner.iter().enumerate().filter(|(_, o)| **o != NONE) {
            let slot = &mut nearest[owner as usize];
            if slot.is_none_or(|g| self.growth.distance[f] < self.growth.distance[g.index()]) {
                *slot = Some(FaceId::new(f));
            }
        }
        self.sites
            .iter()
            .enumerate()
            .map(|(tile, site)| {
                let own = |f: &FaceId| self.growth.owner[f.index()] == tile as u32;
                self.star(site.vertex).into_iter().find(own).or(nearest[tile])
            })
            .collect()
    }

    fn finish(self) -> Tiling {
        let mut number = vec![TileId::NONE; self.sites.len()];
        let (mut sites, mut anchors) = (Vec::new(), Vec::new());
        for (tile, face) in self.representatives().into_iter().enumerate() {
            let Some(face) = face else { continue };
            number[tile] = TileId(sites.len() as u32);
            let site = &self.sites[tile];
            let whole = self.star(site.vertex).iter().all(|f| self.growth.owner[f.index()] == tile as u32);
            sites.push(face);
            anchors.push((site.anchor && whole).then_some(site.vertex));
        }
        let tile_of_face = self.growth.owner.iter().map(|&owner| number[owner as usize]).collect();
        let (part, _) = self.refiner.finish();
        Tiling {
            part,
            tile_of_face,
            sites,
            anchors,
            bordered: false,
            regions: Vec::new(),
            segments: Vec::new(),
        }
    }
}
