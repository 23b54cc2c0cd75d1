//! Makes an oriented manifold of any set of triangles that bounds a solid.
//!
//! In order: duplicate faces go; edges with more than two faces are taken apart, so that each pair of faces bounds
//! material between them (Gueziec et al., "Cutting and stitching", 2001, with inside and outside decided by a ray);
//! faces are turned to agree with their neighbours; vertices whose faces form more than one fan are copied. What
//! stays open, is not two-sided or lies on itself is refused.

use super::ImportError;
use super::draft::Draft;
use crate::spatial::SurfaceIndex;
use crate::{Connectivity, ConnectivityError, HalfEdgeId, Provenance, VertexId};
use glam::DVec3;

/// Repairs `draft`; returns its connectivity, closed and oriented.
pub(super) fn make_manifold(file: &str, draft: &mut Draft) -> Result<Connectivity, ImportError> {
    // Most files are in order, and then this is all.
    if let Ok(connectivity) = Connectivity::build(&draft.mesh)
        && connectivity.is_closed()
    {
        return Ok(connectivity);
    }
    remove_duplicates(draft);
    if draft.mesh.triangles.is_empty() {
        return Err(ImportError::NoVolume { file: file.to_owned() });
    }
    let mut glue = Glue::new(file, draft)?;
    split_vertices(draft, &glue);
    orient(file, draft, &mut glue)?;
    split_double_edges(draft, &glue);
    draft.drop_unused_vertices();
    Connectivity::build(&draft.mesh).map_err(|e| left_over(file, draft, &e))
}

/// What can not be: the steps above leave a manifold. Named all the same.
fn left_over(file: &str, draft: &Draft, error: &ConnectivityError) -> ImportError {
    let place = match error {
        ConnectivityError::NonManifoldEdge { first, .. } => {
            format!("face {}", draft.face_of.get(*first as usize).copied().unwrap_or(0))
        }
        _ => "after repair".to_owned(),
    };
    ImportError::Malformed { file: file.to_owned(), place, problem: error.to_string() }
}

/// Of faces with the same corners, those that lie back to back cancel; of the rest one stays.
fn remove_duplicates(draft: &mut Draft) {
    let mut keyed: Vec<([u32; 3], u32)> = draft
        .mesh
        .triangles
        .iter()
        .enumerate()
        .map(|(f, t)| {
            let mut key = t.map(|v| v.0);
            key.sort_unstable();
            (key, f as u32)
        })
        .collect();
    keyed.sort_unstable();
    let mut keep = vec![true; keyed.len()];
    let (mut repeated, mut internal) = (0, 0);
    for group in keyed.chunk_by(|x, y| x.0 == y.0).filter(|g| g.len() > 1) {
        let is_even = |f: u32| {
            let [a, b, c] = draft.mesh.triangles[f as usize].map(|v| v.0);
            // The rotation that starts with the smallest corner goes on with the second smallest.
            (a < b) as u8 + (b < c) as u8 + (c < a) as u8 == 2
        };
        let even = group.iter().filter(|(_, f)| is_even(*f)).count();
        let odd = group.len() - even;
        let survivor =
            (even != odd).then(|| group.iter().find(|(_, f)| is_even(*f) == (even > odd))).flatten();
        for (_, f) in group {
            keep[*f as usize] = survivor.is_some_and(|(_, s)| s == f);
        }
        internal += 2 * even.min(odd);
        repeated += even.abs_diff(odd).saturating_sub(1);
    }
    if repeated + internal > 0 {
        draft.retain_faces(|f| keep[f]);
        draft.note("dropped duplicate faces", repeated);
        draft.note("dropped internal faces (two back to back)", internal);
    }
}

/// Which half-edges belong together; unlike [`Connectivity`] it does not ask that they run in opposite directions.
struct Glue {
    twin: Vec<HalfEdgeId>,
}

