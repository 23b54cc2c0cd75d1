//! `topipe edit`: a pipeline for an edited part that keeps what the edit does not touch.

use crate::args::EditArguments;
use crate::failure::Failure;
use crate::stages::registry;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use toml::{Table, Value};
use topipe_engine::cache::write_atomically;
use topipe_engine::{ExitCode, Registry};

pub(crate) fn run(arguments: &EditArguments) -> Result<ExitCode, Failure> {
    let registry = registry();
    let pipeline = &arguments.pipeline;
    super::pipeline::load(pipeline, &[], &registry)?;
    let usage = |message: String| Failure::new(ExitCode::Usage, message);
    let text = std::fs::read_to_string(pipeline).map_err(|error| Failure::io("read", pipeline, error))?;
    let spec: Table = text.parse().map_err(|error| usage(format!("{}: {error}", pipeline.display())))?;
    let output = arguments.output.clone().unwrap_or_else(|| output(pipeline, arguments.mesh.as_deref()));
    // Files are named from where the pipeline is.
    if folder(&output) != folder(pipeline) {
        return Err(usage(format!(
            "{} is not in the folder of {}: paths in it would not lead to their files, and the cache would be another; choose a name there",
            output.display(),
            pipeline.display()
        )));
    }
    if output.exists() && !arguments.overwrite {
        return Err(usage(format!(
            "{} exists; choose another name with --output, or --overwrite",
            output.display()
        )));
    }
    let mesh = match &arguments.mesh {
        None => None,
        Some(mesh) if !mesh.is_file() => return Err(usage(format!("there is no mesh {}", mesh.display()))),
        Some(mesh) => Some(super::new::path_from(&output, mesh)),
    };
    let name = output.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let edited = edited(spec, &registry, mesh.as_deref(), &super::new::pipeline_name(Path::new(&name)))
        .map_err(|problem| usage(format!("{}: {problem}", pipeline.display())))?;
    write_atomically(&output, edited.written(pipeline, &output).as_bytes())?;
    super::pipeline::load(&output, &[], &registry)?;
    let shown = output.display();
    super::print(&format!(
        "{shown} is written; run it with\n    topipe run {shown}\nWhat was before the edit is stages {}: they are in the cache if {} was run.\n",
        edited.copies.join(", "),
        pipeline.display()
    ))
}

/// The pipeline's name with `-edited`, or that of the mesh, beside the pipeline.
fn output(pipeline: &Path, mesh: Option<&Path>) -> PathBuf {
    let stem =
        |path: &Path| path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let name = match mesh {
        Some(mesh) if stem(mesh) != stem(pipeline) => stem(mesh),
        _ => format!("{}-edited", stem(pipeline)),
    };
    pipeline.with_file_name(format!("{name}.toml"))
}

fn folder(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned())
}

/// A pipeline after an edit.
#[derive(Debug)]
struct Edited {
    spec: Table,
    /// The stages as they were, in order.
    copies: Vec<String>,
}

