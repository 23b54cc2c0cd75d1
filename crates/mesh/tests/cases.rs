//! The optimized parts of `fixtures/`: counts, genus and volume are those that the programs that made them wrote down.

use std::path::{Path, PathBuf};
use topipe_mesh::import::{ImportOptions, Source, read, read_source};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{Connectivity, Design, Part, Provenance, write};
use topipe_progress::Progress;

fn fixture(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(path)
}

fn bytes(path: &str) -> Vec<u8> {
    std::fs::read(fixture(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

fn case(name: &str) -> (Part, serde_json::Value) {
    let stl = bytes(&format!("{name}/{name}.stl"));
    let labels = bytes(&format!("{name}/{name}.labels.csv"));
    let source = Source { labels: Some(("labels.csv", &labels)), ..Source::new("case.stl", &stl) };
    let part = read_source(&source, &ImportOptions::default(), &Progress::silent()).expect(name);
    let json = serde_json::from_slice(&bytes(&format!("{name}/{name}.json"))).expect(name);
    (part, json)
}

const CASES: [&str; 9] = [
    "bracket",
    "beam-two-holes",
    "bridge",
    "bell-crank",
    "support",
    "cantilever",
    "cantilever-four",
    "y-form",
    "monster-lite",
];

#[test]
fn counts_genus_volume_and_labels_are_as_recorded() {
    for name in CASES {
        let (part, json) = case(name);
        let connectivity = Connectivity::build(&part.mesh).expect(name);
        assert_eq!(part.mesh.vertex_count() as u64, json["vertices"].as_u64().unwrap(), "{name}");
        assert_eq!(part.mesh.face_count() as u64, json["triangles"].as_u64().unwrap(), "{name}");
        assert_eq!(connectivity.genus(&part.mesh), json["genus"].as_i64(), "{name}");
        assert_eq!(connectivity.components().1 as u64, json["shells"].as_u64().unwrap(), "{name}");
        let volume = json["volume"].as_f64().unwrap();
        assert!((part.mesh.volume() / volume - 1.0).abs() < 1e-6, "{name}: {} {volume}", part.mesh.volume());
        let non_design = part.design.iter().filter(|&&d| d == Design::NonDesign).count();
        assert_eq!(non_design as u64, json["non_design_triangles"].as_u64().unwrap(), "{name}");
        assert_eq!(part.import.format, "STL (binary)");
        assert_eq!(part.import.repairs, [], "{name}");
    }
}

#[test]
fn the_space_frame_is_one_ring_of_beams() {
    let part =
        read("space-frame.off", &bytes("space-frame/space-frame.off"), &ImportOptions::default()).unwrap();
    let connectivity = Connectivity::build(&part.mesh).unwrap();
    assert_eq!((part.mesh.vertex_count(), part.mesh.face_count()), (10180, 20360));
    assert_eq!(connectivity.genus(&part.mesh), Some(1));
    assert_eq!(part.import.repairs, []);
}

/// Two files of one mesh: the vertices of an STL are numbered as its faces first name them, and traced back to them.
#[test]
fn vertices_of_an_stl_are_traced_to_their_first_corner() {
    let stl = bytes("monster-lite/monster-lite.stl");
    let part = read("monster-lite.stl", &stl, &ImportOptions::default()).unwrap();
    let coordinate = |corner: usize, axis: usize| {
        let at = 84 + 50 * (corner / 3) + 12 + 12 * (corner % 3) + 4 * axis;
        f64::from(f32::from_le_bytes(stl[at..at + 4].try_into().unwrap()))
    };
    let mut last = None;
    for (v, from) in part.provenance.iter().enumerate() {
        let &Provenance::Vertex(corner) = from else { panic!("no edge was divided") };
        assert_eq!(part.mesh.positions[v].to_array(), [0, 1, 2].map(|axis| coordinate(corner.index(), axis)));
        assert!(last < Some(corner));
        last = Some(corner);
    }
}

/// An edited mesh has no labels of its own: its faces have those of the earlier one, whatever their order is now, and pieces of them too.
#[test]
fn labels_are_those_of_an_earlier_version() {
    for name in CASES {
        let (part, _) = case(name);
        let mut refiner = Refiner::new(&part).unwrap();
        // Every third face in three, the others in another order.
        for f in part.mesh.faces().step_by(3) {
            refiner.split_face(f, [0.2, 0.3, 0.5]);
        }
        let (mut edited, parents) = refiner.finish();
        edited.mesh.triangles.reverse();
        let mut off = Vec::new();
        write::off(&edited.mesh, &mut off).unwrap();
        let source = Source { earlier: Some(&part), ..Source::new("edited.off", &off) };
        let read = read_source(&source, &ImportOptions::default(), &Progress::silent()).expect(name);
        assert_eq!(read.mesh.triangles, edited.mesh.triangles, "{name}");
        let wanted: Vec<Design> = parents.iter().rev().map(|f| part.design[f.index()]).collect();
        assert!(read.design == wanted, "{name}");
        assert!(wanted.contains(&Design::NonDesign));
    }
}

struct Stop;

impl topipe_progress::Listener for Stop {
    fn step(&self, _: u64, _: u64, _: &str) {}
    fn remark(&self, _: &str) {}
    fn interrupted(&self) -> bool {
        true
    }
}

#[test]
fn an_interrupted_import_says_so() {
    let stl = bytes("monster-lite/monster-lite.stl");
    let progress = Progress::new(std::sync::Arc::new(Stop));
    let error = read_source(&Source::new("a.stl", &stl), &ImportOptions::default(), &progress).unwrap_err();
    assert_eq!(error, topipe_mesh::import::ImportError::Interrupted(topipe_progress::Interrupted));
}
