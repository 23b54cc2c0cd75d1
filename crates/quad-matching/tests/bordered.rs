//! Bordered tiles and their layout: topology on parts with and without features, and what it does not depend on.

use proptest::prelude::*;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::{DVec3, FaceId, Part, Region, RegionId, RegionShape, TriangleMesh, VertexId};
use topipe_progress::Progress;
use topipe_quad_matching::{Pairing, Parameters, QuadLayout, QuadMatchingError, match_quads, verify};
use topipe_smoothing::smooth;
use topipe_tiling::{Method, Tiling, tile, tile_sized};

fn smoothed(name: &str) -> Part {
    let path = format!("{}/../../fixtures/{name}/{name}.stl", env!("CARGO_MANIFEST_DIR"));
    let labels = path.replace(".stl", ".labels.csv");
    let (bytes, label_bytes) = (std::fs::read(&path).unwrap(), std::fs::read(&labels).ok());
    let mut source = Source::new(&path, &bytes);
    source.labels = label_bytes.as_deref().map(|bytes| (labels.as_str(), bytes));
    let part = read_source(&source, &ImportOptions::default(), &Progress::silent()).unwrap();
    smooth(&part, &Default::default(), &Progress::silent()).unwrap()
}

fn tiling_parameters() -> topipe_tiling::Parameters {
    topipe_tiling::Parameters { method: Method::Bordered, ..Default::default() }
}

fn tiled(part: &Part, parameters: &topipe_tiling::Parameters) -> Tiling {
    let tiling = tile(part, parameters, &Progress::silent()).unwrap();
    assert_eq!(topipe_tiling::verify(&tiling), []);
    tiling
}

fn laid_out(tiling: &Tiling) -> QuadLayout {
    let parameters = Parameters { pairing: Pairing::Midpoint, ..Default::default() };
    let layout = match_quads(tiling, &parameters, &Progress::silent()).unwrap();
    assert_eq!(verify(&layout), Vec::<String>::new());
    // Nothing has moved.
    let (before, after) = (&tiling.part.mesh, &layout.part.mesh);
    assert!((after.volume() / before.volume() - 1.0).abs() < 1e-11);
    assert!((after.area() / before.area() - 1.0).abs() < 1e-11);
    assert_eq!(after.positions[..before.vertex_count()], before.positions[..]);
    layout
}

fn irregular(layout: &QuadLayout) -> usize {
    let regular = |a: &f64| (15.0..=165.0).contains(&a.to_degrees());
    layout.corner_angles().iter().filter(|corners| !corners.iter().all(regular)).count()
}

/// With large tiles the bracket has a corner of 187 degrees at a fold of its mesh, wherever its vertex is moved to.
#[test]
fn two_quads_share_a_corner_that_is_too_wide_for_one() {
    let parameters = topipe_tiling::Parameters { tile_size: 7.0, ..tiling_parameters() };
    let tiling = tiled(&smoothed("bracket"), &parameters);
    let layout = laid_out(&tiling);
    assert_eq!(irregular(&layout), 0);
    // Divided or not, vertices say where in the mesh of the tiling they lie.
    let (before, after) = (&tiling.part.mesh, &layout.part.mesh);
    for (v, source) in after.vertices().zip(&layout.part.provenance) {
        let expected = source.point(before).unwrap();
        assert!(after.position(v).distance(expected) < 1e-9 * before.diagonal(), "{v:?}");
    }
}

#[test]
fn the_gate_on_corners_holds_here_too() {
    let tiling = tiled(&smoothed("y-form"), &tiling_parameters());
    let widest = laid_out(&tiling).corner_angles().into_iter().flatten().fold(0.0, f64::max).to_degrees();
    let gated = |limit: f64| {
        let parameters =
            Parameters { pairing: Pairing::Midpoint, max_corner_angle: limit, ..Default::default() };
        match_quads(&tiling, &parameters, &Progress::silent())
    };
    assert!(gated(widest + 1e-6).is_ok());
    let refused = gated(widest - 1.0).unwrap_err();
    assert!(
        matches!(refused, QuadMatchingError::ReflexCorner { quads: 1.., widest: w, .. } if (w - widest).abs() < 1e-9)
    );
}

