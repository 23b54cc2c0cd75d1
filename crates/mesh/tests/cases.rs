//! The optimized parts of `fixtures/`: counts, genus and volume are those that the programs that made them wrote down.

use std::path::{Path, PathBuf};
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::{Connectivity, Design, Part};
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
