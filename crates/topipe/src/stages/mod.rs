//! The kinds of stages. A new one is one file here and one line in [`registry`].

mod beams;
mod import;
mod layout_update;
mod quad_matching;
mod remeshing;
mod simp;
mod sizing;
mod skeleton;
mod smoothing;
mod smoothing_study;
mod spline_fit;
mod stiffness;
mod tiling;
mod validation;

use topipe_engine::Registry;

/// All kinds of stages and all writers.
pub fn registry() -> Registry {
    Registry::new()
        .with_stage(import::Import)
        .with_stage(simp::Simp)
        .with_stage(remeshing::Remeshing)
        .with_stage(smoothing::Smoothing)
        .with_stage(smoothing_study::SmoothingStudy)
        .with_stage(tiling::Tiling)
        .with_stage(quad_matching::QuadMatching)
        .with_stage(layout_update::LayoutUpdate)
        .with_stage(spline_fit::SplineFit)
        .with_stage(skeleton::Skeleton)
        .with_stage(beams::Beams)
        .with_stage(sizing::Sizing)
        .with_stage(stiffness::CompareStiffness)
        .with_stage(validation::Validation)
        .with_exporters(crate::export::exporters())
        .with_file_after_run("html")
}

/// The field and the text of a parameter error, for messages that point at the field.
fn bad_value(field: &str, error: &impl std::error::Error) -> topipe_engine::BadValue {
    topipe_engine::BadValue { field: field.to_owned(), message: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use std::collections::BTreeMap;
    use topipe_engine::{AnyStage, ContentHash, ParameterField, parameter_fields};

    /// Another value than the default, as TOML.
    fn another(kind: &str, field: &ParameterField) -> String {
        let variants: Vec<&str> = field.type_name.split(" | ").collect();
        match (&field.default, field.type_name.as_str()) {
            (Value::Bool(value), _) => (!value).to_string(),
            (Value::Number(number), "integer") => (number.as_u64().unwrap() + 1).to_string(),
            (Value::Number(number), _) => format!("{:?}", number.as_f64().unwrap() + 0.125),
            (Value::String(_), "string") => "\"another\"".into(),
            (Value::String(value), _) => {
                (*variants.iter().find(|variant| **variant != format!("{value:?}")).unwrap()).into()
            }
            (Value::Null, "string") => "\"another\"".into(),
            (Value::Null, "boolean") => "true".into(),
            (Value::Null, "integer") => "7".into(),
            (Value::Null, "number") => "7.5".into(),
            (Value::Object(_), _) if field.name == "tiles" => "{ tile_size = 2.5 }".into(),
            (Value::Object(_), _) if field.name == "quads" => "{ snap = 0.2 }".into(),
            (Value::Array(_), _) if field.name == "weights" => "[1.0, 1.0, 1.0, 1.0]".into(),
            (Value::Array(_), "list of number") => "[0.375]".into(),
            (Value::Array(_), _) if field.name == "non_design" => {
                "[{ type = \"box\", min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }]".into()
            }
            (Value::Array(_), _) if ["domain", "subtract"].contains(&field.name.as_str()) => {
                "[{ type = \"box\", min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }]".into()
            }
            (Value::Array(_), _) if field.name == "symmetry" => "[\"y\"]".into(),
            (Value::Null, _) if field.name == "average_along" => "\"y\"".into(),
            (Value::Array(_), _) if field.name == "features" => {
                "[{ action = \"drop\", space = { type = \"non-design\" } }]".into()
            }
            (Value::Array(_), _) if field.name == "profiles" => {
                "[{ name = \"bar\", shape = \"round\", dimensions = [7.3] }]".into()
            }
            (Value::Array(_), _) if field.name == "supports" && kind != "beams" => {
                "[{ region = { type = \"box\", min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] } }]".into()
            }
            (Value::Array(_), _) if field.name == "loads" && kind != "beams" => {
                "[{ region = { type = \"feature\", near = [0.0, 0.0, 0.0] }, pressure = 1.0 }]".into()
            }
            (Value::Array(_), _) if field.name == "supports" => "[{ at = [0.0, 0.0, 0.0] }]".into(),
            (Value::Array(_), _) if field.name == "loads" => {
                "[{ at = [0.0, 0.0, 0.0], force = [1.0, 0.0, 0.0] }]".into()
            }
            _ => panic!("say here what another value of {field:?} is"),
        }
    }

    fn resolved(stage: &dyn AnyStage, text: &str) -> Value {
        stage.parse(toml::de::Deserializer::parse(text).unwrap()).unwrap().json
    }

    /// The key hashes the resolved parameters: a field that does not show in them could change without a rerun.
    #[test]
    fn every_field_shows_in_what_the_key_is_made_of() {
        let mut fields = 0;
        for stage in registry().stages() {
            let default = resolved(stage.as_ref(), "");
            assert_eq!(default, stage.default_parameters());
            for field in parameter_fields(stage.as_ref()) {
                let text = format!("{} = {}", field.name, another(stage.kind(), &field));
                let edited = resolved(stage.as_ref(), &text);
                assert_ne!(edited, default, "{}: {text}", stage.kind());
                fields += 1;
            }
        }
        assert!(fields > 30, "only {fields} fields were tried");
    }

    /// Fields that do not change the key, and why.
    const IGNORED: [(&str, &str, &str); 1] =
        [("import", "/non_design/0/path", "names a file, which counts by its content")];

    /// Every number, word and switch inside of the parameters, by JSON pointer.
    fn leaves(at: String, value: &Value, found: &mut Vec<(String, Value)>) {
        match value {
            Value::Object(fields) => fields.iter().for_each(|(k, v)| leaves(format!("{at}/{k}"), v, found)),
            Value::Array(items) => {
                items.iter().enumerate().for_each(|(k, v)| leaves(format!("{at}/{k}"), v, found))
            }
            leaf => found.push((at, leaf.clone())),
        }
    }

    fn keyed(
        stage: &dyn AnyStage,
        text: &str,
        edit: impl Fn(&mut Inputs, &mut Files),
    ) -> Option<ContentHash> {
        let parameters = stage.parse(toml::de::Deserializer::parse(text).ok()?).ok()?;
        let hash = ContentHash::of(b"some content");
        let mut inputs: Inputs = stage.inputs().iter().map(|port| (port.name, hash)).collect();
        let mut files: Files =
            stage.files().iter().map(|file| (file.name.to_owned(), ("stl".to_owned(), hash))).collect();
        edit(&mut inputs, &mut files);
        Some(topipe_engine::stage_key(stage, &parameters, &inputs, &files))
    }

    type Inputs = BTreeMap<&'static str, ContentHash>;
    type Files = BTreeMap<String, (String, ContentHash)>;

    /// What a result may depend on is in its key: parameters to their last leaf, inputs, files and their endings.
    #[test]
    fn everything_changes_the_key_or_stands_on_the_list() {
        let other = ContentHash::of(b"other content");
        let mut keys = Vec::new();
        for stage in registry().stages() {
            let stage = stage.as_ref();
            let base = keyed(stage, "", |_, _| {}).unwrap();
            let mut expect = |what: String, key: Option<ContentHash>| {
                let key = key.unwrap_or_else(|| panic!("{}: {what} cannot be tried", stage.kind()));
                assert_ne!(key, base, "{}: {what} does not change the key", stage.kind());
                keys.push(key);
            };
            for port in stage.inputs() {
                expect(
                    port.name.into(),
                    keyed(stage, "", |inputs, _| {
                        inputs.insert(port.name, other);
                    }),
                );
                expect(
                    port.name.into(),
                    keyed(stage, "", |inputs, _| {
                        inputs.remove(port.name);
                    }),
                );
            }
            for file in stage.files() {
                let set = |ending: &str, hash| {
                    keyed(stage, "", |_, files| drop(files.insert(file.name.into(), (ending.into(), hash))))
                };
                expect(file.name.into(), set("stl", other));
                expect(file.name.into(), set("ply", ContentHash::of(b"some content")));
                expect(file.name.into(), keyed(stage, "", |_, files| drop(files.remove(file.name))));
            }
            for field in parameter_fields(stage) {
                let text = format!("{} = {}", field.name, another(stage.kind(), &field));
                expect(text.clone(), keyed(stage, &text, |_, _| {}));
                // And what is inside of it.
                let whole = resolved(stage, &text);
                let mut inside = Vec::new();
                leaves(format!("/{}", field.name), &whole[&field.name], &mut inside);
                for (pointer, leaf) in
                    inside.into_iter().filter(|(pointer, _)| pointer.matches('/').count() > 1)
                {
                    let changed = match &leaf {
                        Value::Bool(value) => Value::Bool(!value),
                        Value::Number(number) if number.is_u64() => (number.as_u64().unwrap() + 1).into(),
                        Value::Number(number) => (number.as_f64().unwrap() + 0.125).into(),
                        _ => continue,
                    };
                    let mut edited = whole.clone();
                    *edited.pointer_mut(&pointer).unwrap() = changed;
                    let edited = toml::to_string(&without_null(&edited)).unwrap();
                    let before = keyed(stage, &text, |_, _| {});
                    let after = keyed(stage, &edited, |_, _| {});
                    assert!(after.is_some_and(|after| Some(after) != before), "{}: {pointer}", stage.kind());
                }
            }
        }
        let count = keys.len();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), count, "two different edits give the same key");
        assert!(count > 60, "only {count} edits were tried");
    }

    fn without_null(value: &Value) -> Value {
        match value {
            Value::Object(fields) => fields
                .iter()
                .filter(|(_, value)| !value.is_null())
                .map(|(name, value)| (name.clone(), without_null(value)))
                .collect(),
            Value::Array(items) => items.iter().map(without_null).collect(),
            other => other.clone(),
        }
    }

    /// The list says what is so.
    #[test]
    fn what_stands_on_the_list_does_not_change_the_key() {
        for (kind, pointer, why) in IGNORED {
            assert!(!why.is_empty());
            assert_eq!((kind, pointer), ("import", "/non_design/0/path"));
            let registry = registry();
            let stage = registry.stage(kind).unwrap().as_ref();
            let named = |name: &str| {
                let text = format!("non_design = [{{ type = \"stl\", path = \"{name}\" }}]");
                keyed(stage, &text, |_, _| {}).unwrap()
            };
            assert_eq!(named("a.stl"), named("b.stl"));
        }
    }

    #[test]
    fn code_versions_differ_and_are_known() {
        let mut versions: Vec<String> = registry().stages().map(|stage| stage.code_version()).collect();
        assert!(versions.iter().all(|version| version.len() == 16));
        versions.sort();
        versions.dedup();
        assert_eq!(versions.len(), 14);
    }
}
