//! Properties of import that hold for every input.

use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use topipe_mesh::import::{
    Components, ImportError, ImportOptions, NonDesignRegion, Source, Units, read, read_source,
};
use topipe_mesh::{Connectivity, DVec3, Design, Part, Provenance, TriangleMesh, write};
use topipe_progress::Progress;

fn fixture(path: &str) -> Vec<u8> {
    let full = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(path);
    std::fs::read(&full).unwrap_or_else(|e| panic!("{path}: {e}"))
}

fn all() -> ImportOptions {
    ImportOptions { components: Components::All, ..ImportOptions::default() }
}

/// A cube per cell with all its faces, also those between neighbours, as programs write voxels.
fn voxel_stl(cells: &BTreeSet<[u8; 3]>) -> Vec<u8> {
    let mut mesh = TriangleMesh::default();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    for cell in cells {
        let first = mesh.positions.len() as u32;
        for k in 0..8usize {
            let at = |axis: usize| f64::from(cell[axis]) + (k >> axis & 1) as f64;
            mesh.positions.push(DVec3::new(at(0), at(1), at(2)));
        }
        for q in quads {
            let [a, b, c, d] = q.map(|v| topipe_mesh::VertexId(first + v));
            mesh.triangles.push([a, b, c]);
            mesh.triangles.push([a, c, d]);
        }
    }
    let mut bytes = Vec::new();
    write::stl(&mesh, &mut bytes).unwrap();
    bytes
}

/// The invariants that the module promises for every part it returns.
fn check(part: &Part) -> Connectivity {
    let connectivity = Connectivity::build(&part.mesh).expect("a manifold");
    assert!(connectivity.is_closed());
    assert!(part.mesh.volume() > 0.0);
    assert_eq!(part.design.len(), part.mesh.face_count());
    assert_eq!(part.frozen.len(), part.mesh.vertex_count());
    assert_eq!(part.provenance.len(), part.mesh.vertex_count());
    connectivity
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// Voxels touch in every possible way: faces, edges, corners, cavities, tunnels. The volume tells whether each
    /// edge was taken apart on the right side.
    #[test]
    fn any_set_of_voxels_becomes_a_solid_of_its_volume(cells in prop::collection::btree_set([0u8..4, 0u8..4, 0u8..4], 1..60)) {
        let part = read("voxels.stl", &voxel_stl(&cells), &all()).unwrap();
        check(&part);
        prop_assert!((part.mesh.volume() - cells.len() as f64).abs() < 1e-9);
        // The area is that of the squares with one voxel only.
        let neighbours = |c: &[u8; 3]| (0..3).map(move |k| { let mut d = *c; d[k] += 1; d }).collect::<Vec<_>>();
        let inner = cells.iter().flat_map(neighbours).filter(|d| cells.contains(d)).count();
        prop_assert!((part.mesh.area() - (6 * cells.len() - 2 * inner) as f64).abs() < 1e-9);
    }

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..600), kind in 0usize..5) {
        let name = ["a.stl", "a.off", "a.obj", "a.ply", "a"][kind];
        let start: &[u8] = [b"solid x\nfacet ".as_slice(), b"OFF\n3 1 0\n", b"v 1 2 3\nf ", b"ply\nformat ascii 1.0\n", b""][kind];
        let _ = read(name, &bytes, &all());
        let _ = read(name, &[start, &bytes].concat(), &all());
    }

    /// Files with some bytes changed, cut or repeated either give a part that keeps all promises or a named refusal.
    #[test]
    fn damaged_files_never_panic(which in 0usize..14, edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), cut in any::<prop::sample::Index>(), shorten in any::<bool>()) {
        let name = ["binary.stl", "ascii.stl", "cube.off", "cube.obj", "tetrahedron.ply", "touching-pillars.off",
            "checkered-voxels.off", "nested-shells.off", "klein-bottle.off", "bow-tie-vertex.off", "zero-area-face.off",
            "two-components.off", "duplicate-faces.off", "cubes-sharing-edge.off"][which];
        let mut bytes = fixture(&format!("zoo/{name}"));
        for (place, value) in edits {
            let k = place.index(bytes.len());
            // Digits stay digits half of the time, so that damage gets past the parser.
            bytes[k] = if bytes[k].is_ascii_digit() && value < 128 { b'0' + value % 10 } else { value };
        }
        if shorten { bytes.truncate(cut.index(bytes.len())); }
        if let Ok(part) = read(name, &bytes, &all()) { check(&part); }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// The order of faces, where each starts, its direction and the numbers of the vertices do not matter.
    #[test]
    fn order_and_numbering_do_not_matter(seed in any::<u64>()) {
        let original = read("y-form.stl", &fixture("y-form/y-form.stl"), &ImportOptions::default()).unwrap();
        let mut state = seed;
        let mut random = |n: usize| {
            // SplitMix64.
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) % n as u64) as usize
        };
        let mut mesh = original.mesh.clone();
        let n = mesh.vertex_count();
        let mut number: Vec<u32> = (0..n as u32).collect();
        for k in (1..n).rev() { number.swap(k, random(k + 1)); }
        for v in 0..n { mesh.positions[number[v] as usize] = original.mesh.positions[v]; }
        for t in &mut mesh.triangles {
            *t = t.map(|v| topipe_mesh::VertexId(number[v.index()]));
            t.rotate_left(random(3));
            if random(3) == 0 { t.swap(0, 1); }
        }
        for k in (1..mesh.triangles.len()).rev() { mesh.triangles.swap(k, random(k + 1)); }
        let mut bytes = Vec::new();
        write::off(&mesh, &mut bytes).unwrap();
        let part = read("shuffled.off", &bytes, &ImportOptions::default()).unwrap();
        check(&part);
        let oriented = |part: &Part| -> BTreeSet<[[u64; 3]; 3]> {
            part.mesh.faces().map(|f| {
                let mut corners = part.mesh.corners(f).map(|p| p.to_array().map(f64::to_bits));
                let least = (0..3).min_by_key(|&k| corners[k]).unwrap();
                corners.rotate_left(least);
                corners
            }).collect()
        };
        prop_assert!(oriented(&part) == oriented(&original));
        for (v, p) in part.provenance.iter().enumerate() {
            let Provenance::Vertex(from) = p else { panic!("no edge was divided") };
            prop_assert_eq!(part.mesh.positions[v], mesh.positions[from.index()]);
        }
    }
}