/// What is made of a spec: its stages up to the layout once more under other names, and the new ones with what was before as inputs.
fn edited(mut spec: Table, registry: &Registry, mesh: Option<&str>, name: &str) -> Result<Edited, String> {
    let stages = match spec.get("stage") {
        Some(Value::Table(stages)) => stages.clone(),
        _ => return Err("it has no stages".into()),
    };
    let of_kind = |wanted: &[&str], among: &BTreeSet<String>| -> Vec<String> {
        let is = |name: &&String| among.contains(*name) && wanted.contains(&kind(&stages, name));
        stages.keys().filter(is).cloned().collect()
    };
    let all: BTreeSet<String> = stages.keys().cloned().collect();
    // Of two layouts one was there before an earlier edit.
    let is_input =
        |name: &String| stages.keys().any(|other| field(&stages, other, "earlier_layout") == Some(name));
    let layouts = of_kind(&["quad-matching", "layout-update"], &all);
    let [layout] = &layouts.into_iter().filter(|name| !is_input(name)).collect::<Vec<_>>()[..] else {
        return Err("it has not one layout, a stage of kind \"quad-matching\" or \"layout-update\"".into());
    };
    let version = (1..).find(|n| !all.contains(&format!("{layout}-{n}"))).unwrap_or(1);
    let suffix = format!("-{version}");
    // What came from an edit before stays what it is.
    let known = |name: &str| (1..version).any(|n| name.ends_with(&format!("-{n}")));
    let before: BTreeSet<String> =
        ancestors(&stages, layout, registry).into_iter().filter(|name| !known(name)).collect();
    let copied = |name: &str| format!("{name}{suffix}");
    if let Some(taken) = before.iter().map(|name| copied(name)).find(|name| all.contains(name)) {
        return Err(format!("it has a stage {taken:?} already, the name for what was before the edit"));
    }

    let mut now = stages.clone();
    let mut copies = Vec::new();
    for name in stages.keys().filter(|name| before.contains(*name)) {
        let mut stage = stages[name].clone();
        for (port, input) in inputs(&stages, name, registry) {
            if before.contains(&input) {
                set(&mut stage, &port, copied(&input));
            }
        }
        copies.push(copied(name));
        now.insert(copied(name), stage);
    }

    if let Some(path) = mesh {
        let imports = of_kind(&["import"], &before);
        let [import] = &imports[..] else {
            return Err(format!(
                "it has {} stages of kind \"import\" before the layout, not one",
                imports.len()
            ));
        };
        set(&mut now[import], "path", path.into());
        // Labels are those of the earlier mesh, face by face; the edited one may have others in another order.
        let labels = ["labels", "earlier"].iter().filter(|name| field(&stages, import, name).is_some());
        if labels.count() > 0 {
            if let Value::Table(import) = &mut now[import] {
                import.remove("labels");
            }
            set(&mut now[import], "earlier", copied(import));
        }
    }
    for smoothing in of_kind(&["smoothing"], &before) {
        if let Some(input) = field(&stages, &smoothing, "input") {
            set(
                &mut now[&smoothing],
                "earlier_input",
                if before.contains(input) { copied(input) } else { input.clone() },
            );
            set(&mut now[&smoothing], "earlier", copied(&smoothing));
        }
    }
    update_layout(&stages, &mut now, layout, &copied)?;
    // The tiling is that of before.
    let tiles = field(&stages, layout, "input").filter(|_| kind(&stages, layout) == "quad-matching").cloned();
    let export = spec.get("export").and_then(Value::as_table);
    let is_used = |name: &String| {
        now.keys().any(|stage| inputs(&now, stage, registry).iter().any(|(_, input)| input == name))
            || export.is_some_and(|export| export.values().any(|stage| stage.as_str() == Some(name)))
    };
    if let Some(tiles) = tiles.filter(|tiles| !is_used(tiles)) {
        now.remove(&tiles);
    }
    spec.insert("name".into(), name.into());
    spec.insert("stage".into(), Value::Table(now));
    Ok(Edited { spec, copies })
}

