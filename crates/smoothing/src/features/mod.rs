//! Detection of what must not be smoothed: flat faces and round holes, and of the edges between them.
//!
//! Where the result of an optimizer touches the border of its design domain it is exact to the digits of the file;
//! everywhere else it is noise of the size of an element. Both detectors use this: they fit a shape to a small patch,
//! grow it over all facets whose *vertices* lie on the shape within a small share of an edge, refit, and ask for a
//! size that chance does not produce. Normals alone would not do: on slivers they are noise, and on a coarse hole
//! they differ by 30 degrees from facet to facet.
//!
//! The functions of the paper (*detect_flat_surfaces*, *detect_holes_edges*) compare components of normals with 1e-4
//! and follow sharp edges around holes that are perpendicular to a face. Those here find faces and holes in any
//! orientation, and freeze the wall of a hole together with its rims.

mod borders;
mod chains;
mod cylinder;
mod edge_overrides;
mod edges;
mod noise;
mod overrides;
mod plane;
pub mod published;
mod rims;
mod space;

use crate::{Method, Parameters, SmoothingError};
use topipe_mesh::{
    Connectivity, DVec3, FaceId, HalfEdgeId, Part, Region, RegionId, RegionShape, TriangleMesh, fit,
};
use topipe_progress::Progress;

pub use chains::{EdgeChain, edge_chains};
pub(crate) use edge_overrides::{added, settle};
pub(crate) use edges::Candidates;
pub use edges::feature_edges;
use overrides::Claims;
pub use overrides::{Action, FeatureOverride, Shape};
pub use space::Space;

/// What was found on a part.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    /// The regions: those the part came with, then holes, then planes, those with more faces first.
    pub regions: Vec<Region>,
    /// The region of each face, or [`RegionId::NONE`].
    pub region_of_face: Vec<RegionId>,
    /// One per vertex: true on a face of a region.
    pub on_region: Vec<bool>,
    /// Vertices that may slide on their region: its outline against the free surface, which is ragged, and the
    /// vertices next to it; in order.
    pub sliding: Vec<SlidingVertex>,
}

/// A vertex that may move on the shape of its region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlidingVertex {
    /// The vertex.
    pub vertex: u32,
    /// The region all its faces of known shape belong to.
    pub region: RegionId,
    /// On the outline: its neighbours along it.
    pub along: Option<[u32; 2]>,
}

