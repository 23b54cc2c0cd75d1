//! Spatial queries against brute force and against surfaces whose distances are known.

use proptest::prelude::*;
use std::f64::consts::TAU;
use topipe_mesh::import::{ImportOptions, read};
use topipe_mesh::spatial::{SurfaceIndex, closest_point_on_triangle, deviation};
use topipe_mesh::{DVec3, FaceId, TriangleMesh, VertexId};

fn part(name: &str) -> TriangleMesh {
    let path = format!("{}/../../fixtures/{name}/{name}.stl", env!("CARGO_MANIFEST_DIR"));
    read(name, &std::fs::read(path).unwrap(), &ImportOptions::default()).unwrap().mesh
}

/// An octahedron, its edges divided `levels` times, on the sphere of radius `r`.
fn sphere(r: f64, levels: u32) -> TriangleMesh {
    let n = 1u32 << levels;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    for octant in 0..8u32 {
        let sign = |k: usize| if octant >> k & 1 == 1 { -1.0 } else { 1.0 };
        let flipped = octant.count_ones() % 2 == 1;
        let mut at = |i: u32, k: u32| {
            let (s, t) = (f64::from(i) / f64::from(n), f64::from(k) / f64::from(n));
            let p = axes[0] * (sign(0) * (1.0 - s - t)) + axes[1] * (sign(1) * s) + axes[2] * (sign(2) * t);
            positions.push((p.normalize() * r).to_array());
            positions.len() as u32 - 1
        };
        for i in 0..n {
            for k in 0..n - i {
                let mut add =
                    |a: u32, b: u32, c: u32| triangles.push(if flipped { [a, c, b] } else { [a, b, c] });
                let (a, b, c) = (at(i, k), at(i + 1, k), at(i, k + 1));
                add(a, b, c);
                if k + 1 < n - i {
                    let d = at(i + 1, k + 1);
                    add(b, d, c);
                }
            }
        }
    }
    TriangleMesh::from_arrays(positions, triangles)
}

