//! The borders between design and non-design, where branches start (thesis, section 3.4.1).
//!
//! The thesis groups triangles that share a node. Here sets are connected through edges: two blocks that touch in a
//! corner carry no load from one to the other, and only so do the loops close as the surface does.

use crate::SkeletonError;
use glam::DVec3;
use topipe_mesh::{Connectivity, Design, FaceId, HalfEdgeId, Part, TriangleMesh, VertexId};

/// Cosine of the angle up to which two interfaces lie in one plane: 15 degrees, for outlines run over rounded rims.
const SAME_DIRECTION: f64 = 0.966;

/// A strip between two interfaces is a cut when it is less than so many mean edge lengths wide.
const STRIP: f64 = 4.0;

/// The share of the nodes of an interface that lie along the strip: a quarter of a square.
const BESIDE: f64 = 0.2;

/// One closed border loop between a design set and a non-design set.
#[derive(Debug, Clone)]
pub(crate) struct Interface {
    /// Its half-edges, on the design side, in order.
    pub(crate) half_edges: Vec<HalfEdgeId>,
    /// Where they start: the nodes of the interface section.
    pub(crate) vertices: Vec<VertexId>,
    /// The mean of the nodes (the thesis's non-design skeletal point).
    pub(crate) node_mean: DVec3,
    /// The area centroid of the loop, which does not follow the mesh density.
    pub(crate) centroid: DVec3,
    /// Unit normal, into the design region; zero for a loop without area.
    pub(crate) normal: DVec3,
    /// The non-design set, see [`Sets::of_face`].
    pub(crate) non_design: u32,
}

/// The mesh cut along its label borders.
#[derive(Debug, Clone)]
pub(crate) struct Sets {
    /// The set of each face.
    pub(crate) of_face: Vec<u32>,
    /// One per set.
    pub(crate) label: Vec<Design>,
    /// All borders, ordered by their lowest half-edge.
    pub(crate) interfaces: Vec<Interface>,
}

/// Checks what every method relies on.
pub(crate) fn connect(part: &Part) -> Result<Connectivity, SkeletonError> {
    let mesh = &part.mesh;
    if mesh.triangles.is_empty() {
        return Err(SkeletonError::Empty);
    }
    if part.design.len() != mesh.face_count() {
        return Err(SkeletonError::Labels { labels: part.design.len(), faces: mesh.face_count() });
    }
    if let Some(vertex) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return Err(SkeletonError::NotFinite { vertex: vertex as u32 });
    }
    let connectivity = Connectivity::build(mesh)?;
    if !connectivity.is_closed() {
        let open = (0..mesh.face_count() * 3).map(HalfEdgeId::new).find(|&h| !connectivity.twin(h).is_some());
        let at = open.map_or([f64::NAN; 3], |h| mesh.position(mesh.origin(h)).to_array());
        return Err(SkeletonError::Open { edges: connectivity.border_edge_count(), at });
    }
    Ok(connectivity)
}

impl Sets {
    pub(crate) fn find(part: &Part, connectivity: &Connectivity) -> Self {
        let mesh = &part.mesh;
        let mut of_face = vec![u32::MAX; mesh.face_count()];
        let mut label = Vec::new();
        let mut stack = Vec::new();
        for seed in mesh.faces() {
            if of_face[seed.index()] != u32::MAX {
                continue;
            }
            let set = label.len() as u32;
            label.push(part.design[seed.index()]);
            of_face[seed.index()] = set;
            stack.push(seed);
            while let Some(face) = stack.pop() {
                for k in 0..3 {
                    let next = connectivity.neighbor(face, k).index();
                    if of_face[next] == u32::MAX && part.design[next] == part.design[face.index()] {
                        of_face[next] = set;
                        stack.push(FaceId::new(next));
                    }
                }
            }
        }
        let mut sets = Self { of_face, label, interfaces: Vec::new() };
        sets.interfaces = sets.trace_interfaces(mesh, connectivity);
        sets
    }

    fn trace_interfaces(&self, mesh: &TriangleMesh, connectivity: &Connectivity) -> Vec<Interface> {
        let set = |h: HalfEdgeId| self.of_face[h.face().index()];
        let is_border = |h: HalfEdgeId| {
            self.label[set(h) as usize] == Design::Design && set(h) != set(connectivity.twin(h))
        };
        let mut seen = vec![false; mesh.face_count() * 3];
        let mut interfaces = Vec::new();
        for start in (0..mesh.face_count() * 3).map(HalfEdgeId::new) {
            if seen[start.index()] || !is_border(start) {
                continue;
            }
            let mut half_edges = Vec::new();
            let mut h = start;
            while !std::mem::replace(&mut seen[h.index()], true) {
                half_edges.push(h);
                // Turn about the end inside the design set, so that loops that touch in a vertex stay apart.
                h = h.next();
                while !is_border(h) {
                    h = connectivity.twin(h).next();
                }
            }
            let vertices: Vec<_> = half_edges.iter().map(|&h| connectivity.origin(h)).collect();
            let loop_points: Vec<_> = vertices.iter().map(|&v| mesh.position(v)).collect();
            let node_mean = loop_points.iter().sum::<DVec3>() / loop_points.len() as f64;
            let (centroid, area_vector) = loop_centroid(&loop_points, node_mean);
            interfaces.push(Interface {
                non_design: set(connectivity.twin(start)),
                half_edges,
                vertices,
                node_mean,
                centroid,
                normal: area_vector.normalize_or_zero(),
            });
        }
        interfaces
    }

