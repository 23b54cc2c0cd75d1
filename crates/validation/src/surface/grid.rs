//! Points on a spline surface, a triangulation between them, and the way from the triangulation to the surface.

use super::climb;
use crate::deviation::{Beyond, Surface, arrange};
use rayon::prelude::*;
use std::sync::Arc;
use topipe_mesh::spatial::NearestPoint;
use topipe_mesh::{DVec3, RegionShape, TriangleMesh, VertexId};
use topipe_spline_fit::{Basis, Patch, SplineSurface};

/// Cells along a side of a patch.
const CELLS: std::ops::RangeInclusive<usize> = 4..=128;
/// Steps of Gauss-Newton towards a foot point. Three bring the error below 1e-9 of a cell on the bracket; a step that
/// does not improve ends the search earlier.
const STEPS: usize = 4;

/// Distance of the triangulation of a cylinder from it, over the spacing: it only finds where to look.
const CHORD: f64 = 0.02;

/// Points in each span of the grids from which all patches around are searched.
const SEARCH: usize = 4;

/// The points of one patch.
struct Grid {
    /// Point, area it stands for, parameters.
    points: Vec<(DVec3, f64, [f64; 2])>,
    cells: [usize; 2],
}

/// Samples `surface` on a grid of about `spacing`.
pub(crate) fn sample(surface: &SplineSurface, spacing: f64) -> Surface<'_> {
    let grids: Vec<Grid> = surface.patches.par_iter().map(|patch| grid(patch, spacing)).collect();
    let (mut mesh, mut samples) = (TriangleMesh::default(), Vec::new());
    let (mut patch_of_face, mut parameters) = (Vec::new(), Vec::new());
    // The first sample of each patch, and the sizes of its cells.
    let mut begins: Vec<(usize, [f64; 2])> = Vec::with_capacity(grids.len());
    for (patch, Grid { points, cells }) in grids.into_iter().enumerate() {
        let first = mesh.positions.len();
        begins.push((first, cells.map(|n| 1.0 / n as f64)));
        for (p, area, uv) in points {
            mesh.positions.push(p);
            samples.push((p, area));
            parameters.push(uv);
        }
        let at = |i: usize, j: usize| VertexId::new(first + i + j * (cells[0] + 1));
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                patch_of_face.extend([patch as u32; 2]);
            }
        }
    }
    let in_patches = patch_of_face.len();
    let (faces, face_of_triangle) = surface.tessellate_faces(spacing * CHORD, spacing);
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(&faces.positions);
    mesh.triangles.extend(faces.triangles.iter().map(|t| t.map(|v| VertexId(v.0 + first))));
    // As of a mesh: exact for quadratic functions on a triangle, at points of the face itself.
    for (f, &face) in faces.faces().zip(&face_of_triangle) {
        let area = faces.area_vector(f).length() / 2.0;
        let shape = &surface.faces[face as usize].shape;
        for p in faces.corners(f) {
            samples.push((p, area / 12.0));
        }
        samples.push((shape.project(faces.centroid(f)), 0.75 * area));
    }
    let parameters: Arc<[[f64; 2]]> = parameters.into();
    let places = Arc::clone(&parameters);
    let climb = move |sample: usize, beyond: &mut Beyond<'_>| {
        // Those of faces come after those of patches.
        let place = *places.get(sample)?;
        let patch = begins.partition_point(|&(first, _)| first <= sample) - 1;
        Some(climb::climb(&surface.patches[patch], place, begins[patch].1, beyond))
    };
    let arranged = arrange(&mesh, &samples);
    let boxes: Vec<[DVec3; 2]> = surface.patches.iter().map(bounds).collect();
    let refine = move |p: DVec3, nearest: &NearestPoint| {
        let face = nearest.face.index();
        if face >= in_patches {
            let shape = &surface.faces[face_of_triangle[face - in_patches] as usize].shape;
            return to_shape(shape, p, mesh.corners(nearest.face), nearest.point);
        }
        let patch = &surface.patches[patch_of_face[face] as usize];
        let [a, b, c] = mesh.triangles[face].map(VertexId::index);
        let weights = barycentric(mesh.corners(nearest.face), nearest.point);
        let start = [0, 1].map(|k| {
            weights[0] * parameters[a][k] + weights[1] * parameters[b][k] + weights[2] * parameters[c][k]
        });
        distance(patch, p, start)
    };
    let search = move |p: DVec3, found: f64| nearest_of_all(surface, &boxes, p, found);
    Surface::of_samples(arranged, samples, Box::new(refine), Box::new(search), Box::new(climb))
}