impl Glue {
    fn new(file: &str, draft: &mut Draft) -> Result<Self, ImportError> {
        let mesh = &draft.mesh;
        let mut edges: Vec<(u32, u32, u32)> = (0..3 * mesh.face_count())
            .map(|h| {
                let h = HalfEdgeId::new(h);
                let (a, b) = (mesh.origin(h).0, mesh.target(h).0);
                (a.min(b), a.max(b), h.0)
            })
            .collect();
        edges.sort_unstable();
        let mut twin = vec![HalfEdgeId::NONE; edges.len()];
        let mut open = Vec::new();
        let mut crowded = Vec::new();
        for group in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            match *group {
                [(_, _, h)] => open.push(HalfEdgeId(h)),
                [(_, _, h), (_, _, g)] => {
                    twin[h as usize] = HalfEdgeId(g);
                    twin[g as usize] = HalfEdgeId(h);
                }
                _ => crowded.push(group),
            }
        }
        if !open.is_empty() {
            return Err(super::border::describe(file, draft, &open));
        }
        if !crowded.is_empty() {
            let index = SurfaceIndex::build(mesh);
            for group in &crowded {
                take_apart(file, draft, &index, group, &mut twin)?;
            }
            let count = crowded.len();
            draft.note("took apart edges with more than two faces", count);
        }
        Ok(Self { twin })
    }
}

/// Pairs the faces around one edge so that each pair has material between its two faces.
fn take_apart(
    file: &str,
    draft: &Draft,
    index: &SurfaceIndex,
    group: &[(u32, u32, u32)],
    twin: &mut [HalfEdgeId],
) -> Result<(), ImportError> {
    /// Sectors narrower than this (radians) are two faces on each other: coordinates of 32 bits bend a flat angle by
    /// about 1e-7.
    const FLAT: f64 = 1e-6;
    let mesh = &draft.mesh;
    let (low, high, _) = group[0];
    let (a, b) = (mesh.position(VertexId(low)), mesh.position(VertexId(high)));
    let unresolved = || ImportError::NonManifoldEdge {
        file: file.to_owned(),
        count: group.len(),
        from: a,
        to: b,
        faces: group.iter().map(|&(_, _, h)| draft.face_of[HalfEdgeId(h).face().index()]).take(8).collect(),
    };
    if group.len() % 2 == 1 {
        return Err(unresolved());
    }
    let axis = (b - a).normalize_or_zero();
    let direction = |h: u32| {
        let d = mesh.origin(HalfEdgeId(h).prev()).index();
        let d = mesh.positions[d] - a;
        (d - axis * d.dot(axis)).normalize_or_zero()
    };
    let u = direction(group[0].2);
    let v = axis.cross(u);
    let mut around: Vec<(f64, u32)> = group
        .iter()
        .map(|&(_, _, h)| {
            let d = direction(h);
            let angle = d.dot(v).atan2(d.dot(u));
            (if angle < 0.0 { angle + std::f64::consts::TAU } else { angle }, h)
        })
        .collect();
    around.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    let n = around.len();
    let width = |k: usize| {
        let next = if k + 1 < n { around[k + 1].0 } else { around[0].0 + std::f64::consts::TAU };
        next - around[k].0
    };
    if let Some(k) = (0..n).find(|&k| width(k) < FLAT) {
        let face = |k: usize| draft.face_of[HalfEdgeId(around[k % n].1).face().index()];
        return Err(ImportError::Overlap {
            file: file.to_owned(),
            first: face(k).min(face(k + 1)),
            second: face(k).max(face(k + 1)),
            point: (a + b) / 2.0,
        });
    }
    // Sectors are material and void in turn: one of them decides all. The widest is the safest to look into.
    let widest = (0..n).fold(0, |best, k| if width(k) > width(best) { k } else { best });
    let middle = around[widest].0 + width(widest) / 2.0;
    let probe = (a + b) / 2.0 + (u * middle.cos() + v * middle.sin()) * (1e-4 * a.distance(b));
    if axis == DVec3::ZERO || u == DVec3::ZERO {
        return Err(unresolved());
    }
    let first = if index.contains(probe) { widest % 2 } else { (widest + 1) % 2 };
    for k in (first..n + first).step_by(2) {
        let (h, g) = (HalfEdgeId(around[k % n].1), HalfEdgeId(around[(k + 1) % n].1));
        twin[h.index()] = g;
        twin[g.index()] = h;
    }
    Ok(())
}