/// Thousands of islands and shells in shells must not take the time of all pairs of them.
#[test]
fn many_shells_are_sorted_into_solids_and_cavities() {
    let cube = read("cube.off", &fixture("zoo/cube.off"), &all()).unwrap().mesh;
    let mut mesh = TriangleMesh::default();
    let mut add = |center: DVec3, size: f64| {
        let first = mesh.vertex_count() as u32;
        mesh.positions.extend(cube.positions.iter().map(|p| center + (*p - 0.5) * size));
        mesh.triangles.extend(cube.triangles.iter().map(|t| t.map(|v| topipe_mesh::VertexId(v.0 + first))));
    };
    // A nest of 40 shells around the origin, and 8,000 islands beside it.
    for k in 1..=40 {
        add(DVec3::ZERO, f64::from(k));
    }
    for k in 0..8000 {
        add(DVec3::new(40.0 + f64::from(k % 20), f64::from(k / 20 % 20), f64::from(k / 400)), 0.5);
    }
    let mut bytes = Vec::new();
    write::ply(&mesh, &mut bytes).unwrap();
    let part = read("many.ply", &bytes, &all()).unwrap();
    let connectivity = check(&part);
    assert_eq!(connectivity.components().1, 8040);
    let nest: f64 = (1..=40).map(|k| f64::powi(f64::from(k), 3) * if k % 2 == 0 { 1.0 } else { -1.0 }).sum();
    assert!((part.mesh.volume() - nest - 8000.0 / 8.0).abs() < 1e-6);
    // The largest keeps the cavity right inside it, and nothing else.
    let part = read("many.ply", &bytes, &ImportOptions::default()).unwrap();
    assert!((part.mesh.volume() - (f64::powi(40.0, 3) - f64::powi(39.0, 3))).abs() < 1e-6);
    let repairs: Vec<_> = part.import.repairs.iter().map(|r| (r.what.as_str(), r.count)).collect();
    assert_eq!(
        repairs,
        [
            ("turned shells that were inside out", 1),
            ("dropped smaller components", 8019),
            ("dropped cavities of smaller components", 19)
        ]
    );
}

