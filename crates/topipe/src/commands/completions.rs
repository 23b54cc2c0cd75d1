//! `topipe completions`.

use crate::args::Arguments;
use crate::failure::Failure;
use clap::CommandFactory;
use topipe_engine::ExitCode;

pub(crate) fn run(shell: clap_complete::Shell) -> Result<ExitCode, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "topipe", &mut script);
    super::print(&String::from_utf8_lossy(&script))
}
