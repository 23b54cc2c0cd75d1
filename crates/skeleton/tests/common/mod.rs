//! Meshes with known skeletons: level sets of distance functions, cut into tetrahedra.

#![allow(dead_code)] // each test binary uses a part

use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::PathBuf;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::{Design, Part, TriangleMesh};
use topipe_progress::Progress;

/// The surface on which `distance` is zero, outward where it is positive; the box must hold it. Each cube of the grid
/// is cut into six tetrahedra about a diagonal, which gives a closed manifold for any function.
pub(crate) fn level_set(low: DVec3, high: DVec3, cell: f64, distance: impl Fn(DVec3) -> f64) -> TriangleMesh {
    let n = ((high - low) / cell).ceil().to_array().map(|x| x as usize + 1);
    let index = |c: [usize; 3]| (c[0] * n[1] + c[1]) * n[2] + c[2];
    let place = |c: [usize; 3]| low + cell * DVec3::new(c[0] as f64, c[1] as f64, c[2] as f64);
    let mut value = vec![0.0; n[0] * n[1] * n[2]];
    for x in 0..n[0] {
        for y in 0..n[1] {
            for z in 0..n[2] {
                let d = distance(place([x, y, z]));
                // Away from zero, so that no triangle has zero area.
                value[index([x, y, z])] = if d.abs() < 0.02 * cell { 0.02 * cell } else { d };
            }
        }
    }
    let mut vertex: BTreeMap<(usize, usize), u32> = BTreeMap::new();
    let mut positions: Vec<[f64; 3]> = Vec::new();
    let mut triangles = Vec::new();
    for x in 0..n[0] - 1 {
        for y in 0..n[1] - 1 {
            for z in 0..n[2] - 1 {
                for [a, b] in [[0, 1], [1, 0], [0, 2], [2, 0], [1, 2], [2, 1]] {
                    // From corner 000 to 111, one axis after the other.
                    let mut c = [x, y, z];
                    let mut tetrahedron = vec![c];
                    for axis in [a, b, 3 - a - b] {
                        c[axis] += 1;
                        tetrahedron.push(c);
                    }
                    let (inner, outer): (Vec<_>, Vec<_>) =
                        tetrahedron.into_iter().partition(|&c| value[index(c)] < 0.0);
                    let mut on = |p: [usize; 3], q: [usize; 3]| {
                        let (p, q) = if index(p) < index(q) { (p, q) } else { (q, p) };
                        *vertex.entry((index(p), index(q))).or_insert_with(|| {
                            let (f, g) = (value[index(p)], value[index(q)]);
                            positions.push(place(p).lerp(place(q), f / (f - g)).to_array());
                            positions.len() as u32 - 1
                        })
                    };
                    let polygon: Vec<u32> = match (&inner[..], &outer[..]) {
                        ([i], o @ [_, _, _]) => o.iter().map(|&o| on(*i, o)).collect(),
                        (i @ [_, _, _], [o]) => i.iter().map(|&i| on(i, *o)).collect(),
                        ([i, j], [o, p]) => vec![on(*i, *o), on(*i, *p), on(*j, *p), on(*j, *o)],
                        _ => continue,
                    };
                    let outwards = place(outer[0]) - place(inner[0]);
                    for k in 1..polygon.len() - 1 {
                        let mut t = [polygon[0], polygon[k], polygon[k + 1]];
                        let [p, q, r] = t.map(|v| DVec3::from_array(positions[v as usize]));
                        if (q - p).cross(r - p).dot(outwards) < 0.0 {
                            t.swap(1, 2);
                        }
                        triangles.push(t);
                    }
                }
            }
        }
    }
    TriangleMesh::from_arrays(positions, triangles)
}

/// Distance from a round bar with round ends.
pub(crate) fn capsule(p: DVec3, a: DVec3, b: DVec3, radius: f64) -> f64 {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    p.distance(a + t * along) - radius
}

/// Bars of radius 1 from the origin.
pub(crate) fn star(tips: &[DVec3], cell: f64) -> TriangleMesh {
    let (low, high) = tips.iter().fold((DVec3::ZERO, DVec3::ZERO), |(l, h), &t| (l.min(t), h.max(t)));
    // Off the grid by an odd amount, so that no symmetry of the grid is one of the mesh.
    let pad = DVec3::new(1.61, 1.53, 1.57);
    level_set(low - pad, high + pad, cell, |p| {
        tips.iter().map(|&t| capsule(p, DVec3::ZERO, t, 1.0)).fold(f64::INFINITY, f64::min)
    })
}

/// A torus about the z axis.
pub(crate) fn torus(radius: f64, tube: f64, cell: f64) -> TriangleMesh {
    let reach = DVec3::new(radius + tube + 0.51, radius + tube + 0.53, tube + 0.57);
    level_set(-reach, reach, cell, |p| (p.truncate().length() - radius).hypot(p.z) - tube)
}

/// Turned and moved.
pub(crate) fn turned(mesh: &TriangleMesh, turn: DQuat, scale: f64, shift: DVec3) -> TriangleMesh {
    let mut mesh = mesh.clone();
    mesh.positions.iter_mut().for_each(|p| *p = turn * *p * scale + shift);
    mesh
}

/// Labels non-design the faces whose centre satisfies `is_non_design`.
pub(crate) fn labelled(mesh: TriangleMesh, is_non_design: impl Fn(DVec3) -> bool) -> Part {
    let mut part = Part::new(mesh);
    for f in part.mesh.faces() {
        if is_non_design(part.mesh.centroid(f)) {
            part.design[f.index()] = Design::NonDesign;
        }
    }
    part
}

/// A labelled fixture, smoothed as in the thesis: 10 Taubin iterations, then 5 of contraction.
pub(crate) fn fixture(case: &str) -> Part {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(case);
    let name = format!("{case}.stl");
    let bytes = std::fs::read(folder.join(&name)).unwrap();
    let labels = std::fs::read(folder.join(format!("{case}.labels.csv"))).unwrap();
    let source = Source { labels: Some(("labels", &labels)), ..Source::new(&name, &bytes) };
    let mut part = read_source(&source, &ImportOptions::default(), &Progress::silent()).unwrap();
    for (method, iterations) in
        [(topipe_smoothing::Method::Taubin, 10), (topipe_smoothing::Method::Contract, 5)]
    {
        let parameters = topipe_smoothing::Parameters {
            method,
            iterations: Some(iterations),
            detect_planes: false,
            detect_holes: false,
            detect_bosses: false,
            ..Default::default()
        };
        part = topipe_smoothing::smooth(&part, &parameters, &Progress::silent()).unwrap();
    }
    part
}