    /// The design sets with interfaces that enclose no volume once these are closed, ascending.
    pub(crate) fn hollow(&self, mesh: &TriangleMesh) -> Vec<u32> {
        let n = self.label.len();
        let (mut volume, mut area, mut about) = (vec![0.0; n], vec![0.0; n], vec![None; n]);
        let mut add = |set: usize, corners: [DVec3; 3]| {
            let origin = *about[set].get_or_insert(corners[0]);
            let [a, b, c] = corners.map(|p| p - origin);
            volume[set] += a.dot(b.cross(c)) / 6.0;
            area[set] += (b - a).cross(c - a).length() / 2.0;
        };
        for face in mesh.faces() {
            add(self.of_face[face.index()] as usize, mesh.corners(face));
        }
        let mut bordered = vec![false; n];
        for interface in &self.interfaces {
            let set = self.of_face[interface.half_edges[0].face().index()] as usize;
            bordered[set] = true;
            let count = interface.vertices.len();
            for k in 0..count {
                let (a, b) = (interface.vertices[k], interface.vertices[(k + 1) % count]);
                add(set, [mesh.position(b), mesh.position(a), interface.node_mean]);
            }
        }
        // A round bar a thousand radii long has 6e-3, a plate 300 times as wide as thick 1e-3.
        let hollow = |s: &u32| {
            let s = *s as usize;
            bordered[s] && volume[s] < 1e-3 * area[s].powf(1.5)
        };
        self.with_label(Design::Design).filter(hollow).collect()
    }

    /// Points between interfaces of one plane that a narrow strip of design faces parts: a label that cuts a face in two.
    pub(crate) fn cut_faces(&self, mesh: &TriangleMesh) -> Vec<DVec3> {
        let edge = mesh.mean_edge_length();
        let mut found = Vec::new();
        for (k, a) in self.interfaces.iter().enumerate() {
            for b in &self.interfaces[k + 1..] {
                let apart = a.non_design != b.non_design
                    && self.of_face[a.half_edges[0].face().index()]
                        == self.of_face[b.half_edges[0].face().index()];
                let one_plane = a.normal.dot(b.normal) > SAME_DIRECTION
                    && (b.centroid - a.centroid).dot(a.normal).abs() < STRIP * edge;
                if !(apart && one_plane) {
                    continue;
                }
                let near = |v: &&VertexId| {
                    let p = mesh.position(**v);
                    b.vertices.iter().any(|w| mesh.position(*w).distance(p) < STRIP * edge)
                };
                let beside: Vec<_> = a.vertices.iter().filter(near).collect();
                if beside.len() as f64 >= BESIDE * a.vertices.len().min(b.vertices.len()) as f64 {
                    found
                        .push(beside.iter().map(|v| mesh.position(**v)).sum::<DVec3>() / beside.len() as f64);
                }
            }
        }
        found
    }

    /// The faces of `set`.
    pub(crate) fn faces(&self, set: u32) -> Vec<FaceId> {
        (0..self.of_face.len()).filter(|&f| self.of_face[f] == set).map(FaceId::new).collect()
    }

    /// The sets with the given label.
    pub(crate) fn with_label(&self, label: Design) -> impl Iterator<Item = u32> + '_ {
        (0..self.label.len() as u32).filter(move |&s| self.label[s as usize] == label)
    }
}

/// Area centroid and area vector of a closed polygon in space, which may be slightly out of plane.
pub(crate) fn loop_centroid(points: &[DVec3], about: DVec3) -> (DVec3, DVec3) {
    let triangles = || {
        (0..points.len()).map(|i| {
            let (a, b) = (points[i] - about, points[(i + 1) % points.len()] - about);
            (a, b, a.cross(b) / 2.0)
        })
    };
    let area: DVec3 = triangles().map(|t| t.2).sum();
    let normal = area.normalize_or_zero();
    let weight: f64 = triangles().map(|t| t.2.dot(normal)).sum();
    let size: f64 =
        points.iter().map(|p| (*p - about).length_squared()).sum::<f64>() / points.len().max(1) as f64;
    if weight <= 1e-9 * size {
        return (about, area);
    }
    let moment: DVec3 = triangles().map(|(a, b, t)| t.dot(normal) * (a + b) / 3.0).sum();
    (about + moment / weight, area)
}
