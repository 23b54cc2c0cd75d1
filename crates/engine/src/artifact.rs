//! What flows between stages.

use crate::codec::{self, DecodeError, EncodeError};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::any::Any;
use std::sync::Arc;

/// A kind of result: a name for people and files, and the Rust type behind it.
///
/// It is a marker type of its own, so that a command can give kinds to the types of crates that know nothing of
/// this engine.
///
/// ```
/// use topipe_engine::ArtifactKind;
/// struct Text;
/// impl ArtifactKind for Text {
///     type Value = String;
///     const NAME: &'static str = "text";
///     const VERSION: u32 = 1;
/// }
/// ```
pub trait ArtifactKind: 'static {
    /// The type of the result. Its serde form is positional: no `skip_serializing_if`, no `untagged`, no `flatten`.
    type Value: Serialize + DeserializeOwned + Send + Sync + 'static;
    /// The name in messages and in the header of the artifact.
    const NAME: &'static str;
    /// Raise it when the serialized form of [`Self::Value`] changes.
    const VERSION: u32;
}

/// A result in memory, its type known to the stages that made it and will read it.
pub type Value = Arc<dyn Any + Send + Sync>;

/// An [`ArtifactKind`] with its type erased.
#[derive(Clone, Copy)]
pub struct ArtifactType {
    /// The name of the kind.
    pub name: &'static str,
    /// The version of its serialized form.
    pub version: u32,
    encode: fn(&Value, &ArtifactType) -> Result<Vec<u8>, EncodeError>,
    decode: fn(&[u8], &ArtifactType) -> Result<Value, DecodeError>,
    to_json: fn(&Value) -> Option<serde_json::Value>,
}

impl ArtifactType {
    /// The erased form of `K`.
    pub fn of<K: ArtifactKind>() -> Self {
        Self {
            name: K::NAME,
            version: K::VERSION,
            encode: |value, kind| match value.downcast_ref::<K::Value>() {
                Some(value) => codec::encode(value, kind.name, kind.version),
                None => Err(EncodeError::WrongType { expected: kind.name }),
            },
            decode: |bytes, kind| {
                codec::decode::<K::Value>(bytes, kind.name, kind.version)
                    .map(|value| Arc::new(value) as Value)
            },
            to_json: |value| serde_json::to_value(value.downcast_ref::<K::Value>()?).ok(),
        }
    }

    /// The file of `value`.
    pub fn encode(&self, value: &Value) -> Result<Vec<u8>, EncodeError> {
        (self.encode)(value, self)
    }

    /// `value` as JSON, to pick figures from; nothing if it is of another kind or cannot be written as JSON.
    pub fn to_json(&self, value: &Value) -> Option<serde_json::Value> {
        (self.to_json)(value)
    }

    /// The value in a file.
    pub fn decode(&self, bytes: &[u8]) -> Result<Value, DecodeError> {
        (self.decode)(bytes, self)
    }
}

impl std::fmt::Debug for ArtifactType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} v{}", self.name, self.version)
    }
}

impl PartialEq for ArtifactType {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.version == other.version
    }
}
