//! The sides of tiles: where two tiles meet, and the vertex through which their macro-edge will pass.
//!
//! That vertex is the same for both tiles. It is where a feature curve crosses from one site to the other, if one
//! does, else the middle of the side by length.

use crate::QuadMatchingError;
use std::collections::{BTreeMap, HashMap};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{FaceId, FeatureKind, HalfEdgeId, VertexId};
use topipe_tiling::Tiling;

/// A tile while the mesh is refined: the refiner, and the tile of each face.
pub(crate) struct Tiled {
    pub(crate) refiner: Refiner,
    pub(crate) tile_of_face: Vec<u32>,
    /// Splits that can be taken back, while that is asked for.
    log: Option<Vec<Step>>,
}

/// A split that can be taken back.
enum Step {
    Edge(HalfEdgeId, VertexId),
    Face(FaceId),
}

impl Tiled {
    pub(crate) fn new(tiling: &Tiling) -> Result<Self, QuadMatchingError> {
        let refiner = Refiner::new(&tiling.part)?;
        Ok(Self::over(refiner, tiling.tile_of_face.iter().map(|t| t.0).collect()))
    }

    pub(crate) fn over(refiner: Refiner, tile_of_face: Vec<u32>) -> Self {
        Self { refiner, tile_of_face, log: None }
    }

    /// From here on splits can be taken back with [`Self::roll_back`], until [`Self::commit`].
    pub(crate) fn begin(&mut self) {
        self.log = Some(Vec::new());
    }

    pub(crate) fn commit(&mut self) {
        self.log = None;
    }

    /// Takes back all splits since [`Self::begin`]. Tiles of faces that were there before stay as they are now.
    pub(crate) fn roll_back(&mut self) {
        for step in self.log.take().into_iter().flatten().rev() {
            match step {
                Step::Edge(h, target) => self.refiner.undo_split_edge(h, target),
                Step::Face(face) => self.refiner.undo_split_face(face),
            }
        }
        self.tile_of_face.truncate(self.refiner.part().mesh.face_count());
    }

    pub(crate) fn tile(&self, h: HalfEdgeId) -> u32 {
        self.tile_of_face[h.face().index()]
    }

    /// True when `h` lies on the border of its tile.
    pub(crate) fn is_border(&self, h: HalfEdgeId) -> bool {
        self.tile(h) != self.tile(self.refiner.twin(h))
    }

    pub(crate) fn split_edge(&mut self, h: HalfEdgeId, t: f64) -> VertexId {
        if let Some(log) = &mut self.log {
            log.push(Step::Edge(h, self.refiner.target(h)));
        }
        let split = self.refiner.split_edge(h, t);
        for (_, from) in split.pieces() {
            self.tile_of_face.push(self.tile_of_face[from.index()]);
        }
        split.vertex
    }

    pub(crate) fn split_face(&mut self, face: FaceId, weights: [f64; 3]) -> VertexId {
        if let Some(log) = &mut self.log {
            log.push(Step::Face(face));
        }
        let split = self.refiner.split_face(face, weights);
        for (_, from) in split.pieces() {
            self.tile_of_face.push(self.tile_of_face[from.index()]);
        }
        split.vertex
    }

    /// The tiles around `vertex`, each once, counter-clockwise.
    pub(crate) fn tiles_around(&self, vertex: VertexId) -> Vec<u32> {
        let mut tiles: Vec<u32> = Vec::with_capacity(3);
        for h in self.refiner.around(vertex) {
            let tile = self.tile(h);
            if !tiles.contains(&tile) {
                tiles.push(tile);
            }
        }
        tiles
    }

    /// The border of a tile that contains `start`, counter-clockwise from it.
    pub(crate) fn border(&self, start: HalfEdgeId) -> Vec<HalfEdgeId> {
        let mut border = vec![start];
        let mut h = start;
        loop {
            h = h.next();
            while !self.is_border(h) {
                h = self.refiner.twin(h).next();
            }
            if h == start {
                return border;
            }
            border.push(h);
        }
    }

    /// The angle of a tile at one of its vertices: that of its faces there, together.
    pub(crate) fn corner_angle(&self, vertex: VertexId, tile: u32) -> f64 {
        let mesh = &self.refiner.part().mesh;
        let fan = self.refiner.around(vertex);
        fan.filter(|&h| self.tile(h) == tile).map(|h| crate::pairing::face_angle(mesh, h)).sum()
    }

    fn length(&self, h: HalfEdgeId) -> f64 {
        let mesh = &self.refiner.part().mesh;
        mesh.position(self.refiner.origin(h)).distance(mesh.position(self.refiner.target(h)))
    }
}

/// A side of a tile, seen from it.
#[derive(Debug, Clone)]
pub(crate) struct TileSide {
    pub(crate) neighbor: u32,
    /// Border vertices from corner to corner, counter-clockwise around the tile.
    pub(crate) path: Vec<VertexId>,
}

