//! Small JSON records with a checksum.

use crate::hash::ContentHash;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A sealed record does not verify.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SealError {
    #[error("the record does not match its checksum")]
    Checksum,
    #[error("the record is not what it should be: {0}")]
    Content(String),
}

/// `value` as one line of checksum and one of JSON.
pub(crate) fn seal<T: Serialize>(value: &T) -> Result<Vec<u8>, SealError> {
    let body = serde_json::to_string(value).map_err(|error| SealError::Content(error.to_string()))?;
    Ok(format!("{}\n{body}\n", ContentHash::of(body.as_bytes())).into_bytes())
}

/// The value in a sealed record.
pub(crate) fn unseal<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, SealError> {
    let text = std::str::from_utf8(bytes).map_err(|_| SealError::Checksum)?;
    let (sum, body) = text.split_once('\n').ok_or(SealError::Checksum)?;
    let body = body.strip_suffix('\n').ok_or(SealError::Checksum)?;
    if sum.parse() != Ok(ContentHash::of(body.as_bytes())) {
        return Err(SealError::Checksum);
    }
    serde_json::from_str(body).map_err(|error| SealError::Content(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change_and_truncation_is_noticed() {
        let sealed = seal(&vec![1u32, 22, 333]).unwrap();
        assert_eq!(unseal::<Vec<u32>>(&sealed), Ok(vec![1, 22, 333]));
        for length in 0..sealed.len() {
            assert!(unseal::<Vec<u32>>(&sealed[..length]).is_err(), "truncated to {length}");
        }
        for bit in 0..sealed.len() * 8 {
            let mut damaged = sealed.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            // The checksum is read without regard to case, which changes nothing of what it says.
            let same = damaged.to_ascii_lowercase() == sealed;
            assert!(same || unseal::<Vec<u32>>(&damaged).is_err(), "bit {bit}");
        }
    }
}
