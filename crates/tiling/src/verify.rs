//! An independent check of the conditions of a tessellation.
//!
//! Shares no code with the construction: it builds the connectivity anew and counts.

use crate::{TileId, Tiling};
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;
use topipe_mesh::{Connectivity, FaceId, HalfEdgeId, VertexId};

/// A condition of the source's Definition 1 that does not hold.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Violation {
    /// (a) A tile is not homeomorphic to a disk.
    #[error("tile {tile} is not a disk: Euler characteristic {euler}, {pieces} edge-connected pieces")]
    NotDisk {
        /// The tile.
        tile: u32,
        /// V - E + F of its faces.
        euler: i64,
        /// Number of pieces connected through edges.
        pieces: usize,
    },
    /// (b) More than three tiles meet at a vertex.
    #[error("{tiles} tiles meet at vertex {vertex}")]
    Crowded {
        /// The vertex.
        vertex: u32,
        /// How many tiles meet there.
        tiles: usize,
    },
    /// (c) Two tiles share more than one contiguous set of edges.
    #[error("tiles {first} and {second} share {runs} separate borders")]
    DoubleContact {
        /// A tile.
        first: u32,
        /// The other tile.
        second: u32,
        /// How many separate borders they share.
        runs: usize,
    },
    /// (d) A face lies in no tile.
    #[error("face {face} lies in no tile")]
    Uncovered {
        /// The face.
        face: u32,
    },
    /// The border of a tile is not one simple loop, or has fewer than three corners. Bordered tiles only.
    #[error("the border of tile {tile} {what}")]
    Border {
        /// The tile.
        tile: u32,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A site's face does not lie in its tile, or the arrays do not fit together.
    #[error("the tiling's arrays do not fit together: {0}")]
    Inconsistent(String),
}

/// Checks what a [`Tiling`] guarantees; an empty list means that all of it holds.
///
/// For tiles of the source's tessellation: conditions (a) to (d) of the source's Definition 1; tile corners are also counted: on a closed surface each corner belongs to three tiles, so that the number of
/// macro-triangles is `2 N - 4 + 4 g`; a different count is reported as inconsistent.
pub fn verify(tiling: &Tiling) -> Vec<Violation> {
    let mesh = &tiling.part.mesh;
    if tiling.bordered {
        return crate::verify_bordered::verify(tiling);
    }
    let tiles = tiling.tile_count();
    let inconsistent = |what: String| vec![Violation::Inconsistent(what)];
    if tiling.tile_of_face.len() != mesh.face_count() || tiling.anchors.len() != tiles {
        return inconsistent("one tile per face and one anchor per tile are needed".into());
    }
    let connectivity = match Connectivity::build(mesh) {
        Ok(connectivity) => connectivity,
        Err(error) => return inconsistent(error.to_string()),
    };
    if let Some(face) = tiling.tile_of_face.iter().position(|t| t.index() >= tiles) {
        return vec![Violation::Uncovered { face: face as u32 }];
    }
    for (tile, site) in tiling.sites.iter().enumerate() {
        if tiling.tile_of_face.get(site.index()) != Some(&TileId(tile as u32)) {
            return inconsistent(format!("the site of tile {tile} lies elsewhere"));
        }
    }
    let tile = |f: FaceId| tiling.tile_of_face[f.index()];
    let mut violations = Vec::new();

    // (a)
    let mut vertices: Vec<BTreeSet<VertexId>> = vec![BTreeSet::new(); tiles];
    let mut edges: Vec<BTreeSet<[VertexId; 2]>> = vec![BTreeSet::new(); tiles];
    let mut faces = vec![0i64; tiles];
    let mut pieces = vec![0usize; tiles];
    let mut seen = vec![false; mesh.face_count()];
    for face in mesh.faces() {
        let t = tile(face).index();
        faces[t] += 1;
        for k in 0..3 {
            let h = HalfEdgeId::of(face, k);
            let (a, b) = (connectivity.origin(h), connectivity.target(h));
            vertices[t].insert(a);
            edges[t].insert([a.min(b), a.max(b)]);
        }
        if !seen[face.index()] {
            pieces[t] += 1;
            seen[face.index()] = true;
            let mut stack = vec![face];
            while let Some(f) = stack.pop() {
                for k in 0..3 {
                    let g = connectivity.neighbor(f, k);
                    if g.is_some() && tile(g) == tile(f) && !seen[g.index()] {
                        seen[g.index()] = true;
                        stack.push(g);
                    }
                }
            }
        }
    }
    for t in 0..tiles {
        let euler = vertices[t].len() as i64 - edges[t].len() as i64 + faces[t];
        if euler != 1 || pieces[t] != 1 {
            violations.push(Violation::NotDisk { tile: t as u32, euler, pieces: pieces[t] });
        }
    }

    // (b), and the corners.
    let mut corners = 0i64;
    for vertex in mesh.vertices() {
        let around: BTreeSet<TileId> = connectivity.outgoing(vertex).map(|h| tile(h.face())).collect();
        if around.len() > 3 {
            violations.push(Violation::Crowded { vertex: vertex.0, tiles: around.len() });
        }
        corners += (around.len() == 3) as i64;
    }

    // (c): the edges two tiles share must form one path, counted as components of a graph.
    let mut shared: BTreeMap<(TileId, TileId), Vec<[VertexId; 2]>> = BTreeMap::new();
    for h in connectivity.edges() {
        let g = connectivity.twin(h);
        if !g.is_some() {
            continue;
        }
        let (s, t) = (tile(h.face()), tile(g.face()));
        if s != t {
            shared
                .entry((s.min(t), s.max(t)))
                .or_default()
                .push([connectivity.origin(h), connectivity.target(h)]);
        }
    }
    for ((first, second), edges) in &shared {
        let mut group: BTreeMap<VertexId, VertexId> = BTreeMap::new();
        fn root(group: &mut BTreeMap<VertexId, VertexId>, v: VertexId) -> VertexId {
            let up = *group.entry(v).or_insert(v);
            if up == v {
                return v;
            }
            let top = root(group, up);
            group.insert(v, top);
            top
        }
        for &[a, b] in edges {
            let (a, b) = (root(&mut group, a), root(&mut group, b));
            group.insert(a.max(b), a.min(b));
        }
        let members: Vec<VertexId> = group.keys().copied().collect();
        let roots: BTreeSet<VertexId> = members.iter().map(|&v| root(&mut group, v)).collect();
        if roots.len() != 1 {
            violations.push(Violation::DoubleContact { first: first.0, second: second.0, runs: roots.len() });
        }
    }

    if violations.is_empty()
        && let Some(genus) = connectivity.genus(mesh)
    {
        let (_, shells) = connectivity.components();
        let expected = 2 * tiles as i64 - 4 * shells as i64 + 4 * genus;
        if corners != expected {
            return inconsistent(format!("{corners} corners where {expected} are expected"));
        }
    }
    violations
}
