//! Stages that handle text, and a workshop to run them in.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use topipe_engine::{
    ArtifactKind, BadValue, Cache, Choice, Event, ExitCode, Exporter, FileField, InputPort, Interrupt,
    Override, Pipeline, Plan, Registry, RunOptions, RunRecord, Stage, StageContext, StageError, plan, run,
};

pub(crate) struct Text;
impl ArtifactKind for Text {
    type Value = String;
    const NAME: &'static str = "text";
    const VERSION: u32 = 1;
}

pub(crate) struct Number;
impl ArtifactKind for Number {
    type Value = u64;
    const NAME: &'static str = "number";
    const VERSION: u32 = 1;
}

/// Reads a file.
pub(crate) struct Read;
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct ReadParameters {
    /// Whether to trim white space.
    pub trim: bool,
    /// Further files.
    pub more: Vec<Named>,
}
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Named {
    pub path: String,
}
impl Stage for Read {
    type Parameters = ReadParameters;
    type Output = Text;
    const KIND: &'static str = "read";
    const SUMMARY: &'static str = "Reads a file.";
    fn code_version(&self) -> String {
        "1".into()
    }
    fn inputs(&self) -> Vec<InputPort> {
        Vec::new()
    }
    fn files(&self) -> Vec<FileField> {
        vec![
            FileField { name: "path", optional: false, doc: "The file." },
            FileField { name: "header", optional: true, doc: "What stands before it." },
        ]
    }
    fn nested_files(&self, parameters: &ReadParameters) -> Vec<String> {
        (0..parameters.more.len()).map(|k| format!("/more/{k}/path")).collect()
    }
    fn run(&self, context: &StageContext<'_>, parameters: &ReadParameters) -> Result<String, StageError> {
        let fields =
            ["header".to_owned(), "path".to_owned()].into_iter().chain(self.nested_files(parameters));
        let mut text = String::new();
        for file in fields.filter_map(|field| context.file(&field).cloned()) {
            text += std::str::from_utf8(&file.bytes)
                .map_err(|_| StageError::Refused(format!("{} is not text", file.name)))?;
        }
        Ok(if parameters.trim { text.trim().to_owned() } else { text })
    }
}

/// Adds to a text.
pub(crate) struct Append;
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct AppendParameters {
    /// What is added.
    pub suffix: String,
    /// How often.
    pub times: u32,
    /// Style of the result.
    pub style: Style,
    /// Unused by the computation.
    pub weight: f64,
}
#[derive(Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Style {
    #[default]
    AsIs,
    Upper,
}
impl Default for AppendParameters {
    fn default() -> Self {
        Self { suffix: "!".into(), times: 1, style: Style::AsIs, weight: 0.5 }
    }
}
impl Stage for Append {
    type Parameters = AppendParameters;
    type Output = Text;
    const KIND: &'static str = "append";
    const SUMMARY: &'static str = "Adds to a text.";
    fn code_version(&self) -> String {
        "1".into()
    }
    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Text>("input", "The text.")]
    }
    fn check(&self, parameters: &AppendParameters) -> Result<(), BadValue> {
        if parameters.times <= 100 {
            return Ok(());
        }
        Err(BadValue {
            field: "times".into(),
            message: format!("`times` is {}, at most 100 is allowed", parameters.times),
        })
    }
    fn run(&self, context: &StageContext<'_>, parameters: &AppendParameters) -> Result<String, StageError> {
        context.progress().remark("appending");
        let text = context.input::<Text>("input")?.to_string()
            + &parameters.suffix.repeat(parameters.times as usize);
        Ok(match parameters.style {
            Style::AsIs => text,
            Style::Upper => text.to_uppercase(),
        })
    }
}

