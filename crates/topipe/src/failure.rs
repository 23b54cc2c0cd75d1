//! What ends a command early.

use std::fmt;
use topipe_engine::cache::CacheError;
use topipe_engine::{Diagnostic, EngineError, ExitCode, SpecError};

/// An error message with its exit code.
#[derive(Debug)]
pub(crate) struct Failure {
    code: ExitCode,
    message: String,
}

impl Failure {
    pub(crate) fn new(code: ExitCode, message: impl Into<String>) -> Self {
        Self { code, message: message.into() }
    }

    /// A file operation went wrong.
    pub(crate) fn io(action: &'static str, path: &std::path::Path, error: std::io::Error) -> Self {
        CacheError::io(action, path, error).into()
    }

    pub(crate) fn code(&self) -> ExitCode {
        self.code
    }

    /// Prints the message to stderr.
    pub(crate) fn print(&self) {
        eprintln!("{self}");
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Diagnostics bring their own heading.
        let heading = if self.message.starts_with("error: ") { "" } else { "error: " };
        write!(f, "{heading}{}", self.message)
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        Self::new(error.exit_code(), error.to_string())
    }
}

impl From<SpecError> for Failure {
    fn from(error: SpecError) -> Self {
        EngineError::from(error).into()
    }
}

impl From<CacheError> for Failure {
    fn from(error: CacheError) -> Self {
        EngineError::from(error).into()
    }
}

impl From<Diagnostic> for Failure {
    fn from(diagnostic: Diagnostic) -> Self {
        Self::new(ExitCode::Usage, diagnostic.to_string())
    }
}
