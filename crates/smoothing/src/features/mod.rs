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

mod cylinder;
mod edges;
mod fit;
mod plane;

use crate::{Method, Parameters, SmoothingError};
use topipe_mesh::{
    Connectivity, DVec3, FaceId, HalfEdgeId, Part, Region, RegionId, RegionShape, TriangleMesh,
};
use topipe_progress::Progress;

pub use edges::feature_edges;

/// What was found on a part.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    /// The regions: those the part came with, then holes, then planes, those with more faces first.
    pub regions: Vec<Region>,
    /// The region of each face, or [`RegionId::NONE`].
    pub region_of_face: Vec<RegionId>,
    /// One per vertex: true on a face of a region.
    pub on_region: Vec<bool>,
    /// Where the outline of a flat face is ragged: vertices that may slide in their plane, in order.
    pub outline: Vec<OutlineVertex>,
}

/// A vertex on the border between one flat face and the free surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutlineVertex {
    /// The vertex.
    pub vertex: u32,
    /// Its neighbours along the outline.
    pub along: [u32; 2],
    /// Unit normal of the plane.
    pub normal: DVec3,
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
    if parameters.method == Method::Contract {
        // What contracts does not keep its shapes.
        return Ok(Features {
            regions: Vec::new(),
            region_of_face: vec![RegionId::NONE; mesh.face_count()],
            on_region: vec![false; mesh.vertex_count()],
            outline: Vec::new(),
        });
    }
    let mut regions = part.regions.clone();
    let mut region_of_face = part.region_of_face.clone();
    if parameters.detect_holes {
        let taken: Vec<bool> = region_of_face.iter().map(|r| r.is_some()).collect();
        for (region, faces) in
            cylinder::holes(mesh, connectivity, taken, parameters.hole_tolerance, progress)?
        {
            add(&mut regions, &mut region_of_face, region, &faces);
        }
    }
    if parameters.detect_planes {
        let taken: Vec<bool> = region_of_face.iter().map(|r| r.is_some()).collect();
        for (region, faces) in plane::planes(mesh, connectivity, taken, parameters, progress)? {
            add(&mut regions, &mut region_of_face, region, &faces);
        }
    }
    let mut on_region = vec![false; mesh.vertex_count()];
    for f in mesh.faces() {
        if region_of_face[f.index()].is_some() {
            for v in mesh.triangles[f.index()] {
                on_region[v.index()] = true;
            }
        }
    }
    let outline = outline(part, connectivity, parameters, &regions, &region_of_face);
    let mut features = Features { regions, region_of_face, on_region, outline };
    features.measure(mesh);
    Ok(features)
}

fn add(regions: &mut Vec<Region>, region_of_face: &mut [RegionId], region: Region, faces: &[FaceId]) {
    let id = RegionId::new(regions.len());
    regions.push(region);
    for f in faces {
        region_of_face[f.index()] = id;
    }
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
                let distance = match region.shape {
                    RegionShape::Plane { point, normal } => normal.dot(p - point),
                    RegionShape::Cylinder { point, axis, radius, .. } => {
                        fit::Cylinder { point, axis, radius }.distance(p)
                    }
                };
                region.residual = region.residual.max(distance.abs());
            }
        }
    }
}

/// Vertices with one sector of faces of one plane and one sector of free faces around them, nothing else.
fn outline(
    part: &Part,
    connectivity: &Connectivity,
    parameters: &Parameters,
    regions: &[Region],
    region_of_face: &[RegionId],
) -> Vec<OutlineVertex> {
    let fixed =
        |f: FaceId| parameters.freeze_non_design && part.design[f.index()] == topipe_mesh::Design::NonDesign;
    let mut outline = Vec::new();
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
        if !alone || changes != 2 || !region.is_some() {
            continue;
        }
        if let RegionShape::Plane { normal, .. } = regions[region.index()].shape {
            outline.push(OutlineVertex { vertex: v.0, along, normal });
        }
    }
    outline
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
