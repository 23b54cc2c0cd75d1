//! Counts on triangle meshes, from the triangles alone: they hold for any triangles, manifold or not.

use crate::{OriginalFigures, RepairFigures, ValidationError};
use topipe_mesh::{Part, TriangleMesh};

/// What counting says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) vertices: usize,
    pub(crate) components: usize,
    /// Every edge has exactly two faces, which run along it in opposite directions.
    pub(crate) closed: bool,
    /// `components - (V - E + F) / 2` of a closed surface.
    pub(crate) genus: Option<i64>,
}

/// Refuses attributes of the wrong length, vertices that do not exist, and coordinates that are not finite.
pub(crate) fn check(part: &Part, artifact: &'static str) -> Result<(), ValidationError> {
    let mesh = &part.mesh;
    let (vertices, faces) = (mesh.vertex_count(), mesh.face_count());
    let refuse = |problem: String| Err(ValidationError::artifact(artifact, problem));
    if let Some(f) = mesh.triangles.iter().position(|t| t.iter().any(|v| v.index() >= vertices)) {
        return refuse(format!("face {f} names a vertex that does not exist"));
    }
    if let Some(v) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return refuse(format!("vertex {v} is not a finite point"));
    }
    for (what, count, wanted) in [
        ("labels", part.design.len(), faces),
        ("regions of faces", part.region_of_face.len(), faces),
        ("frozen marks", part.frozen.len(), vertices),
        ("provenances", part.provenance.len(), vertices),
    ] {
        if count != wanted {
            return refuse(format!("it has {count} {what} where {wanted} are due"));
        }
    }
    match part.region_of_face.iter().position(|r| r.is_some() && r.index() >= part.regions.len()) {
        Some(f) => refuse(format!("face {f} names a region that does not exist")),
        None => Ok(()),
    }
}

/// Counts vertices, edges and components.
pub(crate) fn count(mesh: &TriangleMesh) -> Counts {
    let mut parent: Vec<u32> = (0..mesh.vertex_count() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    let mut used = vec![false; mesh.vertex_count()];
    let mut edges = Vec::with_capacity(3 * mesh.face_count());
    for triangle in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (triangle[k].0, triangle[(k + 1) % 3].0);
            used[a as usize] = true;
            edges.push((a.min(b), a.max(b), a < b));
            let (a, b) = (root(&mut parent, a), root(&mut parent, b));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    edges.sort_unstable();
    let (mut distinct, mut closed) = (0usize, !edges.is_empty());
    for sides in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        distinct += 1;
        closed &= sides.len() == 2 && sides[0].2 != sides[1].2;
    }
    let vertices = used.iter().filter(|&&u| u).count();
    let components = (0..mesh.vertex_count()).filter(|&v| used[v] && parent[v] == v as u32).count();
    let euler = vertices as i64 - distinct as i64 + mesh.face_count() as i64;
    Counts { vertices, components, closed, genus: closed.then(|| components as i64 - euler / 2) }
}

/// The figures of the part as imported.
pub(crate) fn original(part: &Part) -> OriginalFigures {
    let counts = count(&part.mesh);
    let (low, high) = part.mesh.bounds();
    OriginalFigures {
        vertices: counts.vertices,
        triangles: part.mesh.face_count(),
        genus: counts.genus,
        components: counts.components,
        volume_mm3: part.mesh.volume(),
        area_mm2: part.mesh.area(),
        bounds: [low.to_array(), high.to_array()],
        repairs: part
            .import
            .repairs
            .iter()
            .map(|repair| RepairFigures { what: repair.what.clone(), count: repair.count })
            .collect(),
    }
}