fn torus(major: f64, minor: f64, rings: u32, sides: u32) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..rings {
        for k in 0..sides {
            let (u, v) = (f64::from(i) / f64::from(rings) * TAU, f64::from(k) / f64::from(sides) * TAU);
            let r = major + minor * v.cos();
            positions.push([r * u.cos(), r * u.sin(), minor * v.sin()]);
            let at = |i: u32, k: u32| (i % rings) * sides + k % sides;
            let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    TriangleMesh::from_arrays(positions, triangles)
}

fn coordinate() -> impl Strategy<Value = f64> {
    -60.0..60.0
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn nearest_is_what_brute_force_finds(x in coordinate(), y in coordinate(), z in coordinate()) {
        let mesh = part("monster-lite");
        let (low, high) = mesh.bounds();
        let p = (low + high) / 2.0 + DVec3::new(x, y, z) / 60.0 * (high - low);
        let found = SurfaceIndex::build(&mesh).nearest(p).unwrap();
        let distance = |f: FaceId| closest_point_on_triangle(p, mesh.corners(f)).distance_squared(p);
        let least = mesh.faces().map(distance).fold(f64::INFINITY, f64::min);
        prop_assert_eq!(found.distance, least.sqrt());
        prop_assert_eq!(found.face, mesh.faces().find(|&f| distance(f) == least).unwrap());
        prop_assert_eq!(found.point.distance_squared(p), least);
    }

    /// The torus knows its inside; points within the chord error of the surface are left out.
    #[test]
    fn inside_of_a_torus(x in -50.0..50.0, y in -50.0..50.0, z in -15.0..15.0) {
        let mesh = torus(30.0, 10.0, 96, 48);
        let p = DVec3::new(x, y, z);
        let depth = 10.0 - DVec3::new(p.truncate().length() - 30.0, 0.0, z).length();
        prop_assume!(depth.abs() > 0.1);
        prop_assert_eq!(SurfaceIndex::build(&mesh).contains(p), depth > 0.0);
    }

    /// The first hit is on the ray, on the surface, and nothing is hit before it.
    #[test]
    fn rays_stop_at_the_first_face(o in [coordinate(), coordinate(), coordinate()], d in [-1.0..1.0, -1.0..1.0, -1.0..1.0]) {
        let mesh = torus(30.0, 10.0, 24, 12);
        let index = SurfaceIndex::build(&mesh);
        let (o, d) = (DVec3::from_array(o), DVec3::from_array(d));
        prop_assume!(d.length() > 0.1);
        let hit = index.ray(o, d, f64::INFINITY);
        // Brute force: all planes, inside tests by nearest points.
        let first = mesh.faces().filter_map(|f| {
            let [a, ..] = mesh.corners(f);
            let n = mesh.area_vector(f);
            let t = (a - o).dot(n) / d.dot(n);
            let q = o + d * t;
            (t >= 0.0 && closest_point_on_triangle(q, mesh.corners(f)).distance(q) < 1e-9).then_some(t * d.length())
        }).fold(f64::INFINITY, f64::min);
        match hit {
            None => prop_assert_eq!(first, f64::INFINITY),
            Some(hit) => {
                prop_assert!((hit.distance - first).abs() < 1e-7, "{} {first}", hit.distance);
                prop_assert!((o + d.normalize() * hit.distance).distance(hit.point) < 1e-9);
                prop_assert_eq!(index.ray(o, d, hit.distance * 0.999), None);
            }
        }
    }
}

/// Rays through edges and vertices must not slip between the faces: aimed at every vertex from the centre.
#[test]
fn no_ray_slips_through_a_closed_surface() {
    let mesh = sphere(1.0, 4);
    let index = SurfaceIndex::build(&mesh);
    let center = DVec3::new(0.01, 0.02, -0.03);
    for &p in &mesh.positions {
        for target in [p, (p + mesh.positions[0]) / 2.0] {
            assert!(index.ray(center, target - center, f64::INFINITY).is_some());
        }
    }
}

/// Points straight above vertices and edge middles, where an axis-aligned ray would graze.
#[test]
fn inside_of_a_cube_from_every_awkward_place() {
    let cube = read("cube", include_bytes!("../../../fixtures/zoo/cube.off"), &ImportOptions::default())
        .unwrap()
        .mesh;
    let index = SurfaceIndex::build(&cube);
    let grid = [-0.5, -1e-9, 1e-9, 0.25, 0.5, 0.75, 1.0 - 1e-9, 1.0 + 1e-9, 1.5];
    for x in grid {
        for y in grid {
            for z in grid {
                let p = DVec3::new(x, y, z);
                let inside = p.min_element() > 0.0 && p.max_element() < 1.0;
                assert_eq!(index.contains(p), inside, "{p}");
            }
        }
    }
    assert!(!index.contains(DVec3::NAN));
}

#[test]
fn nothing_in_an_empty_index() {
    let index = SurfaceIndex::build(&TriangleMesh::default());
    assert!(index.is_empty());
    assert_eq!(index.nearest(DVec3::ZERO), None);
    assert_eq!(index.ray(DVec3::ZERO, DVec3::X, f64::INFINITY), None);
    assert!(!index.contains(DVec3::ZERO));
    assert_eq!(deviation(&TriangleMesh::default(), &TriangleMesh::default(), 10), None);
}

/// All faces at one place, and faces along a line at distances that double: the tree must not become too deep.
#[test]
fn degenerate_arrangements_are_indexed() {
    let mut mesh = TriangleMesh::default();
    for k in 0..4000u32 {
        let at = if k < 2000 { 0.0 } else { f64::powi(1.5, (k % 1000) as i32 - 500) };
        for p in [DVec3::ZERO, DVec3::Y, DVec3::Z] {
            mesh.positions.push(p + DVec3::X * at);
        }
        mesh.triangles.push([3 * k, 3 * k + 1, 3 * k + 2].map(VertexId));
    }
    let index = SurfaceIndex::build(&mesh);
    let found = index.nearest(DVec3::new(-2.0, 0.25, 0.25)).unwrap();
    assert_eq!((found.distance, found.face), (2.0, FaceId(0)));
    assert_eq!(index.nearest_within(DVec3::new(-2.0, 0.25, 0.25), 1.9), None);
}

#[test]
fn spheres_deviate_by_the_difference_of_their_radii() {
    let (a, b) = (sphere(10.0, 6), sphere(10.5, 6));
    let d = deviation(&a, &b, 20_000).unwrap();
    // Chords of edges of length h lie h^2 / 8 r inside the sphere: 0.25^2 / 80 < 1e-3.
    for figure in [d.mean, d.rms, d.p95, d.max] {
        assert!((figure - 0.5).abs() < 4e-3, "{d:?}");
    }
    let same = deviation(&a, &a, 1000).unwrap();
    assert!(same.max < 1e-12);
}

/// A bump on one vertex of one surface is found from that side, whatever the order of the two.
#[test]
fn deviation_is_two_sided_and_names_the_place() {
    let flat = sphere(10.0, 5);
    let mut bumpy = flat.clone();
    let tip = bumpy.positions[100] * 1.2;
    let from = bumpy.positions[100];
    for p in &mut bumpy.positions {
        if p.distance(from) < 1e-9 {
            *p = tip;
        }
    }
    for d in [deviation(&flat, &bumpy, 5000).unwrap(), deviation(&bumpy, &flat, 5000).unwrap()] {
        assert!((d.max - 2.0).abs() < 0.02, "{d:?}");
        assert!(d.where_max.distance(tip) < 1e-9);
        assert!(d.mean < 0.01 && d.rms > d.mean && d.p95 < 1e-9, "{d:?}");
    }
}

#[test]
fn deviation_does_not_depend_on_the_number_of_threads() {
    let (a, b) = (part("y-form"), part("monster-lite"));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| deviation(&a, &b, 3000).unwrap())
    };
    assert_eq!(with(1), with(7));
}
