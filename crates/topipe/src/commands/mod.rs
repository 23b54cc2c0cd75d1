//! One file per command.

pub(crate) mod cache;
pub(crate) mod completions;
pub(crate) mod diff;
pub(crate) mod edit;
pub(crate) mod graph;
pub(crate) mod inspect;
pub(crate) mod kinds;
pub(crate) mod log;
pub(crate) mod man;
pub(crate) mod new;
mod pipeline;
pub(crate) mod plan;
pub(crate) mod render;
pub(crate) mod report;
pub(crate) mod reproduce;
pub(crate) mod run;
mod runs;
pub(crate) mod schema;
mod target;

use crate::failure::Failure;
use std::io::{ErrorKind, Write};
use std::path::Path;
use topipe_engine::ExitCode;

/// Prints the result of a command. A reader that stops reading (`| head`) is no error.
fn print(text: &str) -> Result<ExitCode, Failure> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::io("write", Path::new("stdout"), error))
        }
        _ => Ok(ExitCode::Done),
    }
}
