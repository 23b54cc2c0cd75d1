//! An edit leaves the layout elsewhere as it was.

use std::collections::BTreeMap;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{DVec3, HalfEdgeId, Part, Provenance, TriangleMesh, VertexId};
use topipe_progress::{Progress, Recorder};
use topipe_quad_matching::{
    Earlier, QuadLayout, QuadMatchingError, UpdateParameters, match_quads, update, verify,
};
use topipe_smoothing::features::{Action, FeatureOverride, Shape, Space};
use topipe_smoothing::{Parameters, smooth, smooth_after};
use topipe_tiling::{Tiling, tile};

/// What a run with default parameters makes of a fixture.
struct Run {
    original: Part,
    smoothed: Part,
    tiling: Tiling,
    layout: QuadLayout,
}

fn run(name: &str) -> Run {
    let place = format!("{}/../../fixtures/{name}/{name}", env!("CARGO_MANIFEST_DIR"));
    let silent = Progress::silent();
    let [bytes, labels] =
        [".stl", ".labels.csv"].map(|ending| std::fs::read(place.clone() + ending).unwrap());
    let source = Source { labels: Some(("labels.csv", &labels)), ..Source::new("part.stl", &bytes) };
    let original = read_source(&source, &ImportOptions::default(), &silent).unwrap();
    let smoothed = smooth(&original, &Parameters::default(), &silent).unwrap();
    let tiling = tile(&smoothed, &Default::default(), &silent).unwrap();
    let layout = match_quads(&tiling, &Default::default(), &silent).unwrap();
    Run { original, smoothed, tiling, layout }
}

impl Run {
    /// The layout of the smoothed part as it is after an edit, and what was said.
    fn updated(&self, smoothed: &Part) -> (QuadLayout, Recorder) {
        let recorder = std::sync::Arc::new(Recorder::default());
        let earlier = Earlier { part: &self.smoothed, tiling: Some(&self.tiling), layout: &self.layout };
        let progress = Progress::new(recorder.clone());
        let layout = update(smoothed, earlier, &Default::default(), &progress).unwrap();
        drop(progress);
        assert_eq!(verify(&layout), Vec::<String>::new());
        (layout, std::sync::Arc::into_inner(recorder).unwrap())
    }

    /// The smoothed part after an edit.
    fn after(&self, original: &Part, parameters: &Parameters) -> Part {
        let earlier = topipe_smoothing::Earlier { original: &self.original, smoothed: &self.smoothed };
        smooth_after(original, earlier, parameters, &Progress::silent()).unwrap()
    }

    /// The original with a bump around a point.
    fn bumped(&self, center: DVec3, radius: f64, height: f64) -> Part {
        let mut edited = self.original.clone();
        let edge = edited.mesh.mean_edge_length();
        for p in &mut edited.mesh.positions {
            let d = p.distance(center) / (radius * edge);
            if d < 1.0 {
                *p += DVec3::new(0.6, 0.0, 0.8) * height * edge * (1.0 - d * d).powi(2);
            }
        }
        edited
    }
}

/// The faces of each quad as points.
fn shapes(layout: &QuadLayout) -> Vec<Vec<[u64; 9]>> {
    let mut shapes = vec![Vec::new(); layout.quads.len()];
    for f in layout.part.mesh.faces() {
        if let Some(shape) = shapes.get_mut(layout.quad_of_face[f.index()] as usize) {
            let corners = layout.part.mesh.corners(f).map(|p| p.to_array().map(f64::to_bits));
            shape.push(corners.concat().try_into().unwrap());
        }
    }
    shapes
}

/// How many quads of the second are bit for bit quads of the first.
fn common(before: &QuadLayout, after: &QuadLayout) -> usize {
    let known: BTreeMap<Vec<[u64; 9]>, ()> = shapes(before).into_iter().map(|shape| (shape, ())).collect();
    shapes(after).into_iter().filter(|shape| known.contains_key(shape)).count()
}

#[test]
fn without_an_edit_all_is_kept() {
    for name in ["bracket", "y-form"] {
        let run = run(name);
        let (same, recorder) = run.updated(&run.smoothed);
        assert_eq!(recorder.warnings(), Vec::<String>::new());
        // Provenance refers to the part, not to the tiling.
        let provenance = same.part.provenance.clone();
        assert_ne!(provenance, run.layout.part.provenance);
        let part = Part { provenance, ..run.layout.part.clone() };
        assert_eq!(same, QuadLayout { part, ..run.layout }, "{name}");
    }
}

/// The mesh of a layout is that of the part, but for where it is cut.
fn check_lies_on(layout: &QuadLayout, part: &Part) {
    let [own, part] = [&layout.part.mesh, &part.mesh];
    assert!((own.volume() / part.volume() - 1.0).abs() < 1e-9);
    assert!((own.area() / part.area() - 1.0).abs() < 1e-9);
    for (v, source) in own.vertices().zip(&layout.part.provenance) {
        assert!(source.point(part).unwrap().distance(own.position(v)) < 1e-9 * part.diagonal());
    }
}

