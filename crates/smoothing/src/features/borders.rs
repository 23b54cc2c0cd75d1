//! Clean borders: regions without teeth, tongues and pinches.
//!
//! What a detector grows is every facet that fits, and where a shape meets the free surface chance lets single facets
//! fit. A later stage turns a region into one trimmed face, so its border has to be closed simple loops:
//!
//! - *Opening*: a facet stays only if it has a vertex off the free surface, one whose facets all belong to regions.
//!   Teeth, strips of one facet's width and lone facets have none; the corner of a block has. Opening the union of
//!   the regions instead of each alone keeps a wall that is one facet high between two flat faces.
//! - *Pinches*: where a region, or the free surface, meets itself in a vertex, the smaller sector gives way.
//! - Connected pieces become regions of their own, and pieces that are too small are given up.
//!
//! Each step only takes facets away, so the rounds end. After them non-design facets that were opened away come back where
//! they pinch nothing: they do not fit by chance.

use topipe_mesh::{Connectivity, Design, FaceId, Part, TriangleMesh, VertexId};

/// No region.
pub(super) const NONE: u32 = u32::MAX;

/// From this dihedral angle on a border is an edge of the shape: cosine of 20 degrees, as in the report.
const SHARP: f64 = 0.9397;

/// A connected piece of a region, for the decision whether it is large enough.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Piece {
    /// The region that it is a piece of.
    pub(super) region: u32,
    /// Area of its facets.
    pub(super) area: f64,
    /// Length of its border.
    pub(super) border: f64,
    /// Length of the part of its border that it shares with other regions.
    pub(super) shared: f64,
    /// Length of the part of its border with a dihedral angle of more than [`SHARP`].
    pub(super) sharp: f64,
    /// Area of its facets with a vertex inside the piece.
    pub(super) core: f64,
    /// Area of its non-design facets.
    pub(super) non_design: f64,
}

/// Cleans `owner`, the region of each face or [`NONE`], and returns the region each remaining piece was part of;
/// afterwards `owner` numbers pieces. Regions that are `fixed` stay whole and as they are.
pub(super) fn clean(
    part: &Part,
    connectivity: &Connectivity,
    owner: &mut [u32],
    fixed: &[bool],
    large_enough: impl Fn(&Piece) -> bool,
) -> Vec<u32> {
    let mesh = &part.mesh;
    let grown = owner.to_vec();
    let mut regions: Vec<u32> = (0..fixed.len() as u32).collect();
    loop {
        let pieces = split(part, connectivity, owner, &regions, fixed);
        let stays: Vec<bool> = pieces.iter().map(|p| fixed[p.region as usize]).collect();
        let kept: Vec<bool> = pieces.iter().zip(&stays).map(|(p, stays)| *stays || large_enough(p)).collect();
        let mut changed = kept.contains(&false);
        for o in owner.iter_mut().filter(|o| **o != NONE) {
            if !kept[*o as usize] {
                *o = NONE;
            }
        }
        changed |= open(mesh, owner, &stays);
        changed |= part_pinches(mesh, connectivity, owner, &stays);
        regions = pieces.iter().map(|p| p.region).collect();
        if !changed {
            break;
        }
    }
    keep_teeth(part, connectivity, owner, &regions, &grown);
    regions
}

