//! Quads around the macro-vertices, in order, and the sectors between creases.
//!
//! Around a vertex the quads of the free surface form one closed fan, or open fans between region faces. A fan falls
//! into sectors at its creases: edges across which the normal may jump. All patches of a sector share one tangent
//! plane at the vertex.

use topipe_quad_matching::QuadLayout;

/// What happens across a macro-edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum EdgeRole {
    /// Two patches with a common tangent plane along the edge.
    Smooth,
    /// Two patches whose normals may differ.
    Crease,
    /// A patch on one side, a region face on the other.
    Border,
    /// Region faces on both sides.
    Inner,
}

/// An edge as it leaves a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Spoke {
    pub(crate) edge: u32,
    /// True when the vertex is the edge's last.
    pub(crate) reversed: bool,
}

/// The quads between two creases around a vertex.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Sector {
    pub(crate) vertex: u32,
    /// Quads and the corner of each, counter-clockwise.
    pub(crate) quads: Vec<(u32, u8)>,
    /// Edges before, between and after the quads, counter-clockwise; as many as quads where `closed`, else one more.
    pub(crate) spokes: Vec<Spoke>,
    /// All around the vertex without a crease, or with a single one.
    pub(crate) closed: bool,
}

/// All sectors, and which of them each corner of each quad belongs to.
pub(crate) struct Sectors {
    pub(crate) list: Vec<Sector>,
    /// By quad and corner.
    pub(crate) at: Vec<[u32; 4]>,
}

/// The quads beside each edge: (quad, side), at most two.
pub(crate) fn quads_beside(layout: &QuadLayout) -> Vec<Vec<(u32, u8)>> {
    let mut beside = vec![Vec::with_capacity(2); layout.edges.len()];
    for (q, sides) in layout.quads.iter().enumerate() {
        for (k, side) in sides.iter().enumerate() {
            beside[side.edge as usize].push((q as u32, k as u8));
        }
    }
    beside
}

impl Sectors {
    pub(crate) fn new(layout: &QuadLayout, roles: &[EdgeRole]) -> Self {
        // The quad that leaves a vertex along a directed edge.
        let mut leaving = vec![[None; 2]; layout.edges.len()];
        for (q, sides) in layout.quads.iter().enumerate() {
            for (k, side) in sides.iter().enumerate() {
                leaving[side.edge as usize][side.reversed as usize] = Some((q as u32, k as u8));
            }
        }
        let out = |(q, k): (u32, u8)| {
            let side = layout.quads[q as usize][k as usize];
            Spoke { edge: side.edge, reversed: side.reversed }
        };
        // The edge that enters the corner, as it leaves the vertex again.
        let back = |(q, k): (u32, u8)| {
            let side = layout.quads[q as usize][(k as usize + 3) % 4];
            Spoke { edge: side.edge, reversed: !side.reversed }
        };
        let next = |at: (u32, u8)| leaving[back(at).edge as usize][back(at).reversed as usize];
        let opens = |at: (u32, u8)| roles[out(at).edge as usize] != EdgeRole::Smooth;
        let mut sectors = Self { list: Vec::new(), at: vec![[u32::MAX; 4]; layout.quads.len()] };
        // Sectors that begin at a crease or border first; the corners left over lie in closed fans.
        for closed in [false, true] {
            for q in 0..layout.quads.len() as u32 {
                for k in 0..4u8 {
                    let start = (q, k);
                    if sectors.at[q as usize][k as usize] != u32::MAX || (!closed && !opens(start)) {
                        continue;
                    }
                    let id = sectors.list.len() as u32;
                    let (mut quads, mut spokes) = (vec![start], vec![out(start)]);
                    sectors.at[q as usize][k as usize] = id;
                    let mut current = start;
                    let mut around = false;
                    loop {
                        let spoke = back(current);
                        match next(current) {
                            Some(beyond) if beyond == start => {
                                // All around: a single crease does not make two tangent planes.
                                around = true;
                                break;
                            }
                            Some(beyond) if roles[spoke.edge as usize] == EdgeRole::Smooth => {
                                spokes.push(spoke);
                                quads.push(beyond);
                                sectors.at[beyond.0 as usize][beyond.1 as usize] = id;
                                current = beyond;
                            }
                            _ => {
                                spokes.push(spoke);
                                break;
                            }
                        }
                    }
                    let vertex = layout.start(layout.quads[q as usize][k as usize]);
                    sectors.list.push(Sector { vertex, quads, spokes, closed: around });
                }
            }
        }
        sectors
    }
}