/// The distance from `p` to a face of known shape, given the nearest point of its triangulation.
fn to_shape(shape: &RegionShape, p: DVec3, triangle: [DVec3; 3], nearest: DVec3) -> f64 {
    let foot = shape.project(p);
    // Above the inside of the triangle the foot is on the face; beyond its sides perhaps not.
    if barycentric(triangle, foot).iter().all(|&w| w >= 0.0) {
        return shape.distance(p).abs();
    }
    p.distance(shape.project(nearest))
}

fn grid(patch: &Patch, spacing: f64) -> Grid {
    let (width, height) = (patch.basis_u.len(), patch.basis_v.len());
    // The control polygon is never shorter than the curve.
    let longest = |lines: usize, points: usize, step: usize, stride: usize| {
        let line = |l: usize| -> f64 {
            let at = |k: usize| patch.control[l * stride + k * step];
            (1..points).map(|k| at(k - 1).distance(at(k))).sum()
        };
        (0..lines).map(line).fold(0.0, f64::max)
    };
    let cells = [longest(height, width, 1, width), longest(width, height, width, 1)].map(|length| {
        let count = (length / spacing).ceil();
        // Not a number where the spacing is 0: then the fewest.
        if count.is_finite() { (count as usize).clamp(*CELLS.start(), *CELLS.end()) } else { *CELLS.start() }
    });
    let mut points = Vec::with_capacity((cells[0] + 1) * (cells[1] + 1));
    let places = |cells: usize, basis: &Basis| -> Vec<_> {
        let place = |k: usize| k as f64 / cells as f64;
        (0..=cells).map(|k| (place(k), basis.evaluate(place(k)))).collect()
    };
    let (columns, rows) = (places(cells[0], &patch.basis_u), places(cells[1], &patch.basis_v));
    let columns: Vec<_> = columns.iter().map(|(u, local)| (*u, patch.column(local))).collect();
    for (j, (v, row)) in rows.iter().enumerate() {
        for (i, (u, column)) in columns.iter().enumerate() {
            let uv = [*u, *v];
            let s = column.evaluate(row);
            // The trapezoidal rule: points on a side stand for half a cell.
            let share = |k: usize, n: usize| if k == 0 || k == n { 0.5 } else { 1.0 } / n as f64;
            let area = s.du.cross(s.dv).length() * share(i, cells[0]) * share(j, cells[1]);
            points.push((s.position, area, uv));
        }
    }
    Grid { points, cells }
}

fn barycentric([a, b, c]: [DVec3; 3], p: DVec3) -> [f64; 3] {
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared();
    if area == 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let w1 = (p - a).cross(c - a).dot(normal) / area;
    let w2 = (b - a).cross(p - a).dot(normal) / area;
    [1.0 - w1 - w2, w1, w2]
}

/// The distance from `p` to the patch near the given parameters.
fn distance(patch: &Patch, p: DVec3, [mut u, mut v]: [f64; 2]) -> f64 {
    let mut s = patch.evaluate(u, v);
    let mut best = s.position.distance(p);
    for _ in 0..STEPS {
        let r = p - s.position;
        let (a, b, c) = (s.du.length_squared(), s.du.dot(s.dv), s.dv.length_squared());
        let (f, g) = (s.du.dot(r), s.dv.dot(r));
        let determinant = a * c - b * b;
        if determinant <= 1e-12 * a * c {
            break;
        }
        let (mut du, mut dv) = ((c * f - b * g) / determinant, (a * g - b * f) / determinant);
        // On a side of the patch, slide along it.
        if (u <= 0.0 && du < 0.0) || (u >= 1.0 && du > 0.0) {
            (du, dv) = (0.0, g / c);
        } else if (v <= 0.0 && dv < 0.0) || (v >= 1.0 && dv > 0.0) {
            (du, dv) = (f / a, 0.0);
        }
        (u, v) = ((u + du).clamp(0.0, 1.0), (v + dv).clamp(0.0, 1.0));
        s = patch.evaluate(u, v);
        let distance = s.position.distance(p);
        if distance >= best {
            break;
        }
        best = distance;
    }
    best
}

/// The box around the control points, which contains the patch.
fn bounds(patch: &Patch) -> [DVec3; 2] {
    let all = || patch.control.iter().copied();
    [all().fold(DVec3::INFINITY, DVec3::min), all().fold(DVec3::NEG_INFINITY, DVec3::max)]
}

