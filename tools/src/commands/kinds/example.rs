//! Example of a kind: a graph fragment built from its declaration and from the example in its configuration's
//! documentation.

use std::fmt::Write as _;

use motorium::declare::{Declaration, Direction};
use serde_json::{Map, Value as Json};

use super::keys::Definitions;
use super::source::KindSource;

/// Inputs that replace another input of the example: a robot follows either states or commands.
const REPLACEMENTS: [&str; 2] = ["follow", "follow_base"];

/// Longest line of a fragment, in characters.
const WIDTH: usize = 100;

/// The `config` table of an example.
pub(super) struct ExampleConfig {
    /// Text of the table.
    text: String,
    /// Value passed to the component.
    pub(super) value: Json,
}

/// Returns the example in the documentation of the configuration, or else the required keys with the simplest
/// values.
pub(super) fn config(schema: &Json, definitions: &Json) -> ExampleConfig {
    let definitions = Definitions(definitions);
    let (table, _) = definitions.resolve(schema);
    let documented = table.get("description").and_then(Json::as_str).and_then(fenced);
    let parsed = documented.and_then(|text| Some((text, toml::from_str::<Json>(text).ok()?)));
    if let Some((text, value)) = parsed {
        return ExampleConfig { text: text.to_string(), value };
    }
    simplest_config(schema, definitions.0)
}

/// Returns the required keys of a configuration with the simplest values.
pub(super) fn simplest_config(schema: &Json, definitions: &Json) -> ExampleConfig {
    let value = simplest(schema, Definitions(definitions), 0);
    let text = toml::to_string(&value).unwrap_or_default();
    ExampleConfig { text, value }
}

/// Returns the first TOML block in a documentation text.
fn fenced(description: &str) -> Option<&str> {
    let (_, rest) = description.split_once("```toml\n")?;
    let (text, _) = rest.split_once("```")?;
    Some(text)
}

/// Returns the simplest value that a schema allows, as far as it can be derived.
fn simplest(schema: &Json, definitions: Definitions<'_>, depth: usize) -> Json {
    let (schema, _) = definitions.resolve(schema);
    if depth > 8 {
        return Json::Null;
    }
    for key in ["default", "const"] {
        if let Some(value) = schema.get(key).filter(|value| !value.is_null()) {
            return value.clone();
        }
    }
    if let Some(first) = schema.get("enum").and_then(|values| values.get(0)) {
        return first.clone();
    }
    for list in ["allOf", "anyOf", "oneOf"] {
        if let Some(first) = schema.get(list).and_then(|choices| choices.get(0)) {
            return simplest(first, definitions, depth + 1);
        }
    }
    let name = schema.get("type").map(|kind| kind.get(0).unwrap_or(kind)).and_then(Json::as_str);
    match name {
        Some("integer") => schema.get("minimum").cloned().unwrap_or(Json::from(0)),
        Some("number") => schema.get("minimum").cloned().unwrap_or(Json::from(0.0)),
        Some("boolean") => Json::Bool(false),
        Some("array") => {
            let count = schema.get("minItems").and_then(Json::as_u64).unwrap_or(1);
            let element = schema.get("items").map(|items| simplest(items, definitions, depth + 1));
            Json::Array(element.into_iter().cycle().take(count as usize).collect())
        }
        Some("object") => {
            let required = schema.get("required").and_then(Json::as_array);
            let mut table = Map::new();
            for name in required.into_iter().flatten().filter_map(Json::as_str) {
                let value = schema.get("properties").and_then(|properties| properties.get(name));
                let value = value.map_or(Json::Null, |value| simplest(value, definitions, depth + 1));
                table.insert(name.to_string(), value);
            }
            Json::Object(table)
        }
        _ => Json::String(String::new()),
    }
}

