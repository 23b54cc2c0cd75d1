//! Vertices where four or more tiles meet (violations of condition (b)).
//!
//! Two remedies that need no new site, tried in this order. Give one of the fans around the vertex to the tile
//! beside it, where all tiles stay disks with single contacts. Else split the star of the vertex and give the inner
//! ring to one of the tiles, which then separates the others.

use crate::border::{Shape, double_contact, shape};
use crate::growth::Growth;
use topipe_mesh::refine::Refiner;
use topipe_mesh::{FaceId, VertexId};

/// Faces that must keep their owner: stars of sites and of feature curves.
pub(crate) type Protected = Vec<bool>;

/// Number of fans allowed around a vertex.
const MOST: usize = 3;

/// Brings the number of tiles around `vertex` down to three. True on success.
pub(crate) fn relieve(
    refiner: &mut Refiner,
    growth: &mut Growth,
    site_face: &[FaceId],
    protected: &mut Protected,
    vertex: VertexId,
) -> bool {
    while growth.fans(refiner, vertex).len() > MOST {
        if !hand_over(refiner, growth, site_face, protected, vertex)
            && !split_star(refiner, growth, site_face, protected, vertex)
        {
            return false;
        }
    }
    true
}

/// True when the tile is a disk without double contacts. `count`, where given, is how many faces it must have: a
/// tile that fell apart has more than can be reached from its site.
fn sound(refiner: &Refiner, growth: &Growth, seed: FaceId, count: Option<usize>) -> bool {
    let faces = growth.flood(refiner, seed);
    if count.is_some_and(|count| count != faces.len()) {
        return false;
    }
    match shape(refiner, growth, &faces) {
        Shape::NotDisk => false,
        Shape::Disk(runs) => runs.len() > 2 && double_contact(refiner, &runs).is_none(),
    }
}

fn hand_over(
    refiner: &Refiner,
    growth: &mut Growth,
    site_face: &[FaceId],
    protected: &Protected,
    vertex: VertexId,
) -> bool {
    let fans = growth.fans(refiner, vertex);
    let mut order: Vec<usize> = (0..fans.len()).collect();
    order.sort_by_key(|&i| (fans[i].1.len(), fans[i].0));
    for i in order {
        let (loser, faces) = &fans[i];
        if faces.iter().any(|f| protected[f.index()]) {
            continue;
        }
        let around: Vec<VertexId> = {
            let mut list: Vec<VertexId> =
                faces.iter().flat_map(|f| refiner.part().mesh.triangles[f.index()]).collect();
            list.sort();
            list.dedup();
            list
        };
        let before: Vec<usize> = around.iter().map(|&v| growth.fans(refiner, v).len()).collect();
        let size = growth.flood(refiner, site_face[*loser as usize]).len();
        for step in [1, fans.len() - 1] {
            let gainer = fans[(i + step) % fans.len()].0;
            for f in faces {
                growth.owner[f.index()] = gainer;
            }
            let fewer = growth.fans(refiner, vertex).len() < fans.len();
            let calm = around
                .iter()
                .zip(&before)
                .all(|(&v, &fans_before)| growth.fans(refiner, v).len() <= fans_before.max(MOST));
            // The other tiles around the moved faces lose or gain contacts, too.
            let neighbors_sound = || {
                let mut tiles: Vec<u32> = around
                    .iter()
                    .flat_map(|&v| growth.fans(refiner, v).into_iter().map(|(tile, _)| tile))
                    .filter(|t| t != loser)
                    .collect();
                tiles.sort_unstable();
                tiles.dedup();
                tiles.iter().all(|&t| sound(refiner, growth, site_face[t as usize], None))
            };
            if fewer
                && calm
                && sound(refiner, growth, site_face[*loser as usize], Some(size - faces.len()))
                && neighbors_sound()
            {
                return true;
            }
            for f in faces {
                growth.owner[f.index()] = *loser;
            }
        }
    }
    false
}

fn split_star(
    refiner: &mut Refiner,
    growth: &mut Growth,
    site_face: &[FaceId],
    protected: &mut Protected,
    vertex: VertexId,
) -> bool {
    let fans = growth.fans(refiner, vertex);
    let spokes = refiner.outgoing(vertex);
    if spokes.iter().any(|&h| refiner.feature(vertex, refiner.target(h)).is_some()) {
        return false;
    }
    let contacts = |tile: u32| -> Option<Vec<u32>> {
        match shape(refiner, growth, &growth.flood(refiner, site_face[tile as usize])) {
            Shape::NotDisk => None,
            Shape::Disk(runs) => Some(runs.iter().map(|r| r.neighbor).collect()),
        }
    };
    // The tile that gets the inner ring touches all others there: it must not touch them elsewhere, and a tile
    // may appear in one fan only.
    let winner = (0..fans.len()).find(|&i| {
        let Some(neighbors) = contacts(fans[i].0) else { return false };
        (0..fans.len()).all(|j| {
            let apart = (j + fans.len() - i) % fans.len();
            apart == 0
                || (fans[j].0 != fans[i].0
                    && (apart == 1 || apart == fans.len() - 1 || !neighbors.contains(&fans[j].0)))
        })
    });
    let Some(winner) = winner else { return false };
    let tile = fans[winner].0;
    let neighbors: Vec<VertexId> = spokes.iter().map(|&h| refiner.target(h)).collect();
    for neighbor in neighbors {
        let Some(h) = refiner.half_edge(vertex, neighbor) else { return false };
        let split = refiner.split_edge(h, 0.5);
        growth.follow(refiner, &split);
        for &(_, from) in split.pieces() {
            let inherited = protected[from.index()];
            protected.push(inherited);
        }
    }
    for h in refiner.outgoing(vertex) {
        growth.owner[h.face().index()] = tile;
    }
    true
}
