//! Units of a stage: parts of its result that are kept as they finish and found again by later runs.
//!
//! Units live in `units-v1/NAMESPACE/STAGE-KEY`, one append-only [`segment`] for each stage run that computed any. The
//! namespace is a hash of the kind of stage and of its code version, so no code ever meets the units of other code.
//! Within it a unit is found by its own key, whichever run has made it: after an edit only the units whose content
//! changed are missing. They are no results: nothing but the stage that asks for them by key ever sees them.

use super::segment::{self, Contents, Ending, Record, RecordKind};
use super::{Bucket, Cache, CacheError, Damage};
use crate::hash::{ContentHash, FieldHasher};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};
use topipe_progress::{UnitKey, UnitStore};

/// How many units a stage run found and made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnitCounts {
    /// So many were there.
    pub reused: u64,
    /// So many were not, and are now.
    pub computed: u64,
}

/// The folder of the units that this code of this kind of stage makes.
pub(super) fn folder(root: &Path, kind: &str, code_version: &str) -> PathBuf {
    let namespace = FieldHasher::new("topipe units 1").text(kind).text(code_version).finish();
    root.join(Bucket::Units.folder()).join(namespace.to_hex())
}

/// A segment that is open for reading. Its file stays readable when it is moved or deleted meanwhile.
pub(super) struct Segment {
    path: PathBuf,
    file: Arc<File>,
    /// It is damaged and was moved aside.
    condemned: bool,
    used: bool,
}

struct Writer {
    file: File,
    end: u64,
    synced: Instant,
}

#[derive(Default)]
struct State {
    opened: bool,
    segments: Vec<Segment>,
    index: HashMap<UnitKey, (usize, Record)>,
    writer: Option<Writer>,
    unwritten: Unwritten,
    counts: UnitCounts,
    flush: Option<JoinHandle<()>>,
}

/// What could not be written yet, in the order in which it came.
#[derive(Default)]
struct Unwritten {
    waiting: Vec<(RecordKind, UnitKey, Vec<u8>)>,
    /// When it was last tried in vain.
    tried: Option<Instant>,
}

impl Unwritten {
    fn units(&self) -> usize {
        self.waiting.iter().filter(|(kind, ..)| *kind == RecordKind::Unit).count()
    }
}

/// What the units of a run have to tell.
pub(crate) enum Notice {
    /// A segment did not verify.
    Damage(Damage),
    /// Finished units are not in the cache: for now, or, when the stage ends, at all.
    NotKept(String),
}

/// The units of one stage run. Opened by the first use, so that a stage without units costs nothing. The lock of the
/// stage's key must be held: it makes this the only writer of its segment.
pub(crate) struct UnitCheckpoints {
    cache: Cache,
    folder: PathBuf,
    stage: ContentHash,
    anew: bool,
    state: Mutex<State>,
    report: Box<dyn Fn(Notice) + Send + Sync>,
}

/// A loss of power costs at most the units of this time.
const SYNC_EVERY: Duration = Duration::from_secs(5);

/// Where there was no room for a unit it is tried again after this time: somebody may have made some.
const RETRY_EVERY: Duration = Duration::from_secs(1);

impl UnitCheckpoints {
    /// The units for the run of a stage with the key `stage`; `report` is told of what goes wrong. With `anew`, nothing
    /// that an earlier run has kept is found.
    pub(crate) fn new(
        cache: &Cache,
        kind: &str,
        code_version: &str,
        stage: ContentHash,
        anew: bool,
        report: impl Fn(Notice) + Send + Sync + 'static,
    ) -> Self {
        let folder = folder(cache.root(), kind, code_version);
        Self { cache: cache.clone(), folder, stage, anew, state: Mutex::default(), report: Box::new(report) }
    }

