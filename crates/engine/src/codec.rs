//! The artifact file: a header that identifies and protects a payload.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | magic `topipe\0\x1a` |
//! | 4 | version of this layout |
//! | 4 | version of the kind's serialized form |
//! | 4 | length of the kind's name |
//! | n | the kind's name |
//! | 8 | length of the payload |
//! | 32 | blake3 of the payload |
//! | .. | the payload: bincode, little endian, fixed-width integers |
//!
//! The identity of an artifact is the hash of its header. As the header holds the hash of the payload, this covers
//! every byte, and the payload is hashed only once when it is read.
//!
//! This is the one place that knows bincode. 2.0.1 is the last release anyone can use (3.0.0 is a tombstone, and
//! RUSTSEC-2025-0141 marks the crate as unmaintained), so it is pinned. Integers are of fixed width because large
//! index arrays are read faster than in the variable form, and because the decoder's budget then equals the length
//! of the payload: a forged length cannot make it allocate more than the next power of 16.

use crate::hash::ContentHash;
use bincode::config::{Configuration, Fixint, Limit, LittleEndian};
use serde::Serialize;
use serde::de::DeserializeOwned;

const MAGIC: [u8; 8] = *b"topipe\0\x1a";
const LAYOUT_VERSION: u32 = 1;
/// Longer names are not written, so a longer one in a header is damage.
const LONGEST_KIND: usize = 64;

/// A value could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The stage returned another type than it declares.
    #[error("the stage returned something else than its declared result, a {expected}")]
    WrongType {
        /// The declared kind.
        expected: &'static str,
    },
    /// serde or bincode refused the value.
    #[error("the result cannot be serialized: {0}")]
    Serialize(String),
}

/// A file is not the artifact it should be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// It does not start like an artifact.
    #[error("not a topipe artifact")]
    NotAnArtifact,
    /// It was written by another version of this layout.
    #[error("artifact layout {found} is not layout {LAYOUT_VERSION}, which this program reads")]
    Layout {
        /// The version in the file.
        found: u32,
    },
    /// The header ends early or holds an impossible name.
    #[error("damaged artifact header")]
    Header,
    /// The file is shorter or longer than its header says.
    #[error("the payload has {found} bytes, the header says {expected}")]
    Length {
        /// Length by the header.
        expected: u64,
        /// Length of what follows the header.
        found: u64,
    },
    /// The payload is not what was written.
    #[error("the payload does not match its hash")]
    PayloadHash,
    /// Another kind of artifact, or another version of it.
    #[error("expected {expected}, found {found}")]
    Kind {
        /// Kind and version that was asked for.
        expected: String,
        /// Kind and version in the file.
        found: String,
    },
    /// The payload matches its hash but not the type: it was written by other code.
    #[error("the payload is not a valid {kind}: {reason}")]
    Payload {
        /// The kind.
        kind: String,
        /// What bincode or serde said.
        reason: String,
    },
}

/// The header of an artifact file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Header {
    /// Name of the kind.
    pub kind: String,
    /// Version of the kind's serialized form.
    pub version: u32,
    /// Length of the payload in bytes.
    pub payload_bytes: u64,
    /// blake3 of the payload.
    pub payload_hash: ContentHash,
}

impl Header {
    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(60 + self.kind.len());
        bytes.extend_from_slice(&MAGIC);
        bytes.extend_from_slice(&LAYOUT_VERSION.to_le_bytes());
        bytes.extend_from_slice(&self.version.to_le_bytes());
        bytes.extend_from_slice(&(self.kind.len() as u32).to_le_bytes());
        bytes.extend_from_slice(self.kind.as_bytes());
        bytes.extend_from_slice(&self.payload_bytes.to_le_bytes());
        bytes.extend_from_slice(self.payload_hash.as_bytes());
        bytes
    }

    /// The identity of the artifact with this header.
    pub fn identity(&self) -> ContentHash {
        ContentHash::of(&self.to_bytes())
    }
}

/// Takes `N` bytes from the front of `bytes`.
fn take<const N: usize>(bytes: &mut &[u8]) -> Result<[u8; N], DecodeError> {
    let (head, rest) = bytes.split_first_chunk::<N>().ok_or(DecodeError::Header)?;
    *bytes = rest;
    Ok(*head)
}

