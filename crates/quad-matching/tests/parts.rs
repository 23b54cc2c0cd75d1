//! The layout on the reference parts.

use topipe_mesh::Part;
use topipe_mesh::import::{ImportOptions, read};
use topipe_progress::Progress;
use topipe_quad_matching::{Pairing, Parameters, QuadLayout, QuadMatchingError, match_quads, verify};
use topipe_tiling::{Tiling, tile};

fn fixture(name: &str) -> Part {
    let ending = if name == "space-frame" { "off" } else { "stl" };
    let path = format!("{}/../../fixtures/{name}/{name}.{ending}", env!("CARGO_MANIFEST_DIR"));
    read(&path, &std::fs::read(&path).unwrap(), &ImportOptions::default()).unwrap()
}

/// The source's tessellation: closed, with a cubic dual.
fn source() -> topipe_tiling::Parameters {
    topipe_tiling::Parameters { method: topipe_tiling::Method::AugmentedVoronoi, ..Default::default() }
}

/// Its layout, good pairs first.
fn refined() -> Parameters {
    Parameters { pairing: Pairing::Refined, ..Default::default() }
}

fn tiling(name: &str) -> Tiling {
    tile(&fixture(name), &source(), &Progress::silent()).unwrap()
}

fn layout(tiling: &Tiling) -> QuadLayout {
    match_quads(tiling, &refined(), &Progress::silent()).unwrap()
}

#[test]
fn layouts_of_all_reference_parts_hold_what_they_promise() {
    for (name, genus) in [
        ("bracket", 8),
        ("beam-two-holes", 18),
        ("bridge", 19),
        ("bell-crank", 21),
        ("support", 5),
        ("cantilever", 4),
        ("cantilever-four", 6),
        ("y-form", 0),
        ("monster-lite", 1),
        ("space-frame", 1),
    ] {
        let tiling = tiling(name);
        let layout = layout(&tiling);
        assert_eq!(verify(&layout), Vec::<String>::new(), "{name}");
        // Counts of the dual of a trivalent tiling.
        let tiles = tiling.tile_count() as i64;
        assert_eq!(i64::from(layout.macro_triangles), 2 * tiles - 4 + 4 * genus, "{name}");
        let (v, e, f) = (layout.vertices.len() as i64, layout.edges.len() as i64, layout.quads.len() as i64);
        assert_eq!((e, v - e + f), (2 * f, 2 - 2 * genus), "{name}");
        assert!(layout.valences().iter().all(|&valence| valence >= 3), "{name}");
        // Refinement moves no point.
        let (before, after) = (&tiling.part.mesh, &layout.part.mesh);
        assert!((after.volume() / before.volume() - 1.0).abs() < 1e-11, "{name}");
        assert!((after.area() / before.area() - 1.0).abs() < 1e-11, "{name}");
        assert_eq!(after.positions[..before.vertex_count()], before.positions[..]);
    }
}

#[test]
fn tiles_of_any_size_give_a_layout() {
    for name in ["y-form", "monster-lite", "cantilever"] {
        let part = fixture(name);
        for tile_size in [2.0, 6.0, 12.0, 40.0] {
            let parameters = topipe_tiling::Parameters { tile_size, ..source() };
            let tiling = tile(&part, &parameters, &Progress::silent()).unwrap();
            assert_eq!(topipe_tiling::verify(&tiling), [], "{name}, tile_size {tile_size}");
            let layout = layout(&tiling);
            assert_eq!(verify(&layout), Vec::<String>::new(), "{name}, tile_size {tile_size}");
            // Cutting macro-edges refines along them only.
            assert!(layout.part.mesh.face_count() < 8 * tiling.part.mesh.face_count());
        }
    }
}

#[test]
fn pairing_all_triangles_gives_a_quarter_of_the_quads() {
    for (name, genus) in [("monster-lite", 1), ("support", 5)] {
        let tiling = tiling(name);
        let parameters = Parameters { pairing: Pairing::Perfect, ..Default::default() };
        let layout = match_quads(&tiling, &parameters, &Progress::silent()).unwrap();
        assert_eq!(verify(&layout), Vec::<String>::new(), "{name}");
        // N - 2 + 2 g, less one for each doublet that was merged.
        let quads = tiling.tile_count() - 2 + 2 * genus;
        let merged = tiling.tile_count() - layout.vertices.len();
        assert_eq!(layout.quads.len(), quads - merged, "{name}");
        assert!(merged * 10 < quads, "{name}: {merged} doublets");
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let tiling = tiling("monster-lite");
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| layout(&tiling))
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(8));
}

#[test]
fn the_check_sees_what_is_wrong() {
    let good = layout(&tiling("y-form"));
    let mut swapped = good.clone();
    swapped.quads[0].swap(0, 1);
    assert!(verify(&swapped).iter().any(|p| p.contains("does not end where the next begins")));
    let mut twice = good.clone();
    twice.quads[0] = twice.quads[1];
    assert!(verify(&twice).iter().any(|p| p.contains("times forwards and backwards")));
    let mut lost = good;
    let face = lost.quad_of_face.iter().position(|&q| q == 0).unwrap();
    lost.quad_of_face[face] = 1;
    assert!(!verify(&lost).is_empty());
}

#[test]
fn a_tiling_that_is_none_is_refused() {
    let mut broken = tiling("y-form");
    broken.tile_of_face.iter_mut().for_each(|t| t.0 /= 2);
    let halved = match_quads(&broken, &refined(), &Progress::silent());
    assert!(matches!(halved, Err(QuadMatchingError::Tiling(_))), "{:?}", halved.map(|_| ()));
    let mut short = tiling("y-form");
    short.tile_of_face.pop();
    let short = match_quads(&short, &refined(), &Progress::silent());
    assert_eq!(
        short.unwrap_err().to_string(),
        "the tiling can not be dualized: its arrays do not fit together"
    );
}

#[test]
fn a_limit_on_corner_angles_is_a_gate() {
    let tiling = tiling("y-form");
    let parameters = Parameters { max_corner_angle: 95.0, ..refined() };
    let refused = match_quads(&tiling, &parameters, &Progress::silent());
    assert!(matches!(refused, Err(QuadMatchingError::ReflexCorner { .. })));
}
