//! Writing artifacts into the output folder, and leaving alone what is there already.

use super::executor::{Executor, lock};
use super::failure::Failure;
use super::{ExportOutcome, ExportRecord};
use crate::artifact::Value;
use crate::cache::{Bucket, CacheError, Durability, Temporary};
use crate::error::ExitCode;
use crate::event::Event;
use crate::hash::ContentHash;
use crate::input_file::{FileMemo, hash_with_memo};
use crate::registry::ExportError;
use crate::spec::{ExportNode, Pipeline};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{BufWriter, Write};
use std::panic::AssertUnwindSafe;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// What was last written into an output folder, by file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct Written(BTreeMap<String, WrittenFile>);

/// Whether a run writes an export if its stage has a result.
pub(super) fn writes_of(executor: &Executor<'_>, export: &ExportNode) -> bool {
    !export.exporter.after_run && executor.is_selected(export.stage)
}

/// One file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct WrittenFile {
    artifact: ContentHash,
    writer: String,
    content: ContentHash,
    bytes: u64,
    memo: Option<FileMemo>,
}

/// Removes what dead processes have left in the folders of the exports.
pub(super) fn sweep(pipeline: &Pipeline, out: &Path) {
    let mut folders: Vec<PathBuf> = vec![out.to_owned()];
    folders.extend(
        pipeline.exports.iter().filter_map(|export| Some(out.join(&export.file).parent()?.to_owned())),
    );
    folders.sort();
    folders.dedup();
    folders.iter().for_each(|folder| crate::cache::sweep(folder));
}

/// What became of one export.
enum Done {
    /// Its stage has no result.
    Skipped,
    /// It was not begun before the run was interrupted.
    Interrupted,
    UpToDate(WrittenFile),
    Finished(Result<WrittenFile, Failure>),
}

/// Exports that are finished, and what has been said about them: in the order of the spec, whichever is finished first.
struct Told<'a> {
    executor: &'a Executor<'a>,
    finished: Vec<Option<Done>>,
    /// How many of the first ones have been told.
    count: usize,
    records: Vec<ExportRecord>,
    written: Written,
}

impl Told<'_> {
    /// Takes what became of export `at`, and tells of all that come before the next unfinished one.
    fn finish(&mut self, at: usize, done: Done, exports: &[(usize, &ExportNode)]) {
        self.finished[at] = Some(done);
        while let Some(done) = self.finished.get_mut(self.count).and_then(Option::take) {
            self.tell(exports[self.count].1, done);
            self.count += 1;
        }
    }

    fn tell(&mut self, export: &ExportNode, done: Done) {
        let executor = self.executor;
        let stage = executor.pipeline().stages[export.stage].name.clone();
        let file = export.file.clone();
        match done {
            Done::Interrupted => {}
            Done::Skipped => self.records.push(record(executor, export, ExportOutcome::Skipped, None)),
            Done::UpToDate(known) => {
                executor.events.emit(&Event::ExportUpToDate { file, stage });
                self.records.push(record(executor, export, ExportOutcome::UpToDate, Some(&known)));
                self.written.0.insert(export.file.clone(), known);
            }
            Done::Finished(Ok(new)) => {
                executor.events.emit(&Event::ExportWritten { file, stage, bytes: new.bytes });
                self.records.push(record(executor, export, ExportOutcome::Written, Some(&new)));
                self.written.0.insert(export.file.clone(), new);
            }
            Done::Finished(Err(Failure { message, code })) => {
                executor.events.emit(&Event::ExportFailed { file, stage, message: message.clone(), code });
                let outcome = ExportOutcome::Failed { message, code };
                self.records.push(record(executor, export, outcome, None));
                self.written.0.remove(&export.file);
            }
        }
    }
}

/// Writes the exports of the stages that have a result, as many at once as stages run at once.
pub(super) fn write_all(executor: &Executor<'_>) -> Vec<ExportRecord> {
    let out = &executor.options.out;
    let name = std::path::absolute(out).unwrap_or_else(|_| out.clone()).to_string_lossy().into_owned();
    let before: Written = executor.cache().read_record(Bucket::Exports, &name).unwrap_or_default();
    let all = executor.pipeline().exports.iter().enumerate();
    let exports: Vec<(usize, &ExportNode)> = all.filter(|(_, export)| writes_of(executor, export)).collect();
    let told = Mutex::new(Told {
        executor,
        finished: exports.iter().map(|_| None).collect(),
        count: 0,
        records: Vec::new(),
        written: before.clone(),
    });
    let next = AtomicUsize::new(0);
    let work = || {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(&(place, export)) = exports.get(at) else { break };
            let done = attend(executor, place, export, &before);
            lock(&told).finish(at, done, &exports);
        }
    };
    // Threads of their own and no work that others may steal: a thread that waits for a writer's parallel part would take up
    // another export, and wait for an artifact that it is itself about to load.
    std::thread::scope(|scope| {
        for _ in 1..executor.options.jobs.clamp(1, exports.len().max(1)) {
            scope.spawn(work);
        }
        work();
    });
    let Told { records, written, .. } = told.into_inner().unwrap_or_else(PoisonError::into_inner);
    if written != before
        && let Err(error) = executor.cache().write_record(Bucket::Exports, &name, &written)
    {
        tracing::warn!("exports will be written again by the next run: {error}");
    }
    records
}

