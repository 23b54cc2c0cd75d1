//! A stage of one's own: a mesh mirrored in a plane. The guide prints this file (docs/src/add-a-stage.md).
//!
//!     cargo run -p topipe --example own_stage -- part.stl

// ANCHOR: stage
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use topipe::artifacts::Mesh;
use topipe_engine::{InputPort, Stage, StageContext, StageError};
use topipe_mesh::Part;

/// The axis across which a part is mirrored.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// The plane x = 0.
    #[default]
    X,
    /// The plane y = 0.
    Y,
    /// The plane z = 0.
    Z,
}

/// What can be set in the pipeline. The comments are the documentation that `topipe stages mirror` would print.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// The axis across which the part is mirrored.
    pub axis: Axis,
}

/// The work itself knows no engine: it can be used and tested alone.
pub fn mirror(part: &Part, axis: Axis) -> Part {
    let mut mirrored = part.clone();
    for p in &mut mirrored.mesh.positions {
        p[axis as usize] = -p[axis as usize];
    }
    // A mirror turns the inside out.
    for triangle in &mut mirrored.mesh.triangles {
        triangle.swap(1, 2);
    }
    mirrored
}

/// The adapter.
pub struct Mirror;

impl Stage for Mirror {
    type Parameters = Parameters;
    type Output = Mesh;
    const KIND: &'static str = "mirror";
    const SUMMARY: &'static str = "Mirrors a mesh in a plane through the origin.";

    /// Changes whenever the same input may give another result.
    fn code_version(&self) -> String {
        "1".into()
    }

    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Mesh>("input", "The mesh.")]
    }

    fn run(&self, context: &StageContext<'_>, parameters: &Parameters) -> Result<Part, StageError> {
        let part = context.input::<Mesh>("input")?;
        if !part.regions.is_empty() {
            return Err(StageError::Refused("mirror before smoothing: regions are not mirrored".into()));
        }
        context.progress().check().map_err(|_| StageError::Interrupted)?;
        Ok(mirror(&part, parameters.axis))
    }
}
// ANCHOR_END: stage

// ANCHOR: use
use std::path::Path;
use std::sync::Arc;
use topipe_engine::{Cache, Event, Interrupt, Pipeline, RunOptions, RunRecord, run};

/// Mirrors a mesh file into `folder`, with all stages of the command at hand.
pub fn mirror_file(mesh: &Path, folder: &Path) -> Result<RunRecord, String> {
    let registry = topipe::stages::registry().with_stage(Mirror);
    // A JSON string is a TOML string.
    let path = serde_json::Value::String(mesh.display().to_string());
    let spec = format!(
        "[stage.mesh]\nkind = 'import'\npath = {path}\n\
         [stage.other]\nkind = 'mirror'\ninput = 'mesh'\naxis = 'z'\n\
         [export]\n'mirrored.stl' = 'other'\n"
    );
    let pipeline = Pipeline::parse(&folder.join("mirror.toml"), spec, &[], &registry)
        .map_err(|error| error.to_string())?;
    let cache = Cache::new(folder.join("cache"));
    let options = RunOptions::new(folder);
    let listener = Arc::new(|event: &Event| println!("{event:?}"));
    run(&pipeline, &cache, &options, &Interrupt::new(), listener).map_err(|error| error.to_string())
}
// ANCHOR_END: use

fn main() -> Result<(), String> {
    let mesh = std::env::args().nth(1).ok_or("give a mesh file")?;
    let mesh = std::path::absolute(mesh).map_err(|error| error.to_string())?;
    mirror_file(&mesh, &std::env::temp_dir().join("mirror")).map(|record| println!("{:?}", record.code))
}
