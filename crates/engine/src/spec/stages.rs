//! The `[stage.NAME]` tables.

use super::overrides::Sourced;
use super::parameters::{self, Given};
use super::{Checked, FileInput, Place, StageNode, string, table, with_article};
use crate::diagnostic::{Diagnostic, Source};
use crate::registry::Registry;
use crate::stage::AnyStage;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A stage with the places of its inputs, for messages about the graph.
pub(crate) struct PlacedStage {
    pub(crate) node: StageNode,
    pub(crate) input_places: BTreeMap<&'static str, Place>,
}

/// Where one text speaks of one stage.
struct Section<'t, 's> {
    name: &'t str,
    place: Place,
    stage: &'t Arc<dyn AnyStage>,
    entries: Vec<(Arc<Source>, Entry<'s>)>,
}

type Entry<'s> = (Spanned<toml::de::DeString<'s>>, Spanned<DeValue<'s>>);

pub(super) fn resolve(
    source: &Arc<Source>,
    path: &Path,
    stages: Option<&Spanned<DeValue<'_>>>,
    overrides: &[Sourced],
    registry: &Registry,
) -> Checked<Vec<PlacedStage>> {
    let no_stage =
        || Box::new(Diagnostic::new(source, 0..0, "the pipeline has no stage").help("add `[stage.NAME]`"));
    let all = table(source, stages.ok_or_else(no_stage)?, "`stage`")?;
    if all.is_empty() {
        return Err(no_stage());
    }
    let names: Vec<&str> = all.keys().map(|key| key.get_ref().as_ref()).collect();
    for over in overrides {
        if !names.contains(&over.stage.as_str()) {
            return Err(Box::new(
                Diagnostic::new(
                    &over.source,
                    over.stage_span(),
                    format!("there is no stage `{}`", over.stage),
                )
                .suggest(&over.stage, names.iter().copied()),
            ));
        }
    }
    let mut resolved = Vec::new();
    let mut wanted = Vec::new();
    for (key, value) in all.iter() {
        let mine: Vec<&Sourced> =
            overrides.iter().filter(|over| over.stage == key.get_ref().as_ref()).collect();
        let (node, inputs) = one(source, path, key, value, &mine, registry)?;
        resolved.push(node);
        wanted.push(inputs);
    }
    connect(resolved, &wanted)
}

/// Port name, name of the stage wanted there, and where that is said.
type Wanted = BTreeMap<&'static str, (String, Place)>;

fn one(
    source: &Arc<Source>,
    path: &Path,
    key: &Spanned<toml::de::DeString<'_>>,
    value: &Spanned<DeValue<'_>>,
    overrides: &[&Sourced],
    registry: &Registry,
) -> Checked<(StageNode, Wanted)> {
    let name = key.get_ref().as_ref();
    if !super::is_name(name) || name.contains('.') {
        return Err(Box::new(
            Diagnostic::new(source, key.span(), format!("`{name}` cannot be the name of a stage"))
                .help("use letters, digits, `-` and `_`"),
        ));
    }
    let table = table(source, value, &format!("stage `{name}`"))?;
    let stage = kind(source, key, table, registry)?;
    let section = Section {
        name,
        place: Place { source: Arc::clone(source), span: key.span() },
        stage,
        entries: table
            .iter()
            .map(|(key, value)| {
                let key = Spanned::new(key.span(), key.get_ref().clone());
                (Arc::clone(source), (key, value.clone()))
            })
            .collect(),
    };
    let override_tables = overrides.iter().map(|over| over.table()).collect::<Checked<Vec<_>>>()?;

    let mut wanted = Wanted::new();
    let mut files = BTreeMap::new();
    let mut rest = DeTable::new();
    for (source, (key, value)) in &section.entries {
        match accept(&section, source, key, value)? {
            Role::Kind => {}
            Role::Input(port, text) => {
                wanted.insert(port, (text, Place { source: Arc::clone(source), span: value.span() }));
            }
            Role::File(field, text) => {
                let directory = path.parent().unwrap_or(Path::new(""));
                let place = Place { source: Arc::clone(source), span: value.span() };
                files.insert(field.to_owned(), FileInput { path: directory.join(text), place });
            }
            Role::Parameter => {
                rest.insert(Spanned::new(key.span(), key.get_ref().clone()), value.clone());
            }
        }
    }
    let mut parameter_overrides = Vec::new();
    for (over, entries) in overrides.iter().zip(&override_tables) {
        for (key, value) in entries.iter() {
            let place = Place { source: Arc::clone(&over.source), span: value.span() };
            match accept(&section, &over.source, key, value)? {
                Role::Kind => {
                    let message = "the kind of a stage cannot be set on the command line";
                    return Err(Box::new(Diagnostic::new(&over.source, key.span(), message)));
                }
                Role::Input(port, text) => {
                    wanted.insert(port, (text, place));
                }
                // A path on the command line is relative to where the command is given.
                Role::File(field, text) => {
                    let base =
                        if over.in_spec { path.parent().unwrap_or(Path::new("")) } else { Path::new("") };
                    files.insert(field.to_owned(), FileInput { path: base.join(text), place });
                }
                Role::Parameter => parameter_overrides.push((*over, entries.clone())),
            }
        }
    }
    require(&section, &wanted, &files)?;
    let given = Given { spec: (source, rest), overrides: parameter_overrides };
    let set_here: Vec<String> = given
        .overrides
        .iter()
        .filter(|(over, _)| !over.in_spec)
        .flat_map(|(_, entries)| entries.keys().map(|key| key.get_ref().clone().into_owned()))
        .collect();
    let parameters = parameters::resolve(stage.as_ref(), name, &section.place, given)?;
    for pointer in &parameters.nested_files {
        let Some(text) = parameters.json.pointer(pointer).and_then(serde_json::Value::as_str) else {
            continue;
        };
        let field = pointer.split('/').nth(1).unwrap_or_default();
        let on_command_line = set_here.iter().any(|set| set == field);
        let base = if on_command_line { Path::new("") } else { path.parent().unwrap_or(Path::new("")) };
        files.insert(pointer.clone(), FileInput { path: base.join(text), place: section.place.clone() });
    }
    let node = StageNode {
        name: name.to_owned(),
        base: name.to_owned(),
        stage: Arc::clone(stage),
        inputs: BTreeMap::new(),
        files,
        parameters,
        place: section.place,
    };
    Ok((node, wanted))
}

/// The kind of a stage.
fn kind<'r>(
    source: &Arc<Source>,
    key: &Spanned<toml::de::DeString<'_>>,
    table: &DeTable<'_>,
    registry: &'r Registry,
) -> Checked<&'r Arc<dyn AnyStage>> {
    let kinds: Vec<&str> = registry.stages().map(|stage| stage.kind()).collect();
    let Some(value) = table.get("kind") else {
        return Err(Box::new(
            Diagnostic::new(source, key.span(), format!("stage `{}` has no `kind`", key.get_ref()))
                .suggest("", kinds),
        ));
    };
    let kind = string(source, value, "`kind`")?;
    registry.stage(&kind).ok_or_else(|| {
        Box::new(
            Diagnostic::new(source, value.span(), format!("unknown kind `{kind}`")).suggest(&kind, kinds),
        )
    })
}