/// Two cubes, one moved: they are refused exactly when they pass through each other.
#[test]
fn bodies_that_cross_are_refused_unless_allowed() {
    let cube = read("cube.off", &fixture("zoo/cube.off"), &all()).unwrap().mesh;
    let moved = |by: DVec3| {
        let mut both = cube.clone();
        let first = both.vertex_count() as u32;
        both.positions.extend(cube.positions.iter().map(|p| *p + by));
        both.triangles.extend(cube.triangles.iter().map(|t| t.map(|v| topipe_mesh::VertexId(v.0 + first))));
        let mut bytes = Vec::new();
        write::ply(&both, &mut bytes).unwrap();
        bytes
    };
    for (by, crosses) in [
        (DVec3::new(0.2, 0.3, 0.4), true),
        (DVec3::new(0.999, -0.3, 0.4), true),
        (DVec3::new(1.0, -0.3, 0.4), false),
        (DVec3::new(1.001, 0.3, 0.4), false),
    ] {
        let result = read("cubes.ply", &moved(by), &all());
        assert_eq!(matches!(result, Err(ImportError::SelfIntersection { .. })), crosses, "{by} {result:?}");
        let options = ImportOptions { allow_self_intersection: true, ..all() };
        let part = read("cubes.ply", &moved(by), &options).unwrap();
        assert!((part.mesh.volume() - 2.0).abs() < 1e-12);
    }
}

#[test]
fn what_is_written_is_read_again() {
    let original = read("y-form.stl", &fixture("y-form/y-form.stl"), &ImportOptions::default()).unwrap().mesh;
    type Writer = fn(&TriangleMesh, &mut Vec<u8>) -> std::io::Result<()>;
    // Coordinates that 32 bits can not hold, except for STL.
    let mut exact = original.clone();
    for p in &mut exact.positions {
        *p /= 3.0;
    }
    let writers: [(&str, Writer, &TriangleMesh); 4] = [
        ("a.stl", write::stl, &original),
        ("a.off", write::off, &exact),
        ("a.obj", write::obj, &exact),
        ("a.ply", write::ply, &exact),
    ];
    for (name, writer, mesh) in writers {
        let mut bytes = Vec::new();
        writer(mesh, &mut bytes).unwrap();
        assert!(!bytes.starts_with(b"solid"), "{name}");
        let part = read(name, &bytes, &ImportOptions::default()).expect(name);
        assert_eq!(&part.mesh, mesh, "{name}");
        assert_eq!(part.import.repairs, [], "{name}");
    }
}

#[test]
fn units_scale_and_weld_tolerance() {
    let cube = fixture("zoo/cube.off");
    for (units, scale, side) in
        [(Units::Mm, 1.0, 1.0), (Units::In, 1.0, 25.4), (Units::M, 0.5, 500.0), (Units::Um, 1.0, 1e-3)]
    {
        let part = read("cube.off", &cube, &ImportOptions { units, scale, ..all() }).unwrap();
        assert!((part.mesh.volume() / f64::powi(side, 3) - 1.0).abs() < 1e-12);
        assert_eq!(part.import.scale_to_mm, side);
    }
    // The bottom's corners are a little off: open when only equal points are welded, closed with a tolerance.
    let text = String::from_utf8(fixture("zoo/ascii.stl")).unwrap();
    let cracked = text.replacen("vertex 1 1 0", "vertex 1.00001 1 0", 1);
    let refused = read("cracked.stl", cracked.as_bytes(), &all()).unwrap_err();
    assert!(matches!(refused, ImportError::Open { borders: 1, slit: true, .. }), "{refused:?}");
    let part =
        read("cracked.stl", cracked.as_bytes(), &ImportOptions { weld_tolerance: 1e-4, ..all() }).unwrap();
    assert_eq!(part.mesh.vertex_count(), 8);
    assert_eq!(part.import.repairs[0].what, "welded vertices closer than the tolerance");
    assert_eq!(part.import.repairs[0].count, 1);
}

#[test]
fn bad_options_are_told_from_bad_data() {
    let cube = fixture("zoo/cube.off");
    let cylinder = |axis| NonDesignRegion::Cylinder { point: [0.0; 3], axis, length: 1.0, diameter: 1.0 };
    for (options, message) in [
        (ImportOptions { scale: 0.0, ..all() }, "scale: must be a positive number, not 0"),
        (
            ImportOptions { weld_tolerance: f64::NAN, ..all() },
            "weld_tolerance: must lie between 0 and 0.1 of the diagonal, not NaN",
        ),
        (
            ImportOptions { non_design: vec![cylinder([0.0; 3])], ..all() },
            "non_design: region 1: axis must be a direction, not zero",
        ),
        (
            ImportOptions { non_design: vec![NonDesignRegion::Stl { path: "pad.stl".into() }], ..all() },
            "non_design: the file pad.stl of a region is missing",
        ),
    ] {
        let error = read("cube.off", &cube, &options).unwrap_err();
        assert_eq!(error.to_string(), message);
        assert!(error.is_bad_option());
    }
    assert!(!read("empty.stl", b"", &all()).unwrap_err().is_bad_option());
}