    /// Ends the run: marks what was used as used now, and begins to flush what was written. That goes on beside what follows, and is
    /// waited for when this is dropped.
    pub(crate) fn finish(&self) -> UnitCounts {
        let mut state = self.lock();
        if let Err(error) = self.write_waiting(&mut state) {
            let (lost, made) = (state.unwritten.units(), state.counts.computed);
            (self.report)(Notice::NotKept(format!("{lost} of {made} finished parts are not kept: {error}")));
        }
        if let Some(writer) = state.writer.take() {
            // Losing it with the power costs time only, so it need not succeed, nor have a thread.
            let flush = move || drop(writer.file.sync_data());
            state.flush = std::thread::Builder::new().spawn(flush).ok();
        }
        for segment in state.segments.iter().filter(|segment| segment.used && !segment.condemned) {
            // It only guides what is thrown away first.
            let _ = segment.file.set_modified(SystemTime::now());
        }
        state.counts
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn opened(&self) -> MutexGuard<'_, State> {
        let mut state = self.lock();
        if !state.opened {
            state.opened = true;
            let (segments, damages) = open_all(&self.cache, &self.folder);
            for (segment, contents) in segments {
                let at = state.segments.len();
                for record in contents.records.into_iter().filter(|record| record.kind == RecordKind::Unit) {
                    state.index.insert(record.key, (at, record));
                }
                state.segments.push(segment);
            }
            damages.into_iter().for_each(|damage| (self.report)(Notice::Damage(damage)));
            self.rescue(&mut state);
        }
        state
    }

    /// Writes again what is good in segments that were moved aside.
    fn rescue(&self, state: &mut State) {
        let mut condemned: Vec<(usize, Record)> =
            state.index.values().filter(|(at, _)| state.segments[*at].condemned).copied().collect();
        condemned.sort_by_key(|(at, record)| (*at, record.offset));
        for (at, record) in condemned {
            match segment::read(&state.segments[at].file, &record) {
                Ok(Some(value)) => self.append(state, RecordKind::Unit, record.key, &value),
                _ => drop(state.index.remove(&record.key)),
            }
        }
    }

    /// Appends a record. What there is no room for waits in memory until there is some.
    fn append(&self, state: &mut State, kind: RecordKind, key: UnitKey, value: &[u8]) {
        let written = if state.unwritten.waiting.is_empty() {
            self.try_append(state, kind, key, value)
        } else {
            let waited = state.unwritten.tried.is_none_or(|last| last.elapsed() >= RETRY_EVERY);
            if waited && self.write_waiting(state).is_ok() {
                self.try_append(state, kind, key, value)
            } else {
                state.unwritten.waiting.push((kind, key, value.to_vec()));
                return;
            }
        };
        if let Err(error) = written {
            (self.report)(Notice::NotKept(format!(
                "finished parts cannot be kept for now: {error}; they wait in memory for room"
            )));
            state.unwritten.waiting.push((kind, key, value.to_vec()));
        }
    }

    /// Writes what waits.
    fn write_waiting(&self, state: &mut State) -> Result<(), CacheError> {
        let mut waiting = std::mem::take(&mut state.unwritten.waiting);
        for k in 0..waiting.len() {
            let (kind, key, value) = &waiting[k];
            if let Err(error) = self.try_append(state, *kind, *key, value) {
                state.unwritten.waiting = waiting.split_off(k);
                return Err(error);
            }
        }
        Ok(())
    }

    /// Appends a record. After an error the next one begins with the segment as it is found on the disk, so that half
    /// a record is cut off.
    fn try_append(
        &self,
        state: &mut State,
        kind: RecordKind,
        key: UnitKey,
        value: &[u8],
    ) -> Result<(), CacheError> {
        let appended = self.append_to_segment(state, kind, key, value);
        if appended.is_err() {
            state.unwritten.tried = Some(Instant::now());
            state.writer = None;
        }
        appended
    }

    fn append_to_segment(
        &self,
        state: &mut State,
        kind: RecordKind,
        key: UnitKey,
        value: &[u8],
    ) -> Result<(), CacheError> {
        let path = self.folder.join(self.stage.to_hex());
        let fail = |error| CacheError::io("write", &path, error);
        if state.writer.is_none() {
            state.writer = Some(open_writer(&path, self.stage).map_err(fail)?);
            // What is written now is read again through a handle of its own.
            let file = Arc::new(File::open(&path).map_err(fail)?);
            state.segments.push(Segment { path: path.clone(), file, condemned: false, used: true });
        }
        let at = state.segments.len() - 1;
        let Some(writer) = &mut state.writer else { return Ok(()) };
        let record = segment::append(&writer.file, writer.end, kind, key, value).map_err(fail)?;
        writer.end = record.offset + record.length;
        if writer.synced.elapsed() >= SYNC_EVERY {
            writer.file.sync_data().map_err(fail)?;
            writer.synced = Instant::now();
        }
        if kind == RecordKind::Unit {
            state.index.insert(key, (at, record));
        }
        Ok(())
    }
}

