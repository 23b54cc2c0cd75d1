//! An earlier layout as if its part had had the triangles that the edited one has.

use super::Earlier;
use crate::{MacroEdge, QuadLayout};
use rustc_hash::FxHashMap;
use topipe_mesh::{Correspondence, DVec3, FaceId, Lineage, Part, Provenance, TriangleMesh, VertexId};

/// An earlier version that lies on the triangles of another mesh.
pub(super) struct Restated {
    /// The earlier part.
    pub(super) part: Part,
    /// Its layout: triangles that the mesh has are cut as they were, the others belong to no quad. Quads that lay on triangles which are
    /// gone are left out; edges and vertices that only they had are still there, and may have no path.
    pub(super) layout: QuadLayout,
    /// Quads that were left out.
    pub(super) lost: usize,
}

/// Restates what was earlier on the triangles of `mesh`. `lineage` is how the mesh of the earlier layout lies on that of the
/// earlier part.
pub(super) fn restate(
    earlier: Earlier<'_>,
    lineage: &Lineage,
    same: &Correspondence,
    mesh: &TriangleMesh,
) -> Restated {
    let before = earlier.layout;
    let part = same.restated(earlier.part, mesh);
    let (mut cut, pieces) = Cut::of_kept(earlier, lineage, same);
    for f in same.new_faces() {
        cut.add_new(f, &part.mesh);
    }
    let Cut { number, positions, provenance, triangles, .. } = cut;
    let moved = |v: &VertexId| number[v.index()];

    // Quads of which a piece is gone.
    let mut whole = vec![true; before.quads.len()];
    let mut is_kept = vec![false; before.quad_of_face.len()];
    pieces.iter().for_each(|f| is_kept[f.index()] = true);
    for (&quad, _) in before.quad_of_face.iter().zip(&is_kept).filter(|(_, kept)| !**kept) {
        if let Some(whole) = whole.get_mut(quad as usize) {
            *whole = false;
        }
    }
    let mut quad_number = vec![QuadLayout::NO_QUAD; before.quads.len()];
    let mut quads = Vec::with_capacity(before.quads.len());
    for (quad, sides) in before.quads.iter().enumerate().filter(|(quad, _)| whole[*quad]) {
        quad_number[quad] = quads.len() as u32;
        quads.push(*sides);
    }

    let mut own = Part::new(TriangleMesh { positions, triangles });
    own.provenance = provenance;
    own.regions.clone_from(&before.part.regions);
    let mut quad_of_face = vec![QuadLayout::NO_QUAD; own.mesh.face_count()];
    for (f, piece) in pieces.iter().map(|f| f.index()).enumerate() {
        own.region_of_face[f] = before.part.region_of_face[piece];
        let quad = before.quad_of_face[piece] as usize;
        quad_of_face[f] = quad_number.get(quad).copied().unwrap_or(QuadLayout::NO_QUAD);
    }
    let edge = |edge: &MacroEdge| {
        let mut path: Vec<VertexId> = edge.path.iter().map(moved).collect();
        if path.iter().any(|v| !v.is_some()) {
            path.clear();
        }
        MacroEdge { path, ..edge.clone() }
    };
    let lost = before.quads.len() - quads.len();
    let layout = QuadLayout {
        part: own,
        lengths: before.lengths,
        vertices: before.vertices.iter().map(moved).collect(),
        edges: before.edges.iter().map(edge).collect(),
        quads,
        quad_of_face,
        region_faces: before.region_faces.clone(),
        tiles: before.tiles,
        macro_triangles: before.macro_triangles,
    };
    Restated { part, layout, lost }
}

/// The mesh of a layout while it is put together from pieces of triangles that were there and new ones.
#[derive(Default)]
struct Cut {
    /// Per vertex of the earlier layout: its number now, or none.
    number: Vec<VertexId>,
    /// What lies at a vertex of the mesh.
    at_vertex: FxHashMap<VertexId, VertexId>,
    /// What lies on an edge of the mesh, with its place between the smaller end and the larger.
    on_edge: FxHashMap<[VertexId; 2], Vec<(f64, VertexId)>>,
    positions: Vec<DVec3>,
    provenance: Vec<Provenance>,
    triangles: Vec<[VertexId; 3]>,
}