#[test]
fn regions_are_faces_and_features_are_followed() {
    for name in ["bracket", "cantilever", "y-form", "monster-lite"] {
        let part = smoothed(name);
        let tiling = tiled(&part, &tiling_parameters());
        let layout = laid_out(&tiling);
        assert_eq!(layout.region_faces.len(), tiling.regions.len());
        assert!(!layout.region_faces.is_empty(), "{name}");
        // Every vertex of a region face lies on its shape, and borders of regions are features.
        let mesh = &layout.part.mesh;
        // A dent that was filled is up to a quarter of an edge deep; borders run through two of them on the bracket.
        let dent = 0.25 * (part.mesh.area() / part.mesh.face_count() as f64).sqrt();
        let (mut count, mut beside) = (0, 0);
        for face in &layout.region_faces {
            let region = &layout.part.regions[face.region.index()];
            let slack = region.residual + 1e-9;
            let off = |p: DVec3| match region.shape {
                RegionShape::Plane { point, normal } => (p - point).dot(normal).abs(),
                RegionShape::Cylinder { point, axis, radius, .. } => {
                    ((p - point).reject_from_normalized(axis).length() - radius).abs()
                }
            };
            for side in face.loops.iter().flatten() {
                let edge = &layout.edges[side.edge as usize];
                assert!(edge.feature.is_some(), "{name}");
                // Middles of chords of a circle lie inside it.
                let chord = match region.shape {
                    RegionShape::Plane { .. } => 0.0,
                    RegionShape::Cylinder { radius, .. } => 0.1 * radius,
                };
                for &v in &edge.path {
                    count += 1;
                    if off(mesh.position(v)) > slack + chord {
                        beside += 1;
                        assert!(off(mesh.position(v)) <= dent, "{name}");
                    }
                }
            }
        }
        assert!(beside * 200 <= count, "{name}: {beside} of {count} vertices are not on their shapes");
        assert_eq!(irregular(&layout), 0, "{name}");
    }
}

/// Tilings on which relaxation alone leaves corners of 11 to 15 degrees around centres of eight or nine sides, and of 183 degrees
/// where a border turns back at the middle of an edge.
#[test]
fn corners_outside_the_gates_are_searched_better_places_for() {
    for (name, size, bend) in [
        ("bridge", 1.01, 1.0),
        ("support", 1.03, 1.0),
        ("support", 1.0, 0.95),
        ("cantilever-four", 1.0, 1.15),
    ] {
        let mut parameters = tiling_parameters();
        parameters.tile_size *= size;
        parameters.bend *= bend;
        assert_eq!(irregular(&laid_out(&tiled(&smoothed(name), &parameters))), 0, "{name} {size} {bend}");
    }
}

/// Where a region comes to a point, two quads lie below it: one with both sides of the point would have the same triangle in its
/// corner as the region, in a coarse mesh of the solid.
#[test]
fn below_a_pointed_region_there_are_two_quads() {
    let layout = laid_out(&tiled(&smoothed("bridge"), &tiling_parameters()));
    let mesh = &layout.part.mesh;
    let angle = |v: VertexId, counts: &dyn Fn(FaceId) -> bool| -> f64 {
        let faces = mesh.faces().filter(|&f| counts(f) && mesh.triangles[f.index()].contains(&v));
        faces
            .map(|f| {
                let k = mesh.triangles[f.index()].iter().position(|&w| w == v).unwrap();
                let [a, b, c] = [0, 1, 2].map(|i| mesh.corners(f)[(k + i) % 3]);
                (b - a).angle_between(c - a)
            })
            .sum()
    };
    let mut pointed = 0;
    for face in &layout.region_faces {
        for around in &face.loops {
            for (k, &side) in around.iter().enumerate() {
                let v = layout.vertices[layout.start(side) as usize];
                let narrow =
                    angle(v, &|f| layout.part.region_of_face[f.index()] == face.region).to_degrees() < 120.0;
                if !narrow {
                    continue;
                }
                pointed += 1;
                let edges = [side.edge, around[(k + around.len() - 1) % around.len()].edge];
                for (q, sides) in layout.quads.iter().enumerate() {
                    if edges.iter().all(|e| sides.iter().any(|s| s.edge == *e)) {
                        let own = angle(v, &|f| layout.quad_of_face[f.index()] == q as u32).to_degrees();
                        assert!(own < 40.0, "quad {q} with {own} degrees at {}", mesh.position(v));
                    }
                }
            }
        }
    }
    assert!(pointed > 5, "{pointed}");
}

fn torus(n: u32, m: u32, minor: f64) -> Part {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let angle = |k: u32, count: u32| std::f64::consts::TAU * f64::from(k) / f64::from(count);
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (angle(i, n), angle(j, m));
            let r = 1.0 + minor * b.cos();
            positions.push([r * a.cos(), r * a.sin(), minor * b.sin()]);
            let at = |i: u32, j: u32| (i % n) * m + j % m;
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    Part::new(TriangleMesh::from_arrays(positions, triangles))
}

fn cube() -> Part {
    Part::new(TriangleMesh::from_arrays(
        vec![
            [0., 0., 0.],
            [1., 0., 0.],
            [1., 1., 0.],
            [0., 1., 0.],
            [0., 0., 1.],
            [1., 0., 1.],
            [1., 1., 1.],
            [0., 1., 1.],
        ],
        vec![
            [0, 2, 1],
            [0, 3, 2],
            [4, 5, 6],
            [4, 6, 7],
            [0, 1, 5],
            [0, 5, 4],
            [1, 2, 6],
            [1, 6, 5],
            [2, 3, 7],
            [2, 7, 6],
            [3, 0, 4],
            [3, 4, 7],
        ],
    ))
}

