//! JSON Schema of graph files, for completion and validation in editors.

use schemars::Schema;
use schemars::generate::SchemaSettings;
use serde_json::{Value as Json, json};

use super::model::GraphTable;
use super::values::{NAME_PATTERN, ROBOT_NAME_PATTERN};
use crate::worker::Registry;

/// Returns the JSON Schema of graph files with the kinds of components in `registry`. The schema follows
/// draft 7, which editors support best.
pub fn schema(registry: &Registry) -> Schema {
    let mut generator = SchemaSettings::draft07().for_deserialize().into_generator();
    let configs: Vec<Json> =
        registry.kinds().iter().map(|kind| kind.schema(&mut generator).to_value()).collect();
    let mut schema = generator.into_root_schema_for::<GraphTable<'static>>();
    let configs: Vec<(Json, Vec<&str>)> =
        configs.into_iter().map(|config| (config.clone(), required(&config, &schema))).collect();
    for (table, pattern) in [("component", NAME_PATTERN), ("robot", ROBOT_NAME_PATTERN)] {
        if let Some(names) = schema.pointer_mut(&format!("/properties/{table}")).and_then(Json::as_object_mut)
        {
            names.insert("propertyNames".into(), json!({ "pattern": pattern }));
        }
    }
    if let Some(component) = schema.pointer_mut("/definitions/Component").and_then(Json::as_object_mut) {
        let kinds = registry.kinds().iter();
        let names: Vec<Json> =
            kinds.clone().map(|kind| json!({ "const": kind.name, "description": kind.summary })).collect();
        if let Some(kind) = component.get_mut("properties").and_then(|keys| keys.get_mut("kind")) {
            kind["oneOf"] = Json::Array(names);
        }
        let mut rules = vec![exactly_one(&["kind", "exec"]), exactly_one(&["rate", "trigger", "activate"])];
        rules.push(json!({ "if": { "required": ["phase"] }, "then": { "required": ["rate"] } }));
        rules.extend(kinds.zip(configs).map(|(kind, (config, required))| {
            json!({
                "if": { "properties": { "kind": { "const": kind.name } }, "required": ["kind"] },
                "then": { "properties": { "config": config }, "required": required },
            })
        }));
        whole_graph(&mut schema, rules);
        world(&mut schema, registry);
    }
    schema
}

/// Restricts rules about required keys to files without `extends` and `remove`, because other files may omit
/// keys of the files below.
fn whole_graph(schema: &mut Schema, rules: Vec<Json>) {
    let of_robot = schema.pointer_mut("/definitions/Robot").and_then(Json::as_object_mut);
    let robot = of_robot.and_then(|robot| robot.remove("required")).unwrap_or(json!([]));
    let required = schema.remove("required").unwrap_or(json!([]));
    let rules = json!({ "allOf": rules });
    if let Some(definitions) = schema.pointer_mut("/definitions").and_then(Json::as_object_mut) {
        definitions.insert("WholeComponent".into(), rules);
    }
    let condition = json!({ "anyOf": [{ "required": ["extends"] }, { "required": ["remove"] }] });
    let whole = json!({
        "required": required,
        "properties": {
            "component": { "additionalProperties": { "$ref": "#/definitions/WholeComponent" } },
            "robot": { "additionalProperties": { "required": robot } },
        },
    });
    schema.insert("if".into(), condition);
    schema.insert("then".into(), json!({}));
    schema.insert("else".into(), whole);
}

/// Defines the `[world]` of a graph as the `world` key of its kinds.
fn world(schema: &mut Schema, registry: &Registry) {
    let Some(kind) = registry.kinds().iter().find(|kind| kind.reads_world) else { return };
    let mut generator = SchemaSettings::draft07().for_deserialize().into_generator();
    let config = kind.schema(&mut generator).to_value();
    let name = config["$ref"].as_str().and_then(|path| path.rsplit('/').next()).unwrap_or_default();
    let world = schema.pointer(&format!("/definitions/{name}/properties/world")).cloned();
    let Some(Json::Object(world)) = world else { return };
    if let Some(place) = schema.pointer_mut("/properties/world").and_then(Json::as_object_mut) {
        // keep the description of the graph
        let described = place.remove("description");
        *place = world;
        place.remove("default");
        place.extend(described.map(|text| ("description".to_string(), text)));
    }
}

fn exactly_one(keys: &[&str]) -> Json {
    let choices: Vec<Json> = keys.iter().map(|key| json!({ "required": [key] })).collect();
    json!({ "oneOf": choices })
}

/// Returns `config` as required if one of its keys is required.
fn required(config: &Json, schema: &Schema) -> Vec<&'static str> {
    let reference =
        config.get("$ref").and_then(Json::as_str).and_then(|reference| reference.strip_prefix('#'));
    let table = reference.and_then(|pointer| schema.pointer(pointer)).unwrap_or(config);
    let keys = table.get("required").and_then(Json::as_array);
    if keys.is_some_and(|keys| !keys.is_empty()) { vec!["config"] } else { Vec::new() }
}