fn labelled(name: &str, bytes: &[u8], labels: &str) -> Result<Part, ImportError> {
    let source = Source { labels: Some(("labels.csv", labels.as_bytes())), ..Source::new(name, bytes) };
    read_source(&source, &all(), &Progress::silent())
}

#[test]
fn labels_follow_their_faces_through_repair() {
    // Two cubes with a common wall; the label is set on the faces of the second.
    let bytes = fixture("zoo/cubes-sharing-face.off");
    let labels = "0\n".repeat(12) + &"1\r\n".repeat(12);
    let part = labelled("cubes.off", &bytes, &labels).unwrap();
    assert_eq!(part.mesh.face_count(), 20);
    for f in part.mesh.faces() {
        let expected = if part.mesh.centroid(f).x > 1.0 { Design::NonDesign } else { Design::Design };
        assert_eq!(part.design[f.index()], expected);
    }
    // A square of the file is two triangles with its label.
    let part = labelled("cube.obj", &fixture("zoo/cube.obj"), "1\n0\n0\n0\n0\n0\n").unwrap();
    for f in part.mesh.faces() {
        let bottom = part.mesh.corners(f).iter().all(|p| p.z == 0.0);
        assert_eq!(part.design[f.index()] == Design::NonDesign, bottom);
    }
}

#[test]
fn wrong_labels_are_refused_with_their_place() {
    let cube = fixture("zoo/cube.off");
    let message = |labels: &str| labelled("cube.off", &cube, labels).unwrap_err().to_string();
    assert_eq!(
        message("0\n1\n"),
        "labels.csv: 2 labels for the 12 faces of cube.off; one per face, in the order of the file, is needed"
    );
    assert_eq!(message("0\n1\n2\n"), "labels.csv, line 3: a label is 0 or 1, not \"2\"");
    assert_eq!(message("label\n0\n"), "labels.csv, line 1: a label is 0 or 1, not \"label\"");
    assert_eq!(message("0\n\n1\n"), "labels.csv, line 2: a label is 0 or 1, not \"\"");
}

/// The optimizer's own non-design regions, given as cylinders, mark the faces that its label file marks.
#[test]
fn regions_of_the_bracket_are_its_labels() {
    let json: serde_json::Value = serde_json::from_slice(&fixture("bracket/bracket.json")).unwrap();
    let non_design: Vec<NonDesignRegion> = serde_json::from_value(json["non_design"].clone()).unwrap();
    assert_eq!(non_design.len(), 6);
    let stl = fixture("bracket/bracket.stl");
    let by_region = read("bracket.stl", &stl, &ImportOptions { non_design, ..all() }).unwrap();
    let labels = String::from_utf8(fixture("bracket/bracket.labels.csv")).unwrap();
    let by_label = labelled("bracket.stl", &stl, &labels).unwrap();
    let count = |part: &Part| part.design.iter().filter(|&&d| d == Design::NonDesign).count();
    let differ = (0..by_label.design.len()).filter(|&f| by_label.design[f] != by_region.design[f]).count();
    assert_eq!((count(&by_region), differ), (count(&by_label), 0));
}

#[test]
fn boxes_and_meshes_as_regions() {
    let cube = fixture("zoo/cube.off");
    let count = |non_design: Vec<NonDesignRegion>, files: &[(&str, &[u8])]| {
        let mut source = Source::new("cube.off", &cube);
        source.region_files = files.iter().map(|(n, b)| ((*n).to_owned(), *b)).collect::<BTreeMap<_, _>>();
        let part = read_source(&source, &ImportOptions { non_design, ..all() }, &Progress::silent()).unwrap();
        part.design.iter().filter(|&&d| d == Design::NonDesign).count()
    };
    let side = NonDesignRegion::Box { min: [0.0; 3], max: [1.0, 1.0, 0.0] };
    assert_eq!(count(vec![side], &[]), 2);
    assert_eq!(count(vec![NonDesignRegion::Box { min: [0.0; 3], max: [1.0, 0.9, 0.9] }], &[]), 0);
    let pad = NonDesignRegion::Stl { path: "pad.stl".into() };
    let around = voxel_stl(&BTreeSet::from([[0, 0, 0], [1, 0, 0]]));
    assert_eq!(count(vec![pad.clone()], &[("pad.stl", &around)]), 12);
    let beside = voxel_stl(&BTreeSet::from([[1, 0, 0]]));
    assert_eq!(count(vec![pad], &[("pad.stl", &beside)]), 2);
}