#[test]
fn closed_surfaces_without_features_are_laid_out() {
    for part in [cube(), torus(24, 12, 0.4), torus(3, 3, 0.4)] {
        for tile_size in [2.0, 1000.0] {
            laid_out(&tiled(&part, &topipe_tiling::Parameters { tile_size, ..tiling_parameters() }));
        }
    }
}

#[test]
fn a_cube_of_six_planes_has_no_quad() {
    let mut part = cube();
    for side in 0..6u32 {
        let (p, n) = (part.mesh.centroid(FaceId(2 * side)), part.mesh.area_vector(FaceId(2 * side)));
        let shape = RegionShape::Plane { point: p, normal: n.normalize() };
        part.regions.push(Region { shape, area: 1.0, residual: 0.0 });
        for k in 0..2 {
            part.region_of_face[(2 * side + k) as usize] = RegionId(side);
        }
    }
    let layout = laid_out(&tiled(&part, &tiling_parameters()));
    assert_eq!((layout.region_faces.len(), layout.quads.len()), (6, 0));
    // Corners of the cube and the middles of its edges.
    assert_eq!((layout.vertices.len(), layout.edges.len()), (20, 24));
}

#[test]
fn smaller_tiles_where_they_are_asked_for() {
    let part = torus(48, 24, 0.4);
    let plain = tiled(&part, &tiling_parameters());
    let right: Vec<f64> =
        part.mesh.faces().map(|f| if part.mesh.centroid(f).x > 0.0 { 0.5 } else { 1.0 }).collect();
    let finer = tile_sized(&part, &tiling_parameters(), Some(&right), &Progress::silent()).unwrap();
    assert_eq!(topipe_tiling::verify(&finer), []);
    let count = |tiling: &Tiling, sign: f64| {
        let at = |site: &&FaceId| sign * tiling.part.mesh.centroid(**site).x > 0.3;
        tiling.sites.iter().filter(at).count()
    };
    assert!(count(&finer, 1.0) > 2 * count(&plain, 1.0));
    assert!(count(&finer, -1.0) < 2 * count(&plain, -1.0));
}

#[test]
fn the_checks_see_what_is_wrong() {
    let tiling = tiled(&smoothed("y-form"), &tiling_parameters());
    let mut swapped = tiling.clone();
    let free = swapped.tile_of_face.iter().position(|t| *t == topipe_tiling::TileId(3)).unwrap();
    swapped.tile_of_face[free] = topipe_tiling::TileId::NONE;
    assert!(!topipe_tiling::verify(&swapped).is_empty());
    let mut torn = tiling.clone();
    torn.segments.pop();
    assert!(!topipe_tiling::verify(&torn).is_empty());

    let layout = laid_out(&tiling);
    let mut reversed = layout.clone();
    reversed.region_faces[0].loops[0].reverse();
    assert!(!verify(&reversed).is_empty());
    let mut lost = layout.clone();
    lost.region_faces.pop();
    assert!(!verify(&lost).is_empty());
    let mut moved = layout;
    let quad = moved.quad_of_face.iter().position(|&q| q == 0).unwrap();
    moved.quad_of_face[quad] = 1;
    assert!(!verify(&moved).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Same part in another place, size and numbering: laid out as well, with about as many quads.
    #[test]
    fn parts_anywhere_are_laid_out(
        axis in prop::array::uniform3(-1.0f64..1.0), angle in 0.0f64..6.3, scale in -3.0f64..3.0, shift in 1usize..1000
    ) {
        let mut part = torus(20, 10, 0.35);
        let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::X);
        let turn = rotation(axis, angle);
        let n = part.mesh.vertex_count();
        let old = part.mesh.positions.clone();
        for (v, p) in old.iter().enumerate() {
            part.mesh.positions[(v + shift) % n] = 10f64.powf(scale) * turn(*p);
        }
        for triangle in &mut part.mesh.triangles {
            *triangle = triangle.map(|v| VertexId(((v.index() + shift) % n) as u32));
        }
        let part = Part::new(part.mesh);
        let layout = laid_out(&tiled(&part, &tiling_parameters()));
        prop_assert!((30..400).contains(&layout.quads.len()), "{}", layout.quads.len());
    }
}

/// Rodrigues' rotation.
fn rotation(axis: DVec3, angle: f64) -> impl Fn(DVec3) -> DVec3 {
    move |p| {
        let (s, c) = angle.sin_cos();
        c * p + s * axis.cross(p) + (1.0 - c) * axis.dot(p) * axis
    }
}

#[test]
fn only_closed_surfaces_are_paired() {
    let part = torus(40, 24, 1.0);
    let tiling = tiled(&part, &tiling_parameters());
    let parameters = Parameters { pairing: Pairing::Perfect, ..Default::default() };
    let error = match_quads(&tiling, &parameters, &Progress::silent()).unwrap_err().to_string();
    assert!(error.contains("pairing") && error.contains("augmented-voronoi"), "{error}");
}