/// Turns faces so that neighbours agree, the fewer of each piece.
fn orient(file: &str, draft: &mut Draft, glue: &mut Glue) -> Result<(), ImportError> {
    let count = draft.mesh.face_count();
    let mut turned: Vec<Option<bool>> = vec![None; count];
    let mut total = 0;
    let mut piece = Vec::new();
    for seed in 0..count {
        if turned[seed].is_some() {
            continue;
        }
        turned[seed] = Some(false);
        piece.clear();
        piece.push(seed);
        let mut next = 0;
        while next < piece.len() {
            let f = piece[next];
            next += 1;
            for k in 0..3 {
                let h = HalfEdgeId::of(crate::FaceId::new(f), k);
                let g = glue.twin[h.index()];
                let other = g.face().index();
                let against = draft.mesh.origin(h) == draft.mesh.origin(g);
                let wanted = turned[f].is_some_and(|t| t != against);
                match turned[other] {
                    None => {
                        turned[other] = Some(wanted);
                        piece.push(other);
                    }
                    Some(t) if t != wanted => {
                        let (x, y) = (draft.face_of[f], draft.face_of[other]);
                        return Err(ImportError::NotOrientable {
                            file: file.to_owned(),
                            first: x.min(y),
                            second: x.max(y),
                            point: (draft.mesh.position(draft.mesh.origin(h))
                                + draft.mesh.position(draft.mesh.target(h)))
                                / 2.0,
                        });
                    }
                    Some(_) => {}
                }
            }
        }
        let turns = piece.iter().filter(|&&f| turned[f] == Some(true)).count();
        if 2 * turns > piece.len() {
            for &f in &piece {
                turned[f] = turned[f].map(|t| !t);
            }
        }
        total += turns.min(piece.len() - turns);
    }
    if total == 0 {
        return Ok(());
    }
    for f in 0..count {
        if turned[f] == Some(true) {
            draft.mesh.triangles[f].swap(1, 2);
        }
    }
    // A turned face runs through its edges backwards: edge 0 is now edge 2 and the other way round.
    let renumbered = |h: HalfEdgeId| match turned[h.face().index()] {
        Some(true) => HalfEdgeId::of(h.face(), 2 - h.corner()),
        _ => h,
    };
    let before = std::mem::take(&mut glue.twin);
    glue.twin = before.clone();
    for (h, &g) in before.iter().enumerate() {
        glue.twin[renumbered(HalfEdgeId::new(h)).index()] = renumbered(g);
    }
    draft.note("turned faces to agree with their neighbours", total);
    Ok(())
}

