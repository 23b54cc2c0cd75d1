//! The faces a tessellated part once had: its flats, its edges, and the smooth charts between them.

use crate::seams::mark_seams;
use topipe_mesh::fit::{self, Cylinder, Symmetric};
use topipe_mesh::{Connectivity, DVec3, FaceId, HalfEdgeId, Part, RegionShape, TriangleMesh, VertexId};

/// Vertices within this part of the diagonal of a plane lie in it. A 32-bit STL rounds to 6e-8 of the largest coordinate.
const IN_PLANE: f64 = 2e-6;

/// Facets that lie in one plane differ by less than this, degrees, unless they are slivers.
const ALIKE: f64 = 1.0;

/// What a face bulges out of its facets, over the diagonal, that is still taken for the work of a tessellation; where it would be more,
/// the edge between two facets is an edge of the part. The fixtures are tessellated within 2e-4 to 6e-4; a cylinder of twelve sides has
/// 8e-3 where it is as long as wide.
const DEFLECTION: f64 = 1e-2;

/// The part has an edge there at the smallest angle, degrees.
const LEAST_SHARP: f64 = 5.0;

/// A facet that reaches less far across the edge than this share of what the flat does is part of something else: the first strip of a
/// fillet.
const NARROW: f64 = 1.0 / 3.0;

/// The angles on two sides of a facet of a curved face differ by less than this factor: that to a flat beside it is half of the others.
const EVEN: f64 = 3.0;

/// The share of the outline of a flat that is sharp or runs into something narrower. A square with one side towards another flat at a
/// small angle has 0.75. With 0.5 strips of a hole that another hole cuts were flats, where next to nothing of a strip is left beside them.
const FIRM: f64 = 0.7;

/// Fewest strips of a cylinder: any three parallel lines lie on one.
const FEWEST_STRIPS: usize = 3;

/// The spread of normals along the axis of a cylinder over that across, squares: rounding of slivers.
const ACROSS: f64 = 1e-3;

/// The parts of the surface.
#[derive(Debug)]
pub(crate) struct Faces {
    /// Per triangle: the chart it belongs to.
    pub(crate) chart: Vec<u32>,
    /// Per chart: the plane or the cylinder that all of its vertices lie on.
    pub(crate) shape: Vec<Option<RegionShape>>,
    /// Per chart: the width of a flat, mm; infinite for others.
    pub(crate) width: Vec<f64>,
    /// Per half-edge, the same for twins: between two charts, sharp within one, or a seam.
    pub(crate) feature: Vec<bool>,
    /// Per half-edge, the same for twins: the surface has an edge there.
    pub(crate) sharp: Vec<bool>,
}

/// Facets in one plane.
struct Component {
    faces: Vec<FaceId>,
    point: DVec3,
    normal: DVec3,
    /// Twice the area over the outline: the width of a strip, mm.
    width: f64,
}

impl Faces {
    /// Finds them. `sharp_angle` in radians.
    pub(crate) fn find(part: &Part, connectivity: &Connectivity, sharp_angle: f64) -> Self {
        let mesh = &part.mesh;
        let diagonal = mesh.diagonal();
        let (component_of, components) = coplanar(part, connectivity, diagonal);
        let width = |f: FaceId| components[component_of[f.index()] as usize].width;
        let labels = |f: FaceId| (part.design[f.index()], part.region_of_face[f.index()]);
        let half_edges = 3 * mesh.face_count();
        let mut bend = vec![0.0; half_edges];
        let mut sharp = vec![false; half_edges];
        for h in connectivity.edges() {
            let twin = connectivity.twin(h);
            let (f, g) = (h.face(), twin.face());
            if component_of[f.index()] == component_of[g.index()] {
                continue;
            }
            let angle = signed_bend(mesh, h, twin, &components, &component_of);
            let bulge = width(f).min(width(g)) * angle.abs() / 8.0;
            let is_sharp = angle.abs() > sharp_angle
                || (angle.abs() > LEAST_SHARP.to_radians() && bulge > DEFLECTION * diagonal);
            for e in [h, twin] {
                bend[e.index()] = angle;
                sharp[e.index()] = is_sharp;
            }
        }
        // What is a cylinder from edge to edge has no flats, and no seams.
        let none = |_: FaceId| None;
        let (smooth, whole, _) = shapes(mesh, connectivity, &sharp, none, &component_of, &components);
        let is_round = |f: FaceId| whole[smooth[f.index()] as usize].is_some();
        let is_flat: Vec<bool> = (0..components.len())
            .map(|c| {
                !is_round(components[c].faces[0])
                    && is_flat(c, mesh, connectivity, &components, &component_of, &bend, &sharp)
            })
            .collect();
        let flat_of = |f: FaceId| {
            let c = component_of[f.index()];
            is_flat[c as usize].then_some(c)
        };
        let mut feature = sharp.clone();
        for h in connectivity.edges() {
            let twin = connectivity.twin(h);
            let (f, g) = (h.face(), twin.face());
            if flat_of(f) != flat_of(g) || labels(f) != labels(g) {
                feature[h.index()] = true;
                feature[twin.index()] = true;
            }
        }
        let (chart, shape, _) = shapes(mesh, connectivity, &feature, flat_of, &component_of, &components);
        // Neither has what is one between flats.
        let known = |h: HalfEdgeId| shape[chart[h.face().index()] as usize].is_some();
        mark_seams(mesh, connectivity, known, &mut feature);
        let (chart, shape, width) = shapes(mesh, connectivity, &feature, flat_of, &component_of, &components);
        Self { chart, shape, width, feature, sharp }
    }
}

