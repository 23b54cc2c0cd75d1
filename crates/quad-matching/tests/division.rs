//! Division of quads around vertices: topology, what it leaves alone, and what it does not depend on.

use std::collections::BTreeSet;
use topipe_mesh::Part;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_progress::Progress;
use topipe_quad_matching::{Division, QuadLayout, divide, match_quads, verify};

fn layout(name: &str) -> QuadLayout {
    let stem = format!("{}/../../fixtures/{name}/{name}", env!("CARGO_MANIFEST_DIR"));
    let [bytes, labels] = [".stl", ".labels.csv"].map(|ending| std::fs::read(stem.clone() + ending).unwrap());
    let source = Source { labels: Some(("labels.csv", &labels)), ..Source::new("part.stl", &bytes) };
    let silent = Progress::silent();
    let part = read_source(&source, &ImportOptions::default(), &silent).unwrap();
    laid_out(&topipe_smoothing::smooth(&part, &Default::default(), &silent).unwrap())
}

fn laid_out(part: &Part) -> QuadLayout {
    let silent = Progress::silent();
    let tiling = topipe_tiling::tile(part, &Default::default(), &silent).unwrap();
    match_quads(&tiling, &Default::default(), &silent).unwrap()
}

/// The corners of its quads at each macro-vertex.
fn corners_at(layout: &QuadLayout) -> Vec<Vec<(usize, usize)>> {
    let mut at = vec![Vec::new(); layout.vertices.len()];
    for quad in 0..layout.quads.len() {
        layout.corners(quad).iter().enumerate().for_each(|(k, &v)| at[v as usize].push((quad, k)));
    }
    at
}

/// The faces of a quad by the places of their corners, whatever their numbers.
fn area(layout: &QuadLayout, quad: usize) -> f64 {
    let mesh = &layout.part.mesh;
    let faces = mesh.faces().filter(|f| layout.quad_of_face[f.index()] == quad as u32);
    faces.map(|f| mesh.area_vector(f).length() / 2.0).sum()
}

fn some(step: usize) -> impl Fn(&QuadLayout) -> Vec<Vec<u32>> {
    move |layout| (0..layout.vertices.len() as u32).step_by(step).map(|v| vec![v]).collect()
}

/// A division, and around how many vertices.
fn divided(layout: &QuadLayout, wanted: &[Vec<u32>]) -> (QuadLayout, usize) {
    let Division { layout, vertices } = divide(layout, wanted, &Progress::silent()).unwrap().unwrap();
    let vertices: BTreeSet<u32> = vertices.into_iter().flatten().collect();
    (layout, vertices.len())
}

#[test]
fn a_division_is_a_layout_of_the_same_surface() {
    for name in ["y-form", "bracket", "monster-lite"] {
        let coarse = layout(name);
        let (fine, count) = divided(&coarse, &some(29)(&coarse));
        assert!(count > 5, "{name}: {count}");
        assert_eq!(verify(&fine), Vec::<String>::new(), "{name}");
        let (before, after) = (&coarse.part.mesh, &fine.part.mesh);
        assert_eq!(after.positions[..before.vertex_count()], before.positions[..], "{name}");
        assert!((after.volume() / before.volume() - 1.0).abs() < 1e-11, "{name}");
        assert!((after.area() / before.area() - 1.0).abs() < 1e-11, "{name}");
        let gates = 15f64.to_radians()..=165f64.to_radians();
        let bad = |layout: &QuadLayout| {
            let angles = layout.corner_angles();
            angles.iter().filter(|corners| !corners.iter().all(|a| gates.contains(a))).count()
        };
        assert!(bad(&fine) <= bad(&coarse), "{name}: {} corners", bad(&fine));
    }
}