/// Counts characters.
pub(crate) struct Count;
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct NoParameters {}
impl Stage for Count {
    type Parameters = NoParameters;
    type Output = Number;
    const KIND: &'static str = "count";
    const SUMMARY: &'static str = "Counts characters.";
    fn code_version(&self) -> String {
        "1".into()
    }
    fn inputs(&self) -> Vec<InputPort> {
        vec![
            InputPort::required::<Text>("input", "The text."),
            InputPort::optional::<Text>("other", "Another text."),
        ]
    }
    fn run(&self, context: &StageContext<'_>, _: &NoParameters) -> Result<u64, StageError> {
        let other = context.optional_input::<Text>("other")?.map_or(0, |text| text.len());
        Ok((context.input::<Text>("input")?.len() + other) as u64)
    }
}

/// Does not go well.
pub(crate) struct Trouble;
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct TroubleParameters {
    /// What happens.
    pub how: String,
}
impl Default for TroubleParameters {
    fn default() -> Self {
        Self { how: "fail".into() }
    }
}
impl Stage for Trouble {
    type Parameters = TroubleParameters;
    type Output = Text;
    const KIND: &'static str = "trouble";
    const SUMMARY: &'static str = "Does not go well.";
    fn code_version(&self) -> String {
        "1".into()
    }
    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Text>("input", "The text.")]
    }
    fn run(&self, context: &StageContext<'_>, parameters: &TroubleParameters) -> Result<String, StageError> {
        match parameters.how.as_str() {
            "panic" => panic!("out of range"),
            "refuse" => Err(StageError::Refused("not this text".into())),
            "parameter" => Err(StageError::BadParameter("how: too much".into())),
            "wait" => loop {
                context.progress().check()?;
                std::thread::sleep(std::time::Duration::from_millis(1));
            },
            "fine" => Ok("fine".into()),
            _ => Err(StageError::Failed("did not converge".into())),
        }
    }
}

/// Counts how often it is run, over all threads of a test, and takes its time.
pub(crate) struct Slow(pub Arc<AtomicUsize>);
impl Stage for Slow {
    type Parameters = NoParameters;
    type Output = Text;
    const KIND: &'static str = "slow";
    const SUMMARY: &'static str = "Takes its time.";
    fn code_version(&self) -> String {
        "1".into()
    }
    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Text>("input", "The text.")]
    }
    fn run(&self, context: &StageContext<'_>, _: &NoParameters) -> Result<String, StageError> {
        self.0.fetch_add(1, Ordering::SeqCst);
        std::thread::sleep(std::time::Duration::from_millis(50));
        Ok(context.input::<Text>("input")?.to_string() + " slowly")
    }
}

pub(crate) fn registry() -> Registry {
    Registry::new()
        .with_stage(Read)
        .with_stage(Append)
        .with_stage(Count)
        .with_stage(Trouble)
        .with_exporter(Exporter::new::<Text>(
            "txt",
            "1",
            |text, _, file| Ok(file.write_all(text.as_bytes())?),
        ))
        .with_exporter(Exporter::new::<Text>("md", "1", |text, title, file| {
            Ok(write!(file, "# {title}\n{text}")?)
        }))
        .with_exporter(Exporter::new::<Number>("json", "1", |number, _, file| Ok(write!(file, "{number}")?)))
}

/// read -> trim -> shout -> count, and exports of the last two.
pub(crate) const CHAIN: &str = r#"
name = "chain"

[stage.read]
kind = "read"
path = "in.txt"

[stage.soft]
kind = "append"
input = "read"
suffix = "."

[stage.loud]
kind = "append"
input = "soft"

[stage.size]
kind = "count"
input = "loud"

[export]
"loud.txt" = "loud"
"size.json" = "size"
"#;

/// A folder with a pipeline, its input and its cache.
pub(crate) struct Workshop {
    pub folder: tempfile::TempDir,
    pub registry: Registry,
    pub options: RunOptions,
    pub interrupt: Interrupt,
}

