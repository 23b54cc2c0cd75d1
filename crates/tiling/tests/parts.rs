//! The tessellation on the reference parts and on shapes with known topology.

use proptest::prelude::*;
use topipe_mesh::import::{ImportOptions, read};
use topipe_mesh::{Part, TriangleMesh, VertexId};
use topipe_progress::Progress;
use topipe_tiling::{Parameters, TileId, Tiling, TilingError, Violation, tile, verify};

/// The source's tessellation, of a closed surface.
fn source() -> Parameters {
    Parameters { method: topipe_tiling::Method::AugmentedVoronoi, ..Default::default() }
}

fn fixture(name: &str) -> Part {
    let ending = if name == "space-frame" { "off" } else { "stl" };
    let path = format!("{}/../../fixtures/{name}/{name}.{ending}", env!("CARGO_MANIFEST_DIR"));
    read(&path, &std::fs::read(&path).unwrap(), &ImportOptions::default()).unwrap()
}

fn tiled(part: &Part, parameters: &Parameters) -> Tiling {
    let tiling = tile(part, parameters, &Progress::silent()).unwrap();
    assert_eq!(verify(&tiling), [], "{} tiles", tiling.tile_count());
    assert!((tiling.part.mesh.volume() / part.mesh.volume() - 1.0).abs() < 1e-12);
    tiling
}

/// A torus with `n` by `m` squares, each of two triangles.
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

#[test]
fn every_reference_part_satisfies_all_conditions() {
    for name in [
        "bracket",
        "beam-two-holes",
        "bridge",
        "bell-crank",
        "support",
        "cantilever",
        "cantilever-four",
        "y-form",
        "monster-lite",
        "space-frame",
    ] {
        tiled(&fixture(name), &source());
    }
}

#[test]
fn the_number_of_tiles_is_about_what_was_asked_for() {
    let tiling = tiled(&fixture("support"), &Parameters { tiles: 300, ..source() });
    assert!((300..330).contains(&tiling.tile_count()), "{}", tiling.tile_count());
}

#[test]
fn the_number_of_bordered_tiles_is_within_a_tenth_where_there_is_room() {
    for (name, most) in [("y-form", 600), ("bracket", 800), ("bridge", 900)] {
        let part =
            topipe_smoothing::smooth(&fixture(name), &Default::default(), &Progress::silent()).unwrap();
        for tiles in [most / 2, most] {
            let found =
                tile(&part, &Parameters { tiles, ..Default::default() }, &Progress::silent()).unwrap();
            assert_eq!(topipe_tiling::verify(&found), [], "{name}");
            let ratio = found.tile_count() as f64 / f64::from(tiles);
            assert!((0.9..1.11).contains(&ratio), "{name}: {} for {tiles}", found.tile_count());
        }
        // Fewer than the features allow: the fewest there are.
        let few = tile(&part, &Parameters { tiles: 4, ..Default::default() }, &Progress::silent()).unwrap();
        assert!(few.tile_count() < most as usize / 2, "{name}: {}", few.tile_count());
    }
}

#[test]
fn a_mesh_that_is_too_coarse_is_refined() {
    // Nine squares: the smallest torus that is a simplicial complex. A simple dual of genus 1 needs seven tiles.
    let part = torus(3, 3, 0.4);
    let tiling = tiled(&part, &Parameters { tile_size: 1000.0, ..source() });
    assert!(tiling.tile_count() >= 7);
    assert!(tiling.part.mesh.face_count() > part.mesh.face_count());
}

/// Bordered tiles: of `n` faces each, edges are at most twice as long as those of `n` equilateral triangles.
#[test]
fn tiles_have_the_faces_they_need() {
    let part = torus(12, 8, 0.4);
    let longest = |part: &Part| {
        let sides = part.mesh.faces().map(|f| part.mesh.corners(f));
        let sides = sides.flat_map(|[a, b, c]| [a.distance(b), b.distance(c), c.distance(a)]);
        sides.fold(0.0, f64::max)
    };
    let spacing = 2.0 * 2.0 * part.mesh.volume() / part.mesh.area();
    for faces_per_tile in [12, 24, 100] {
        let limit = 2.0 * (2.0 / f64::from(faces_per_tile)).sqrt() * spacing;
        let parameters = Parameters { tile_size: 2.0, faces_per_tile, bend: 0.0, ..Default::default() };
        let tiling = tile(&part, &parameters, &Progress::silent()).unwrap();
        assert_eq!(verify(&tiling), []);
        let (before, after) = (longest(&part), longest(&tiling.part));
        assert!(after <= limit && limit < before, "{faces_per_tile}: {after} of {limit}, {before} before");
    }
}

#[test]
fn shells_are_tiled_each_for_itself() {
    let mut part = torus(12, 8, 0.4);
    let count = part.mesh.vertex_count() as u32;
    let inner = torus(12, 8, 0.2);
    part.mesh.positions.extend(&inner.mesh.positions);
    // Inside out: a cavity.
    part.mesh
        .triangles
        .extend(inner.mesh.triangles.iter().map(|t| [t[1], t[0], t[2]].map(|v| VertexId(v.0 + count))));
    tiled(&Part::new(part.mesh), &source());
}