/// Writes one export, unless nothing needs it.
fn attend(executor: &Executor<'_>, place: usize, export: &ExportNode, before: &Written) -> Done {
    if executor.interrupt.is_raised() {
        return Done::Interrupted;
    }
    let Some(artifact) = executor.artifact(export.stage) else { return Done::Skipped };
    let path = executor.options.out.join(&export.file);
    if let Some(mut known) = before.0.get(&export.file).cloned()
        && is_up_to_date(&mut known, &path, artifact, export)
    {
        return Done::UpToDate(known);
    }
    Done::Finished(write(executor, place, artifact, &path))
}

fn record(
    executor: &Executor<'_>,
    export: &ExportNode,
    outcome: ExportOutcome,
    written: Option<&WrittenFile>,
) -> ExportRecord {
    ExportRecord {
        file: export.file.clone(),
        stage: executor.pipeline().stages[export.stage].name.clone(),
        outcome,
        hash: written.map(|written| written.content),
        bytes: written.map(|written| written.bytes),
    }
}

/// Whether the file holds this artifact as this writer writes it, unchanged since.
fn is_up_to_date(known: &mut WrittenFile, path: &Path, artifact: ContentHash, export: &ExportNode) -> bool {
    if known.artifact != artifact || known.writer != export.exporter.code_version {
        return false;
    }
    match hash_with_memo(path, known.memo.as_ref()) {
        Ok((hash, memo)) => {
            known.memo = Some(memo);
            hash == known.content
        }
        Err(_) => false,
    }
}

fn write(
    executor: &Executor<'_>,
    place: usize,
    artifact: ContentHash,
    path: &Path,
) -> Result<WrittenFile, Failure> {
    let export = &executor.pipeline().exports[place];
    let fail = |error| Failure::from(CacheError::io("write", path, error));
    let in_memory = lock(&executor.values[export.stage]).clone();
    let (temporary, content, bytes) = match executor.ahead.take(place, in_memory.as_ref()) {
        Some(composed) => {
            let mut temporary = Temporary::beside(path).map_err(fail)?;
            composed.pieces.iter().try_for_each(|piece| temporary.write_all(piece)).map_err(fail)?;
            (temporary, composed.content, composed.bytes)
        }
        None => {
            let value = executor.obtain(export.stage)?;
            let temporary = Temporary::beside(path).map_err(fail)?;
            let written = compose(export, &value, temporary).map_err(|unwritten| match unwritten {
                Unwritten::Io(error) => fail(error),
                Unwritten::Failed(failure) => failure,
            })?;
            let content = ContentHash::from_bytes(*written.hasher.finalize().as_bytes());
            (written.to, content, written.bytes)
        }
    };
    temporary.persist(path, Durability::Flushed).map_err(fail)?;
    crate::failpoint::pass("export written");
    let writer = export.exporter.code_version.clone();
    Ok(WrittenFile { artifact, writer, content, bytes, memo: None })
}

/// Why an export is not there.
pub(super) enum Unwritten {
    /// It could not be written where it should go.
    Io(std::io::Error),
    /// It could not be composed.
    Failed(Failure),
}

/// Lets the writer of an export write it to `to`.
pub(super) fn compose<W: Write>(export: &ExportNode, value: &Value, to: W) -> Result<Hashing<W>, Unwritten> {
    let file = Path::new(&export.file).file_name();
    let name = file.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    // The ending was found without regard to case; its dot comes before it.
    let title = name.get(..name.len().saturating_sub(export.exporter.ending.len() + 1)).unwrap_or(&name);
    // Hashed and written in blocks: many hashes at once are several times faster than one small piece after the other.
    let hashing = Hashing { to, hasher: blake3::Hasher::new(), bytes: 0 };
    let mut file = BufWriter::with_capacity(BLOCK, hashing);
    let result =
        std::panic::catch_unwind(AssertUnwindSafe(|| export.exporter.write(value, title, &mut file)));
    match result {
        Ok(Ok(())) => file.into_inner().map_err(|error| Unwritten::Io(error.into_error())),
        Ok(Err(ExportError::Io(error))) => Err(Unwritten::Io(error)),
        Ok(Err(error)) => {
            Err(Unwritten::Failed(Failure { message: error.to_string(), code: ExitCode::Refused }))
        }
        Err(_) => {
            let message = format!(
                "the writer of .{} files panicked, which is a defect of topipe",
                export.exporter.ending
            );
            Err(Unwritten::Failed(Failure { message, code: ExitCode::StageFailed }))
        }
    }
}

/// Bytes that are hashed and written together.
const BLOCK: usize = 1 << 17;

/// Hashes what passes through on its way.
pub(super) struct Hashing<W: Write> {
    pub(super) to: W,
    pub(super) hasher: blake3::Hasher,
    pub(super) bytes: u64,
}

impl<W: Write> Write for Hashing<W> {
    fn write(&mut self, buffer: &[u8]) -> std::io::Result<usize> {
        let length = self.to.write(buffer)?;
        self.hasher.update(&buffer[..length]);
        self.bytes += length as u64;
        Ok(length)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.to.flush()
    }
}