impl Workshop {
    pub(crate) fn new(spec: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let options = RunOptions::new(folder.path().join("out"));
        let shop = Self { folder, registry: registry(), options, interrupt: Interrupt::new() };
        shop.write("in.txt", "hello");
        shop.write("p.toml", spec);
        shop
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub(crate) fn out(&self, name: &str) -> String {
        std::fs::read_to_string(self.options.out.join(name)).unwrap()
    }

    pub(crate) fn edit(&self, old: &str, new: &str) {
        let text = std::fs::read_to_string(self.path("p.toml")).unwrap();
        assert!(text.contains(old), "{old} is not in {text}");
        self.write("p.toml", &text.replace(old, new));
    }

    pub(crate) fn cache(&self) -> Cache {
        Cache::new(self.path("cache"))
    }

    pub(crate) fn pipeline(&self, sets: &[&str]) -> Pipeline {
        let overrides: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
        match Pipeline::load(&self.path("p.toml"), &overrides, &self.registry) {
            Ok(pipeline) => pipeline,
            Err(error) => panic!("{error}"),
        }
    }

    pub(crate) fn plan(&self, choice: &Choice) -> Plan {
        plan(&self.pipeline(&[]), &self.cache(), choice).unwrap()
    }

    /// Runs and returns the record and the log, one line for each event.
    pub(crate) fn run(&self) -> (RunRecord, Vec<String>) {
        self.run_with(&[], &self.options)
    }

    pub(crate) fn run_with(&self, sets: &[&str], options: &RunOptions) -> (RunRecord, Vec<String>) {
        let log = Arc::new(Mutex::new(Vec::new()));
        let into = Arc::clone(&log);
        let sink = Arc::new(move |event: &Event| into.lock().unwrap().push(line(event)));
        let record = run(&self.pipeline(sets), &self.cache(), options, &self.interrupt, sink).unwrap();
        let lines = log.lock().unwrap().clone();
        (record, lines)
    }

    /// Runs well and returns the log without its first and last line.
    pub(crate) fn log(&self) -> Vec<String> {
        self.log_with(&[])
    }

    pub(crate) fn log_with(&self, sets: &[&str]) -> Vec<String> {
        let (record, mut lines) = self.run_with(sets, &self.options);
        assert_eq!(record.code, ExitCode::Done, "{lines:#?}");
        assert_eq!(lines.pop().as_deref(), Some("done"));
        lines.remove(0);
        lines
    }
}

/// An event without hashes and times.
pub(crate) fn line(event: &Event) -> String {
    match event {
        Event::RunStarted { pipeline, stages, .. } => format!("run {pipeline}: {}", stages.join(" ")),
        Event::StageCached { stage, .. } => format!("{stage} cached"),
        Event::StageWaiting { stage, .. } => format!("{stage} waits"),
        Event::StageStarted { stage, reasons, .. } => {
            let reasons: Vec<String> = reasons.iter().map(ToString::to_string).collect();
            format!("{stage} starts: {}", reasons.join("; "))
        }
        Event::StageProgress { stage, .. } => format!("{stage} progresses"),
        Event::StageRemark { stage, text } => format!("{stage} remarks: {text}"),
        Event::StageFinished { stage, .. } => format!("{stage} finished"),
        Event::StageFailed { stage, message, code } => {
            format!("{stage} failed ({}): {message}", code.number())
        }
        Event::StageSkipped { stage, because } => format!("{stage} skipped: {because}"),
        Event::Quarantined { path, reason, .. } => {
            let bucket = path.components().rev().nth(2).unwrap().as_os_str().to_string_lossy().into_owned();
            format!("quarantined from {bucket}: {reason}")
        }
        Event::ExportWritten { file, .. } => format!("{file} written"),
        Event::ExportUpToDate { file, .. } => format!("{file} up to date"),
        Event::ExportFailed { file, message, code, .. } => {
            format!("{file} failed ({}): {message}", code.number())
        }
        Event::RunFinished { code, .. } => format!("{code:?}").to_lowercase(),
        other => format!("{other:?}"),
    }
}
