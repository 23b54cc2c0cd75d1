//! `topipe stages [KIND]`.

use crate::failure::Failure;
use crate::stages::registry;
use std::fmt::Write;
use topipe_engine::{AnyStage, ExitCode, Registry, nearest, parameter_fields};

pub(crate) fn run(kind: Option<&str>) -> Result<ExitCode, Failure> {
    let registry = registry();
    let Some(kind) = kind else { return super::print(&list(&registry)) };
    match registry.stage(kind) {
        Some(stage) => super::print(&describe(stage.as_ref(), &registry)),
        None => {
            let kinds: Vec<&str> = registry.stages().map(|stage| stage.kind()).collect();
            let help = match nearest(kind, kinds.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("possible are {}", kinds.join(", ")),
            };
            Err(Failure::new(ExitCode::Usage, format!("there is no kind `{kind}`; {help}")))
        }
    }
}

fn list(registry: &Registry) -> String {
    let mut text = String::new();
    let width = registry.stages().map(|stage| stage.kind().len()).max().unwrap_or(0);
    for stage in registry.stages() {
        let _ = writeln!(text, "{:width$}  {}", stage.kind(), stage.summary());
    }
    text
}

/// The fields of a kind as a commented table of a pipeline.
fn describe(stage: &dyn AnyStage, registry: &Registry) -> String {
    let output = stage.output();
    let mut text = format!("# {}\n", stage.summary());
    let endings: Vec<String> = registry.endings(&output).iter().map(|ending| format!(".{ending}")).collect();
    let _ = writeln!(text, "# Makes: {}. Exports: {}.", output.name, endings.join(", "));
    let _ = writeln!(text, "[stage.NAME]\nkind = \"{}\"", stage.kind());
    for port in stage.inputs() {
        let optional = if port.optional { ", optional" } else { "" };
        let _ =
            writeln!(text, "\n# {} Names a stage that makes: {}{optional}.", port.doc, port.artifact.name);
        let comment = if port.optional { "# " } else { "" };
        let _ = writeln!(text, "{comment}{} = \"STAGE\"", port.name);
    }
    for file in stage.files() {
        let (comment, optional) = if file.optional { ("# ", " Optional.") } else { ("", "") };
        let _ = writeln!(text, "\n# {}{optional}\n{comment}{} = \"FILE\"", file.doc, file.name);
    }
    for field in parameter_fields(stage) {
        let _ = writeln!(text, "\n{}", wrapped(&field.doc));
        if field.default.is_null() {
            let _ = writeln!(text, "# {} = ({}; not set)", field.name, field.type_name);
        } else {
            let _ = writeln!(text, "{} = {}    # {}", field.name, field.default, field.type_name);
        }
    }
    text
}

/// A comment of lines of about 100 characters.
fn wrapped(text: &str) -> String {
    let mut lines = vec!["#".to_owned()];
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + word.chars().count() < 100 => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(format!("# {word}")),
        }
    }
    lines.join("\n")
}
