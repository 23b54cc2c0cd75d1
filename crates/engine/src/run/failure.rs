//! Why something came to nothing.

use crate::cache::{CacheError, LockError};
use crate::error::ExitCode;
use crate::input_file::InputFileError;
use crate::stage::StageError;

/// Why a stage or an export came to nothing.
#[derive(Debug, Clone)]
pub(super) struct Failure {
    pub(super) message: String,
    pub(super) code: ExitCode,
}

impl From<StageError> for Failure {
    fn from(error: StageError) -> Self {
        let code = match error {
            StageError::Refused(_) => ExitCode::Refused,
            StageError::BadParameter(_) => ExitCode::Usage,
            StageError::Failed(_) => ExitCode::StageFailed,
            StageError::Interrupted => ExitCode::Interrupted,
        };
        Self { message: error.to_string(), code }
    }
}

impl From<CacheError> for Failure {
    fn from(error: CacheError) -> Self {
        Self { message: error.to_string(), code: ExitCode::Storage }
    }
}

impl From<InputFileError> for Failure {
    fn from(error: InputFileError) -> Self {
        Self { message: error.to_string(), code: ExitCode::Storage }
    }
}

impl From<LockError> for Failure {
    fn from(error: LockError) -> Self {
        let code = match error {
            LockError::Interrupted => ExitCode::Interrupted,
            _ => ExitCode::Storage,
        };
        Self { message: error.to_string(), code }
    }
}
