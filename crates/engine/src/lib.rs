//! A staged pipeline engine: spec -> graph -> plan -> run. It knows no geometry.
//!
//! A pipeline is a TOML file of stages. A [`Stage`] turns parameters, the artifacts of other stages and external
//! files into one typed artifact. The engine checks the spec ([`Pipeline`]), decides which stages must run ([`plan()`]),
//! runs them in parallel ([`run()`]) and keeps every result in a content-addressed [`Cache`].
//!
//! # Guarantees
//!
//! - The key of a stage run is a hash over the kind of stage, the version of its code, its parameters with defaults
//!   filled in, and the content of its inputs and files. Paths, times and thread counts are not part of it.
//! - Downstream keys use the *content* of upstream artifacts: an edit that changes no result stops there.
//! - `plan` and `run` ask the same function. What `plan` calls cached does not run, what it calls run does.
//! - What the cache gives has been verified. Damage is moved aside, reported, and computed again.
//! - A process that is killed leaves whole results or none. Processes that need the same result compute it once.
//! - The bytes a stage is handed are the bytes that were hashed.
//!
//! # Finished parts
//!
//! A stage of many independent parts (the patches of a fit) gives each of them a key over exactly what it depends on
//! and asks [`StageContext::units`] first:
//!
//! ```ignore
//! fn run(&self, context: &StageContext<'_>, parameters: &P) -> Result<Surface, StageError> {
//!     let layout = context.input::<QuadLayout>("input")?;
//!     // A library that knows no engine takes the handle: `fit(&layout, parameters, context.units(), progress)`.
//!     let keys: Vec<UnitKey> = patches.iter().map(|p| UnitKey::of("patch").f64s(&p.samples).finish()).collect();
//!     context.units().announce("patches", &keys);
//!     patches.par_iter().zip(keys).map(|(patch, key)| context.units().f64s(key, || solve(patch)))...
//! }
//! ```
//!
//! A part survives a kill as soon as `put` (or `f64s`) returns: it is one append to one file of the run, without a
//! flush, and it is checked when it is read. It is found by its own key, so that after an edit only the parts whose
//! content has changed are computed, and only by the same version of the stage's code. `announce` lets `plan` count what an
//! interrupted run has left; [`Stage::needed_units`] lets it count what an edit leaves. Parts are thrown away by
//! `cache gc` alone. [`Event::StageUnits`] and [`StageRecord::units`] tell how many were reused.
//!
//! # Non-guarantees
//!
//! - A stage that depends on anything but its arguments defeats the keys; the engine notices only when such a stage
//!   is run again by force.
//! - Nothing is ever deleted from the cache by itself.
//! - Memory: results of a run stay in memory until its end.
//!
//! # Example
//!
//! ```
//! use std::sync::Arc;
//! use topipe_engine::*;
//!
//! struct Text;
//! impl ArtifactKind for Text {
//!     type Value = String;
//!     const NAME: &'static str = "text";
//!     const VERSION: u32 = 1;
//! }
//!
//! /// Says something several times.
//! struct Say;
//! #[derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
//! #[serde(deny_unknown_fields, default)]
//! struct Words { text: String, times: usize }
//! impl Default for Words {
//!     fn default() -> Self { Self { text: "hello".into(), times: 1 } }
//! }
//! impl Stage for Say {
//!     type Parameters = Words;
//!     type Output = Text;
//!     const KIND: &'static str = "say";
//!     const SUMMARY: &'static str = "Says something several times.";
//!     fn code_version(&self) -> String { "1".into() }
//!     fn inputs(&self) -> Vec<InputPort> { Vec::new() }
//!     fn run(&self, _: &StageContext<'_>, words: &Words) -> Result<String, StageError> {
//!         Ok(words.text.repeat(words.times))
//!     }
//! }
//!
//! let folder = tempfile::tempdir().unwrap();
//! let registry = Registry::new().with_stage(Say);
//! let spec = "[stage.greet]\nkind = 'say'\ntimes = 2\n".to_owned();
//! let pipeline = Pipeline::parse(&folder.path().join("greet.toml"), spec, &[], &registry).unwrap();
//! let cache = Cache::new(folder.path().join("cache"));
//! let options = RunOptions::new(folder.path().join("out"));
//! let sink = Arc::new(|_: &Event| {});
//! let record = run(&pipeline, &cache, &options, &Interrupt::new(), sink).unwrap();
//! assert_eq!(record.code, ExitCode::Done);
//! assert_eq!(plan(&pipeline, &cache, &Choice::default()).unwrap().stages[0].action, Action::Cached);
//! ```

mod artifact;
pub mod cache;
pub mod codec;
mod compare;
mod decide;
mod diagnostic;
mod error;
mod event;
#[doc(hidden)]
pub mod failpoint;
mod graph;
mod hash;
mod history;
mod input_file;
mod interrupt;
mod machine;
mod plan;
mod reason;
mod registry;
pub mod reproduce;
mod run;
mod schema;
mod selection;
mod spec;
mod stage;
mod sweep_table;

pub use artifact::{ArtifactKind, ArtifactType, Value};
pub use cache::{Cache, UnitCounts, UnitsAtHand};
pub use compare::{RunDifference, StageDifference, compare};
pub use decide::Decision;
pub use diagnostic::{Diagnostic, Source, nearest};
pub use error::{EngineError, ExitCode};
pub use event::{Event, EventSink};
pub use graph::StageGraph;
pub use hash::{ContentHash, ParseHashError};
pub use input_file::InputFileError;
pub use interrupt::Interrupt;
pub use plan::{Action, Plan, PlannedStage, PlannedUnits, plan};
pub use reason::Reason;
pub use registry::{ExportError, Exporter, Registry};
pub use run::{
    ExportOutcome, ExportRecord, FileRecord, InputRecord, Machine, Outcome, RunOptions, RunRecord,
    StageRecord, run,
};
pub use schema::{ParameterField, parameter_fields, pipeline_schema};
pub use selection::Choice;
pub use spec::{ExportNode, FileInput, Override, OverrideError, Pipeline, Place, SpecError, StageNode};
pub use spec::{Figure, Sweep, Variant};
pub use stage::{
    AnyStage, BadValue, FileField, InputPort, NeededUnits, ResolvedParameters, SourceFile, Stage,
    StageContext, StageError, stage_key, with_causes,
};
pub use sweep_table::SweepTable;
