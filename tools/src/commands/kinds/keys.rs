//! The keys of a `config` table, from its JSON Schema: nested tables by dotted paths.

use serde::Serialize;
use serde_json::Value as Json;

/// A key of a configuration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Key {
    /// Path of the key: `limits.position.margin`, `goals[].duration`, `parts.NAME.joints`.
    pub(super) key: String,
    /// Readable type of the value, such as `list of numbers`.
    #[serde(rename = "type")]
    pub(super) kind: String,
    /// `true` if the key is required in its table.
    pub(super) required: bool,
    /// Default value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) default: Option<Json>,
    /// Smallest number allowed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) minimum: Option<Json>,
    /// Largest number allowed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) maximum: Option<Json>,
    /// Meaning, with unit, range and default.
    pub(super) description: String,
}

/// Definitions referenced by a schema.
#[derive(Clone, Copy)]
pub(super) struct Definitions<'a>(pub(super) &'a Json);

impl<'a> Definitions<'a> {
    /// Returns the schema, or the referenced one with its name.
    pub(super) fn resolve(&self, schema: &'a Json) -> (&'a Json, Option<&'a str>) {
        let name = schema.get("$ref").and_then(Json::as_str).and_then(|path| path.rsplit('/').next());
        match name.and_then(|name| Some((self.0.get(name)?, name))) {
            Some((definition, name)) => (definition, Some(name)),
            None => (schema, None),
        }
    }
}

/// Returns all keys of a table; keys of a table precede keys of its nested tables.
pub(super) fn collect(schema: &Json, definitions: &Json) -> Vec<Key> {
    let mut keys = Vec::new();
    let mut walk =
        Walk { definitions: Definitions(definitions), trail: Vec::new(), in_variant: false, keys: &mut keys };
    walk.enter(schema, "");
    keys
}

struct Walk<'a, 'k> {
    definitions: Definitions<'a>,
    /// Names of the enclosing definitions; a recursive definition is entered once.
    trail: Vec<&'a str>,
    /// `true` if the key is in one of several variants of a table.
    in_variant: bool,
    keys: &'k mut Vec<Key>,
}

impl<'a> Walk<'a, '_> {
    /// Enters all tables described by a schema; `path` is their path.
    fn enter(&mut self, schema: &'a Json, path: &str) {
        let (schema, name) = self.definitions.resolve(schema);
        if let Some(name) = name {
            if self.trail.contains(&name) {
                return;
            }
            self.trail.push(name);
        }
        for list in ["allOf", "anyOf", "oneOf"] {
            let choices = schema.get(list).and_then(Json::as_array).map_or(&[][..], Vec::as_slice);
            let variants = choices.iter().filter(|choice| !is_null(choice)).count() > 1;
            for choice in choices {
                let outside = self.in_variant;
                self.in_variant = outside || variants;
                self.enter(choice, path);
                self.in_variant = outside;
            }
        }
        if let Some(items) = schema.get("items").filter(|items| items.is_object()) {
            self.enter(items, &format!("{path}[]"));
        }
        if let Some(values) = schema.get("additionalProperties").filter(|values| values.is_object()) {
            self.enter(values, &joined(path, "NAME"));
        }
        if let Some(properties) = schema.get("properties").and_then(Json::as_object) {
            let required = schema.get("required").and_then(Json::as_array);
            for (name, property) in properties {
                // keys required by one variant do not exist in the others
                let is_required = !self.in_variant
                    && required.is_some_and(|required| required.iter().any(|other| other == name));
                self.add(joined(path, name), property, is_required);
            }
            let outside = std::mem::take(&mut self.in_variant);
            for (name, property) in properties {
                self.enter(property, &joined(path, name));
            }
            self.in_variant = outside;
        }
        if name.is_some() {
            self.trail.pop();
        }
    }

    fn add(&mut self, key: String, schema: &'a Json, required: bool) {
        let kind = kind(schema, self.definitions);
        // a key of several variants of a table is listed once
        if let Some(known) = self.keys.iter_mut().find(|known| known.key == key) {
            if !known.kind.split(" or ").any(|one| one == kind) {
                known.kind = format!("{} or {kind}", known.kind);
            }
            return;
        }
        let text = |schema: &Json| schema.get("description").and_then(Json::as_str).map(prose);
        let inner = inner(schema, self.definitions);
        self.keys.push(Key {
            kind,
            required,
            default: schema.get("default").filter(|default| !default.is_null()).cloned(),
            minimum: inner.get("minimum").cloned(),
            maximum: inner.get("maximum").cloned(),
            description: text(schema).or_else(|| text(inner)).unwrap_or_default(),
            key,
        });
    }
}

fn is_null(schema: &Json) -> bool {
    schema.get("type").is_some_and(|kind| kind == "null")
}

fn joined(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_string() } else { format!("{path}.{name}") }
}