/// Gives non-design facets that were opened away back to the region they grew in. A non-design facet does not fit by
/// chance, and all its vertices are frozen: dropped, it stays behind in a free surface that moves away from it, a dent
/// that no patch can follow. A facet is taken with one edge on a piece of its region where no other facet of any region
/// is at the tip, or with two edges: neither pinches anything.
fn keep_teeth(part: &Part, connectivity: &Connectivity, owner: &mut [u32], regions: &[u32], grown: &[u32]) {
    let mesh = &part.mesh;
    let mut touched = vec![false; mesh.vertex_count()];
    for f in mesh.faces().filter(|f| owner[f.index()] != NONE) {
        mesh.triangles[f.index()].iter().for_each(|v| touched[v.index()] = true);
    }
    let dropped = |f: &FaceId| grown[f.index()] != NONE && part.design[f.index()] == Design::NonDesign;
    let dropped: Vec<FaceId> = mesh.faces().filter(dropped).collect();
    loop {
        let mut changed = false;
        for &f in dropped.iter() {
            if owner[f.index()] != NONE {
                continue;
            }
            let across = |k: usize| {
                let across = connectivity.neighbor(f, k);
                let there = if across.is_some() { owner[across.index()] } else { NONE };
                (there != NONE && regions[there as usize] == grown[f.index()]).then_some(there)
            };
            let sides = [0, 1, 2].map(across);
            let tip = |k: usize| mesh.triangles[f.index()][(k + 2) % 3];
            let piece = match sides {
                [Some(a), Some(b), _] | [Some(a), _, Some(b)] | [_, Some(a), Some(b)] => {
                    (a == b).then_some(a)
                }
                _ => (0..3).find_map(|k| sides[k].filter(|_| !touched[tip(k).index()])),
            };
            if let Some(piece) = piece {
                owner[f.index()] = piece;
                mesh.triangles[f.index()].iter().for_each(|v| touched[v.index()] = true);
                changed = true;
            }
        }
        if !changed {
            return;
        }
    }
}

/// Numbers the connected pieces in `owner`, in the order of their first faces, and measures them.
fn split(
    part: &Part,
    connectivity: &Connectivity,
    owner: &mut [u32],
    regions: &[u32],
    fixed: &[bool],
) -> Vec<Piece> {
    let mesh = &part.mesh;
    // The piece of each fixed region; they come first.
    let mut whole = vec![NONE; fixed.len()];
    let mut pieces: Vec<Piece> = Vec::new();
    for region in (0..fixed.len()).filter(|&r| fixed[r]) {
        whole[region] = pieces.len() as u32;
        pieces.push(Piece { region: region as u32, ..Piece::default() });
    }
    let mut piece_of: Vec<u32> =
        owner.iter().map(|&o| if o == NONE { NONE } else { whole[regions[o as usize] as usize] }).collect();
    let mut stack = Vec::new();
    for seed in mesh.faces() {
        if owner[seed.index()] == NONE || piece_of[seed.index()] != NONE {
            continue;
        }
        let id = pieces.len() as u32;
        let mut piece = Piece { region: regions[owner[seed.index()] as usize], ..Piece::default() };
        piece_of[seed.index()] = id;
        stack.push(seed);
        while let Some(f) = stack.pop() {
            let area = mesh.area_vector(f).length() / 2.0;
            piece.area += area;
            if part.design[f.index()] == Design::NonDesign {
                piece.non_design += area;
            }
            for k in 0..3 {
                let across = connectivity.neighbor(f, k);
                let there = if across.is_some() { owner[across.index()] } else { NONE };
                if there == owner[seed.index()] {
                    if piece_of[across.index()] == NONE {
                        piece_of[across.index()] = id;
                        stack.push(across);
                    }
                    continue;
                }
                let t = mesh.triangles[f.index()];
                let length = mesh.position(t[k]).distance(mesh.position(t[(k + 1) % 3]));
                piece.border += length;
                if there != NONE {
                    piece.shared += length;
                }
                if !across.is_some() || mesh.normal(f).dot(mesh.normal(across)) < SHARP {
                    piece.sharp += length;
                }
            }
        }
        pieces.push(piece);
    }
    owner.copy_from_slice(&piece_of);
    // Per vertex the piece of all its faces, or NONE.
    let mut inside = vec![NONE; mesh.vertex_count()];
    let mut mixed = vec![false; mesh.vertex_count()];
    for (t, &o) in mesh.triangles.iter().zip(owner.iter()) {
        for v in t {
            mixed[v.index()] |= o == NONE || (inside[v.index()] != NONE && inside[v.index()] != o);
            inside[v.index()] = o;
        }
    }
    for f in mesh.faces() {
        let o = owner[f.index()];
        if o != NONE && mesh.triangles[f.index()].iter().any(|v| !mixed[v.index()]) {
            pieces[o as usize].core += mesh.area_vector(f).length() / 2.0;
        }
    }
    pieces
}

