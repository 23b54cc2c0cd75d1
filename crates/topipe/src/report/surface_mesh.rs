//! A spline surface as triangles to look at.
//!
//! Exports divide patches until chords are near enough, however many triangles that takes. Here their number is what
//! counts: every patch gets the same grid, so neighbours agree on the points of their common edge, and faces of known
//! shape are cut up to a chord.

use topipe_mesh::{DVec3, TriangleMesh, VertexId};
use topipe_spline_fit::{Basis, SplineSurface};

/// Triangles of all patches together that are aimed at: fine enough for a screen, and a few hundred kilobytes.
const TRIANGLES: usize = 80_000;
/// Largest distance of the triangles of a plane or a cylinder from it, over the diagonal.
const CHORD: f64 = 1e-4;
/// Longest edge inside such a face over the diagonal: numbers are shown at vertices, and a face without any inside would
/// show those of its border.
const LONGEST: f64 = 0.03;

/// Cells of the grid of a patch along each side.
pub(super) fn grid(surface: &SplineSurface) -> usize {
    let per_patch = TRIANGLES / 2 / surface.patches.len().max(1);
    ((per_patch as f64).sqrt() as usize).clamp(2, 12)
}

/// Triangles, and for each the face it belongs to: patches first, then faces of known shape.
pub(super) fn surface_mesh(surface: &SplineSurface) -> (TriangleMesh, Vec<u32>) {
    let low = surface.vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = surface.vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let diagonal = if surface.vertices.is_empty() { 0.0 } else { (high - low).length() };
    let (mut mesh, faces) = surface.tessellate_faces(CHORD * diagonal, LONGEST * diagonal);
    let patches = surface.patches.len() as u32;
    let mut face_of_triangle: Vec<u32> = faces.into_iter().map(|face| face + patches).collect();
    let n = grid(surface);
    for (id, patch) in surface.patches.iter().enumerate() {
        let first = mesh.positions.len();
        let along =
            |basis: &Basis| -> Vec<_> { (0..=n).map(|k| basis.evaluate(k as f64 / n as f64)).collect() };
        let columns: Vec<_> = along(&patch.basis_u).iter().map(|u| patch.column(u)).collect();
        for row in along(&patch.basis_v) {
            mesh.positions.extend(columns.iter().map(|column| column.evaluate(&row).position));
        }
        let at = |i: usize, j: usize| VertexId::new(first + j * (n + 1) + i);
        for j in 0..n {
            for i in 0..n {
                mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        face_of_triangle.resize(mesh.triangles.len(), id as u32);
    }
    weld(&mut mesh);
    (mesh, face_of_triangle)
}

/// Points that are the same to rounding become one, and points of no triangle go: then normals are averaged across the
/// edges of patches, and every point is stored once. Patches share the control points of their edges, but evaluate them
/// with knots of their own, hence the rounding.
fn weld(mesh: &mut TriangleMesh) {
    let step = mesh.diagonal() * 1e-7;
    let cell = |p: DVec3| (p / step).round().to_array().map(|x| x as i64);
    let mut known = std::collections::HashMap::with_capacity(mesh.positions.len());
    let mut positions = Vec::with_capacity(mesh.positions.len());
    let mut place = vec![u32::MAX; mesh.positions.len()];
    for v in mesh.triangles.iter_mut().flatten() {
        if place[v.index()] == u32::MAX {
            let p = mesh.positions[v.index()];
            place[v.index()] = *known.entry(cell(p)).or_insert_with(|| {
                positions.push(p);
                (positions.len() - 1) as u32
            });
        }
        *v = VertexId(place[v.index()]);
    }
    mesh.positions = positions;
}