impl Drop for UnitCheckpoints {
    fn drop(&mut self) {
        // Whoever comes next under the lock of the key finds all of it on the disk.
        if let Some(flush) = self.lock().flush.take() {
            let _ = flush.join();
        }
    }
}

impl UnitStore for UnitCheckpoints {
    fn get(&self, key: UnitKey) -> Option<Vec<u8>> {
        if self.anew {
            return None;
        }
        let (at, record, file) = {
            let mut state = self.opened();
            let Some((at, record)) = state.index.get(&key).copied() else {
                let waiting = &state.unwritten.waiting;
                let value =
                    waiting.iter().find(|(_, waits, _)| *waits == key).map(|(.., value)| value.clone())?;
                state.counts.reused += 1;
                return Some(value);
            };
            (at, record, Arc::clone(&state.segments[at].file))
        };
        let value = segment::read(&file, &record);
        let mut state = self.lock();
        match value {
            Ok(Some(value)) => {
                state.counts.reused += 1;
                state.segments[at].used = true;
                Some(value)
            }
            Ok(None) => {
                state.index.remove(&key);
                if !state.segments[at].condemned {
                    let path = state.segments[at].path.clone();
                    let damage = self.cache.quarantine(&path, "a unit does not match its hash");
                    (self.report)(Notice::Damage(damage));
                    for segment in state.segments.iter_mut().filter(|segment| segment.path == path) {
                        segment.condemned = true;
                    }
                    if path == self.folder.join(self.stage.to_hex()) {
                        state.writer = None;
                    }
                    self.rescue(&mut state);
                }
                None
            }
            Err(error) => {
                tracing::warn!("a finished part cannot be read: {error}");
                state.index.remove(&key);
                None
            }
        }
    }

    fn put(&self, key: UnitKey, value: &[u8]) {
        let mut state = self.opened();
        state.counts.computed += 1;
        if !state.index.contains_key(&key) {
            self.append(&mut state, RecordKind::Unit, key, value);
            drop(state);
            crate::failpoint::pass("unit put");
        }
    }

    fn announce(&self, what: &str, keys: &[UnitKey]) {
        let list = segment::list(what, keys);
        let mut state = self.opened();
        self.append(&mut state, RecordKind::List, UnitKey::from_bytes([0; 32]), &list);
    }
}

/// Opens a segment for appending, behind its last whole record.
fn open_writer(path: &Path, stage: ContentHash) -> std::io::Result<Writer> {
    use std::io::Write;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut file = OpenOptions::new().read(true).append(true).create(true).open(path)?;
    let mut end = segment::contents(&file, stage)?.end;
    file.set_len(end)?;
    if end == 0 {
        file.write_all(&segment::header(stage))?;
        end = segment::HEADER;
    }
    Ok(Writer { file, end, synced: Instant::now() })
}

/// Opens all segments of a namespace. Damaged ones are moved aside; what is good in them is still read.
pub(super) fn open_all(cache: &Cache, folder: &Path) -> (Vec<(Segment, Contents)>, Vec<Damage>) {
    let (mut segments, mut damages) = (Vec::new(), Vec::new());
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        let Some(stage) = stage_of(&path) else { continue };
        // It may have been deleted since it was listed.
        let Ok(file) = File::open(&path) else { continue };
        let Ok(contents) = segment::contents(&file, stage) else { continue };
        let condemned = matches!(contents.ending, Ending::Damaged(_));
        if let Ending::Damaged(reason) = contents.ending {
            damages.push(cache.quarantine(&path, reason));
        }
        segments.push((Segment { path, file: Arc::new(file), condemned, used: false }, contents));
    }
    (segments, damages)
}

pub(super) fn stage_of(path: &Path) -> Option<ContentHash> {
    path.file_name()?.to_str()?.parse().ok()
}
