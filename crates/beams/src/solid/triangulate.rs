//! A solid as triangles, for pictures and to check it.

use super::{Brep, Surface};
use glam::{DVec2, DVec3};
use topipe_mesh::TriangleMesh;

/// A closed mesh of all bodies; arcs are divided into chords of at most `turn` radians.
pub fn triangulate(brep: &Brep, turn: f64) -> TriangleMesh {
    let mut positions: Vec<DVec3> = brep.vertices.clone();
    // The points of each edge, those between its ends made once.
    let courses: Vec<Vec<u32>> = (0..brep.edges.len() as u32)
        .map(|e| {
            let points = brep.points(e, turn);
            let [a, b] = brep.edges[e as usize].ends;
            let mut ids = vec![a];
            for p in &points[1..points.len() - 1] {
                ids.push(positions.len() as u32);
                positions.push(*p);
            }
            ids.push(b);
            ids
        })
        .collect();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for face in &brep.faces {
        let loops: Vec<Vec<u32>> = (face.loops.iter())
            .map(|list| {
                let mut ids = Vec::new();
                for &(edge, forwards) in list {
                    let course = &courses[edge as usize];
                    let n = course.len();
                    ids.extend((0..n - 1).map(|k| course[if forwards { k } else { n - 1 - k }]));
                }
                ids
            })
            .collect();
        match face.surface {
            Surface::Plane { normal, .. } => plane(&positions, &loops, normal, &mut triangles),
            Surface::Cylinder { .. } => {
                strip(&loops[0], courses[face.loops[0][0].0 as usize].len(), &mut triangles)
            }
        }
    }
    // Vertices that no edge uses do not occur; all indices are those of `positions`.
    TriangleMesh::from_arrays(positions.iter().map(|p| p.to_array()).collect(), triangles)
}

/// Half a cylinder: an arc of `n` points, and the same arc backwards at the other end.
fn strip(outline: &[u32], n: usize, triangles: &mut Vec<[u32; 3]>) {
    // Either the first edge is an arc, or the last: turn so that it is.
    let start = if outline.len() == 2 * n { 0 } else { 1 };
    let m = outline.len();
    let half = m / 2;
    let at = |k: usize| outline[(start + k) % m];
    for k in 0..half - 1 {
        let (a, b, c, d) = (at(k), at(k + 1), at(m - 2 - k), at(m - 1 - k));
        triangles.extend([[a, b, c], [a, c, d]]);
    }
}

fn plane(positions: &[DVec3], loops: &[Vec<u32>], normal: DVec3, triangles: &mut Vec<[u32; 3]>) {
    let (u, v) = normal.any_orthonormal_pair();
    let (u, v) = if u.cross(v).dot(normal) > 0.0 { (u, v) } else { (v, u) };
    let flat = |id: u32| DVec2::new(positions[id as usize].dot(u), positions[id as usize].dot(v));
    let mut outline = loops[0].clone();
    for hole in &loops[1..] {
        // A bridge between the nearest points; both loops are convex around a common middle, so it crosses nothing.
        let mut best = (f64::INFINITY, 0, 0);
        for (i, &a) in outline.iter().enumerate() {
            for (j, &b) in hole.iter().enumerate() {
                let d = flat(a).distance_squared(flat(b));
                if d < best.0 {
                    best = (d, i, j);
                }
            }
        }
        let (_, i, j) = best;
        let around = hole.iter().cycle().skip(j).take(hole.len() + 1).copied();
        let bridge: Vec<u32> = around.chain([outline[i]]).collect();
        outline.splice(i + 1..i + 1, bridge);
    }
    // Ears, the best-shaped first.
    let side = |a: u32, b: u32, c: u32| (flat(b) - flat(a)).perp_dot(flat(c) - flat(a));
    while outline.len() > 3 {
        let n = outline.len();
        let ear = (0..n)
            .filter_map(|k| {
                let (a, b, c) = (outline[(k + n - 1) % n], outline[k], outline[(k + 1) % n]);
                let area = side(a, b, c);
                let holds = |&p: &u32| {
                    ![a, b, c].contains(&p)
                        && side(a, b, p) >= 0.0
                        && side(b, c, p) >= 0.0
                        && side(c, a, p) >= 0.0
                };
                if area <= 0.0 || outline.iter().any(holds) {
                    return None;
                }
                let longest = [(a, b), (b, c), (c, a)]
                    .iter()
                    .map(|(p, q)| flat(*p).distance_squared(flat(*q)))
                    .fold(0.0, f64::max);
                Some((area / longest, k))
            })
            .max_by(|x, y| x.0.total_cmp(&y.0));
        // A polygon that is simple but for rounding has an ear; else any corner will do.
        let k = ear.map_or(0, |e| e.1);
        triangles.push([outline[(k + n - 1) % n], outline[k], outline[(k + 1) % n]]);
        outline.remove(k);
    }
    if let [a, b, c] = outline[..] {
        triangles.push([a, b, c]);
    }
}