/// Bumps on free surface, over borders of flat faces and beside holes.
#[test]
fn an_edit_changes_the_quads_around_it() {
    for (name, bumps) in [
        ("bracket", [(0.1, 3.0, 0.3), (0.3, 3.0, 0.3), (0.7, 6.0, 1.0)]),
        ("support", [(0.1, 6.0, 1.0), (0.5, 3.0, 0.3), (0.9, 6.0, 1.0)]),
        ("cantilever", [(0.1, 3.0, 0.3), (0.7, 3.0, 0.3), (0.9, 6.0, 1.0)]),
    ] {
        let run = run(name);
        for (share, radius, height) in bumps {
            let n = run.original.mesh.vertex_count();
            let center = run.original.mesh.positions[(share * n as f64) as usize];
            let edited = run.bumped(center, radius, height);
            let smoothed = run.after(&edited, &Parameters::default());
            let (layout, recorder) = run.updated(&smoothed);
            assert_eq!(recorder.warnings(), Vec::<String>::new(), "{name} {share}");
            let (all, same) = (run.layout.quads.len(), common(&run.layout, &layout));
            assert!(10 * same > 7 * all, "{name} {share}: {same} of {all}");
            assert!(layout.quads.len() < 3 * all / 2, "{name} {share}: {} for {all}", layout.quads.len());
            assert!(layout.outside_gates() <= 2, "{name} {share}");
            check_lies_on(&layout, &smoothed);
        }
    }
}

/// The same part with other numbers, as another program would have written it.
fn renumbered(part: &Part) -> Part {
    let mut state = 7u64;
    let mut shuffled = |n: usize| {
        let mut order: Vec<usize> = (0..n).collect();
        for k in (1..n).rev() {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            order.swap(k, (state >> 33) as usize % (k + 1));
        }
        order
    };
    let (vertices, faces) = (shuffled(part.mesh.vertex_count()), shuffled(part.mesh.face_count()));
    let mut number = vec![VertexId::NONE; vertices.len()];
    vertices.iter().enumerate().for_each(|(k, &v)| number[v] = VertexId::new(k));
    let triangle = |&f: &usize| {
        let mut t = part.mesh.triangles[f].map(|v| number[v.index()]);
        t.rotate_left(f % 3);
        t
    };
    let mut other = Part::new(TriangleMesh {
        positions: vertices.iter().map(|&v| part.mesh.positions[v]).collect(),
        triangles: faces.iter().map(triangle).collect(),
    });
    other.design = faces.iter().map(|&f| part.design[f]).collect();
    other.import.clone_from(&part.import);
    other
}

/// The part with new vertices in the middle of edges around a point.
fn refined(part: &Part, center: DVec3, radius: f64) -> Part {
    let mut refiner = Refiner::new(part).unwrap();
    let within = radius * part.mesh.mean_edge_length();
    for h in (0..3 * part.mesh.face_count()).map(HalfEdgeId::new) {
        let ends = [refiner.origin(h), refiner.target(h)].map(|v| refiner.part().mesh.position(v));
        if h < refiner.twin(h) && ends.iter().all(|p| p.distance(center) < within) {
            refiner.split_edge(h, 0.5);
        }
    }
    let mut part = refiner.finish().0;
    part.provenance = part.mesh.vertices().map(Provenance::Vertex).collect();
    part
}

/// Nothing goes by the numbers of vertices and triangles.
#[test]
fn a_file_with_other_numbers_is_the_same_part() {
    for name in ["bracket", "y-form"] {
        let run = run(name);
        let smoothed = run.after(&renumbered(&run.original), &Parameters::default());
        assert_eq!(smoothed.smoothing.as_ref().unwrap().kept as usize, smoothed.mesh.vertex_count());
        let (layout, recorder) = run.updated(&smoothed);
        assert_eq!(recorder.warnings(), Vec::<String>::new(), "{name}");
        // Tiles, and what lies on them, are in the order they were in.
        assert_eq!(layout.part.mesh, run.layout.part.mesh);
        assert_eq!(layout.vertices, run.layout.vertices);
        assert_eq!(layout.edges, run.layout.edges);
        assert_eq!(layout.quads, run.layout.quads);
        check_lies_on(&layout, &smoothed);
    }
}

/// A file with other numbers and other triangles around a point, there with a bump or not.
#[test]
fn triangles_that_are_new_are_laid_out() {
    for (name, places) in [("bracket", [(0.1, 0.0), (0.7, 1.0)]), ("support", [(0.5, 0.3), (0.9, 0.0)])] {
        let run = run(name);
        for (share, height) in places {
            let n = run.original.mesh.vertex_count();
            let center = run.original.mesh.positions[(share * n as f64) as usize];
            let edited = renumbered(&refined(&run.bumped(center, 4.0, height), center, 3.0));
            assert!(edited.mesh.face_count() > run.original.mesh.face_count() + 50, "{name} {share}");
            let smoothed = run.after(&edited, &Parameters::default());
            let (layout, recorder) = run.updated(&smoothed);
            assert_eq!(recorder.warnings(), Vec::<String>::new(), "{name} {share}");
            let (all, same) = (run.layout.quads.len(), common(&run.layout, &layout));
            assert!(10 * same > 7 * all, "{name} {share}: {same} of {all}");
            assert!(layout.quads.len() < 3 * all / 2, "{name} {share}: {} for {all}", layout.quads.len());
            check_lies_on(&layout, &smoothed);
        }
    }
}

