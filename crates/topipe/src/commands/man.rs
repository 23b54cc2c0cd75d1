//! `topipe man`.

use crate::args::{Arguments, ManArguments};
use crate::failure::Failure;
use clap::CommandFactory;
use topipe_engine::ExitCode;
use topipe_engine::cache::write_atomically;

/// The page of the command to stdout, or one page for it and each of its commands into a folder.
pub(crate) fn run(arguments: &ManArguments) -> Result<ExitCode, Failure> {
    let command = Arguments::command();
    let Some(folder) = &arguments.output else {
        return super::print(&String::from_utf8_lossy(&page(command)?));
    };
    std::fs::create_dir_all(folder).map_err(|error| Failure::io("make the folder", folder, error))?;
    let mut written = String::new();
    for (name, command) in pages(command) {
        let path = folder.join(format!("{name}.1"));
        write_atomically(&path, &page(command)?)?;
        written += &format!("{}\n", path.display());
    }
    super::print(&written)
}

/// The command and its commands under the names of their pages.
fn pages(mut command: clap::Command) -> Vec<(String, clap::Command)> {
    command.build();
    let mut pages = vec![("topipe".to_owned(), command.clone())];
    for sub in command.get_subcommands().filter(|sub| !sub.is_hide_set() && sub.get_name() != "help") {
        // `build` has given it the name to show.
        pages.push((format!("topipe-{}", sub.get_name()), sub.clone()));
    }
    pages
}

fn page(command: clap::Command) -> Result<Vec<u8>, Failure> {
    let mut text = Vec::new();
    clap_mangen::Man::new(command)
        .render(&mut text)
        .map_err(|error| Failure::new(ExitCode::StageFailed, error.to_string()))?;
    Ok(text)
}