/// Finds the flat faces and the holes of `part`, as far as `parameters` ask for them.
///
/// Regions that the part already has are kept and taken as given; the detectors look at the remaining faces.
/// Nothing is looked for, and nothing kept, when the part is to be contracted.
pub fn detect(
    part: &Part,
    connectivity: &Connectivity,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Features, SmoothingError> {
    let mesh = &part.mesh;
    let nothing_asked = !(parameters.detect_planes || parameters.detect_holes || parameters.detect_bosses)
        && parameters.features.is_empty()
        && part.regions.is_empty();
    if parameters.method == Method::Contract || nothing_asked {
        // What contracts does not keep its shapes.
        return Ok(Features {
            regions: Vec::new(),
            region_of_face: vec![RegionId::NONE; mesh.face_count()],
            on_region: vec![false; mesh.vertex_count()],
            sliding: Vec::new(),
        });
    }
    let tolerance = noise::tolerance(mesh, connectivity, parameters);
    // The regions a part comes with stay as they are: what follows looks at the other faces.
    let given = part.regions.len();
    let mut claims = Claims {
        shapes: part.regions.iter().map(|r| r.shape).collect(),
        owner: part.region_of_face.iter().map(|r| r.0).collect(),
        pinned: vec![true; given],
    };
    let size = SizeRule::new(mesh, parameters);
    let mut least: Vec<LeastArea> = vec![size.any; given];
    let taken = |claims: &Claims| -> Vec<bool> { claims.owner.iter().map(|&o| o != borders::NONE).collect() };
    if parameters.detect_holes || parameters.detect_bosses {
        let (free, narrow) = (taken(&claims), parameters.hole_tolerance);
        for wall in cylinder::cylinders(mesh, connectivity, free, narrow, tolerance, progress)? {
            let hole = matches!(wall.shape, RegionShape::Cylinder { hole: true, .. });
            if if hole { parameters.detect_holes } else { parameters.detect_bosses } {
                claims.claim(wall.shape, &wall.faces);
                least.push(if wall.closed { size.any } else { size.arc });
            }
        }
    }
    if parameters.detect_planes {
        let (free, smallest) = (taken(&claims), size.plane.vouched);
        for flat in plane::planes(mesh, connectivity, free, tolerance, smallest, progress)? {
            claims.claim(flat.shape, &flat.faces);
            least.push(if flat.exact { size.plane } else { size.rough_plane });
        }
    }
    overrides::apply(part, connectivity, &parameters.features, tolerance, &mut claims)?;
    least.resize(claims.shapes.len(), size.any);
    let accepts = |piece: &borders::Piece| {
        claims.pinned[piece.region as usize] || least[piece.region as usize].accepts(piece)
    };
    let mut fixed: Vec<bool> = (0..claims.shapes.len()).map(|r| r < given).collect();
    let (owner, origin) = loop {
        let mut owner = claims.owner.clone();
        let origin = borders::clean(part, connectivity, &mut owner, &fixed, accepts);
        // A pinned region without a vertex inside it has no clean border: it is kept as it is.
        let mut kept: Vec<bool> = fixed.clone();
        owner.iter().filter(|o| **o != borders::NONE).for_each(|o| kept[origin[*o as usize] as usize] = true);
        let lost: Vec<usize> = (0..kept.len()).filter(|&r| claims.pinned[r] && !kept[r]).collect();
        if lost.is_empty() {
            break (owner, origin);
        }
        lost.into_iter().for_each(|r| fixed[r] = true);
    };
    Ok(assemble(part, connectivity, parameters, &claims.shapes, &owner, &origin, given as u32))
}

/// The smallest area of a region, mm^2.
#[derive(Debug, Clone, Copy)]
struct LeastArea {
    /// Amid the free surface.
    alone: f64,
    /// Where the engineer says that it is a face of the design, by a label, or other regions around it do.
    vouched: f64,
    /// Whether a strip without a vertex inside must have sharp edges: the facets of a fine cylinder have none.
    strips_are_sharp: bool,
}

impl LeastArea {
    fn accepts(self, piece: &borders::Piece) -> bool {
        let vouched =
            piece.shared >= VOUCHED_SHARE * piece.border || piece.non_design >= VOUCHED_SHARE * piece.area;
        let large = piece.area >= self.alone || (vouched && piece.area >= self.vouched);
        let strip = piece.core < STRIP_CORE * piece.area;
        large && !(self.strips_are_sharp && strip && piece.sharp < STRIP_SHARP * piece.border)
    }
}

/// Which pieces of a shape are large enough to be a region.
struct SizeRule {
    /// Most vertices lie in the plane to rounding.
    plane: LeastArea,
    /// They do not.
    rough_plane: LeastArea,
    arc: LeastArea,
    any: LeastArea,
}

/// Of the border, or of the area, of a piece that others vouch for.
const VOUCHED_SHARE: f64 = 0.5;

/// A piece with less than this share of its area around vertices inside it is a strip.
const STRIP_CORE: f64 = 0.5;

/// The share of its border at which a strip must have a dihedral angle.
const STRIP_SHARP: f64 = 0.8;

/// The part of `plane_area` that is asked of a piece that others vouch for: the strip between a boss and the oblique side it
/// stands on is half an element wide, and still a face of the design.
const VOUCHED_AREA: f64 = 0.2;

/// The multiple of `plane_area` that is asked of an arc of a cylinder: five freedoms of a shape instead of three. On
/// the reference parts smaller arcs are real, but one or two facets wide.
const ARC_AREA: f64 = 2.0;

/// A flat face of less than `plane_area` is accepted when it is this share of the whole surface: a coarse CAD box has
/// twelve facets.
const LARGE_SHARE: f64 = 0.05;

/// Nothing smaller than this share of the surface is a region, however fine the mesh: the nine parts' smallest known
/// face that an engineer would name has 1.4e-3.
const LEAST_SHARE: f64 = 1e-4;

impl SizeRule {
    fn new(mesh: &TriangleMesh, parameters: &Parameters) -> Self {
        let (edge, area) = (mesh.mean_edge_length(), mesh.area());
        let least = |factor: f64| {
            (factor * parameters.plane_area * edge * edge).max(LEAST_SHARE * area).min(LARGE_SHARE * area)
        };
        Self {
            plane: LeastArea { alone: least(1.0), vouched: least(VOUCHED_AREA), strips_are_sharp: true },
            rough_plane: LeastArea { alone: least(1.0), vouched: least(1.0), strips_are_sharp: true },
            arc: LeastArea { alone: least(ARC_AREA), vouched: least(ARC_AREA), strips_are_sharp: false },
            any: LeastArea { alone: 0.0, vouched: 0.0, strips_are_sharp: false },
        }
    }
}

/// Turns pieces into regions: given ones first, then cylinders, then planes, those with more faces first.
fn assemble(
    part: &Part,
    connectivity: &Connectivity,
    parameters: &Parameters,
    shapes: &[RegionShape],
    owner: &[u32],
    origin: &[u32],
    given: u32,
) -> Features {
    let mesh = &part.mesh;
    let mut faces = vec![Vec::new(); origin.len()];
    for f in mesh.faces().filter(|f| owner[f.index()] != borders::NONE) {
        faces[owner[f.index()] as usize].push(f);
    }
    let mut order: Vec<usize> = (0..origin.len()).collect();
    // By number of faces: unlike areas, counts are the same after a rotation.
    order.sort_by_key(|&p| {
        let rank = if origin[p] < given { origin[p] } else { given };
        let plane = matches!(shapes[origin[p] as usize], RegionShape::Plane { .. });
        (rank, plane, std::cmp::Reverse(faces[p].len()), faces[p].first().copied())
    });
    let mut regions = Vec::new();
    let mut region_of_face = vec![RegionId::NONE; mesh.face_count()];
    let (kept, new) = order.split_at(given as usize);
    let kept = kept.iter().map(|&p| (p, shapes[origin[p] as usize]));
    let new =
        joint_shapes(mesh, new.iter().map(|&p| (p, shapes[origin[p] as usize], &faces[p][..])).collect());
    for (p, shape) in kept.chain(new) {
        let id = RegionId::new(regions.len());
        faces[p].iter().for_each(|f| region_of_face[f.index()] = id);
        regions.push(Region { shape, area: 0.0, residual: 0.0 });
    }
    let mut on_region = vec![false; mesh.vertex_count()];
    for f in mesh.faces() {
        if region_of_face[f.index()].is_some() {
            for v in mesh.triangles[f.index()] {
                on_region[v.index()] = true;
            }
        }
    }
    let sliding = sliding(part, connectivity, parameters, &region_of_face);
    let mut features = Features { regions, region_of_face, on_region, sliding };
    features.measure(mesh);
    features
}

/// Fits pieces, and fits those together that are pieces of one shape: the flats of a notched plate share a plane to
/// the last bit, and short arcs get the radius of the long ones.
fn joint_shapes(
    mesh: &TriangleMesh,
    pieces: Vec<(usize, RegionShape, &[FaceId])>,
) -> Vec<(usize, RegionShape)> {
    let rounding = noise::ROUNDING * mesh.mean_edge_length();
    let mut groups: Vec<(RegionShape, Vec<usize>)> = Vec::new();
    for (i, &(_, shape, faces)) in pieces.iter().enumerate() {
        let shape = refit(mesh, shape, faces);
        let fits = |other: &RegionShape| {
            let alike = match (shape, other) {
                (RegionShape::Plane { normal: a, .. }, RegionShape::Plane { normal: b, .. }) => {
                    a.dot(*b) > 0.0
                }
                (RegionShape::Cylinder { hole: a, .. }, RegionShape::Cylinder { hole: b, .. }) => a == *b,
                _ => false,
            };
            alike && faces.iter().flat_map(|&f| mesh.corners(f)).all(|p| distance(other, p).abs() <= rounding)
        };
        match groups.iter_mut().find(|(other, _)| fits(other)) {
            Some((_, members)) => members.push(i),
            None => groups.push((shape, vec![i])),
        }
    }
    let mut fitted: Vec<(usize, RegionShape)> = pieces.iter().map(|&(p, shape, _)| (p, shape)).collect();
    for (shape, members) in groups {
        let all: Vec<FaceId> = members.iter().flat_map(|&i| pieces[i].2).copied().collect();
        let shape = if members.len() > 1 { refit(mesh, shape, &all) } else { shape };
        for i in members {
            fitted[i].1 = match shape {
                RegionShape::Cylinder { point, axis, radius, hole } => {
                    cylinder::shape(mesh, fit::Cylinder { point, axis, radius }, pieces[i].2, hole)
                }
                plane => plane,
            };
        }
    }
    fitted
}

/// Signed distance of a point from a shape.
fn distance(shape: &RegionShape, p: DVec3) -> f64 {
    match *shape {
        RegionShape::Plane { point, normal } => normal.dot(p - point),
        RegionShape::Cylinder { point, axis, radius, .. } => {
            fit::Cylinder { point, axis, radius }.distance(p)
        }
    }
}

/// The diameter of the cylinder of least squares through faces that were on `shape`; `None` where they are on none.
pub(crate) fn diameter(mesh: &TriangleMesh, shape: RegionShape, faces: &[FaceId]) -> Option<f64> {
    let RegionShape::Cylinder { point, axis, radius, .. } = shape else { return None };
    let points = cylinder::points(mesh, faces);
    let fitted = fit::Cylinder { point, axis, radius }.refine(&points, 50)?;
    // A wall that lies off its cylinder by a quarter of the radius is none.
    (fitted.misfit(&points) < 0.25 * fitted.radius).then_some(2.0 * fitted.radius)
}

/// The shape of least squares through faces that were found with a shape near it.
fn refit(mesh: &TriangleMesh, shape: RegionShape, faces: &[FaceId]) -> RegionShape {
    let better = match shape {
        RegionShape::Plane { .. } => {
            fit::plane(mesh, faces).map(|(point, normal)| RegionShape::Plane { point, normal })
        }
        RegionShape::Cylinder { point, axis, radius, hole } => fit::Cylinder { point, axis, radius }
            .refine(&cylinder::points(mesh, faces), 20)
            .map(|better| cylinder::shape(mesh, better, faces, hole)),
    };
    better.unwrap_or(shape)
}

impl Features {
    /// Measures area and residual of the regions again, after vertices have moved.
    pub fn measure(&mut self, mesh: &TriangleMesh) {
        for region in &mut self.regions {
            (region.area, region.residual) = (0.0, 0.0);
        }
        for f in mesh.faces() {
            let id = self.region_of_face[f.index()];
            if !id.is_some() {
                continue;
            }
            let region = &mut self.regions[id.index()];
            region.area += mesh.area_vector(f).length() / 2.0;
            for p in mesh.corners(f) {
                region.residual = region.residual.max(distance(&region.shape, p).abs());
            }
        }
    }
}

/// How many rings of vertices inside an outline give way with it. With none, an outline that straightens runs into
/// the frozen inside of its face and stops.
const GIVING_RINGS: usize = 2;

/// Outline vertices have one sector of faces of one region and one sector of free faces around them, nothing else.
fn sliding(
    part: &Part,
    connectivity: &Connectivity,
    parameters: &Parameters,
    region_of_face: &[RegionId],
) -> Vec<SlidingVertex> {
    let fixed =
        |f: FaceId| parameters.freeze_non_design && part.design[f.index()] == topipe_mesh::Design::NonDesign;
    let mut found: Vec<Option<SlidingVertex>> = vec![None; part.mesh.vertex_count()];
    let mut last = Vec::new();
    for v in part.mesh.vertices() {
        if part.frozen[v.index()] || connectivity.is_border(v) {
            continue;
        }
        let mut region = RegionId::NONE;
        let mut alone = true;
        let mut along = [u32::MAX; 2];
        let mut changes = 0;
        for h in connectivity.outgoing(v) {
            let here = region_of_face[h.face().index()];
            let across = region_of_face[connectivity.twin(h).face().index()];
            alone &= !fixed(h.face());
            if here.is_some() {
                alone &= region == RegionId::NONE || region == here;
                region = here;
            }
            if here != across {
                if changes < 2 {
                    along[changes] = connectivity.target(h).0;
                }
                changes += 1;
            }
        }
        if alone && changes == 2 && region.is_some() {
            found[v.index()] = Some(SlidingVertex { vertex: v.0, region, along: Some(along) });
            last.push(v);
        }
    }
    for _ in 0..GIVING_RINGS {
        let mut next = Vec::new();
        for v in last {
            let Some(SlidingVertex { region, .. }) = found[v.index()] else { continue };
            for h in connectivity.outgoing(v) {
                let w = connectivity.target(h);
                let inside = |g: topipe_mesh::HalfEdgeId| {
                    region_of_face[g.face().index()] == region && !fixed(g.face())
                };
                if found[w.index()].is_none()
                    && !part.frozen[w.index()]
                    && !connectivity.is_border(w)
                    && connectivity.outgoing(w).all(inside)
                {
                    found[w.index()] = Some(SlidingVertex { vertex: w.0, region, along: None });
                    next.push(w);
                }
            }
        }
        last = next;
    }
    found.into_iter().flatten().collect()
}

/// The half-edges on the border of a set of faces: their own face is inside, the one across is not.
fn border_half_edges(
    connectivity: &Connectivity,
    faces: &[FaceId],
    inside: impl Fn(FaceId) -> bool,
) -> Vec<HalfEdgeId> {
    let mut border = Vec::new();
    for &f in faces {
        for k in 0..3 {
            let across = connectivity.neighbor(f, k);
            if !across.is_some() || !inside(across) {
                border.push(HalfEdgeId::of(f, k));
            }
        }
    }
    border
}