/// Splits a file into header and payload and checks the one against the other.
pub fn open(file: &[u8]) -> Result<(Header, &[u8]), DecodeError> {
    let (header, rest) = split(file)?;
    if header.payload_bytes != rest.len() as u64 {
        return Err(DecodeError::Length { expected: header.payload_bytes, found: rest.len() as u64 });
    }
    if ContentHash::of(rest) != header.payload_hash {
        return Err(DecodeError::PayloadHash);
    }
    Ok((header, rest))
}

/// No header is longer.
const LONGEST_HEADER: usize = 60 + LONGEST_KIND;
/// What is read at a time: it stays in the second-level cache between reading and hashing.
const BLOCK: usize = 256 * 1024;
/// From this size on all threads hash one file.
const LARGE: u64 = 4 << 20;

/// Reads a file, checks header and payload against each other, and returns the header. Unlike [`open`] it never holds
/// the whole file.
pub fn verify(file: &std::fs::File) -> std::io::Result<Result<Header, DecodeError>> {
    let length = file.metadata()?.len();
    if cfg!(unix) && length >= LARGE { verify_large(file, length) } else { verify_stream(file) }
}

/// Hashes the payload in pieces, each read by the thread that hashes it: blake3 is a tree over pieces of 2^n bytes, so
/// they can be joined afterwards.
fn verify_large(file: &std::fs::File, length: u64) -> std::io::Result<Result<Header, DecodeError>> {
    use blake3::hazmat::{ChainingValue, HasherExt, Mode, left_subtree_len, merge_subtrees_non_root};
    fn subtree(file: &std::fs::File, start: u64, from: u64, length: u64) -> std::io::Result<ChainingValue> {
        if length > BLOCK as u64 {
            let left = left_subtree_len(length);
            let (left, right) = rayon::join(
                || subtree(file, start, from, left),
                || subtree(file, start, from + left, length - left),
            );
            return Ok(merge_subtrees_non_root(&left?, &right?, Mode::Hash));
        }
        thread_local! {
            static PIECE: std::cell::RefCell<Vec<u8>> = const { std::cell::RefCell::new(Vec::new()) };
        }
        PIECE.with_borrow_mut(|piece| {
            piece.resize(length as usize, 0);
            crate::cache::read_at(file, piece, start + from)?;
            Ok(blake3::Hasher::new().set_input_offset(from).update(piece).finalize_non_root())
        })
    }
    let mut front = [0; LONGEST_HEADER];
    crate::cache::read_at(file, &mut front, 0)?;
    let (header, start) = match split(&front) {
        Ok((header, rest)) => (header, (front.len() - rest.len()) as u64),
        Err(error) => return Ok(Err(error)),
    };
    let found = length - start;
    if found != header.payload_bytes {
        return Ok(Err(DecodeError::Length { expected: header.payload_bytes, found }));
    }
    let left = left_subtree_len(found);
    let (one, two) =
        rayon::join(|| subtree(file, start, 0, left), || subtree(file, start, left, found - left));
    let root = blake3::hazmat::merge_subtrees_root(&one?, &two?, Mode::Hash);
    Ok(if root.as_bytes() == header.payload_hash.as_bytes() {
        Ok(header)
    } else {
        Err(DecodeError::PayloadHash)
    })
}

fn verify_stream(mut file: impl std::io::Read) -> std::io::Result<Result<Header, DecodeError>> {
    let mut block = vec![0; BLOCK];
    let mut filled = fill(&mut file, &mut block)?;
    let (header, start) = match split(&block[..filled.min(LONGEST_HEADER)]) {
        // The rest of the first bytes belongs to the payload.
        Ok((header, rest)) => (header, filled.min(LONGEST_HEADER) - rest.len()),
        Err(error) => return Ok(Err(error)),
    };
    let mut hasher = blake3::Hasher::new();
    let (mut from, mut found) = (start, 0);
    loop {
        let bytes = &block[from..filled];
        found += bytes.len() as u64;
        hasher.update(bytes);
        if filled < block.len() {
            break;
        }
        from = 0;
        filled = fill(&mut file, &mut block)?;
    }
    Ok(if found != header.payload_bytes {
        Err(DecodeError::Length { expected: header.payload_bytes, found })
    } else if hasher.finalize().as_bytes() != header.payload_hash.as_bytes() {
        Err(DecodeError::PayloadHash)
    } else {
        Ok(header)
    })
}

