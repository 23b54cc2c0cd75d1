//! Writing artifacts into the output folder, and leaving alone what is there already.

use super::executor::Executor;
use super::failure::Failure;
use super::{ExportOutcome, ExportRecord};
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

/// What was last written into an output folder, by file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct Written(BTreeMap<String, WrittenFile>);

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

/// Writes the exports of the stages that have a result, in the order of the spec.
pub(super) fn write_all(executor: &Executor<'_>) -> Vec<ExportRecord> {
    let out = &executor.options.out;
    let name = std::path::absolute(out).unwrap_or_else(|_| out.clone()).to_string_lossy().into_owned();
    let before: Written = executor.cache().read_record(Bucket::Exports, &name).unwrap_or_default();
    let mut written = before.clone();
    let mut records = Vec::new();
    let of_stages = executor.pipeline().exports.iter().filter(|export| !export.exporter.after_run);
    for export in of_stages.filter(|export| executor.is_selected(export.stage)) {
        if executor.interrupt.is_raised() {
            break;
        }
        let Some(artifact) = executor.artifact(export.stage) else {
            records.push(record(executor, export, ExportOutcome::Skipped, None));
            continue;
        };
        let path = out.join(&export.file);
        if let Some(known) = written.0.get_mut(&export.file)
            && is_up_to_date(known, &path, artifact, export)
        {
            let stage = executor.pipeline().stages[export.stage].name.clone();
            executor.events.emit(&Event::ExportUpToDate { file: export.file.clone(), stage });
            records.push(record(executor, export, ExportOutcome::UpToDate, Some(known)));
            continue;
        }
        let outcome = write(executor, export, artifact, &path);
        let stage = executor.pipeline().stages[export.stage].name.clone();
        let file = export.file.clone();
        match outcome {
            Ok(new) => {
                executor.events.emit(&Event::ExportWritten { file, stage, bytes: new.bytes });
                records.push(record(executor, export, ExportOutcome::Written, Some(&new)));
                written.0.insert(export.file.clone(), new);
            }
            Err(Failure { message, code }) => {
                executor.events.emit(&Event::ExportFailed { file, stage, message: message.clone(), code });
                records.push(record(executor, export, ExportOutcome::Failed { message, code }, None));
                written.0.remove(&export.file);
            }
        }
    }
    if written != before
        && let Err(error) = executor.cache().write_record(Bucket::Exports, &name, &written)
    {
        tracing::warn!("exports will be written again by the next run: {error}");
    }
    records
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
    export: &ExportNode,
    artifact: ContentHash,
    path: &Path,
) -> Result<WrittenFile, Failure> {
    let value = executor.obtain(export.stage)?;
    let fail = |error| Failure::from(CacheError::io("write", path, error));
    let temporary = Temporary::beside(path).map_err(fail)?;
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    // The ending was found without regard to case; its dot comes before it.
    let title = name.get(..name.len().saturating_sub(export.exporter.ending.len() + 1)).unwrap_or(&name);
    let mut file = HashingFile { file: BufWriter::new(temporary), hasher: blake3::Hasher::new(), bytes: 0 };
    let result =
        std::panic::catch_unwind(AssertUnwindSafe(|| export.exporter.write(&value, title, &mut file)));
    match result {
        Ok(Ok(())) => {}
        Ok(Err(ExportError::Io(error))) => return Err(fail(error)),
        Ok(Err(error)) => return Err(Failure { message: error.to_string(), code: ExitCode::Refused }),
        Err(_) => {
            let message = format!(
                "the writer of .{} files panicked, which is a defect of topipe",
                export.exporter.ending
            );
            return Err(Failure { message, code: ExitCode::StageFailed });
        }
    }
    let content = ContentHash::from_bytes(*file.hasher.finalize().as_bytes());
    let bytes = file.bytes;
    let temporary = file.file.into_inner().map_err(|error| fail(error.into_error()))?;
    temporary.persist(path, Durability::Flushed).map_err(fail)?;
    crate::failpoint::pass("export written");
    let writer = export.exporter.code_version.clone();
    Ok(WrittenFile { artifact, writer, content, bytes, memo: None })
}

/// Hashes what passes through on its way to the file.
struct HashingFile<W: Write> {
    file: BufWriter<W>,
    hasher: blake3::Hasher,
    bytes: u64,
}

impl<W: Write> Write for HashingFile<W> {
    fn write(&mut self, buffer: &[u8]) -> std::io::Result<usize> {
        let length = self.file.write(buffer)?;
        self.hasher.update(&buffer[..length]);
        self.bytes += length as u64;
        Ok(length)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}