impl Cut {
    /// The pieces of triangles that are there still, in their order, as are their vertices: what follows goes by numbers here and there,
    /// and shall not come to another result for others. Returns their earlier numbers.
    fn of_kept(earlier: Earlier<'_>, lineage: &Lineage, same: &Correspondence) -> (Self, Vec<FaceId>) {
        let (before, parent) = (&earlier.layout.part.mesh, &earlier.part.mesh);
        let is_there = |(_, f): &(FaceId, &FaceId)| same.face_now(**f).is_some();
        let pieces: Vec<FaceId> =
            before.faces().zip(lineage.faces()).filter(is_there).map(|(f, _)| f).collect();
        let mut is_used = vec![false; before.vertex_count()];
        for f in &pieces {
            before.triangles[f.index()].iter().for_each(|v| is_used[v.index()] = true);
        }
        let mut cut = Self { number: vec![VertexId::NONE; before.vertex_count()], ..Self::default() };
        for (v, point) in before.vertices().zip(lineage.provenance(parent)) {
            // A piece of a triangle that is there lies on it.
            if let Some(point) = same.provenance(&point).filter(|_| is_used[v.index()]) {
                cut.number[v.index()] = cut.add(point, before.position(v));
            }
        }
        cut.on_edge.values_mut().for_each(|points| points.sort_by(|a, b| a.0.total_cmp(&b.0)));
        let numbered = |f: &FaceId| before.triangles[f.index()].map(|v| cut.number[v.index()]);
        let triangles = pieces.iter().map(numbered).collect();
        (Self { triangles, ..cut }, pieces)
    }

    fn add(&mut self, point: Provenance, position: DVec3) -> VertexId {
        let v = VertexId::new(self.positions.len());
        match point {
            Provenance::Vertex(own) => drop(self.at_vertex.insert(own, v)),
            Provenance::Edge { ends, t } => self.on_edge.entry(ends).or_default().push((t, v)),
            Provenance::Face { .. } => {}
        }
        self.positions.push(position);
        self.provenance.push(point);
        v
    }

    /// A triangle that was not there, divided where its neighbours are.
    fn add_new(&mut self, f: FaceId, mesh: &TriangleMesh) {
        let corners = mesh.triangles[f.index()];
        let mut outline = Vec::with_capacity(8);
        // Where sides begin, and which of them are divided.
        let (mut first, mut divided) = ([0; 3], Vec::with_capacity(3));
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            first[k] = outline.len();
            outline.push(match self.at_vertex.get(&a) {
                Some(&v) => v,
                None => self.add(Provenance::Vertex(a), mesh.position(a)),
            });
            let points = self.on_edge.get(&[a.min(b), a.max(b)]).map_or(&[][..], |points| points);
            if !points.is_empty() {
                divided.push(k);
            }
            let points = points.iter().map(|&(_, v)| v);
            if a < b { outline.extend(points) } else { outline.extend(points.rev()) }
        }
        let n = outline.len();
        // A point inside sees all of the outline; a corner all but its own two sides.
        let (center, from) = match divided[..] {
            [] => return self.triangles.push([outline[0], outline[1], outline[2]]),
            [side] => {
                (outline[first[(side + 2) % 3]], (first[(side + 2) % 3] + 1)..(first[(side + 2) % 3] + n - 1))
            }
            _ => {
                let weights = [1.0 / 3.0; 2];
                (self.add(Provenance::Face { face: f, weights }, mesh.centroid(f)), 0..n)
            }
        };
        self.triangles.extend(from.map(|k| [center, outline[k % n], outline[(k + 1) % n]]));
    }
}