/// What an entry of a stage's table is.
enum Role {
    Kind,
    Input(&'static str, String),
    File(&'static str, String),
    Parameter,
}

fn accept(
    section: &Section<'_, '_>,
    source: &Arc<Source>,
    key: &Spanned<toml::de::DeString<'_>>,
    value: &Spanned<DeValue<'_>>,
) -> Checked<Role> {
    let field = key.get_ref().as_ref();
    if field == "kind" {
        return Ok(Role::Kind);
    }
    if let Some(port) = section.stage.inputs().into_iter().find(|port| port.name == field) {
        return Ok(Role::Input(port.name, string(source, value, &format!("`{field}` names a stage: it"))?));
    }
    if let Some(file) = section.stage.files().into_iter().find(|file| file.name == field) {
        return Ok(Role::File(file.name, string(source, value, &format!("`{field}` names a file: it"))?));
    }
    let known = section.stage.field_names();
    if known.iter().any(|name| name == field) {
        return Ok(Role::Parameter);
    }
    let message = format!("unknown field `{field}` in stage `{}` ({})", section.name, section.stage.kind());
    Err(Box::new(
        Diagnostic::new(source, key.span(), message)
            .suggest(field, known.iter().map(String::as_str).chain(["kind"])),
    ))
}

/// Every input and file that must be given is given.
fn require(section: &Section<'_, '_>, wanted: &Wanted, files: &BTreeMap<String, FileInput>) -> Checked<()> {
    let missing = |field: &str, doc: &str, help: String| {
        let doc = doc.trim_end_matches('.');
        let message = format!("stage `{}` ({}) needs `{field}`: {doc}", section.name, section.stage.kind());
        Box::new(section.place.diagnostic(message).help(help))
    };
    for port in section.stage.inputs() {
        if !port.optional && !wanted.contains_key(port.name) {
            let makes = with_article(port.artifact.name);
            let help = format!("add `{} = \"STAGE\"` with the name of a stage that makes {makes}", port.name);
            return Err(missing(port.name, port.doc, help));
        }
    }
    for file in section.stage.files() {
        if !file.optional && !files.contains_key(file.name) {
            return Err(missing(file.name, file.doc, format!("add `{} = \"FILE\"`", file.name)));
        }
    }
    Ok(())
}

/// Replaces names by indices and checks that each port gets what it takes.
fn connect(mut nodes: Vec<StageNode>, wanted: &[Wanted]) -> Checked<Vec<PlacedStage>> {
    let known: Vec<(String, crate::ArtifactType)> =
        nodes.iter().map(|node| (node.name.clone(), node.stage.output())).collect();
    let index_of: HashMap<String, usize> =
        known.iter().enumerate().map(|(index, (name, _))| (name.clone(), index)).collect();
    let mut placed = Vec::new();
    for (node, wanted) in nodes.drain(..).zip(wanted) {
        let mut node = node;
        let mut input_places = BTreeMap::new();
        for port in node.stage.inputs() {
            let Some((target, place)) = wanted.get(port.name) else { continue };
            let fitting = || -> Vec<&str> {
                let fits = |(name, artifact): &&(String, crate::ArtifactType)| {
                    *artifact == port.artifact && *name != node.name
                };
                known.iter().filter(fits).map(|(name, _)| name.as_str()).collect()
            };
            let Some(&index) = index_of.get(target) else {
                let message = format!("there is no stage `{target}`");
                let all = known.iter().map(|(name, _)| name.as_str());
                return Err(Box::new(match crate::diagnostic::nearest(target, all) {
                    Some(near) => place.diagnostic(message).help(format!("did you mean `{near}`?")),
                    None => place.diagnostic(message).suggest(target, fitting()),
                }));
            };
            let made = known[index].1;
            if made != port.artifact {
                let message = format!(
                    "`{}` of stage `{}` takes {}, but stage `{target}` makes {}",
                    port.name,
                    node.name,
                    with_article(port.artifact.name),
                    with_article(made.name)
                );
                let fitting = fitting();
                let list = fitting.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
                let help = if fitting.is_empty() {
                    format!("no stage of this pipeline makes {}", with_article(port.artifact.name))
                } else {
                    format!("{} is made by {list}", with_article(port.artifact.name))
                };
                return Err(Box::new(place.diagnostic(message).help(help)));
            }
            node.inputs.insert(port.name, index);
            input_places.insert(port.name, place.clone());
        }
        placed.push(PlacedStage { node, input_places });
    }
    Ok(placed)
}