/// Returns a fragment of a graph with a component of this kind.
pub(super) fn fragment(
    kind: &KindSource<'_>,
    declaration: &Declaration,
    robot: Option<&str>,
    config: &ExampleConfig,
) -> String {
    let name = component_name(kind.name());
    let mut text = String::new();
    if let Some(robot) = robot {
        let _ = writeln!(text, "[robot.{robot}]\nurdf = \"{robot}\"\n");
    }
    let _ = writeln!(text, "[component.{name}]");
    let mut line = |key: &str, value: &str| {
        let _ = writeln!(text, "{key:9} = {value}");
    };
    match kind {
        KindSource::Exec(path, _) => line("exec", &format!("{:?}", path.display().to_string())),
        _ => line("kind", &format!("{:?}", kind.name())),
    }
    if let Some(robot) = robot {
        line("robot", &format!("{robot:?}"));
    }
    match (declaration.wakes_on_descriptor, robot) {
        (true, _) => line("activate", "{ on = \"fd\", min_interval = \"5 ms\" }"),
        (false, Some(_)) => line("rate", "\"1 kHz\""),
        (false, None) => line("rate", "\"100 Hz\""),
    }
    if robot.is_none() {
        line("schedule", "\"normal\"");
    }
    let mut tables = String::new();
    for (key, direction) in [("subscribe", Direction::Input), ("publish", Direction::Output)] {
        let is_used = |name: &str| name.split('.').all(|part| !REPLACEMENTS.contains(&part));
        let ports =
            declaration.ports.iter().filter(|port| port.direction == direction && is_used(&port.name));
        // a port `ROBOT.PORT` is one key, and its topic has a name without dots
        let wire = |port: &str| {
            let key = if port.contains('.') { format!("{port:?}") } else { port.to_string() };
            let topic = port.replace('.', "/");
            match robot {
                Some(robot) => format!("{key} = \"{robot}/{topic}\""),
                None => format!("{key} = \"{topic}\""),
            }
        };
        let wires: Vec<String> = ports.map(|port| wire(&port.name)).collect();
        let inline = format!("{{ {} }}", wires.join(", "));
        if !wires.is_empty() && inline.len() + 12 <= WIDTH {
            line(key, &inline);
        } else if !wires.is_empty() {
            let _ = writeln!(tables, "\n[component.{name}.{key}]\n{}", wires.join("\n"));
        }
    }
    text + &tables + &config_tables(&name, &config.text)
}

/// Returns the `config` table of a component and the tables in it.
fn config_tables(name: &str, config: &str) -> String {
    if config.trim().is_empty() {
        return String::new();
    }
    let place = format!("component.{name}.config");
    let mut text = match config.trim_start().starts_with('[') {
        true => "\n".to_string(),
        false => format!("\n[{place}]\n"),
    };
    for line in config.trim().lines() {
        let header = line.strip_prefix('[').filter(|rest| rest.trim_end().ends_with(']'));
        let _ = match (header, line.starts_with("[[")) {
            (Some(rest), true) => writeln!(text, "[[{place}.{}", &rest[1..]),
            (Some(rest), false) => writeln!(text, "[{place}.{rest}"),
            (None, _) => writeln!(text, "{line}"),
        };
    }
    text
}

/// Returns the default component name for a kind: the last part of the kind's name.
fn component_name(kind: &str) -> String {
    let last = kind.rsplit('.').next().unwrap_or(kind).to_lowercase();
    let kept = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    last.chars().map(kept).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn documented_example_is_used_verbatim() {
        let schema =
            json!({ "description": "A table.\n\n```toml\ngain = 2.0 # 1/s\n\n[limits]\nrate = 1\n```" });
        let config = config(&schema, &json!({}));
        assert_eq!(config.value, json!({ "gain": 2.0, "limits": { "rate": 1 } }));
        let text = config_tables("qp", &config.text);
        assert_eq!(
            text,
            "\n[component.qp.config]\ngain = 2.0 # 1/s\n\n[component.qp.config.limits]\nrate = 1\n"
        );
    }

    #[test]
    fn required_keys_get_simplest_values_without_an_example() {
        let schema = json!({ "type": "object", "required": ["joint", "kp", "mode"], "properties": {
            "joint": { "type": "integer", "minimum": 0 }, "kp": { "type": "array", "items": { "type": "number" } },
            "mode": { "$ref": "#/definitions/Mode" }, "left_out": { "type": "number" },
        } });
        let definitions = json!({ "Mode": { "oneOf": [{ "const": "fast" }, { "const": "slow" }] } });
        assert_eq!(config(&schema, &definitions).value, json!({ "joint": 0, "kp": [0.0], "mode": "fast" }));
    }
}
