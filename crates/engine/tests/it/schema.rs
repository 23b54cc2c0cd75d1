//! What the engine tells about stages.

use crate::toy::registry;
use topipe_engine::{parameter_fields, pipeline_schema};

#[test]
fn fields_have_type_default_and_meaning_in_the_order_of_declaration() {
    let registry = registry();
    let fields = parameter_fields(registry.stage("append").unwrap().as_ref());
    let told: Vec<String> = fields
        .iter()
        .map(|field| format!("{}: {} = {} ({})", field.name, field.type_name, field.default, field.doc))
        .collect();
    assert_eq!(
        told,
        [
            "suffix: string = \"!\" (What is added.)",
            "times: integer = 1 (How often.)",
            "style: \"as-is\" | \"upper\" = \"as-is\" (Style of the result.)",
            "weight: number = 0.5 (Unused by the computation.)",
        ]
    );
}

#[test]
fn the_schema_has_all_kinds_with_all_their_fields() {
    let schema = pipeline_schema(&registry());
    let variants = schema["properties"]["stage"]["additionalProperties"]["oneOf"].as_array().unwrap();
    let kinds: Vec<&str> =
        variants.iter().map(|kind| kind["properties"]["kind"]["const"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["read", "append", "count", "trouble"]);
    assert_eq!(variants[1]["required"], serde_json::json!(["kind", "input"]));
    assert_eq!(variants[1]["properties"]["times"]["default"], 1);
    assert_eq!(variants[0]["required"], serde_json::json!(["kind", "path"]));
    // Every reference leads somewhere.
    let text = schema.to_string();
    for name in text.split("#/definitions/").skip(1).map(|rest| rest.split('"').next().unwrap()) {
        assert!(schema["definitions"].get(name).is_some(), "{name} is not defined");
    }
}
