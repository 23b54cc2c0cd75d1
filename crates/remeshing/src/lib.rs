//! Isotropic remeshing of tessellated CAD parts.
//!
//! A CAD system writes a part as few triangles as its shape allows: strips as long as a cylinder, fans from a corner of a flat face, two
//! triangles for a side of a box. Such a mesh says what the part is, but there is nothing on it that could be smoothed, tiled or fitted:
//! those stages want triangles of about one size. [`remesh`] makes them, of the faces that the facets are chords of, not of the facets:
//! holes stay round and come closer to it, flat faces stay flat, edges stay.
//!
//! [`Tessellation::of`] tells which meshes need it.

mod error;
mod faces;
mod parameters;
mod passes;
mod reference;
mod seams;
mod sizes;
mod surface;
mod tangents;
mod tessellation;

pub use error::RemeshingError;
pub use parameters::Parameters;
pub use tessellation::Tessellation;

use faces::Faces;
use topipe_mesh::spatial::{SurfaceIndex, crossings, deviation};
use topipe_mesh::{Connectivity, Design, FaceId, Part, Provenance, Region, RegionId, TriangleMesh, VertexId};
use topipe_progress::Progress;

/// Most triangles that are made.
const MOST_TRIANGLES: f64 = 2e7;

/// Remeshes a closed part into triangles of about [`Parameters::edge_length`].
///
/// Vertices lie on the faces that the facets are chords of; those of flat faces and of cylinders within rounding of their shapes, and
/// these faces are regions of the new part, beside those it had. Labels, regions and marks of frozen vertices go over to what lies in
/// their place, provenance names places of the mesh that was given; feature edges are kept where the new mesh has them whole. The
/// topology does not change. One thread does it all: the result does not depend on their number.
///
/// What lies closer to a face than its facets bulge may end up on its other side: a warning names a place where triangles of the result
/// pass through each other.
///
/// # Errors
/// Parameters out of range, meshes that are no closed manifold, meshes without extent, too many triangles, or a run that is stopped.
pub fn remesh(part: &Part, parameters: &Parameters, progress: &Progress) -> Result<Part, RemeshingError> {
    parameters.validate()?;
    let mesh = &part.mesh;
    let connectivity = Connectivity::build(mesh)?;
    if !connectivity.is_closed() {
        let border = connectivity.edges().find(|&h| !connectivity.twin(h).is_some());
        let at = border.map_or(topipe_mesh::DVec3::ZERO, |h| mesh.position(mesh.origin(h)));
        return Err(RemeshingError::Border {
            edges: connectivity.border_edge_count(),
            x: at.x,
            y: at.y,
            z: at.z,
        });
    }
    let (diagonal, area) = (mesh.diagonal(), mesh.area());
    if mesh.face_count() == 0 {
        return Err(RemeshingError::Degenerate("it has no faces"));
    }
    if !(diagonal > 0.0 && diagonal.is_finite() && area > 0.0) {
        return Err(RemeshingError::Degenerate("it has no extent, or coordinates that are not numbers"));
    }
    let longest = parameters.edge_length * diagonal;
    // Of even triangles with such sides.
    let triangles = area / (longest * longest * 3f64.sqrt() / 4.0);
    if triangles > MOST_TRIANGLES {
        return Err(RemeshingError::TooFine {
            edge_length: parameters.edge_length,
            triangles: triangles as u64,
            most: MOST_TRIANGLES as u64,
        });
    }
    let sharp_angle = parameters.sharp_angle.to_radians();
    let faces = Faces::find(part, &connectivity, sharp_angle);
    let surface = surface::Surface::new(mesh, &connectivity, &faces, sharp_angle);
    let sizes = sizes::sizes(mesh, &connectivity, &faces, &surface, longest);
    let reference = reference::Reference::new(mesh, &faces, &surface);
    progress.check()?;
    let mut passes = passes::Passes::new(mesh, &connectivity, &faces, &surface, &reference, sizes, longest);
    passes.run(progress)?;
    let (new, chart) = passes.finish();
    let flats = faces.width.iter().filter(|width| width.is_finite()).count();
    let known = faces.shape.iter().filter(|shape| shape.is_some()).count();
    progress.remark(&format!(
        "{} triangles became {} with edges of about {:.4} mm; {} flat faces, {} cylinders, {} others",
        mesh.face_count(),
        new.face_count(),
        new.mean_edge_length(),
        flats,
        known - flats,
        faces.shape.len() - known,
    ));
    if let Some(deviation) = deviation(&new, mesh, 0) {
        let (volume, after) = (mesh.volume(), new.volume());
        progress.remark(&format!(
            "at most {:.4e} mm from the facets; volume {:+.4} %",
            deviation.max,
            100.0 * (after - volume) / volume,
        ));
    }
    let crossed = crossings(&new);
    if let Some(first) = crossed.first() {
        let at = first.point;
        progress.warn(&format!(
            "{} pairs of triangles pass through each other after remeshing, one at ({:.3}, {:.3}, {:.3}); use a smaller `edge_length`, \
             or mend the mesh there",
            crossed.len(),
            at.x,
            at.y,
            at.z
        ));
    }
    Ok(transfer(part, new, &chart, &faces))
}