/// Groups of triangles in one plane, grown from the large ones, whose normals are the surest.
fn coplanar(part: &Part, connectivity: &Connectivity, diagonal: f64) -> (Vec<u32>, Vec<Component>) {
    let mesh = &part.mesh;
    let areas: Vec<f64> = mesh.faces().map(|f| mesh.area_vector(f).length() / 2.0).collect();
    let mut order: Vec<FaceId> = mesh.faces().collect();
    order.sort_by(|a, b| areas[b.index()].total_cmp(&areas[a.index()]).then(a.cmp(b)));
    let mut component_of = vec![u32::MAX; mesh.face_count()];
    let mut components = Vec::new();
    let near = IN_PLANE * diagonal;
    for seed in order {
        if component_of[seed.index()] != u32::MAX {
            continue;
        }
        let id = components.len() as u32;
        let (point, normal) = (mesh.centroid(seed), mesh.normal(seed));
        let mut faces = vec![seed];
        component_of[seed.index()] = id;
        let mut next = 0;
        while next < faces.len() {
            let face = faces[next];
            next += 1;
            for k in 0..3 {
                let g = connectivity.neighbor(face, k);
                if component_of[g.index()] != u32::MAX {
                    continue;
                }
                let in_plane = mesh.corners(g).iter().all(|&p| normal.dot(p - point).abs() <= near);
                let longest = longest_edge(mesh, g);
                let sliver = 2.0 * areas[g.index()] <= 10.0 * near * longest;
                if in_plane && (sliver || mesh.normal(g).dot(normal) >= ALIKE.to_radians().cos()) {
                    component_of[g.index()] = id;
                    faces.push(g);
                }
            }
        }
        let area: f64 = faces.iter().map(|f| areas[f.index()]).sum();
        let mut outline = 0.0;
        for h in faces.iter().flat_map(|&f| (0..3).map(move |k| HalfEdgeId::of(f, k))) {
            if component_of[connectivity.twin(h).face().index()] != id {
                outline += mesh.position(mesh.origin(h)).distance(mesh.position(mesh.target(h)));
            }
        }
        let width = if outline > 0.0 { 2.0 * area / outline } else { 0.0 };
        components.push(Component { faces, point, normal, width });
    }
    (component_of, components)
}