/// Gives each fan of faces around a vertex a vertex of its own; the fan with the first face keeps the old one.
fn split_vertices(draft: &mut Draft, glue: &Glue) {
    fn root(parent: &mut [u32], mut corner: u32) -> u32 {
        while parent[corner as usize] != corner {
            parent[corner as usize] = parent[parent[corner as usize] as usize];
            corner = parent[corner as usize];
        }
        corner
    }
    // Corners that meet across an edge are one vertex.
    let corners = 3 * draft.mesh.face_count();
    let mut parent: Vec<u32> = (0..corners as u32).collect();
    for h in (0..corners).map(HalfEdgeId::new) {
        let g = glue.twin[h.index()];
        let ends = if draft.mesh.origin(h) == draft.mesh.origin(g) {
            [(h, g), (h.next(), g.next())]
        } else {
            [(h, g.next()), (h.next(), g)]
        };
        for (c, d) in ends {
            let (c, d) = (root(&mut parent, c.0), root(&mut parent, d.0));
            parent[c.max(d) as usize] = c.min(d);
        }
    }
    let mut owner = vec![u32::MAX; draft.mesh.vertex_count()];
    let mut copy = vec![VertexId::NONE; corners];
    let mut copies = 0;
    for c in 0..corners {
        let v = draft.mesh.triangles[c / 3][c % 3];
        let r = root(&mut parent, c as u32);
        if owner[v.index()] == u32::MAX {
            owner[v.index()] = r;
        }
        if owner[v.index()] == r {
            continue;
        }
        if !copy[r as usize].is_some() {
            copy[r as usize] = VertexId::new(draft.mesh.vertex_count());
            draft.mesh.positions.push(draft.mesh.positions[v.index()]);
            draft.provenance.push(draft.provenance[v.index()]);
            copies += 1;
        }
        draft.mesh.triangles[c / 3][c % 3] = copy[r as usize];
    }
    draft.note("copied vertices where the surface touches itself", copies);
}

/// Where a surface touches itself along an edge and both ends are single fans, two edges run between the same two
/// vertices. All but one get a vertex in their middle.
fn split_double_edges(draft: &mut Draft, glue: &Glue) {
    let key = |draft: &Draft, h: HalfEdgeId| {
        let (a, b) = (draft.mesh.origin(h), draft.mesh.target(h));
        (a.min(b), a.max(b))
    };
    let mut edges: Vec<(VertexId, VertexId, HalfEdgeId)> = (0..glue.twin.len())
        .map(HalfEdgeId::new)
        .filter(|&h| h < glue.twin[h.index()])
        .map(|h| {
            let (a, b) = key(draft, h);
            (a, b, h)
        })
        .collect();
    edges.sort_unstable();
    let extra: Vec<HalfEdgeId> = edges
        .chunk_by(|x, y| (x.0, x.1) == (y.0, y.1))
        .flat_map(|group| group[1..].iter().map(|e| e.2))
        .collect();
    if extra.is_empty() {
        return;
    }
    // The middle vertex of each half-edge to be divided; a face may have several.
    let mut middle = vec![VertexId::NONE; glue.twin.len()];
    for &h in &extra {
        let (a, b) = key(draft, h);
        let m = VertexId::new(draft.mesh.vertex_count());
        draft.mesh.positions.push((draft.mesh.position(a) + draft.mesh.position(b)) / 2.0);
        draft.provenance.push(match (draft.provenance[a.index()], draft.provenance[b.index()]) {
            (Provenance::Vertex(a), Provenance::Vertex(b)) => Provenance::Edge { ends: [a, b], t: 0.5 },
            (other, _) => other,
        });
        middle[h.index()] = m;
        middle[glue.twin[h.index()].index()] = m;
    }
    for f in 0..glue.twin.len() / 3 {
        let m = [middle[3 * f], middle[3 * f + 1], middle[3 * f + 2]];
        let Some(k) = (0..3).find(|&k| m[k].is_some()) else { continue };
        // The polygon of corners and middles, as a fan around the first middle.
        let t = draft.mesh.triangles[f];
        let mut ring = vec![m[k]];
        for i in 1..=3 {
            let j = (k + i) % 3;
            ring.push(t[j]);
            if i < 3 && m[j].is_some() {
                ring.push(m[j]);
            }
        }
        let origin = draft.face_of[f];
        draft.mesh.triangles[f] = [ring[0], ring[1], ring[2]];
        for i in 2..ring.len() - 1 {
            draft.mesh.triangles.push([ring[0], ring[i], ring[i + 1]]);
            draft.face_of.push(origin);
        }
    }
    draft.note("divided edges along which the surface touches itself", extra.len());
}
