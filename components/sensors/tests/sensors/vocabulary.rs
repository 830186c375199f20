//! All sensors share the same configuration keys.

use std::collections::BTreeSet;

use serde_json::Value;

/// The keys of a table in a schema.
fn keys(schema: &Value) -> BTreeSet<&str> {
    schema["properties"].as_object().map(|keys| keys.keys().map(String::as_str).collect()).unwrap_or_default()
}

/// Returns the definition referenced by a key of a table, if any.
fn definition<'a>(key: &'a Value, definitions: &'a Value) -> Option<&'a Value> {
    let reference = key["$ref"].as_str().or_else(|| key["allOf"][0]["$ref"].as_str())?;
    Some(&definitions[reference.rsplit('/').next()?])
}

#[test]
fn every_sensor_has_the_common_keys() {
    let kinds = motorium_sensors::kinds();
    let sensors: Vec<_> = kinds.iter().filter(|kind| kind.name.starts_with("sensor.")).collect();
    assert!(sensors.len() >= 13, "{}", sensors.len());
    let errors = BTreeSet::from(["noise", "bias", "bias_walk", "scale_error", "resolution", "range"]);
    for kind in sensors {
        let (schema, definitions) = kind.config_schema();
        let table = schema["$ref"]
            .as_str()
            .map_or(&schema, |reference| &definitions[reference.rsplit('/').next().expect("a name")]);
        let found = keys(table);
        for key in ["latency", "drop_out", "seed", "randomise"] {
            assert!(found.contains(key), "{} has no key `{key}`: {found:?}", kind.name);
        }
        // pixel values are rounded and limited to 255 anyway
        if kind.name == "sensor.camera" {
            continue;
        }
        let properties = table["properties"].as_object().expect("keys");
        let described = properties
            .values()
            .filter_map(|key| definition(key, &definitions))
            .filter(|definition| keys(definition) == errors)
            .count();
        assert!(described > 0, "{} has no quantity with {errors:?}", kind.name);
    }
}