pub(crate) fn longest_edge(mesh: &TriangleMesh, face: FaceId) -> f64 {
    let [a, b, c] = mesh.corners(face);
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

/// The angle between the planes on both sides of an edge, positive where the part is convex.
fn signed_bend(
    mesh: &TriangleMesh,
    h: HalfEdgeId,
    twin: HalfEdgeId,
    components: &[Component],
    component_of: &[u32],
) -> f64 {
    let normal = |e: HalfEdgeId| components[component_of[e.face().index()] as usize].normal;
    let (m, n) = (normal(h), normal(twin));
    let along = (mesh.position(mesh.target(h)) - mesh.position(mesh.origin(h))).normalize_or_zero();
    m.cross(n).dot(along).atan2(m.dot(n))
}

/// Whether facets in one plane are a flat face of the part. They are facets of a curved face when the surface bends on, about evenly
/// and to the same side, on two opposite sides of them.
fn is_flat(
    component: usize,
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    components: &[Component],
    component_of: &[u32],
    bend: &[f64],
    sharp: &[bool],
) -> bool {
    let own = &components[component];
    let mut area = 0.0;
    let mut middle = DVec3::ZERO;
    for &f in &own.faces {
        let a = mesh.area_vector(f).length();
        area += a;
        middle += a * mesh.centroid(f);
    }
    if area <= 0.0 {
        return false;
    }
    middle /= area;
    let mut sides: Vec<(f64, DVec3)> = Vec::new();
    let (mut outline, mut firm, mut sharp_length) = (0.0, 0.0, 0.0);
    for h in own.faces.iter().flat_map(|&f| (0..3).map(move |k| HalfEdgeId::of(f, k))) {
        let other = component_of[connectivity.twin(h).face().index()] as usize;
        if other == component {
            continue;
        }
        let (a, b) = (mesh.position(mesh.origin(h)), mesh.position(mesh.target(h)));
        let length = a.distance(b);
        outline += length;
        sharp_length += if sharp[h.index()] { length } else { 0.0 };
        let across = |e: HalfEdgeId| mesh.area_vector(e.face()).length() / length.max(f64::MIN_POSITIVE);
        if sharp[h.index()] || across(connectivity.twin(h)) < NARROW * across(h).max(own.width) {
            firm += length;
        } else {
            sides.push((bend[h.index()], (b - a).cross(own.normal)));
        }
    }
    let goes_on = sides.iter().enumerate().any(|(i, (bend, outward))| {
        sides[..i].iter().any(|(other, facing)| {
            bend * other > 0.0
                && bend.abs() <= EVEN * other.abs()
                && other.abs() <= EVEN * bend.abs()
                && outward.dot(*facing) < 0.0
        })
    });
    // Single triangles of a curved face may have needles around them.
    let alone = own.faces.len() == 1 && sharp_length < FIRM * outline;
    !goes_on && !alone && firm >= FIRM * outline
}

/// The chart of each triangle between `feature` edges, and the shape and the width of each chart.
fn shapes(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    feature: &[bool],
    flat_of: impl Fn(FaceId) -> Option<u32>,
    component_of: &[u32],
    components: &[Component],
) -> (Vec<u32>, Vec<Option<RegionShape>>, Vec<f64>) {
    let (chart, count) = charts(mesh, connectivity, feature);
    let (mut shape, mut widths) = (vec![None; count], vec![f64::INFINITY; count]);
    let mut curved: Vec<Vec<FaceId>> = vec![Vec::new(); count];
    for f in mesh.faces() {
        let own = chart[f.index()] as usize;
        match flat_of(f) {
            Some(c) => {
                if shape[own].is_none() {
                    let component = &components[c as usize];
                    let (point, normal) =
                        fit::plane(mesh, &component.faces).unwrap_or((component.point, component.normal));
                    shape[own] = Some(RegionShape::Plane { point, normal });
                    widths[own] = component.width;
                }
            }
            None => curved[own].push(f),
        }
    }
    for (shape, faces) in shape.iter_mut().zip(&curved).filter(|(shape, _)| shape.is_none()) {
        let mut strips: Vec<u32> = faces.iter().map(|f| component_of[f.index()]).collect();
        strips.sort_unstable();
        strips.dedup();
        if strips.len() >= FEWEST_STRIPS {
            *shape = cylinder(mesh, faces, IN_PLANE * mesh.diagonal());
        }
    }
    (chart, shape, widths)
}

/// The cylinder that all vertices of a chart lie on, within `near`.
fn cylinder(mesh: &TriangleMesh, faces: &[FaceId], near: f64) -> Option<RegionShape> {
    let mut moments = Symmetric::default();
    let mut vertices: Vec<VertexId> = Vec::with_capacity(3 * faces.len());
    for &f in faces {
        // Chords along the axis: the normals of all facets are at a right angle to it.
        moments.add(mesh.normal(f), mesh.area_vector(f).length());
        vertices.extend(mesh.triangles[f.index()]);
    }
    vertices.sort_unstable();
    vertices.dedup();
    let points: Vec<DVec3> = vertices.iter().map(|&v| mesh.position(v)).collect();
    let (values, vectors) = moments.eigen();
    let across = values[0] <= ACROSS * values[1];
    if !across {
        return None;
    }
    let Cylinder { point, axis, radius } = Cylinder::along(vectors[0], &points)?.refine(&points, 20)?;
    let fitted = Cylinder { point, axis, radius };
    if !points.iter().all(|&p| fitted.distance(p).abs() <= near) {
        return None;
    }
    let outward: f64 = faces.iter().map(|&f| mesh.area_vector(f).dot(fitted.radial(mesh.centroid(f)))).sum();
    Some(RegionShape::Cylinder { point, axis, radius, hole: outward < 0.0 })
}

/// Connected sets of triangles without a feature between them, in the order of their first triangles.
fn charts(mesh: &TriangleMesh, connectivity: &Connectivity, feature: &[bool]) -> (Vec<u32>, usize) {
    let mut chart = vec![u32::MAX; mesh.face_count()];
    let mut count = 0;
    let mut open = Vec::new();
    for seed in mesh.faces() {
        if chart[seed.index()] != u32::MAX {
            continue;
        }
        chart[seed.index()] = count;
        open.push(seed);
        while let Some(face) = open.pop() {
            for h in (0..3).map(|k| HalfEdgeId::of(face, k)) {
                let g = connectivity.twin(h).face();
                if !feature[h.index()] && chart[g.index()] == u32::MAX {
                    chart[g.index()] = count;
                    open.push(g);
                }
            }
        }
        count += 1;
    }
    (chart, count as usize)
}