/// Makes the layout one that is carried over.
fn update_layout(
    stages: &Table,
    now: &mut Table,
    layout: &str,
    copied: &impl Fn(&str) -> String,
) -> Result<(), String> {
    let parameters = |name: &str| -> Table {
        let mut table = stages[name].as_table().cloned().unwrap_or_default();
        ["kind", "input"].iter().for_each(|field| drop(table.remove(*field)));
        table
    };
    let mut stage = Table::new();
    stage.insert("kind".into(), "layout-update".into());
    let input = field(stages, layout, "input").ok_or_else(|| format!("stage {layout:?} has no input"))?;
    let (smooth, tiles, quads) = match kind(stages, layout) {
        "layout-update" => {
            let own = parameters(layout);
            let table = |name: &str| own.get(name).and_then(Value::as_table).cloned().unwrap_or_default();
            (input, table("tiles"), table("quads"))
        }
        _ => {
            if kind(stages, input) != "tiling" {
                return Err(format!("the input of stage {layout:?} is not of kind \"tiling\""));
            }
            let smooth =
                field(stages, input, "input").ok_or_else(|| format!("stage {input:?} has no input"))?;
            stage.insert("earlier_tiling".into(), copied(input).into());
            (smooth, parameters(input), parameters(layout))
        }
    };
    stage.insert("input".into(), smooth.clone().into());
    stage.insert("earlier_mesh".into(), copied(smooth).into());
    stage.insert("earlier_layout".into(), copied(layout).into());
    for (name, table) in [("tiles", tiles), ("quads", quads)] {
        if !table.is_empty() {
            stage.insert(name.into(), Value::Table(table));
        }
    }
    now.insert(layout.into(), Value::Table(stage));
    Ok(())
}

fn field<'t>(stages: &'t Table, stage: &str, name: &str) -> Option<&'t String> {
    match stages.get(stage)?.get(name)? {
        Value::String(text) => Some(text),
        _ => None,
    }
}

fn kind<'t>(stages: &'t Table, stage: &str) -> &'t str {
    field(stages, stage, "kind").map_or("", String::as_str)
}

fn set(stage: &mut Value, name: &str, text: String) {
    if let Value::Table(stage) = stage {
        stage.insert(name.into(), Value::String(text));
    }
}

/// The ports of a stage that are set, and the stages they name.
fn inputs(stages: &Table, stage: &str, registry: &Registry) -> Vec<(String, String)> {
    let ports = registry.stage(kind(stages, stage)).map(|stage| stage.inputs()).unwrap_or_default();
    let set = |port: topipe_engine::InputPort| {
        Some((port.name.to_owned(), field(stages, stage, port.name)?.clone()))
    };
    ports.into_iter().filter_map(set).collect()
}

/// A stage and all that it is made of.
fn ancestors(stages: &Table, stage: &str, registry: &Registry) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open = vec![stage.to_owned()];
    while let Some(name) = open.pop() {
        if found.insert(name.clone()) {
            open.extend(inputs(stages, &name, registry).into_iter().map(|(_, input)| input));
        }
    }
    found
}

impl Edited {
    /// As text, the new stages first.
    fn written(&self, pipeline: &Path, output: &Path) -> String {
        let file = |path: &Path| {
            path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
        };
        let (before, now) = (file(pipeline), file(output));
        let section = |table: Table| toml::to_string(&table).unwrap_or_default();
        let one = |name: &str, value: &Value| Table::from_iter([(name.to_owned(), value.clone())]);
        let mut text = format!(
            "# {before} after an edit: what the edit does not touch stays as it was there, and is not fitted again.\n#\n# Run it:                        \
             topipe run {now}\n# What would run, and why:       topipe plan {now}\n"
        );
        for (name, value) in self.spec.iter().filter(|(_, value)| !value.is_table()) {
            text += &section(one(name, value));
        }
        let stages = self.spec.get("stage").and_then(Value::as_table);
        let stages = |copies: bool| {
            let stages = stages.into_iter().flatten();
            stages.filter(move |(name, _)| self.copies.contains(name) == copies)
        };
        let written = |name: &str, value: &Value| {
            format!("\n{}", section(one("stage", &Value::Table(one(name, value)))))
        };
        stages(false).for_each(|(name, value)| text += &written(name, value));
        for (name, value) in self.spec.iter().filter(|(name, value)| value.is_table() && *name != "stage") {
            text += &format!("\n{}", section(one(name, value)));
        }
        text += &format!("\n# As it was in {before}; taken from the cache.\n");
        stages(true).for_each(|(name, value)| text += &written(name, value));
        text
    }
}
