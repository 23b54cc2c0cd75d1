//! Points of the mesh with parameters in a patch.
//!
//! A quad is mapped to the unit square by mean-value coordinates, its sides by arc length, so that the parameters
//! along a macro-edge are the same from both patches. Points are taken inside the faces, weighted by their area:
//! the fit then depends on the surface and not on how densely it is meshed, which varies a lot beside the cuts.

use glam::DVec2;
use rustc_hash::FxHashMap;
use topipe_mesh::disk_map::DiskMap;
use topipe_mesh::{DVec3, FaceId, TriangleMesh, VertexId};
use topipe_quad_matching::QuadLayout;

/// A point to be approximated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) point: DVec3,
    pub(crate) u: f64,
    pub(crate) v: f64,
    /// Share of the patch's area; all shares of a patch add up to 1.
    pub(crate) weight: f64,
    /// Unit normal of the mesh; zero where it has none.
    pub(crate) normal: DVec3,
}

/// A point of the mesh with its normal, for local fits: three a face.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceSample {
    pub(crate) point: DVec3,
    /// Unit normal of its face; zero where the face has none.
    pub(crate) normal: DVec3,
    /// Area it stands for, mm^2.
    pub(crate) area: f64,
}

/// The samples of one quad.
#[derive(Debug, Clone)]
pub(crate) struct PatchSamples {
    pub(crate) samples: Vec<Sample>,
    /// Points of the faces as they are, undivided.
    pub(crate) surface: Vec<SurfaceSample>,
    /// A ball around them: centre and radius.
    pub(crate) ball: (DVec3, f64),
    /// Area of the quad's faces, mm^2.
    pub(crate) area: f64,
}

impl PatchSamples {
    /// The samples within a distance of a place, in parameters, and the nearest in any case.
    pub(crate) fn near(&self, place: [f64; 2], reach: f64) -> impl Iterator<Item = &Sample> {
        let square = move |s: &Sample| (s.u - place[0]).powi(2) + (s.v - place[1]).powi(2);
        let nearest = self.samples.iter().min_by(|a, b| square(a).total_cmp(&square(b)));
        self.samples.iter().filter(move |s| square(s) <= reach * reach).chain(nearest)
    }
}

/// Arc-length positions, 0 to 1, along a path of mesh vertices.
pub(crate) fn arc_length(points: &[DVec3]) -> Vec<f64> {
    let mut along = vec![0.0];
    for pair in points.windows(2) {
        along.push(along[along.len() - 1] + pair[0].distance(pair[1]));
    }
    let total = along[along.len() - 1];
    let count = along.len() - 1;
    for (k, s) in along.iter_mut().enumerate() {
        *s = if total > 0.0 { *s / total } else { k as f64 / count as f64 };
    }
    along
}

/// Inner points of a triangle and their weights: the three-point rule of degree two.
const RULE: [[f64; 3]; 3] =
    [[2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0], [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0]];

/// The share of a triangle's area that each of its corners stands for where it is a vertex of the mesh, in the rule of its
/// corners and centroid that is exact for quadratic functions.
const CORNER: f64 = 1.0 / 12.0;

/// A quad with fewer faces than this is divided, each face into four, before it is mapped: the map of a few faces
/// with all their corners on the sides is as coarse as they are.
const FACES: usize = 64;

/// A quad's faces as a mesh of their own, with the places of the vertices on its sides.
struct Piece {
    mesh: TriangleMesh,
    fixed: FxHashMap<VertexId, DVec2>,
}

impl Piece {
    fn new(layout: &QuadLayout, quad: usize, faces: &[FaceId]) -> Self {
        let mesh = &layout.part.mesh;
        let mut number: FxHashMap<VertexId, VertexId> =
            FxHashMap::with_capacity_and_hasher(faces.len(), Default::default());
        let mut piece = TriangleMesh::default();
        for &f in faces {
            piece.triangles.push(mesh.triangles[f.index()].map(|v| {
                *number.entry(v).or_insert_with(|| {
                    piece.positions.push(mesh.position(v));
                    VertexId::new(piece.positions.len() - 1)
                })
            }));
        }
        let corner = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        let mut fixed: FxHashMap<VertexId, DVec2> = FxHashMap::default();
        for (k, side) in layout.quads[quad].iter().enumerate() {
            // Along the edge in its own direction, so that both patches get the same parameters bit for bit.
            let path = &layout.edges[side.edge as usize].path;
            let points: Vec<DVec3> = path.iter().map(|&v| mesh.position(v)).collect();
            let (from, to) = (corner[k], corner[(k + 1) % 4]);
            for (&v, t) in path.iter().zip(arc_length(&points)) {
                let t = if side.reversed { 1.0 - t } else { t };
                if let Some(&v) = number.get(&v) {
                    fixed.insert(v, from.lerp(to, t));
                }
            }
        }
        Self { mesh: piece, fixed }
    }

