//! A stage: from parameters, artifacts and files to one artifact.

use crate::artifact::{ArtifactKind, ArtifactType, Value};
use crate::hash::ContentHash;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use topipe_progress::{Progress, UnitKey, Units};

/// A field of a stage that names another stage, whose artifact it reads.
#[derive(Debug, Clone)]
pub struct InputPort {
    /// The field in the spec.
    pub name: &'static str,
    /// What it accepts.
    pub artifact: ArtifactType,
    /// Whether it may be left out.
    pub optional: bool,
    /// One sentence for people.
    pub doc: &'static str,
}

impl InputPort {
    /// An input that must be given.
    pub fn required<K: ArtifactKind>(name: &'static str, doc: &'static str) -> Self {
        Self { name, artifact: ArtifactType::of::<K>(), optional: false, doc }
    }

    /// An input that may be left out.
    pub fn optional<K: ArtifactKind>(name: &'static str, doc: &'static str) -> Self {
        Self { name, artifact: ArtifactType::of::<K>(), optional: true, doc }
    }
}

/// A field of a stage that names a file. The engine reads and hashes it before the stage runs, and the stage is
/// handed the very bytes that were hashed; it opens nothing itself.
#[derive(Debug, Clone)]
pub struct FileField {
    /// The field in the spec.
    pub name: &'static str,
    /// Whether it may be left out.
    pub optional: bool,
    /// One sentence for people.
    pub doc: &'static str,
}

/// An external file as a stage sees it.
#[derive(Debug, Clone)]
pub struct SourceFile {
    /// Its name without directories, for messages and to tell formats apart.
    pub name: String,
    /// Its content.
    pub bytes: Arc<[u8]>,
}

/// Why a stage gave no result.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StageError {
    /// The geometry or the data is not one this stage can work with. Exit code 3.
    #[error("{0}")]
    Refused(String),
    /// A parameter is out of range, alone or together with others. Exit code 2.
    #[error("{0}")]
    BadParameter(String),
    /// It went wrong: no convergence, a defect. Exit code 1.
    #[error("{0}")]
    Failed(String),
    /// It was asked to stop. Exit code 130.
    #[error("interrupted")]
    Interrupted,
}

/// A parameter has a value of the right type that makes no sense.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadValue {
    /// The field, so that the message can point at it.
    pub field: String,
    /// What is wrong.
    pub message: String,
}

impl From<topipe_progress::Interrupted> for StageError {
    fn from(_: topipe_progress::Interrupted) -> Self {
        Self::Interrupted
    }
}

/// Joins an error and its causes into one line, leaving out causes that the text before already quotes.
pub fn with_causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        let cause_text = cause.to_string();
        if !text.contains(&cause_text) {
            text = format!("{text}: {cause_text}");
        }
        source = cause.source();
    }
    text
}

/// What a running stage is given besides its parameters.
pub struct StageContext<'a> {
    pub(crate) inputs: BTreeMap<&'static str, Value>,
    pub(crate) files: BTreeMap<String, SourceFile>,
    pub(crate) progress: &'a Progress,
    pub(crate) units: Units,
}

impl StageContext<'_> {
    /// The artifact at a required port.
    pub fn input<K: ArtifactKind>(&self, port: &str) -> Result<Arc<K::Value>, StageError> {
        self.optional_input::<K>(port)?.ok_or_else(|| {
            StageError::Failed(format!("the stage asked for `{port}`, which is not connected"))
        })
    }

    /// The artifact at an optional port.
    pub fn optional_input<K: ArtifactKind>(&self, port: &str) -> Result<Option<Arc<K::Value>>, StageError> {
        let Some(value) = self.inputs.get(port) else { return Ok(None) };
        match Arc::clone(value).downcast::<K::Value>() {
            Ok(value) => Ok(Some(value)),
            Err(_) => Err(StageError::Failed(format!(
                "the stage asked for `{port}` as a {}, which it is not",
                K::NAME
            ))),
        }
    }

    /// The file named in a field: by the name of the field, or by one of the pointers of [`Stage::nested_files`].
    pub fn file(&self, field: &str) -> Option<&SourceFile> {
        self.files.get(field)
    }

    /// Where to report progress and ask for interruption.
    pub fn progress(&self) -> &Progress {
        self.progress
    }

    /// Where finished parts of the result are kept, and those of earlier runs are found: the runs of this kind of
    /// stage with this version of its code, whatever their inputs and parameters. A part is found by its own key
    /// alone, which must cover all it depends on; see [`UnitKey`]. Once `put` returns, the part survives a kill. A stage
    /// that is run by force finds none.
    pub fn units(&self) -> &Units {
        &self.units
    }
}

/// Parts that a stage is going to need.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NeededUnits {
    /// What they are, in the plural: "patches".
    pub what: String,
    /// Their keys.
    pub keys: Vec<UnitKey>,
}

