//! Stages that handle text, and a workshop to run them in.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use topipe_engine::{
    ArtifactKind, BadValue, Cache, Choice, Event, ExitCode, Exporter, FileField, InputPort, Interrupt,
    NeededUnits, Override, Pipeline, Plan, Registry, RunOptions, RunRecord, Stage, StageContext, StageError,
    plan, run,
};
use topipe_progress::UnitKey;

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
        if parameters.times == 0 {
            context.progress().warn("nothing is appended");
        }
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

/// Writes each word of a text in capitals, and keeps each word as it is done.
#[derive(Default)]
pub(crate) struct Shout {
    /// Goes no further after so many words: hangs until the process is killed, or until it is interrupted.
    pub hang_after: Option<usize>,
}
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct ShoutParameters {
    /// What stands between words. No word depends on it.
    pub between: String,
    /// What follows each word.
    pub mark: String,
}
impl Default for ShoutParameters {
    fn default() -> Self {
        Self { between: " ".into(), mark: String::new() }
    }
}
impl Stage for Shout {
    type Parameters = ShoutParameters;
    type Output = Text;
    const KIND: &'static str = "shout";
    const SUMMARY: &'static str = "Writes each word in capitals.";
    const NAMES_UNITS: bool = true;
    fn code_version(&self) -> String {
        "1".into()
    }
    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Text>("input", "The text.")]
    }
    fn needed_units(
        &self,
        context: &StageContext<'_>,
        parameters: &ShoutParameters,
    ) -> Result<Vec<NeededUnits>, StageError> {
        let text = context.input::<Text>("input")?;
        let key = |word: &str| {
            UnitKey::of("word").bytes(word.as_bytes()).bytes(parameters.mark.as_bytes()).finish()
        };
        Ok(vec![NeededUnits { what: "words".into(), keys: text.split_whitespace().map(key).collect() }])
    }
    fn run(&self, context: &StageContext<'_>, parameters: &ShoutParameters) -> Result<String, StageError> {
        let text = context.input::<Text>("input")?;
        let keys = self.needed_units(context, parameters)?.remove(0).keys;
        context.units().announce("words", &keys);
        let (mut words, mut made) = (Vec::new(), 0);
        for (word, key) in text.split_whitespace().zip(keys) {
            if let Some(kept) = context.units().get(key) {
                words.push(String::from_utf8(kept).map_err(|error| StageError::Failed(error.to_string()))?);
                continue;
            }
            if Some(made) == self.hang_after {
                context.progress().step(made as u64, 0, "hangs");
                loop {
                    context.progress().check()?;
                    std::thread::sleep(std::time::Duration::from_millis(1));
                }
            }
            made += 1;
            let word = word.to_uppercase() + &parameters.mark;
            if made <= 10 {
                context.progress().remark(&word);
            }
            context.units().put(key, word.as_bytes());
            words.push(word);
        }
        Ok(words.join(&parameters.between))
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
    folder: PathBuf,
    /// Deletes the folder in the end, if it is ours.
    _owned: Option<tempfile::TempDir>,
    pub registry: Registry,
    /// Its cache, in the folder if relative.
    pub cache_folder: PathBuf,
    /// The file of the pipeline.
    pub spec: String,
    pub options: RunOptions,
    pub interrupt: Interrupt,
}

impl Workshop {
    pub(crate) fn new(spec: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut shop = Self::at(folder.path().to_owned());
        shop._owned = Some(folder);
        shop.write("in.txt", "hello");
        shop.write("p.toml", spec);
        shop
    }

    /// The workshop that another process has made.
    pub(crate) fn at(folder: PathBuf) -> Self {
        let options = RunOptions::new(folder.join("out"));
        Self {
            folder,
            _owned: None,
            registry: registry(),
            cache_folder: "cache".into(),
            spec: "p.toml".into(),
            options,
            interrupt: Interrupt::new(),
        }
    }

    pub(crate) fn folder(&self) -> &std::path::Path {
        &self.folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
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
        Cache::new(self.folder.join(&self.cache_folder))
    }

    pub(crate) fn pipeline(&self, sets: &[&str]) -> Pipeline {
        let overrides: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
        match Pipeline::load(&self.path(&self.spec), &overrides, &self.registry) {
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

    /// Runs no further than to this stage.
    pub(crate) fn run_until(&self, stage: &str) -> (RunRecord, Vec<String>) {
        let mut options = self.options.clone();
        options.choice.until = vec![stage.into()];
        self.run_with(&[], &options)
    }

    pub(crate) fn run_with(&self, sets: &[&str], options: &RunOptions) -> (RunRecord, Vec<String>) {
        self.run_watched(sets, options, |_| {})
    }

    /// Runs and tells `watch` of each line as it comes.
    pub(crate) fn run_and(&self, watch: impl Fn(&str) + Send + Sync + 'static) -> (RunRecord, Vec<String>) {
        self.run_watched(&[], &self.options, watch)
    }

    fn run_watched(
        &self,
        sets: &[&str],
        options: &RunOptions,
        watch: impl Fn(&str) + Send + Sync + 'static,
    ) -> (RunRecord, Vec<String>) {
        let log = Arc::new(Mutex::new(Vec::new()));
        let into = Arc::clone(&log);
        let sink = Arc::new(move |event: &Event| {
            let line = line(event);
            watch(&line);
            into.lock().unwrap().push(line);
        });
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
        Event::StageCached { stage, warnings, .. } if !warnings.is_empty() => {
            format!("{stage} cached, warns: {}", warnings.join("; "))
        }
        Event::StageCached { stage, .. } => format!("{stage} cached"),
        Event::StageWaiting { stage, .. } => format!("{stage} waits"),
        Event::StageStarted { stage, reasons, .. } => {
            let reasons: Vec<String> = reasons.iter().map(ToString::to_string).collect();
            format!("{stage} starts: {}", reasons.join("; "))
        }
        Event::StageProgress { stage, .. } => format!("{stage} progresses"),
        Event::StageWarning { stage, text } => format!("{stage} warns: {text}"),
        Event::StageRemark { stage, text } => format!("{stage} remarks: {text}"),
        Event::StageUnits { stage, reused, computed } => {
            format!("{stage} units: {reused} reused, {computed} computed")
        }
        Event::UnitsNotKept { stage, message } => format!("{stage} parts not kept: {message}"),
        Event::RecordNotWritten { message } => format!("record not written: {message}"),
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