#[test]
fn scaling_by_a_power_of_two_changes_nothing() {
    let part = fixture("y-form");
    let reference = tiled(&part, &source());
    for scale in [1.0 / 1024.0, 1024.0] {
        let mut scaled = part.clone();
        scaled.mesh.positions.iter_mut().for_each(|p| *p *= scale);
        let tiling = tiled(&scaled, &source());
        assert_eq!(tiling.tile_of_face, reference.tile_of_face);
        assert_eq!(tiling.part.provenance, reference.part.provenance);
    }
}

#[test]
fn the_check_sees_what_is_wrong() {
    let good = tiled(&torus(24, 12, 0.4), &source());
    let mut hole = good.clone();
    // A face in the middle of a tile handed to another one.
    let connectivity = topipe_mesh::Connectivity::build(&good.part.mesh).unwrap();
    let inner = good
        .part
        .mesh
        .faces()
        .find(|&f| {
            let own = good.tile_of_face[f.index()];
            !good.sites.contains(&f)
                && good.part.mesh.triangles[f.index()]
                    .iter()
                    .all(|&v| connectivity.outgoing(v).all(|h| good.tile_of_face[h.face().index()] == own))
        })
        .unwrap();
    let own = hole.tile_of_face[inner.index()];
    hole.tile_of_face[inner.index()] = TileId((own.0 + 1) % hole.tile_count() as u32);
    assert!(verify(&hole).iter().any(|v| matches!(v, Violation::NotDisk { tile, .. } if *tile == own.0)));

    let mut uncovered = good.clone();
    uncovered.tile_of_face[0] = TileId::NONE;
    assert_eq!(verify(&uncovered), [Violation::Uncovered { face: 0 }]);

    // Three tiles on a torus can not be disks with single contacts.
    let mut merged = good.clone();
    merged.tile_of_face.iter_mut().for_each(|t| t.0 %= 3);
    assert!(!verify(&merged).is_empty());
}

#[test]
fn bad_input_is_refused_with_a_reason() {
    let refuse = |part: &Part, parameters: Parameters| {
        tile(part, &parameters, &Progress::silent()).unwrap_err().to_string()
    };
    let part = torus(6, 6, 0.4);
    assert_eq!(
        refuse(&part, Parameters { tile_size: 0.0, ..source() }),
        "tile_size = 0 is out of range: it must be greater than 0, at most 1000"
    );
    assert_eq!(
        refuse(&part, Parameters { tiles: 3, ..source() }),
        "tiles = 3 is out of range: it must be 0, or at least 4"
    );
    let mut open = part.clone();
    open.mesh.triangles.pop();
    let open = Part::new(open.mesh);
    assert!(refuse(&open, source()).starts_with("the mesh has 3 border edges"));
    assert_eq!(refuse(&Part::default(), source()), "the mesh can not be tiled: it has no faces");
    let mut nan = part;
    nan.mesh.positions[0].x = f64::NAN;
    assert!(matches!(
        tile(&nan, &source(), &Progress::silent()),
        Err(TilingError::Degenerate("a coordinate is not a finite number"))
    ));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Lumpy tori of any resolution and tile size: all conditions hold, and the result does not depend on where
    /// the numbering of faces starts only in so far as the conditions hold again.
    #[test]
    fn any_torus_is_tiled(
        n in 3u32..20,
        m in 3u32..14,
        minor in 0.1f64..0.9,
        size in 0.3f64..8.0,
        bumps in prop::collection::vec(-0.3f64..0.3, 280),
        shift in 0usize..500,
    ) {
        let mut part = torus(n, m, minor);
        for (p, bump) in part.mesh.positions.iter_mut().zip(&bumps) {
            p.z += bump * minor;
        }
        let faces = part.mesh.face_count();
        part.mesh.triangles.rotate_left(shift % faces);
        let parameters = Parameters { tile_size: size, faces_per_tile: 8, ..source() };
        if part.mesh.volume().abs() > 1e-6 {
            tiled(&part, &parameters);
        }
    }
}
/// Sites beside long thin faces: a neighbour is nearer to the centroid of such a face than the site whose face it is.
#[test]
fn lumpy_thin_tori_are_tiled() {
    for k in [11, 20, 70, 72, 81, 90, 108, 110, 120, 126] {
        let (n, m, minor) = (3 + k % 9, 5 + k % 8, 0.1 + 0.01 * f64::from(k % 10));
        let mut part = torus(n, m, minor);
        for (i, p) in part.mesh.positions.iter_mut().enumerate() {
            p.z += ((0.618034 * f64::from(k) * i as f64).fract() - 0.5) * 0.6 * minor;
        }
        tiled(&part, &Parameters { tile_size: 1.0, faces_per_tile: 8, ..source() });
    }
}