/// One kind of stage. Implementations are thin: the work is done by a library that knows nothing of the engine.
pub trait Stage: Send + Sync + 'static {
    /// Its parameters. Unknown fields must be denied and every field must have a default.
    type Parameters: Serialize + DeserializeOwned + JsonSchema + Default + Send + Sync + 'static;
    /// What it makes.
    type Output: ArtifactKind;
    /// The name after `kind =`.
    const KIND: &'static str;
    /// One sentence for people.
    const SUMMARY: &'static str;

    /// Identifies the code: it must change whenever the same input may give another result.
    fn code_version(&self) -> String;
    /// The fields that name other stages.
    fn inputs(&self) -> Vec<InputPort>;
    /// The fields that name files.
    fn files(&self) -> Vec<FileField> {
        Vec::new()
    }
    /// Where `parameters`, written as JSON, name further files: JSON pointers to strings. These files are read and
    /// hashed like those of [`Self::files`]; what they are called has no part in the key.
    fn nested_files(&self, parameters: &Self::Parameters) -> Vec<String> {
        let _ = parameters;
        Vec::new()
    }
    /// Checks what can be checked of the parameters without the inputs, before anything runs.
    fn check(&self, parameters: &Self::Parameters) -> Result<(), BadValue> {
        let _ = parameters;
        Ok(())
    }
    /// Computes the result. Must depend on nothing but its arguments.
    fn run(
        &self,
        context: &StageContext<'_>,
        parameters: &Self::Parameters,
    ) -> Result<<Self::Output as ArtifactKind>::Value, StageError>;
    /// Whether [`Self::needed_units`] has anything to say.
    const NAMES_UNITS: bool = false;
    /// The parts that [`Self::run`] would ask [`StageContext::units`] for, as far as they can be named without
    /// computing any. `plan` calls it for a stage that must run and whose inputs are known, to say how many of them are
    /// there already; so it should take a small part of the time of a run. It decides nothing.
    fn needed_units(
        &self,
        context: &StageContext<'_>,
        parameters: &Self::Parameters,
    ) -> Result<Vec<NeededUnits>, StageError> {
        let _ = (context, parameters);
        Ok(Vec::new())
    }
}

/// Parameters of a stage with all defaults filled in.
#[derive(Clone)]
pub struct ResolvedParameters {
    /// As JSON, for records.
    pub json: serde_json::Value,
    /// As JSON without the names of files, for keys and reasons.
    pub(crate) essence: serde_json::Value,
    /// JSON pointers to the names of files.
    pub(crate) nested_files: Vec<String>,
    typed: Arc<dyn Any + Send + Sync>,
}

impl ResolvedParameters {
    /// The same parameters always give the same text: fields sorted by name, numbers in their shortest form.
    pub(crate) fn canonical(&self) -> String {
        canonical_json(&self.essence)
    }
}

/// JSON text with the fields of objects sorted by name.
fn canonical_json(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Object(fields) => {
            let sorted: BTreeMap<&String, &serde_json::Value> = fields.iter().collect();
            let fields: Vec<String> = sorted
                .into_iter()
                .map(|(name, value)| {
                    format!("{}:{}", serde_json::Value::String(name.clone()), canonical_json(value))
                })
                .collect();
            format!("{{{}}}", fields.join(","))
        }
        serde_json::Value::Array(items) => {
            format!("[{}]", items.iter().map(canonical_json).collect::<Vec<_>>().join(","))
        }
        other => other.to_string(),
    }
}

/// A [`Stage`] with its types erased.
pub trait AnyStage: Send + Sync {
    /// The name after `kind =`.
    fn kind(&self) -> &'static str;
    /// One sentence for people.
    fn summary(&self) -> &'static str;
    /// Identifies the code.
    fn code_version(&self) -> String;
    /// What it makes.
    fn output(&self) -> ArtifactType;
    /// The fields that name other stages.
    fn inputs(&self) -> Vec<InputPort>;
    /// The fields that name files.
    fn files(&self) -> Vec<FileField>;
    /// The JSON schema of the parameters.
    fn schema(&self, generator: &mut SchemaGenerator) -> Schema;
    /// All parameters at their defaults.
    fn default_parameters(&self) -> serde_json::Value;
    /// Checks and completes a table of parameters.
    fn parse(&self, table: toml::de::Deserializer<'_>) -> Result<ResolvedParameters, toml::de::Error>;
    /// Checks the values of parameters.
    fn check(&self, parameters: &ResolvedParameters) -> Result<(), BadValue>;
    /// Runs the stage.
    fn run(&self, context: &StageContext<'_>, parameters: &ResolvedParameters) -> Result<Value, StageError>;
    /// The names of all fields it may have in a spec, but `kind`.
    fn field_names(&self) -> &[String];
    /// Whether it can name the parts it needs.
    fn names_units(&self) -> bool;
    /// The parts a run would need.
    fn needed_units(
        &self,
        context: &StageContext<'_>,
        parameters: &ResolvedParameters,
    ) -> Result<Vec<NeededUnits>, StageError>;
}

/// Erases the types of a [`Stage`].
pub(crate) struct Erased<S: Stage> {
    stage: S,
    field_names: OnceLock<Vec<String>>,
}

impl<S: Stage> Erased<S> {
    pub(crate) fn new(stage: S) -> Self {
        Self { stage, field_names: OnceLock::new() }
    }
}

impl<S: Stage> AnyStage for Erased<S> {
    fn kind(&self) -> &'static str {
        S::KIND
    }

    fn summary(&self) -> &'static str {
        S::SUMMARY
    }

