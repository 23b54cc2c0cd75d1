//! What a tile is like: its border, its corners, how much it bends.

use super::Construction;
use super::surface::{NONE, Surface};
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, VertexId};

/// The largest part of a tile's area whose normals are not looked at: slivers and single spikes of noise.
const STRAY: f64 = 0.02;

/// A tile as it is now.
pub(crate) struct Outline {
    /// Border half-edges inside the tile, counter-clockwise from a corner if there is one.
    pub(crate) border: Vec<HalfEdgeId>,
    /// Indices into the border where sides start.
    pub(crate) corners: Vec<usize>,
}

/// Why faces are no disk with a simple border.
pub(crate) enum Fault {
    /// The border touches itself at this vertex.
    Pinch(VertexId),
    /// More than one border, a handle, or several pieces.
    NotDisk,
}

/// Stamps vertices that were met; cheaper than a set for each tile.
pub(crate) struct Stamps {
    stamp: Vec<u32>,
    current: u32,
}

impl Stamps {
    pub(crate) fn new(vertices: usize) -> Self {
        Self { stamp: vec![0; vertices], current: 0 }
    }

    /// Makes room for vertices that have come since.
    pub(crate) fn grow(&mut self, vertices: usize) {
        self.stamp.resize(vertices, 0);
    }

    fn begin(&mut self) {
        self.current += 1;
    }

    /// True the first time since `begin`.
    fn first(&mut self, v: VertexId) -> bool {
        let slot = &mut self.stamp[v.index()];
        let first = *slot != self.current;
        *slot = self.current;
        first
    }
}

impl Construction<'_> {
    /// Per vertex: a corner of the tiles around it, because more than two borders meet or a segment ends here.
    pub(crate) fn corner_vertices(&self) -> Vec<bool> {
        let surface = &self.surface;
        let mut borders = vec![0u8; surface.on_barrier.len()];
        for h in surface.half_edges() {
            if surface.is_border(h) {
                let slot = &mut borders[surface.refiner.origin(h).index()];
                *slot = slot.saturating_add(1);
            }
        }
        let node = |v: usize| self.is_node.get(v) == Some(&true);
        borders.iter().enumerate().map(|(v, &count)| count > 2 || node(v)).collect()
    }
}

/// The outline of a set of faces that is bounded by `is_border`, if it is a disk with a simple border.
pub(crate) fn outline(
    surface: &Surface,
    faces: &[FaceId],
    is_border: impl Fn(HalfEdgeId) -> bool,
    is_corner: &[bool],
    stamps: &mut Stamps,
) -> Result<Outline, Fault> {
    stamps.begin();
    let (mut vertices, mut edges) = (0i64, 0i64);
    let (mut start, mut at_corner) = (None, false);
    for &f in faces {
        for k in 0..3 {
            let h = HalfEdgeId::of(f, k);
            vertices += stamps.first(surface.refiner.origin(h)) as i64;
            if is_border(h) {
                edges += 1;
                let corner = is_corner[surface.refiner.origin(h).index()];
                if start.is_none() || (corner && !at_corner) {
                    start = Some(h);
                    at_corner = corner;
                }
            }
        }
    }
    let Some(start) = start else { return Err(Fault::NotDisk) };
    let border_count = edges;
    stamps.begin();
    let mut border = Vec::with_capacity(border_count as usize);
    let mut h = start;
    loop {
        if !stamps.first(surface.refiner.origin(h)) {
            return Err(Fault::Pinch(surface.refiner.origin(h)));
        }
        border.push(h);
        h = h.next();
        while !is_border(h) {
            h = surface.refiner.twin(h).next();
        }
        if h == start {
            break;
        }
    }
    // Each inner edge has two half-edges inside, each border edge one.
    let all = (3 * faces.len() as i64 + border_count) / 2;
    if border.len() as i64 != border_count || vertices - all + faces.len() as i64 != 1 {
        return Err(Fault::NotDisk);
    }
    let corners =
        (0..border.len()).filter(|&k| is_corner[surface.refiner.origin(border[k]).index()]).collect();
    Ok(Outline { border, corners })
}

/// The square of the length of a border over the area it bounds: 16 for a square, 25 for four squares in a row, 33 for
/// six. In a map to the disk what is far from the middle shrinks by the exponential of that.
pub(crate) fn slenderness(surface: &Surface, faces: &[FaceId], border: &[HalfEdgeId]) -> f64 {
    let mesh = &surface.refiner.part().mesh;
    let length: f64 = border.iter().map(|&h| surface.length(h)).sum();
    let area: f64 = faces.iter().map(|&f| mesh.area_vector(f).length() / 2.0).sum();
    length * length / area
}

/// The largest angle between a face's normal and the mean normal of a tile, radians, and the face; all but a stray
/// share of the area lies within it.
pub(crate) fn normal_cone(surface: &Surface, faces: &[FaceId]) -> (f64, FaceId) {
    let mesh = &surface.refiner.part().mesh;
    let sum: DVec3 = faces.iter().map(|&f| mesh.area_vector(f)).sum();
    let mut by_angle: Vec<(f64, f64, FaceId)> = faces
        .iter()
        .map(|&f| {
            let n = mesh.area_vector(f);
            (n.cross(sum).length().atan2(n.dot(sum)), n.length(), f)
        })
        .collect();
    by_angle.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)));
    let mut stray = STRAY * by_angle.iter().map(|e| e.1).sum::<f64>();
    for (angle, area, face) in by_angle {
        stray -= area;
        if stray <= 0.0 {
            return (angle, face);
        }
    }
    (0.0, faces.first().copied().unwrap_or(FaceId(NONE)))
}
