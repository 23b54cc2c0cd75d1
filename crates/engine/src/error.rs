//! What ends a run before it begins, and how a run ends.

use crate::cache::CacheError;
use crate::diagnostic::Diagnostic;
use crate::spec::SpecError;
use serde::{Deserialize, Serialize};

/// How a command ends, as the exit code of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExitCode {
    /// Everything asked for is done.
    Done,
    /// A stage failed.
    StageFailed,
    /// The command line or the spec is wrong.
    Usage,
    /// The geometry or the data was refused.
    Refused,
    /// Trouble with the cache or with a file.
    Storage,
    /// Interrupted; what was finished stays finished.
    Interrupted,
}

impl ExitCode {
    /// The number.
    pub const fn number(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::StageFailed => 1,
            Self::Usage => 2,
            Self::Refused => 3,
            Self::Storage => 4,
            Self::Interrupted => 130,
        }
    }
}

/// A plan or a run could not begin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EngineError {
    /// The spec is wrong.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// The command line is wrong.
    #[error(transparent)]
    Argument(Box<Diagnostic>),
    /// A file named in the spec cannot be read.
    #[error(transparent)]
    InputFile(Box<Diagnostic>),
    /// The cache or the output folder cannot be used.
    #[error(transparent)]
    Cache(#[from] CacheError),
}

impl EngineError {
    /// The exit code.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Spec(_) | Self::Argument(_) => ExitCode::Usage,
            Self::InputFile(_) | Self::Cache(_) => ExitCode::Storage,
        }
    }
}
