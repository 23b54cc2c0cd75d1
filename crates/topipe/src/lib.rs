//! `topipe`: from a topology optimization result to a closed CAD solid, in one command.
//!
//! This crate is the thin outer layer: arguments, progress, exit codes, and one adapter for each kind of stage. The
//! engine ([`topipe_engine`]) knows no geometry, the stage crates know no engine; they meet in [`stages`].

pub mod args;
pub mod artifacts;
mod commands;
mod diagram;
mod display;
mod export;
mod failure;
mod fields;
#[cfg(feature = "s3")]
mod object_store;
mod picture;
mod remote;
mod report;
pub mod stages;

use args::{Arguments, Command};
use clap::Parser;
use std::panic::AssertUnwindSafe;
use std::process::ExitCode;

/// Parses the command line and does what it says.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    start_logging(&arguments);
    // The engine turns a panic inside of a stage into a failure of that stage; a trace would only hide the message.
    std::panic::set_hook(Box::new(|info| tracing::debug!("{info}")));
    match std::panic::catch_unwind(AssertUnwindSafe(|| run(&arguments))) {
        Ok(Ok(code)) => ExitCode::from(code.number()),
        Ok(Err(failure)) => {
            failure.print();
            ExitCode::from(failure.code().number())
        }
        Err(payload) => {
            let text = payload
                .downcast_ref::<&str>()
                .map(|text| (*text).to_owned())
                .or_else(|| payload.downcast_ref::<String>().cloned())
                .unwrap_or_default();
            eprintln!("error: topipe panicked, which is a defect of it: {text}");
            ExitCode::from(topipe_engine::ExitCode::StageFailed.number())
        }
    }
}

fn run(arguments: &Arguments) -> Result<topipe_engine::ExitCode, failure::Failure> {
    let verbosity = arguments.verbosity();
    match &arguments.command {
        Command::Run(run) => commands::run::run(run, verbosity),
        Command::Plan(plan) => commands::plan::run(plan),
        Command::Graph(graph) => commands::graph::run(graph),
        Command::Stages { kind } => commands::kinds::run(kind.as_deref()),
        Command::Schema => commands::schema::run(),
        Command::Inspect(inspect) => commands::inspect::run(inspect),
        Command::Render(render) => commands::render::run(render),
        Command::Report(report) => commands::report::run(report),
        Command::Reproduce(reproduce) => commands::reproduce::run(reproduce, verbosity),
        Command::Lock(lock) => commands::reproduce::write_lock(lock),
        Command::Diff(diff) => commands::diff::run(diff),
        Command::Log(log) => commands::log::run(log),
        Command::Cache(cache) => commands::cache::run(cache),
        Command::New(new) => commands::new::run(new),
        Command::Edit(edit) => commands::edit::run(edit),
        Command::Man(man) => commands::man::run(man),
        Command::Completions { shell } => commands::completions::run(*shell),
    }
}

/// Logs go to stderr. `RUST_LOG` has the last word.
fn start_logging(arguments: &Arguments) {
    use tracing_subscriber::EnvFilter;
    let level = match arguments.verbosity() {
        args::Verbosity::Quiet => "error",
        args::Verbosity::Normal => "warn",
        args::Verbosity::Verbose => "debug",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(display::colors_on_stderr())
        .without_time()
        .with_target(false)
        .init();
}