/// Drops faces whose vertices all lie on the free surface.
fn open(mesh: &TriangleMesh, owner: &mut [u32], stays: &[bool]) -> bool {
    let mut free = vec![false; mesh.vertex_count()];
    for f in mesh.faces().filter(|f| owner[f.index()] == NONE) {
        mesh.triangles[f.index()].iter().for_each(|v| free[v.index()] = true);
    }
    let mut changed = false;
    for f in mesh.faces() {
        let t = mesh.triangles[f.index()];
        let o = owner[f.index()];
        if o != NONE && !stays[o as usize] && t.iter().all(|v| free[v.index()]) {
            owner[f.index()] = NONE;
            changed = true;
        }
    }
    changed
}

/// Runs of faces of one owner around a vertex, in order.
struct Run {
    owner: u32,
    faces: Vec<FaceId>,
    angle: f64,
}

fn runs(mesh: &TriangleMesh, connectivity: &Connectivity, owner: &[u32], v: VertexId) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for h in connectivity.outgoing(v) {
        let f = h.face();
        let here = mesh.position(v);
        let a = mesh.position(connectivity.target(h)) - here;
        let b = mesh.position(connectivity.origin(h.prev())) - here;
        let angle = a.angle_between(b);
        match runs.last_mut() {
            Some(run) if run.owner == owner[f.index()] => {
                run.faces.push(f);
                run.angle += angle;
            }
            _ => runs.push(Run { owner: owner[f.index()], faces: vec![f], angle }),
        }
    }
    // The walk starts anywhere: its ends are one run. At a border of the surface they are not.
    if runs.len() > 1 && runs[0].owner == runs[runs.len() - 1].owner && !connectivity.is_border(v) {
        let last = runs.remove(runs.len() - 1);
        runs[0].faces.extend(last.faces);
        runs[0].angle += last.angle;
    }
    runs
}

/// Takes faces from the regions until no vertex joins two sectors of a region, or two of the free surface.
fn part_pinches(mesh: &TriangleMesh, connectivity: &Connectivity, owner: &mut [u32], stays: &[bool]) -> bool {
    let mut changed = false;
    for v in mesh.vertices() {
        let mut first = NONE;
        let mut mixed = false;
        for (k, h) in connectivity.outgoing(v).enumerate() {
            let o = owner[h.face().index()];
            if k == 0 {
                first = o;
            }
            mixed |= o != first;
        }
        if !mixed {
            continue;
        }
        loop {
            let around = runs(mesh, connectivity, owner, v);
            let Some(least) = pinch(&around, stays) else { break };
            for f in &around[least].faces {
                owner[f.index()] = NONE;
            }
            changed = true;
        }
    }
    changed
}

/// The run to give up, if two runs of one owner, or two runs of free faces, meet in the vertex.
fn pinch(around: &[Run], stays: &[bool]) -> Option<usize> {
    let may_go = |i: &usize| around[*i].owner != NONE && !stays[around[*i].owner as usize];
    let twice = |o: u32| around.iter().filter(|r| r.owner == o).count() > 1;
    let smaller = |a: &usize, b: &usize| {
        around[*a].angle.total_cmp(&around[*b].angle).then(around[*a].faces.cmp(&around[*b].faces))
    };
    if twice(NONE) {
        // Any region run may go; dropping the smallest brings the free runs together or shortens what parts them.
        return (0..around.len()).filter(may_go).min_by(smaller);
    }
    (0..around.len()).filter(|i| may_go(i) && twice(around[*i].owner)).min_by(smaller)
}