/// The new mesh with what the old one knew.
fn transfer(part: &Part, mesh: TriangleMesh, chart: &[u32], faces: &Faces) -> Part {
    // All faces of a chart have the same labels.
    let mut labels = vec![(Design::Design, RegionId::NONE); faces.shape.len()];
    for f in part.mesh.faces() {
        labels[faces.chart[f.index()] as usize] = (part.design[f.index()], part.region_of_face[f.index()]);
    }
    let mut regions = part.regions.clone();
    for ((_, region), shape) in labels.iter_mut().zip(&faces.shape) {
        if let (Some(shape), false) = (shape, region.is_some()) {
            *region = RegionId::new(regions.len());
            regions.push(Region { shape: *shape, area: 0.0, residual: 0.0 });
        }
    }
    let index = SurfaceIndex::build(&part.mesh);
    let mut new = Part::new(mesh);
    for v in new.mesh.vertices() {
        let Some(nearest) = index.nearest(new.mesh.position(v)) else { continue };
        let corners = part.mesh.triangles[nearest.face.index()];
        let at = part.mesh.corners(nearest.face);
        new.provenance[v.index()] = match corners.iter().zip(at).find(|(_, p)| *p == new.mesh.position(v)) {
            Some((&corner, _)) => Provenance::Vertex(corner),
            None => inside(nearest.face, reference::barycentric(nearest.point, at)),
        };
        new.frozen[v.index()] = corners.iter().all(|c| part.frozen[c.index()]);
    }
    for f in 0..new.mesh.face_count() {
        (new.design[f], new.region_of_face[f]) = labels[chart[f] as usize];
    }
    for f in new.mesh.faces() {
        if let Some(region) = regions.get_mut(new.region_of_face[f.index()].index()) {
            region.area += new.mesh.area_vector(f).length() / 2.0;
            for p in new.mesh.corners(f) {
                region.residual = region.residual.max(region.shape.distance(p).abs());
            }
        }
    }
    new.regions = regions;
    new.feature_edges = kept_features(part, &new);
    new.import = part.import.clone();
    new
}

fn inside(face: FaceId, [_, v, w]: [f64; 3]) -> Provenance {
    Provenance::Face { face, weights: [v, w] }
}

/// Feature edges whose two ends are still there and neighbours.
fn kept_features(part: &Part, new: &Part) -> Vec<topipe_mesh::FeatureEdge> {
    if part.feature_edges.is_empty() {
        return Vec::new();
    }
    let mut place = vec![VertexId::NONE; part.mesh.vertex_count()];
    for v in new.mesh.vertices() {
        if let Provenance::Vertex(old) = new.provenance[v.index()] {
            place[old.index()] = v;
        }
    }
    let edges: rustc_hash::FxHashSet<[VertexId; 2]> =
        new.mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    let mut kept: Vec<_> = part
        .feature_edges
        .iter()
        .map(|e| (e.vertices.map(|v| place[v.index()]), e.kind))
        .filter(|([a, b], _)| edges.contains(&[*a, *b]) || edges.contains(&[*b, *a]))
        .map(|([a, b], kind)| topipe_mesh::FeatureEdge { vertices: [a.min(b), a.max(b)], kind })
        .collect();
    kept.sort_by_key(|e| e.vertices);
    kept
}
