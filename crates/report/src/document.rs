//! What a report tells beside the model.

use crate::{EncodedScene, Histogram};
use serde_json::Value;

/// A whole report. Nothing in it must be there: what is missing shows as missing.
#[derive(Debug, Clone, Default)]
pub struct Document {
    /// The name of the pipeline.
    pub title: String,
    /// Name and version of the program.
    pub program: String,
    /// When the run began, UTC.
    pub started: String,
    /// How long it took, s.
    pub seconds: f64,
    /// Why the run did not end well, one sentence each. Empty if it did.
    pub problems: Vec<String>,
    /// Facts about the machine: name and value.
    pub machine: Vec<(String, String)>,
    /// The stages in the order of their dependence.
    pub stages: Vec<Stage>,
    /// The files of the run.
    pub exports: Vec<Export>,
    /// The pipeline as an SVG element. Inserted as it is.
    pub diagram: String,
    /// The figures of each validation.
    pub figures: Vec<Figures>,
    /// Distributions.
    pub histograms: Vec<Histogram>,
    /// The model.
    pub scene: EncodedScene,
    /// The model in small pictures.
    pub pictures: Vec<Picture>,
    /// What could not be shown, and why.
    pub missing: Vec<String>,
}

/// A small picture of a layer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// What is seen.
    pub name: String,
    /// The file.
    pub png: Vec<u8>,
}

/// The content of a `report.json`.
#[derive(Debug, Clone)]
pub struct Figures {
    /// The stage that made it.
    pub stage: String,
    /// Its sections.
    pub value: Value,
    /// What is to be known of all of them. Empty if there is nothing.
    pub note: String,
}

/// What became of a stage.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Outcome {
    /// Computed in this run.
    #[default]
    Computed,
    /// Known before.
    Cached,
    /// Failed, with the message.
    Failed(String),
    /// Not tried, with the reason.
    Skipped(String),
}

/// A stage of the run.
#[derive(Debug, Clone, Default)]
pub struct Stage {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: String,
    /// What the kind does, one sentence.
    pub summary: String,
    /// What became of it.
    pub outcome: Outcome,
    /// How long it took when it was computed, s.
    pub seconds: Option<f64>,
    /// The most memory of the process by its end.
    pub peak_memory_bytes: Option<u64>,
    /// Length of its result.
    pub bytes: Option<u64>,
    /// Why it ran.
    pub reasons: Vec<String>,
    /// What it warned of.
    pub warnings: Vec<String>,
    /// What it remarked.
    pub remarks: Vec<String>,
    /// Finished parts that were found, and those that were computed.
    pub parts: Option<(u64, u64)>,
    /// Port and stage of each input.
    pub inputs: Vec<(String, String)>,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
}

/// A parameter of a stage.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub doc: String,
    /// The value that was used.
    pub value: Value,
    /// The value if nothing is said.
    pub default: Value,
}

/// A file of the run.
#[derive(Debug, Clone)]
pub struct Export {
    /// Path below the output folder.
    pub file: String,
    /// The stage it holds the result of.
    pub stage: String,
    /// Whether it is there, in words.
    pub state: String,
    /// Its length.
    pub bytes: Option<u64>,
}
