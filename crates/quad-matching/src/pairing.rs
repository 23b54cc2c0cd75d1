//! Which macro-triangles are paired, for each way of making quads of them.

use crate::dual::{MacroTriangle, rotated_to};
use crate::matching::{DOUBLET_PENALTY, Diagonal, perfect_matching, widest_corner};
use crate::sides::Tiled;
use crate::{MacroEdge, Parameters};
use topipe_mesh::{HalfEdgeId, TriangleMesh, VertexId};

/// The angles of each macro-triangle at its three sites, as sums of the angles of its faces, radians.
pub(crate) fn surface_angles(
    tiled: &Tiled,
    sites: &[VertexId],
    triangles: &[MacroTriangle],
    triangle_of_face: &[u32],
) -> Vec<[f64; 3]> {
    let mut angles = vec![[0.0; 3]; triangles.len()];
    for (site, &vertex) in sites.iter().enumerate() {
        for h in tiled.refiner.outgoing(vertex) {
            let t = triangle_of_face[h.face().index()] as usize;
            if let Some(k) = triangles[t].tiles.iter().position(|&tile| tile as usize == site) {
                angles[t][k] += face_angle(&tiled.refiner.part().mesh, h);
            }
        }
    }
    angles
}

/// The angle of a face at the origin of one of its half-edges; zero where it has none.
pub(crate) fn face_angle(mesh: &TriangleMesh, h: HalfEdgeId) -> f64 {
    let at = mesh.position(mesh.origin(h));
    let angle = (mesh.position(mesh.target(h)) - at).angle_between(mesh.position(mesh.origin(h.prev())) - at);
    if angle.is_finite() { angle } else { 0.0 }
}

/// Pairs as many triangles as give good quads: no feature between them, no corner wider than the limit, neither
/// along the surface nor between the corner points, and no doublet.
pub(crate) fn match_good_pairs(
    sites: &[VertexId],
    triangles: &[MacroTriangle],
    edges: &[MacroEdge],
    diagonals: &[Diagonal],
    angles: &[[f64; 3]],
    parameters: &Parameters,
) -> Vec<Option<usize>> {
    let limit = parameters.pair_angle.to_radians();
    let angle_at = |t: u32, tile: u32| {
        let k = triangles[t as usize].tiles.iter().position(|&other| other == tile);
        k.map_or(0.0, |k| angles[t as usize][k])
    };
    let good: Vec<usize> = (0..diagonals.len())
        .filter(|&i| {
            let [t1, t2] = diagonals[i].triangles;
            let across = edges[i].ends.iter().map(|&d| angle_at(t1, d) + angle_at(t2, d));
            let apexes = [t1, t2].map(|t| angle_at(t, rotated_to(&triangles[t as usize], edges[i].ends)[0]));
            !diagonals[i].feature
                && widest_corner(diagonals[i].corners) <= limit
                && across.chain(apexes).all(|angle| angle <= limit)
        })
        .collect();
    let chosen: Vec<Diagonal> = good.iter().map(|&i| diagonals[i]).collect();
    let mut partner: Vec<Option<usize>> = perfect_matching(triangles.len(), &chosen, parameters)
        .into_iter()
        .map(|partner| partner.map(|k| good[k]))
        .collect();
    // A site with only two regions left gets an edge back: its lowest pair is taken apart.
    let mut valence = vec![0u32; sites.len()];
    let mut removed: Vec<Vec<usize>> = vec![Vec::new(); sites.len()];
    edges.iter().flat_map(|e| e.ends).for_each(|site| valence[site as usize] += 1);
    for (t, &pair) in partner.iter().enumerate() {
        let Some(i) = pair.filter(|&i| diagonals[i].triangles[0] == t as u32) else { continue };
        for site in edges[i].ends {
            valence[site as usize] -= 1;
            removed[site as usize].push(i);
        }
    }
    for site in 0..sites.len() {
        for &i in &removed[site] {
            let apart = diagonals[i].triangles.iter().all(|&t| partner[t as usize] != Some(i));
            if valence[site] >= 3 || apart {
                continue;
            }
            diagonals[i].triangles.iter().for_each(|&t| partner[t as usize] = None);
            edges[i].ends.iter().for_each(|&end| valence[end as usize] += 1);
        }
    }
    partner
}

/// Rounds in which edges whose removal makes a doublet are penalized. Each is a whole matching (about 0.2 s at 1,800
/// triangles on a busy machine), and twelve did not clear all doublets either; those that remain are merged.
const DOUBLET_ROUNDS: usize = 3;

/// Matches, and matches again with the edges penalized that were removed at sites left with two quads. Doublets
/// that remain are merged later, which makes bigger quads.
pub(crate) fn match_without_doublets(
    sites: usize,
    triangles: usize,
    edges: &[MacroEdge],
    diagonals: &mut [Diagonal],
    parameters: &Parameters,
) -> Vec<Option<usize>> {
    let mut degree = vec![0u32; sites];
    edges.iter().flat_map(|e| e.ends).for_each(|site| degree[site as usize] += 1);
    // A site with three neighbours becomes a doublet as soon as one of its edges goes.
    for (edge, diagonal) in edges.iter().zip(diagonals.iter_mut()) {
        if edge.ends.iter().any(|&site| degree[site as usize] == 3) {
            diagonal.penalty = DOUBLET_PENALTY;
        }
    }
    let mut best: Option<(usize, Vec<Option<usize>>)> = None;
    for _ in 0..DOUBLET_ROUNDS {
        let partner = perfect_matching(triangles, diagonals, parameters);
        let mut removed: Vec<usize> = partner.iter().flatten().copied().collect();
        removed.sort_unstable();
        removed.dedup();
        let mut valence = degree.clone();
        for &i in &removed {
            edges[i].ends.iter().for_each(|&site| valence[site as usize] -= 1);
        }
        let doublets = valence.iter().filter(|&&v| v == 2).count();
        if best.as_ref().is_none_or(|(fewest, _)| doublets < *fewest) {
            best = Some((doublets, partner));
        }
        if doublets == 0 {
            break;
        }
        for &i in &removed {
            if edges[i].ends.iter().any(|&site| valence[site as usize] == 2) {
                diagonals[i].penalty += DOUBLET_PENALTY;
            }
        }
    }
    best.map(|(_, partner)| partner).unwrap_or_default()
}