/// One vertex: two quads more for each that was there, and what does not touch these is what it was.
#[test]
fn only_what_lies_around_the_vertex_changes() {
    let coarse = layout("bracket");
    let at = corners_at(&coarse);
    let on_border =
        |v: usize| coarse.edges.iter().any(|edge| edge.feature.is_some() && edge.ends.contains(&(v as u32)));
    let mut tried = [0, 0];
    for v in (0..at.len()).step_by(at.len() / 12).filter(|&v| !at[v].is_empty()) {
        let wanted = [vec![v as u32]];
        let Some(Division { layout: fine, vertices }) =
            divide(&coarse, &wanted, &Progress::silent()).unwrap()
        else {
            continue;
        };
        tried[usize::from(on_border(v))] += 1;
        assert_eq!(vertices, [Some(v as u32)]);
        let own: BTreeSet<usize> = at[v].iter().map(|corner| corner.0).collect();
        assert_eq!(fine.quads.len(), coarse.quads.len() + 2 * own.len());
        // Vertices in the middles of the edges there and inside of each quad.
        let edges: BTreeSet<u32> = own
            .iter()
            .flat_map(|&quad| coarse.quads[quad])
            .map(|side| side.edge)
            .filter(|&e| coarse.edges[e as usize].ends.contains(&(v as u32)))
            .collect();
        assert_eq!(fine.vertices.len(), coarse.vertices.len() + own.len() + edges.len());
        let touched: BTreeSet<u32> = own.iter().flat_map(|&quad| coarse.corners(quad)).collect();
        for quad in (0..coarse.quads.len()).filter(|quad| !own.contains(quad)) {
            assert_eq!(coarse.quads[quad], fine.quads[quad]);
            if coarse.corners(quad).iter().any(|corner| touched.contains(corner)) {
                continue;
            }
            for side in coarse.quads[quad] {
                assert_eq!(coarse.path(side), fine.path(side));
            }
            assert!((area(&fine, quad) / area(&coarse, quad) - 1.0).abs() < 1e-12);
        }
        // Around the vertex there are as many quads as before; at the corners opposite there is one more for each quad divided.
        let (before, after) = (coarse.valences(), fine.valences());
        assert_eq!(before[v], after[v]);
        for w in 0..before.len() {
            let opposite = at[v].iter().filter(|&&(q, k)| coarse.corners(q)[(k + 2) % 4] == w as u32);
            assert_eq!(after[w], before[w] + opposite.count() as u32);
        }
        // Inside of each quad three meet; in the middle of an edge between two of them four.
        let new = &after[before.len()..];
        let count = |valence: u32| new.iter().filter(|&&v| v == valence).count();
        let inner = edges.iter().filter(|&&e| coarse.edges[e as usize].feature.is_none()).count();
        assert_eq!((count(3), count(4)), (own.len(), inner));
        // The quad at the vertex keeps its number.
        for &(quad, _) in &at[v] {
            assert!(fine.corners(quad).contains(&(v as u32)));
            assert!(area(&fine, quad) < area(&coarse, quad));
        }
    }
    assert!(tried[0] > 2 && tried[1] > 0, "{tried:?}");
}

#[test]
fn quads_are_divided_for_one_vertex_only() {
    let coarse = layout("y-form");
    // All corners of one quad, as places of their own: the first is taken. A place that wants it too has it.
    let corners = coarse.corners(7);
    let mut wanted: Vec<Vec<u32>> = corners.map(|v| vec![v]).to_vec();
    wanted.push(vec![corners[1], corners[0]]);
    let both = divide(&coarse, &wanted, &Progress::silent()).unwrap().unwrap();
    assert_eq!(both.vertices, [Some(corners[0]), None, None, None, Some(corners[0])]);
    assert_eq!(both.layout, divided(&coarse, &wanted[..1]).0);
    // And where all stars are wanted no two have a quad in common.
    let (fine, count) = divided(&coarse, &some(1)(&coarse));
    assert!(count > 50 && fine.quads.len() <= 3 * coarse.quads.len(), "{count}");
    assert_eq!(verify(&fine), Vec::<String>::new());
}

#[test]
fn nothing_wanted_gives_nothing() {
    let coarse = layout("y-form");
    for wanted in [vec![], vec![vec![]], vec![vec![u32::MAX]]] {
        assert!(divide(&coarse, &wanted, &Progress::silent()).unwrap().is_none());
    }
}

#[test]
fn divisions_can_be_divided_and_threads_do_not_matter() {
    let coarse = layout("monster-lite");
    let rounds = || {
        let (once, _) = divided(&coarse, &some(17)(&coarse));
        divided(&once, &some(23)(&once)).0
    };
    let on = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(rounds)
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(verify(&one), Vec::<String>::new());
    assert!(one == three);
}