/// Sides of tiles that are gone with some of their triangles, in part or as a whole, wherever they are.
#[test]
fn any_triangles_may_be_new() {
    let run = run("bracket");
    let n = run.original.mesh.vertex_count();
    for place in 0..24 {
        let center = run.smoothed.mesh.positions[n * (2 * place + 1) / 48];
        let edited = renumbered(&refined(&run.original, center, 2.0));
        let smoothed = run.after(&edited, &Parameters::default());
        let (layout, recorder) = run.updated(&smoothed);
        assert_eq!(recorder.warnings(), Vec::<String>::new(), "{place}");
        let (all, same) = (run.layout.quads.len(), common(&run.layout, &layout));
        assert!(10 * same > 8 * all, "{place}: {same} of {all}");
        check_lies_on(&layout, &smoothed);
    }
}

/// The same bits for any number of threads.
#[test]
fn threads_change_nothing() {
    let run = run("y-form");
    let n = run.original.mesh.vertex_count();
    let edited = run.bumped(run.original.mesh.positions[n / 10], 6.0, 1.0);
    let smoothed = run.after(&edited, &Parameters::default());
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run.updated(&smoothed).0)
    };
    assert_eq!(with(1), with(3));
}

/// A hole that is given up is covered with quads, and the others stay.
#[test]
fn a_dropped_hole_is_laid_out_and_nothing_else() {
    let run = run("bracket");
    let space =
        Space::Cylinder { point: [-53.0, -34.0, 0.0], axis: [0.0, 0.0, 1.0], length: 12.0, diameter: 6.5 };
    let drop = FeatureOverride { action: Action::Drop, shape: Shape::Hole, space, diameter: None };
    let smoothed = run.after(&run.original, &Parameters { features: vec![drop], ..Parameters::default() });
    assert_eq!(smoothed.regions.len(), run.smoothed.regions.len() - 1);
    let (layout, recorder) = run.updated(&smoothed);
    assert_eq!(recorder.warnings(), Vec::<String>::new());
    assert_eq!(layout.region_faces.len(), run.layout.region_faces.len() - 1);
    let (all, same) = (run.layout.quads.len(), common(&run.layout, &layout));
    assert!(10 * same > 9 * all, "{same} of {all}");
    // And back: an update of what was updated, whose provenance refers to the part already.
    let earlier = Earlier { part: &smoothed, tiling: None, layout: &layout };
    let recorder = std::sync::Arc::new(Recorder::default());
    let back = update(&run.smoothed, earlier, &Default::default(), &Progress::new(recorder.clone())).unwrap();
    assert_eq!(recorder.warnings(), Vec::<String>::new());
    assert_eq!(verify(&back), Vec::<String>::new());
    assert_eq!(back.region_faces.len(), run.layout.region_faces.len());
    assert!(10 * common(&run.layout, &back) > 9 * all);
}

#[test]
fn what_does_not_fit_is_laid_out_anew_and_said() {
    let run = run("y-form");
    let fresh = |part: &Part| {
        let tiling = tile(part, &Default::default(), &Progress::silent()).unwrap();
        match_quads(&tiling, &Default::default(), &Progress::silent()).unwrap()
    };
    let mut other = renumbered(&run.smoothed);
    other.mesh.positions.iter_mut().for_each(|p| p.x += 1.0);
    let (layout, recorder) = run.updated(&other);
    assert!(recorder.warnings()[0].contains("none of its"), "{:?}", recorder.warnings());
    assert_eq!(layout, fresh(&other));
    // The layout of another mesh, and a tiling that is not its own.
    let support = self::run("support");
    for (tiling, layout) in [(Some(&support.tiling), &run.layout), (None, &support.layout)] {
        let earlier = Earlier { part: &run.smoothed, tiling, layout };
        let recorder = std::sync::Arc::new(Recorder::default());
        let progress = Progress::new(recorder.clone());
        let layout = update(&run.smoothed, earlier, &Default::default(), &progress).unwrap();
        assert!(recorder.warnings()[0].contains("made of another mesh"), "{:?}", recorder.warnings());
        assert_eq!(layout, fresh(&run.smoothed));
    }
    let parameters = UpdateParameters {
        quads: topipe_quad_matching::Parameters { snap: 0.9, ..Default::default() },
        ..Default::default()
    };
    let earlier = Earlier { part: &run.smoothed, tiling: Some(&run.tiling), layout: &run.layout };
    let error = update(&run.smoothed, earlier, &parameters, &Progress::silent()).unwrap_err();
    assert!(matches!(error, QuadMatchingError::Parameter { field: "snap", .. }), "{error}");
}