/// The distance from `p` to the nearest patch of all; `found` where none is nearer.
fn nearest_of_all(surface: &SplineSurface, boxes: &[[DVec3; 2]], p: DVec3, found: f64) -> f64 {
    let mut best = found;
    for (patch, [low, high]) in surface.patches.iter().zip(boxes) {
        if p.clamp(*low, *high).distance(p) >= best {
            continue;
        }
        let places = |basis: &Basis| -> Vec<_> {
            let breaks = basis.breaks();
            let inner = breaks
                .windows(2)
                .flat_map(|w| (0..SEARCH).map(move |k| w[0] + k as f64 / SEARCH as f64 * (w[1] - w[0])));
            inner.chain([1.0]).map(|t| (t, basis.evaluate(t))).collect()
        };
        let (us, vs) = (places(&patch.basis_u), places(&patch.basis_v));
        let us: Vec<_> = us.iter().map(|(u, local)| (*u, patch.column(local))).collect();
        let nearest = us
            .iter()
            .flat_map(|(u, column)| vs.iter().map(move |(v, row)| ([*u, *v], column, row)))
            .map(|(uv, column, row)| (column.evaluate(row).position.distance_squared(p), uv))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, start)) = nearest {
            best = best.min(distance(patch, p, start));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::spatial::Trail;
    use topipe_spline_fit::PatchSide;

    #[test]
    fn points_off_a_curved_patch_find_their_foot() {
        let basis = Basis::uniform(3, 2).unwrap();
        let n = basis.len();
        let control = (0..n * n)
            .map(|k| {
                let (i, j) = ((k % n) as f64, (k / n) as f64);
                DVec3::new(i, j, (0.9 * i).sin() + 0.3 * j * j)
            })
            .collect();
        let sides = [PatchSide { edge: 0, reversed: false }; 4];
        let patch = Patch { sides, basis_u: basis.clone(), basis_v: basis, control };
        let surface = SplineSurface {
            vertices: Vec::new(),
            edges: Vec::new(),
            patches: vec![patch],
            faces: Vec::new(),
            tolerance: None,
            tolerance_mm: None,
        };
        let sampled = sample(&surface, 0.5);
        let mut chords = 0.0f64;
        for k in 0..50 {
            let (u, v) = ((f64::from(k) * 0.618).fract(), (f64::from(k) * 0.414).fract());
            let s = surface.patches[0].evaluate(u, v);
            for offset in [0.0, 0.05, -0.05] {
                let p = s.position + s.normal() * offset;
                let nearest = sampled.index.nearest(p).unwrap();
                let found = sampled.distance(p, &mut Trail::default());
                assert!((found - offset.abs()).abs() < 1e-8, "{found} for {offset} at ({u}, {v})");
                chords = chords.max((nearest.distance - offset.abs()).abs());
            }
        }
        assert!(chords > 1e-4, "the triangulation alone is not enough: {chords}");
    }

    #[test]
    fn the_tip_of_a_narrow_spike_is_found() {
        // A spike two hundredths wide in a patch that is sampled at quarters.
        let inner: Vec<f64> = (1..100).map(|k| f64::from(k) / 100.0).collect();
        let basis = Basis::clamped(3, &inner).unwrap();
        let n = basis.len();
        let control = (0..n * n)
            .map(|k| {
                let (i, j) = (k % n, k / n);
                // It leans, so that the foot on the plane below the tip is not its own.
                let spike = if i == 37 && j == 63 { DVec3::new(1.0, 0.0, 1.0) } else { DVec3::ZERO };
                DVec3::new(i as f64 / 100.0, j as f64 / 100.0, 0.0) + spike
            })
            .collect();
        let sides = [PatchSide { edge: 0, reversed: false }; 4];
        let patch = Patch { sides, basis_u: basis.clone(), basis_v: basis, control };
        let surface = SplineSurface {
            vertices: Vec::new(),
            edges: Vec::new(),
            patches: vec![patch],
            faces: Vec::new(),
            tolerance: None,
            tolerance_mm: None,
        };
        let sampled = sample(&surface, 0.5);
        let (u, v) = (0.36, 0.62);
        let tip = surface.patches[0].evaluate(u, v).position;
        assert!(tip.z > 0.3, "{tip}");
        assert!(sampled.index.nearest(tip).unwrap().distance > 0.3, "the triangulation cuts it off");
        let found = sampled.distance(tip, &mut Trail::default());
        assert!(found > 0.1 && sampled.search(tip, found) < 1e-9, "{found}");
    }
}
