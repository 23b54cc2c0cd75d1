//! What smoothing promises, checked on recomputed optimization results and on shapes with known answers.

mod bad_input;
mod detection;
mod guarantees;
mod invariance;
mod methods;
mod shapes;

use std::collections::HashMap;
use std::path::PathBuf;
use topipe_mesh::{Design, Part, TriangleMesh};
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

/// A case with its labels. Equal coordinates are one vertex, in order of appearance.
fn read(case: &str) -> Part {
    let bytes = std::fs::read(file(case, "stl")).expect("the fixture");
    let mut vertices = HashMap::new();
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for facet in bytes[84..].chunks_exact(50) {
        triangles.push([0, 1, 2].map(|corner| {
            let bits = [0, 1, 2].map(|axis| {
                let at = 12 + 12 * corner + 4 * axis;
                u32::from_le_bytes([facet[at], facet[at + 1], facet[at + 2], facet[at + 3]])
            });
            *vertices.entry(bits).or_insert_with(|| {
                positions.push(bits.map(|b| f64::from(f32::from_bits(b))));
                positions.len() as u32 - 1
            })
        }));
    }
    let mut part = Part::new(TriangleMesh::from_arrays(positions, triangles));
    let labels = std::fs::read_to_string(file(case, "labels.csv")).expect("the labels");
    for (design, label) in part.design.iter_mut().zip(labels.split_ascii_whitespace()) {
        *design = if label == "1" { Design::NonDesign } else { Design::Design };
    }
    part
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
