//! What a pipeline may say, for people (`topipe stages`) and for editors (`topipe schema`).

use crate::registry::Registry;
use crate::spec::with_article;
use crate::stage::AnyStage;
use schemars::SchemaGenerator;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

/// A parameter of a stage.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterField {
    /// The field in the spec.
    pub name: String,
    /// Its type in plain words, or the possible values.
    pub type_name: String,
    /// Its value when the spec says nothing.
    pub default: Value,
    /// Meaning, unit and source.
    pub doc: String,
}

/// The parameters of a stage in the order of their declaration.
pub fn parameter_fields(stage: &dyn AnyStage) -> Vec<ParameterField> {
    let mut generator = SchemaSettings::draft2020_12().into_generator();
    let schema = stage.schema(&mut generator).to_value();
    let definitions = Value::Object(generator.take_definitions(true));
    let schema = follow(&schema, &definitions);
    let defaults = stage.default_parameters();
    let Some(properties) = schema.get("properties").and_then(Value::as_object) else { return Vec::new() };
    // serde_json keeps the order of declaration only in the serialized defaults.
    let order = |name: &str| {
        defaults
            .as_object()
            .and_then(|fields| fields.keys().position(|key| key == name))
            .unwrap_or(usize::MAX)
    };
    let mut fields: Vec<ParameterField> = properties
        .iter()
        .map(|(name, property)| ParameterField {
            name: name.clone(),
            type_name: type_name(property, &definitions),
            default: defaults.get(name).cloned().unwrap_or(Value::Null),
            doc: doc(property),
        })
        .collect();
    fields.sort_by_key(|field| order(&field.name));
    fields
}

/// The names of all fields a stage of this kind may have, but `kind`.
pub(crate) fn field_names(stage: &dyn AnyStage) -> Vec<String> {
    let mut names: Vec<String> = stage.inputs().iter().map(|port| port.name.to_owned()).collect();
    names.extend(stage.files().iter().map(|file| file.name.to_owned()));
    names.extend(parameter_fields(stage).into_iter().map(|field| field.name));
    names
}

fn doc(schema: &Value) -> String {
    let text = schema.get("description").and_then(Value::as_str).unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The definition behind a reference.
fn follow<'v>(schema: &'v Value, definitions: &'v Value) -> &'v Value {
    let mut schema = schema;
    // A chain of references longer than this is a circle.
    for _ in 0..16 {
        let Some(reference) = schema.get("$ref").and_then(Value::as_str) else { break };
        let name = reference.rsplit('/').next().unwrap_or_default();
        match definitions.get(name) {
            Some(definition) => schema = definition,
            None => break,
        }
    }
    schema
}

fn type_name(schema: &Value, definitions: &Value) -> String {
    let schema = follow(schema, definitions);
    if let Some(value) = schema.get("const") {
        return value.to_string();
    }
    if let Some(values) = schema.get("enum").and_then(Value::as_array) {
        return values.iter().map(Value::to_string).collect::<Vec<_>>().join(" | ");
    }
    for union in ["oneOf", "anyOf"] {
        if let Some(variants) = schema.get(union).and_then(Value::as_array) {
            let mut names: Vec<String> = variants
                .iter()
                .filter(|variant| variant.get("type").and_then(Value::as_str) != Some("null"))
                .map(|variant| type_name(variant, definitions))
                .collect();
            names.dedup();
            return names.join(" | ");
        }
    }
    match schema.get("type") {
        Some(Value::String(name)) => plain_type(name, schema, definitions),
        Some(Value::Array(names)) => {
            let names: Vec<String> = names
                .iter()
                .filter_map(Value::as_str)
                .filter(|name| *name != "null")
                .map(|name| plain_type(name, schema, definitions))
                .collect();
            names.join(" | ")
        }
        _ => "value".into(),
    }
}

fn plain_type(name: &str, schema: &Value, definitions: &Value) -> String {
    match name {
        "array" => {
            let item =
                schema.get("items").map_or_else(|| "value".into(), |item| type_name(item, definitions));
            match schema.get("maxItems").and_then(Value::as_u64) {
                Some(length) => format!("{length} x {item}"),
                None => format!("list of {item}"),
            }
        }
        "object" => "table".into(),
        other => other.into(),
    }
}

/// The JSON schema of a pipeline.
pub fn pipeline_schema(registry: &Registry) -> Value {
    let mut generator = SchemaSettings::draft07().into_generator();
    let variants: Vec<Value> =
        registry.stages().map(|stage| stage_schema(stage.as_ref(), &mut generator)).collect();
    let definitions = generator.take_definitions(true);
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "A topipe pipeline",
        "type": "object",
        "additionalProperties": false,
        "required": ["stage"],
        "properties": {
            "name": { "type": "string", "description": "Names the output folder; the stem of the file if left out." },
            "stage": {
                "type": "object",
                "description": "The stages by name.",
                "minProperties": 1,
                "additionalProperties": { "oneOf": variants }
            },
            "export": {
                "type": "object",
                "description": "File name = stage; the ending picks the format.",
                "additionalProperties": { "type": "string" }
            },
            "sweep": {
                "type": "object",
                "description": "Many variants of the pipeline: all combinations of cases, rows of zip, and grid.",
                "additionalProperties": false,
                "properties": {
                    "grid": lists("\"STAGE.FIELD\" = [values]: every value with every other."),
                    "zip": lists("\"STAGE.FIELD\" = [values]: first with first, second with second."),
                    "cases": {
                        "type": "array",
                        "description": "Variants one by one: { name = \"...\", \"STAGE.FIELD\" = value }.",
                        "items": { "type": "object", "properties": { "name": { "type": "string" } } }
                    },
                    "figures": {
                        "type": "array",
                        "description": "Columns of the table of results: \"STAGE.PATH\" into the stage's report.",
                        "items": { "type": "string" }
                    }
                }
            }
        },
        "definitions": definitions
    })
}

fn lists(description: &str) -> Value {
    let values = json!({ "anyOf": [{ "type": "array" }, { "type": "object" }] });
    json!({ "type": "object", "description": description, "additionalProperties": values })
}

fn stage_schema(stage: &dyn AnyStage, generator: &mut SchemaGenerator) -> Value {
    let schema = stage.schema(generator).to_value();
    let defaults = stage.default_parameters();
    let mut properties = Map::new();
    let mut required = vec![json!("kind")];
    properties.insert("kind".into(), json!({ "const": stage.kind(), "description": stage.summary() }));
    for port in stage.inputs() {
        let text = format!("{} Names a stage that makes {}.", port.doc, with_article(port.artifact.name));
        properties.insert(port.name.into(), json!({ "type": "string", "description": text }));
        if !port.optional {
            required.push(json!(port.name));
        }
    }
    for file in stage.files() {
        properties.insert(file.name.into(), json!({ "type": "string", "description": file.doc }));
        if !file.optional {
            required.push(json!(file.name));
        }
    }
    for (name, property) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
        let mut property = property.clone();
        if let (Some(fields), Some(default)) = (property.as_object_mut(), defaults.get(name)) {
            fields.insert("default".into(), default.clone());
        }
        properties.insert(name.clone(), property);
    }
    json!({
        "type": "object",
        "title": stage.kind(),
        "description": stage.summary(),
        "additionalProperties": false,
        "required": required,
        "properties": properties
    })
}
