//! The kinds of stages. A new one is one file here and one line in [`registry`].

mod beams;
mod import;
mod quad_matching;
mod skeleton;
mod smoothing;
mod smoothing_study;
mod spline_fit;
mod tiling;
mod validation;

use topipe_engine::Registry;

/// All kinds of stages and all writers.
pub fn registry() -> Registry {
    Registry::new()
        .with_stage(import::Import)
        .with_stage(smoothing::Smoothing)
        .with_stage(smoothing_study::SmoothingStudy)
        .with_stage(tiling::Tiling)
        .with_stage(quad_matching::QuadMatching)
        .with_stage(spline_fit::SplineFit)
        .with_stage(skeleton::Skeleton)
        .with_stage(beams::Beams)
        .with_stage(validation::Validation)
        .with_exporters(crate::export::exporters())
}

/// The field and the text of a parameter error, for messages that point at the field.
fn bad_value(field: &str, error: &impl std::error::Error) -> topipe_engine::BadValue {
    topipe_engine::BadValue { field: field.to_owned(), message: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use topipe_engine::{AnyStage, ParameterField, parameter_fields};

    /// Another value than the default, as TOML.
    fn another(field: &ParameterField) -> String {
        let variants: Vec<&str> = field.type_name.split(" | ").collect();
        match (&field.default, field.type_name.as_str()) {
            (Value::Bool(value), _) => (!value).to_string(),
            (Value::Number(number), "integer") => (number.as_u64().unwrap() + 1).to_string(),
            (Value::Number(number), _) => format!("{:?}", number.as_f64().unwrap() + 0.125),
            (Value::String(_), "string") => "\"another\"".into(),
            (Value::String(value), _) => {
                (*variants.iter().find(|variant| **variant != format!("{value:?}")).unwrap()).into()
            }
            (Value::Null, "boolean") => "true".into(),
            (Value::Null, "integer") => "7".into(),
            (Value::Null, "number") => "7.5".into(),
            (Value::Array(_), _) if field.name == "weights" => "[1.0, 1.0, 1.0, 1.0]".into(),
            (Value::Array(_), "list of number") => "[0.375]".into(),
            (Value::Array(_), _) if field.name == "non_design" => {
                "[{ type = \"box\", min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }]".into()
            }
            (Value::Array(_), _) if field.name == "features" => {
                "[{ action = \"drop\", space = { type = \"non-design\" } }]".into()
            }
            (Value::Array(_), _) if field.name == "profiles" => {
                "[{ name = \"bar\", shape = \"round\", dimensions = [7.3] }]".into()
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
                let text = format!("{} = {}", field.name, another(&field));
                let edited = resolved(stage.as_ref(), &text);
                assert_ne!(edited, default, "{}: {text}", stage.kind());
                fields += 1;
            }
        }
        assert!(fields > 30, "only {fields} fields were tried");
    }

    #[test]
    fn code_versions_differ_and_are_known() {
        let mut versions: Vec<String> = registry().stages().map(|stage| stage.code_version()).collect();
        assert!(versions.iter().all(|version| version.len() == 16));
        versions.sort();
        versions.dedup();
        assert_eq!(versions.len(), 9);
    }
}