/// Returns a description in one line, without code examples.
pub(super) fn prose(description: &str) -> String {
    let text: String = description.split("```").step_by(2).collect();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Resolves references and wrappers with a single element.
fn inner<'a>(schema: &'a Json, definitions: Definitions<'a>) -> &'a Json {
    let (schema, _) = definitions.resolve(schema);
    let alternatives = ["allOf", "anyOf"].iter().find_map(|list| schema.get(list)).and_then(Json::as_array);
    let mut real = alternatives.into_iter().flatten().filter(|one| !is_null(one));
    match (real.next(), real.next()) {
        (Some(only), None) => inner(only, definitions),
        _ => schema,
    }
}

/// Returns a readable type of a value.
fn kind(schema: &Json, definitions: Definitions<'_>) -> String {
    let schema = inner(schema, definitions);
    if let Some(value) = schema.get("const") {
        return value.to_string();
    }
    if let Some(values) = schema.get("enum").and_then(Json::as_array) {
        return either(values.iter().map(Json::to_string).collect());
    }
    for list in ["oneOf", "anyOf"] {
        if let Some(choices) = schema.get(list).and_then(Json::as_array) {
            let real = choices.iter().filter(|one| !is_null(one));
            return either(real.map(|choice| kind(choice, definitions)).collect());
        }
    }
    let name = match schema.get("type") {
        Some(Json::String(name)) => name.as_str(),
        Some(Json::Array(names)) => {
            names.iter().filter_map(Json::as_str).find(|name| *name != "null").unwrap_or_default()
        }
        _ => "",
    };
    match name {
        "array" => {
            let element = schema.get("items").map_or("value".to_string(), |items| kind(items, definitions));
            match (schema.get("minItems"), schema.get("maxItems")) {
                (Some(least), Some(most)) if least == most => format!("list of {least} {}", plural(&element)),
                _ => format!("list of {}", plural(&element)),
            }
        }
        "string" if schema.get("format").is_some_and(|format| format == "path") => "path".to_string(),
        // the pattern of a value with its unit
        "string" if schema.get("pattern").is_some_and(has_unit) => "text with a unit".to_string(),
        "string" => "text".to_string(),
        "integer" => "whole number".to_string(),
        "boolean" => "true or false".to_string(),
        "object" => "table".to_string(),
        "" => "any value".to_string(),
        name => name.to_string(),
    }
}

fn has_unit(pattern: &Json) -> bool {
    pattern.as_str().is_some_and(|pattern| pattern.contains("[0-9]+(\\.[0-9]*)?\\s*"))
}

fn either(kinds: Vec<String>) -> String {
    let mut distinct: Vec<String> = Vec::new();
    for kind in kinds {
        if !distinct.contains(&kind) {
            distinct.push(kind);
        }
    }
    distinct.join(" or ")
}

fn plural(kind: &str) -> String {
    match kind {
        "number" | "whole number" | "table" | "path" => format!("{kind}s"),
        "text" => "texts".to_string(),
        "any value" => "values".to_string(),
        kind => kind.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn listed(schema: &Json, definitions: &Json) -> Vec<String> {
        collect(schema, definitions).iter().map(|key| format!("{}: {}", key.key, key.kind)).collect()
    }

    #[test]
    fn nested_keys_have_paths_and_readable_types() {
        let schema = json!({ "$ref": "#/definitions/Config" });
        let definitions = json!({
            "Config": { "type": "object", "required": ["goals"], "properties": {
                "goals": { "type": "array", "items": { "$ref": "#/definitions/Goal" } },
                "offset": { "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 },
                "parts": { "type": "object", "additionalProperties": { "$ref": "#/definitions/Goal" } },
                "mode": { "oneOf": [{ "const": "a" }, { "const": "b" }] },
            } },
            "Goal": { "type": "object", "properties": {
                "time": { "anyOf": [{ "type": "integer", "minimum": 1 }, { "type": "null" }], "description": "Time, s." },
                "next": { "$ref": "#/definitions/Goal" },
            } },
        });
        let expected = [
            "goals: list of tables",
            "mode: \"a\" or \"b\"",
            "offset: list of 3 numbers",
            "parts: table",
            "goals[].next: table",
            "goals[].time: whole number",
            "parts.NAME.next: table",
            "parts.NAME.time: whole number",
        ];
        let mut found = listed(&schema, &definitions);
        found.sort();
        let mut sorted = expected.map(str::to_string).to_vec();
        sorted.sort();
        assert_eq!(found, sorted);
        let keys = collect(&schema, &definitions);
        assert!(keys.iter().find(|key| key.key == "goals").is_some_and(|key| key.required));
        let time = keys.iter().find(|key| key.key == "goals[].time").expect("there");
        assert_eq!((&time.minimum, time.description.as_str()), (&Some(json!(1)), "Time, s."));
    }

    #[test]
    fn key_of_several_variants_is_listed_once_with_all_types() {
        let variant = |kind: Json| json!({ "type": "object", "properties": { "kind": kind } });
        let schema = json!({ "oneOf": [variant(json!({ "const": "a" })), variant(json!({ "const": "b" }))] });
        assert_eq!(listed(&schema, &json!({})), ["kind: \"a\" or \"b\""]);
    }

    #[test]
    fn code_examples_are_removed_from_descriptions() {
        assert_eq!(prose("Gain,\n1/s.\n\n```toml\ngain = 1\n```\nDefault 1."), "Gain, 1/s. Default 1.");
    }
}