/// Reads until the buffer is full or the file ends.
fn fill(file: &mut impl std::io::Read, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match file.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

/// Splits the header from what follows it.
fn split(file: &[u8]) -> Result<(Header, &[u8]), DecodeError> {
    let mut rest = file;
    if take::<8>(&mut rest).map_err(|_| DecodeError::NotAnArtifact)? != MAGIC {
        return Err(DecodeError::NotAnArtifact);
    }
    let layout = u32::from_le_bytes(take(&mut rest)?);
    if layout != LAYOUT_VERSION {
        return Err(DecodeError::Layout { found: layout });
    }
    let version = u32::from_le_bytes(take(&mut rest)?);
    let length = u32::from_le_bytes(take(&mut rest)?) as usize;
    if length > LONGEST_KIND || length > rest.len() {
        return Err(DecodeError::Header);
    }
    let (kind, mut rest) = rest.split_at(length);
    let kind = std::str::from_utf8(kind).map_err(|_| DecodeError::Header)?.to_owned();
    let payload_bytes = u64::from_le_bytes(take(&mut rest)?);
    let payload_hash = ContentHash::from_bytes(take(&mut rest)?);
    Ok((Header { kind, version, payload_bytes, payload_hash }, rest))
}

/// The file of `value`.
pub fn encode<T: Serialize>(value: &T, kind: &str, version: u32) -> Result<Vec<u8>, EncodeError> {
    let config = bincode::config::standard().with_fixed_int_encoding();
    let payload = bincode::serde::encode_to_vec(value, config)
        .map_err(|error| EncodeError::Serialize(error.to_string()))?;
    Ok(frame(&payload, kind, version))
}

/// The file of a payload that is serialized already.
pub fn frame(payload: &[u8], kind: &str, version: u32) -> Vec<u8> {
    let header = Header {
        kind: kind.to_owned(),
        version,
        payload_bytes: payload.len() as u64,
        payload_hash: ContentHash::of(payload),
    };
    let mut file = header.to_bytes();
    file.extend_from_slice(payload);
    file
}

/// The value in `file`, which must be of the given kind and version.
pub fn decode<T: DeserializeOwned>(file: &[u8], kind: &str, version: u32) -> Result<T, DecodeError> {
    let (header, payload) = open(file)?;
    if header.kind != kind || header.version != version {
        return Err(DecodeError::Kind {
            expected: format!("{kind} v{version}"),
            found: format!("{} v{}", header.kind, header.version),
        });
    }
    decode_payload(payload)
        .map_err(|reason| DecodeError::Payload { kind: kind.to_owned(), reason: reason.to_string() })
}

/// bincode takes its limit as a constant: the smallest power of 16 that holds the payload is used.
fn decode_payload<T: DeserializeOwned>(payload: &[u8]) -> Result<T, bincode::error::DecodeError> {
    fn within<T: DeserializeOwned, const N: usize>(payload: &[u8]) -> Result<T, bincode::error::DecodeError> {
        let config: Configuration<LittleEndian, Fixint, Limit<N>> =
            bincode::config::standard().with_fixed_int_encoding().with_limit::<N>();
        let (value, read) = bincode::serde::decode_from_slice(payload, config)?;
        if read != payload.len() {
            return Err(bincode::error::DecodeError::OtherString(format!(
                "{} bytes follow the value",
                payload.len() - read
            )));
        }
        Ok(value)
    }
    match payload.len() {
        0..=0xFFFF => within::<T, 0xFFFF>(payload),
        0x1_0000..=0xF_FFFF => within::<T, 0xF_FFFF>(payload),
        0x10_0000..=0xFF_FFFF => within::<T, 0xFF_FFFF>(payload),
        0x100_0000..=0xFFF_FFFF => within::<T, 0xFFF_FFFF>(payload),
        0x1000_0000..=0xFFFF_FFFF => within::<T, 0xFFFF_FFFF>(payload),
        _ => within::<T, { usize::MAX }>(payload),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Sample = (Vec<[f64; 3]>, Vec<u32>, String, Option<u64>);

    fn sample() -> Sample {
        (vec![[0.0, -0.0, 1.5], [f64::MAX, 1e-300, 3.0]], vec![1, 2, 3], "names".into(), Some(7))
    }

    /// A file whose payload is arbitrary but whose header matches it: what a forger would write.
    fn forged(payload: &[u8]) -> Vec<u8> {
        frame(payload, "sample", 1)
    }

    #[test]
    fn round_trip() {
        let file = encode(&sample(), "sample", 1).unwrap();
        assert_eq!(decode::<Sample>(&file, "sample", 1).unwrap(), sample());
    }

    #[test]
    fn identity_covers_kind_version_and_payload() {
        let id = |value: &Sample, kind: &str, version| {
            open(&encode(value, kind, version).unwrap()).unwrap().0.identity()
        };
        let base = id(&sample(), "sample", 1);
        let mut other = sample();
        other.1[0] = 9;
        assert_eq!(base, id(&sample(), "sample", 1));
        assert_ne!(base, id(&sample(), "other", 1));
        assert_ne!(base, id(&sample(), "sample", 2));
        assert_ne!(base, id(&other, "sample", 1));
    }

    #[test]
    fn another_kind_or_version_is_refused() {
        let file = encode(&sample(), "sample", 1).unwrap();
        let message = decode::<Sample>(&file, "sample", 2).unwrap_err().to_string();
        assert_eq!(message, "expected sample v2, found sample v1");
        assert!(matches!(decode::<Sample>(&file, "other", 1), Err(DecodeError::Kind { .. })));
    }

    #[test]
    fn every_truncation_is_noticed() {
        let file = encode(&sample(), "sample", 1).unwrap();
        for length in 0..file.len() {
            assert!(decode::<Sample>(&file[..length], "sample", 1).is_err(), "truncated to {length}");
        }
    }

    #[test]
    fn every_flipped_bit_is_noticed() {
        let file = encode(&sample(), "sample", 1).unwrap();
        for bit in 0..file.len() * 8 {
            let mut damaged = file.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(decode::<Sample>(&damaged, "sample", 1).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn a_file_verifies_piece_by_piece_as_it_does_whole() {
        let check = |bytes: &[u8]| {
            let whole = open(bytes).map(|(header, _)| header);
            assert_eq!(verify_stream(bytes).unwrap(), whole);
            if bytes.len() > BLOCK {
                let mut file = tempfile::tempfile().unwrap();
                std::io::Write::write_all(&mut file, bytes).unwrap();
                assert_eq!(verify_large(&file, bytes.len() as u64).unwrap(), whole);
            }
            whole.is_ok()
        };
        for length in [0, 1, BLOCK - 70, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK, 5_000_000] {
            let mut file = frame(&vec![7; length], "sample", 1);
            assert!(check(&file));
            *file.last_mut().unwrap() ^= 1;
            assert!(!check(&file));
            file.push(0);
            assert!(!check(&file));
        }
        let file = encode(&sample(), "sample", 1).unwrap();
        assert!((0..file.len()).all(|length| !check(&file[..length])));
    }

    #[test]
    fn trailing_bytes_are_refused() {
        let mut payload = open(&encode(&sample(), "sample", 1).unwrap()).unwrap().1.to_vec();
        payload.push(0);
        assert!(matches!(decode::<Sample>(&forged(&payload), "sample", 1), Err(DecodeError::Payload { .. })));
    }

    #[test]
    fn a_forged_length_does_not_allocate() {
        // 2^60 elements, or a string of 2^60 bytes: must fail fast, not abort.
        let length = (1u64 << 60).to_le_bytes();
        assert!(decode::<Vec<[f64; 3]>>(&forged(&length), "sample", 1).is_err());
        assert!(decode::<String>(&forged(&length), "sample", 1).is_err());
        assert!(decode::<Vec<u8>>(&forged(&length), "sample", 1).is_err());
    }

    proptest! {
        #[test]
        fn no_bytes_make_the_decoder_panic(payload in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = decode::<Sample>(&payload, "sample", 1);
            let _ = decode::<Sample>(&forged(&payload), "sample", 1);
        }
    }
}
