//! A file to which finished units are appended.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | magic `tpunits\x1a` |
//! | 4 | version of this layout |
//! | 4 | zero |
//! | 32 | key of the stage run that writes it |
//! | 16 | first bytes of the blake3 of the above |
//!
//! and then any number of
//!
//! | bytes | content |
//! |---|---|
//! | 4 | 1 for a unit, 2 for a list of units that a run is going to need |
//! | 4 | zero |
//! | 8 | length of the value |
//! | 32 | key of the unit; zero for a list |
//! | 32 | blake3 of the value |
//! | 16 | first bytes of the blake3 of the above |
//! | .. | the value |
//!
//! One process at a time appends, the one that holds the lock of the stage run; each record is one write. Whatever
//! ends that process, what it leaves is a row of whole records and at most one torn one at the end, which is cut off
//! before the next is appended. Nothing is flushed to the disk record by record: every value is checked when it is
//! read, so that after a loss of power some units are computed again and none is wrong.

use crate::hash::ContentHash;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Write};
use topipe_progress::UnitKey;

const MAGIC: [u8; 8] = *b"tpunits\x1a";
const LAYOUT_VERSION: u32 = 1;
pub(super) const HEADER: u64 = 64;
const RECORD: u64 = 96;

/// What a record is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RecordKind {
    /// A finished unit.
    Unit,
    /// A list of units that the run is going to need.
    List,
}

impl RecordKind {
    const fn code(self) -> u32 {
        match self {
            Self::Unit => 1,
            Self::List => 2,
        }
    }
}

/// Where a value stands in a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Record {
    pub(super) kind: RecordKind,
    pub(super) key: UnitKey,
    pub(super) offset: u64,
    pub(super) length: u64,
    hash: ContentHash,
}

/// How a segment ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Ending {
    /// With a whole record.
    Whole,
    /// In the middle of a record, as a killed process leaves it, or as a running one has not written it yet.
    Torn,
    /// With something that was never written.
    Damaged(&'static str),
}

/// The records of a segment up to the first that is not whole.
#[derive(Debug)]
pub(super) struct Contents {
    pub(super) records: Vec<Record>,
    /// Where the next record belongs.
    pub(super) end: u64,
    pub(super) ending: Ending,
}

fn sum(bytes: &[u8]) -> [u8; 16] {
    let mut sum = [0; 16];
    sum.copy_from_slice(&ContentHash::of(bytes).as_bytes()[..16]);
    sum
}

/// The head of the segment of a stage run.
pub(super) fn header(stage: ContentHash) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER as usize);
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&LAYOUT_VERSION.to_le_bytes());
    bytes.extend_from_slice(&[0; 4]);
    bytes.extend_from_slice(stage.as_bytes());
    bytes.extend_from_slice(&sum(&bytes));
    bytes
}

/// Appends a record at `end`, where the file ends.
pub(super) fn append(
    mut file: &File,
    end: u64,
    kind: RecordKind,
    key: UnitKey,
    value: &[u8],
) -> std::io::Result<Record> {
    let hash = ContentHash::of(value);
    let mut bytes = Vec::with_capacity(RECORD as usize + value.len());
    bytes.extend_from_slice(&kind.code().to_le_bytes());
    bytes.extend_from_slice(&[0; 4]);
    bytes.extend_from_slice(&(value.len() as u64).to_le_bytes());
    bytes.extend_from_slice(key.as_bytes());
    bytes.extend_from_slice(hash.as_bytes());
    bytes.extend_from_slice(&sum(&bytes));
    bytes.extend_from_slice(value);
    file.write_all(&bytes)?;
    Ok(Record { kind, key, offset: end + RECORD, length: value.len() as u64, hash })
}

/// Lists the records of the segment of `stage`. Values are passed over; see [`read`].
pub(super) fn contents(file: &File, stage: ContentHash) -> std::io::Result<Contents> {
    let length = file.metadata()?.len();
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let mut found = Contents { records: Vec::new(), end: 0, ending: Ending::Torn };
    let mut head = [0; HEADER as usize];
    if !fill(&mut reader, &mut head)? {
        return Ok(found);
    }
    if head[..] != header(stage) {
        found.ending = Ending::Damaged("it does not begin like the units of this stage run");
        return Ok(found);
    }
    found.end = HEADER;
    loop {
        if found.end == length {
            found.ending = Ending::Whole;
            return Ok(found);
        }
        let mut bytes = [0; RECORD as usize];
        if !fill(&mut reader, &mut bytes)? {
            return Ok(found);
        }
        let Some(record) = parse(&bytes, found.end + RECORD) else {
            found.ending = Ending::Damaged("the head of a unit does not match its checksum");
            return Ok(found);
        };
        // The file may have grown since its length was asked for; the rest is for the next look.
        match record.offset.checked_add(record.length) {
            Some(end) if end <= length => {
                reader.seek_relative(record.length as i64)?;
                found.end = end;
                found.records.push(record);
            }
            _ => return Ok(found),
        }
    }
}

/// Reads all of `buffer`; false if the file ends before.
fn fill(reader: &mut impl Read, buffer: &mut [u8]) -> std::io::Result<bool> {
    match reader.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

fn parse(bytes: &[u8; RECORD as usize], offset: u64) -> Option<Record> {
    let (body, written) = bytes.split_at(80);
    if written != sum(body) {
        return None;
    }
    let kind = match u32::from_le_bytes(body[..4].try_into().ok()?) {
        1 => RecordKind::Unit,
        2 => RecordKind::List,
        _ => return None,
    };
    Some(Record {
        kind,
        length: u64::from_le_bytes(body[8..16].try_into().ok()?),
        key: UnitKey::from_bytes(body[16..48].try_into().ok()?),
        hash: ContentHash::from_bytes(body[48..80].try_into().ok()?),
        offset,
    })
}

/// Reads a value; nothing if it is not what was written.
pub(super) fn read(file: &File, record: &Record) -> std::io::Result<Option<Vec<u8>>> {
    // `contents` has checked that the file is as long as that.
    let mut value = vec![0; record.length as usize];
    read_at(file, &mut value, record.offset)?;
    Ok((ContentHash::of(&value) == record.hash).then_some(value))
}

#[cfg(unix)]
pub(crate) fn read_at(file: &File, buffer: &mut [u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

#[cfg(not(unix))]
pub(crate) fn read_at(file: &File, buffer: &mut [u8], offset: u64) -> std::io::Result<()> {
    use std::io::{Seek, SeekFrom};
    let mut file = file.try_clone()?;
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(buffer)
}

/// A list of units as the value of a record.
pub(super) fn list(what: &str, keys: &[UnitKey]) -> Vec<u8> {
    let mut bytes = (what.len() as u32).to_le_bytes().to_vec();
    bytes.extend_from_slice(what.as_bytes());
    for key in keys {
        bytes.extend_from_slice(key.as_bytes());
    }
    bytes
}

/// The units in such a value.
pub(super) fn parse_list(value: &[u8]) -> Option<(String, Vec<UnitKey>)> {
    let (length, rest) = value.split_first_chunk::<4>()?;
    let (what, keys) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    let (keys, rest) = keys.as_chunks::<32>();
    if !rest.is_empty() {
        return None;
    }
    Some((String::from_utf8(what.to_vec()).ok()?, keys.iter().map(|key| UnitKey::from_bytes(*key)).collect()))
}