    /// Divides each face into four. Vertices between two of a side that a face joins lie on the side.
    fn divide(&mut self) {
        let mut uses: FxHashMap<[VertexId; 2], u32> = FxHashMap::default();
        let key = |a: VertexId, b: VertexId| if a < b { [a, b] } else { [b, a] };
        for &[a, b, c] in &self.mesh.triangles {
            [key(a, b), key(b, c), key(c, a)].into_iter().for_each(|e| *uses.entry(e).or_default() += 1);
        }
        let mut middles: FxHashMap<[VertexId; 2], VertexId> = FxHashMap::default();
        let mut finer = Vec::with_capacity(4 * self.mesh.triangles.len());
        for [a, b, c] in std::mem::take(&mut self.mesh.triangles) {
            let [d, e, f] = [key(a, b), key(b, c), key(c, a)].map(|edge| {
                *middles.entry(edge).or_insert_with(|| {
                    let [p, q] = edge.map(|v| self.mesh.positions[v.index()]);
                    self.mesh.positions.push((p + q) / 2.0);
                    let middle = VertexId::new(self.mesh.positions.len() - 1);
                    if let (1, Some(p), Some(q)) =
                        (uses[&edge], self.fixed.get(&edge[0]), self.fixed.get(&edge[1]))
                    {
                        let place = (*p + *q) / 2.0;
                        self.fixed.insert(middle, place);
                    }
                    middle
                })
            });
            finer.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
        }
        self.mesh.triangles = finer;
    }
}

/// Parameterizes quad `quad` and samples its faces. `None` when its faces are not a disk.
pub(crate) fn sample(layout: &QuadLayout, quad: usize, faces: &[FaceId]) -> Option<PatchSamples> {
    let mut piece = Piece::new(layout, quad, faces);
    let surface: Vec<SurfaceSample> = piece
        .mesh
        .faces()
        .flat_map(|f| {
            let points = piece.mesh.corners(f);
            let (normal, area) = (piece.mesh.normal(f), piece.mesh.area_vector(f).length() / 6.0);
            RULE.map(|shares| SurfaceSample {
                point: (0..3).map(|k| shares[k] * points[k]).sum(),
                normal,
                area,
            })
        })
        .filter(|s| s.area > 0.0)
        .collect();
    let center = surface.iter().map(|s| s.point).sum::<DVec3>() / surface.len().max(1) as f64;
    let radius = surface.iter().map(|s| s.point.distance(center)).fold(0.0, f64::max);
    let degenerate = piece.mesh.triangles.is_empty();
    let corners = piece.mesh.positions.len();
    while !degenerate && piece.mesh.triangles.len() < FACES {
        piece.divide();
    }
    let mesh = &piece.mesh;
    let all: Vec<FaceId> = mesh.faces().collect();
    let map = DiskMap::solve(mesh, &piece.fixed)?;
    let area: f64 = all.iter().map(|&f| mesh.area_vector(f).length() / 2.0).sum();
    // The vertices of the mesh inside: the tip of a spike is one of them.
    let mut tips = vec![(0.0, DVec3::ZERO); corners];
    for &f in &all {
        let normal = mesh.area_vector(f);
        let share = CORNER * normal.length() / 2.0 / area;
        for v in mesh.triangles[f.index()].into_iter().filter(|v| v.index() < corners) {
            if !piece.fixed.contains_key(&v) {
                tips[v.index()].0 += share;
                tips[v.index()].1 += normal;
            }
        }
    }
    let rest = 1.0 - tips.iter().map(|tip| tip.0).sum::<f64>();
    let mut samples = Vec::with_capacity(3 * all.len() + corners);
    for (v, &(weight, normal)) in tips.iter().enumerate().filter(|(_, tip)| tip.0 > 0.0) {
        let (point, place) = (mesh.positions[v], map.at(VertexId::new(v)));
        samples.push(Sample { point, u: place.x, v: place.y, weight, normal: normal.normalize_or_zero() });
    }
    for f in all {
        let weight = rest * mesh.area_vector(f).length() / 2.0 / (3.0 * area);
        let points = mesh.corners(f);
        let places = mesh.triangles[f.index()].map(|v| map.at(v));
        for shares in RULE {
            let point = (0..3).map(|k| shares[k] * points[k]).sum();
            let place: DVec2 = (0..3).map(|k| shares[k] * places[k]).sum();
            if weight > 0.0 {
                samples.push(Sample { point, u: place.x, v: place.y, weight, normal: mesh.normal(f) });
            }
        }
    }
    Some(PatchSamples { samples, surface, ball: (center, radius), area })
}

/// The faces of each quad, in order.
pub(crate) fn faces_by_quad(layout: &QuadLayout) -> Vec<Vec<FaceId>> {
    let mut faces = vec![Vec::new(); layout.quads.len()];
    for (f, &quad) in layout.quad_of_face.iter().enumerate() {
        if let Some(list) = faces.get_mut(quad as usize) {
            list.push(FaceId::new(f));
        }
    }
    faces
}
