//! What smoothing promises, checked on recomputed optimization results and on shapes with known answers.

mod alpha;
mod bad_input;
mod detection;
mod earlier;
mod edge_overrides;
mod embedding;
mod guarantees;
mod invariance;
mod methods;
mod overrides;
mod shapes;

use std::path::PathBuf;
use topipe_mesh::Part;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_progress::Progress;
use topipe_smoothing::{Parameters, smooth};

/// The parts that come with a description of their holes and flat faces.
const CASES: [&str; 9] = [
    "beam-two-holes",
    "bell-crank",
    "bracket",
    "bridge",
    "cantilever",
    "cantilever-four",
    "monster-lite",
    "support",
    "y-form",
];

fn file(case: &str, ending: &str) -> PathBuf {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    root.join(case).join(format!("{case}.{ending}"))
}

/// A case with its labels.
fn read(case: &str) -> Part {
    let bytes = std::fs::read(file(case, "stl")).expect("the fixture");
    let labels = std::fs::read(file(case, "labels.csv")).expect("the labels");
    let mut source = Source::new(case, &bytes);
    source.labels = Some(("labels.csv", &labels));
    read_source(&source, &ImportOptions::default(), &Progress::silent()).expect("a readable mesh")
}

/// What is known about a case.
fn facts(case: &str) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(file(case, "json")).expect("the facts")).expect("JSON")
}

fn smoothed(part: &Part, parameters: &Parameters) -> Part {
    smooth(part, parameters, &Progress::silent()).expect("a smoothable part")
}

/// Pseudo-random numbers between -1 and 1, the same in each run (SplitMix64).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64 * 2.0 - 1.0
    }
}