/// The sides of each tile, counter-clockwise; each starts at a corner, where three tiles meet.
pub(crate) fn tile_sides(tiled: &Tiled, tiles: usize) -> Result<Vec<Vec<TileSide>>, QuadMatchingError> {
    let mut start = vec![HalfEdgeId::NONE; tiles];
    for h in (0..tiled.tile_of_face.len() * 3).map(HalfEdgeId::new) {
        let tile = tiled.tile(h) as usize;
        if tile >= tiles {
            return Err(QuadMatchingError::Tiling(format!("a face belongs to tile {tile} of {tiles}")));
        }
        if !tiled.refiner.twin(h).is_some() {
            return Err(QuadMatchingError::Tiling("the mesh has a border".into()));
        }
        if !start[tile].is_some()
            && tiled.is_border(h)
            && tiled.tiles_around(tiled.refiner.origin(h)).len() == 3
        {
            start[tile] = h;
        }
    }
    let mut sides = Vec::with_capacity(tiles);
    for (tile, &start) in start.iter().enumerate() {
        if !start.is_some() {
            return Err(QuadMatchingError::Tiling(format!("tile {tile} has no corner")));
        }
        let mut of_tile: Vec<TileSide> = Vec::new();
        for h in tiled.border(start) {
            let neighbor = tiled.tile(tiled.refiner.twin(h));
            match of_tile.last_mut() {
                Some(side) if side.neighbor == neighbor => side.path.push(tiled.refiner.target(h)),
                _ => of_tile.push(TileSide {
                    neighbor,
                    path: vec![tiled.refiner.origin(h), tiled.refiner.target(h)],
                }),
            }
        }
        if of_tile.len() < 3 {
            return Err(QuadMatchingError::Tiling(format!("tile {tile} has {} corners", of_tile.len())));
        }
        sides.push(of_tile);
    }
    Ok(sides)
}

/// The path of a feature curve between the sites of two tiles, from the lower tile's to the higher one's.
#[derive(Debug, Clone)]
pub(crate) struct FeaturePath {
    pub(crate) path: Vec<VertexId>,
    /// Index in `path` of the vertex on the border between the tiles.
    pub(crate) crossing: usize,
    pub(crate) kind: FeatureKind,
}

/// Feature curves that run from the anchor of one tile to the anchor of a neighbour and cross their border once.
pub(crate) fn feature_paths(tiling: &Tiling, tiled: &Tiled) -> BTreeMap<[u32; 2], FeaturePath> {
    let mut adjacent: HashMap<VertexId, Vec<(VertexId, FeatureKind)>> = HashMap::new();
    for edge in &tiling.part.feature_edges {
        let [a, b] = edge.vertices;
        adjacent.entry(a).or_default().push((b, edge.kind));
        adjacent.entry(b).or_default().push((a, edge.kind));
    }
    let inside = |v: VertexId| tiled.tiles_around(v).len() == 1;
    let mut paths: BTreeMap<[u32; 2], FeaturePath> = BTreeMap::new();
    for (tile, anchor) in tiling.anchors.iter().enumerate() {
        let Some(anchor) = *anchor else { continue };
        let tile = tile as u32;
        for &(first, kind) in adjacent.get(&anchor).map_or(&[][..], |list| list) {
            let mut path = vec![anchor, first];
            let mut crossing = None;
            let found = loop {
                let (previous, current) = (path[path.len() - 2], path[path.len() - 1]);
                if inside(current) {
                    let here = tiled.tiles_around(current)[0];
                    match crossing {
                        None if here != tile => break None,
                        Some(_) if tiling.anchors[here as usize] == Some(current) => break Some(here),
                        _ => {}
                    }
                } else {
                    // Exactly one border vertex, where exactly two tiles meet.
                    if crossing.is_some() || tiled.tiles_around(current).len() != 2 {
                        break None;
                    }
                    crossing = Some(path.len() - 1);
                }
                let next = match adjacent.get(&current).map_or(&[][..], |list| list) {
                    [(a, _), (b, _)] => {
                        if *a == previous {
                            *b
                        } else {
                            *a
                        }
                    }
                    _ => break None,
                };
                if path.contains(&next) {
                    break None;
                }
                path.push(next);
            };
            if let (Some(other), Some(mut crossing)) = (found, crossing) {
                if tile < other && path.len() > 2 {
                    paths.entry([tile, other]).or_insert_with(|| FeaturePath {
                        path: path.clone(),
                        crossing,
                        kind,
                    });
                } else if other < tile {
                    path.reverse();
                    crossing = path.len() - 1 - crossing;
                    paths.entry([other, tile]).or_insert(FeaturePath { path, crossing, kind });
                }
            }
        }
    }
    paths
}

/// The vertex through which each pair of neighbours is connected; splits an edge where no vertex is near the middle.
pub(crate) fn midpoints(
    tiled: &mut Tiled,
    sides: &[Vec<TileSide>],
    features: &BTreeMap<[u32; 2], FeaturePath>,
    snap: f64,
) -> BTreeMap<[u32; 2], VertexId> {
    let mut midpoints = BTreeMap::new();
    for (tile, of_tile) in sides.iter().enumerate() {
        for side in of_tile {
            let tile = tile as u32;
            if tile > side.neighbor {
                continue;
            }
            let pair = [tile, side.neighbor];
            if let Some(feature) = features.get(&pair) {
                midpoints.insert(pair, feature.path[feature.crossing]);
                continue;
            }
            let edges: Vec<HalfEdgeId> =
                side.path.windows(2).filter_map(|w| tiled.refiner.half_edge(w[0], w[1])).collect();
            let total: f64 = edges.iter().map(|&h| tiled.length(h)).sum();
            let mut goal = total / 2.0;
            let mut middle = side.path[side.path.len() / 2];
            for (k, &h) in edges.iter().enumerate() {
                let length = tiled.length(h);
                if goal <= length {
                    let t = if length > 0.0 { goal / length } else { 0.5 };
                    // The ends of the side are corners and can not be middles.
                    middle = if t < snap && k > 0 {
                        side.path[k]
                    } else if t > 1.0 - snap && k + 1 < edges.len() {
                        side.path[k + 1]
                    } else {
                        tiled.split_edge(h, t.clamp(0.1, 0.9))
                    };
                    break;
                }
                goal -= length;
            }
            midpoints.insert(pair, middle);
        }
    }
    midpoints
}