    fn code_version(&self) -> String {
        self.stage.code_version()
    }

    fn output(&self) -> ArtifactType {
        ArtifactType::of::<S::Output>()
    }

    fn inputs(&self) -> Vec<InputPort> {
        self.stage.inputs()
    }

    fn files(&self) -> Vec<FileField> {
        self.stage.files()
    }

    fn schema(&self, generator: &mut SchemaGenerator) -> Schema {
        S::Parameters::json_schema(generator)
    }

    fn default_parameters(&self) -> serde_json::Value {
        // Parameters are plain data; where one cannot be written as JSON, `parse` reports it.
        serde_json::to_value(S::Parameters::default()).unwrap_or_default()
    }

    fn parse(&self, table: toml::de::Deserializer<'_>) -> Result<ResolvedParameters, toml::de::Error> {
        let typed = <S::Parameters as serde::Deserialize>::deserialize(table)?;
        let json = serde_json::to_value(&typed).map_err(serde::de::Error::custom)?;
        let nested_files = self.stage.nested_files(&typed);
        let mut essence = json.clone();
        for pointer in &nested_files {
            if let Some(name) = essence.pointer_mut(pointer) {
                *name = serde_json::Value::Null;
            }
        }
        Ok(ResolvedParameters { json, essence, nested_files, typed: Arc::new(typed) })
    }

    fn check(&self, parameters: &ResolvedParameters) -> Result<(), BadValue> {
        // Parameters of another kind are refused by `run`.
        parameters.typed.downcast_ref::<S::Parameters>().map_or(Ok(()), |typed| self.stage.check(typed))
    }

    fn run(&self, context: &StageContext<'_>, parameters: &ResolvedParameters) -> Result<Value, StageError> {
        self.stage.run(context, typed::<S>(parameters)?).map(|value| Arc::new(value) as Value)
    }

    fn field_names(&self) -> &[String] {
        self.field_names.get_or_init(|| crate::schema::field_names(self))
    }

    fn names_units(&self) -> bool {
        S::NAMES_UNITS
    }

    fn needed_units(
        &self,
        context: &StageContext<'_>,
        parameters: &ResolvedParameters,
    ) -> Result<Vec<NeededUnits>, StageError> {
        self.stage.needed_units(context, typed::<S>(parameters)?)
    }
}

fn typed<S: Stage>(parameters: &ResolvedParameters) -> Result<&S::Parameters, StageError> {
    parameters
        .typed
        .downcast_ref()
        .ok_or_else(|| StageError::Failed("the parameters belong to another kind of stage".into()))
}

/// The key of a run of `stage`: equal for equal work, whatever the paths, the time, the machine and the number of
/// threads. `inputs` are the content hashes at the connected ports, `files` the ending of each file's name, which
/// selects its reader, and the hash of its content.
pub fn stage_key(
    stage: &dyn AnyStage,
    parameters: &ResolvedParameters,
    inputs: &BTreeMap<&'static str, ContentHash>,
    files: &BTreeMap<String, (String, ContentHash)>,
) -> ContentHash {
    KeyParts {
        kind: stage.kind(),
        code_version: &stage.code_version(),
        output: stage.output(),
        parameters,
        inputs,
        files,
    }
    .key()
}

/// Everything the key of a stage run is made of.
pub(crate) struct KeyParts<'a> {
    pub(crate) kind: &'a str,
    pub(crate) code_version: &'a str,
    pub(crate) output: ArtifactType,
    pub(crate) parameters: &'a ResolvedParameters,
    /// Port name and content hash, for the ports that are connected.
    pub(crate) inputs: &'a BTreeMap<&'static str, ContentHash>,
    /// Field name, ending of the file's name (it selects the parser) and content hash.
    pub(crate) files: &'a BTreeMap<String, (String, ContentHash)>,
}

impl KeyParts<'_> {
    /// The key: equal for equal work, whatever the paths, the time, the machine and the number of threads.
    pub(crate) fn key(&self) -> ContentHash {
        let mut hasher = crate::hash::FieldHasher::new("topipe stage key 1");
        hasher.text(self.kind).text(self.code_version);
        hasher.text(self.output.name).text(&self.output.version.to_string());
        hasher.text(&self.parameters.canonical());
        hasher.text(&self.inputs.len().to_string());
        for (port, hash) in self.inputs {
            hasher.text(port).bytes(hash.as_bytes());
        }
        hasher.text(&self.files.len().to_string());
        for (field, (ending, hash)) in self.files {
            hasher.text(field).text(ending).bytes(hash.as_bytes());
        }
        hasher.finish()
    }
}
