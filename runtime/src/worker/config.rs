//! Reading a `config` table.

use serde::de::DeserializeOwned;
use serde_json::Value as Json;

use crate::declare::ConfigError;

/// Reads a `config` table; an error names the invalid key with its path, such as `tasks[0].gain`.
///
/// Every configuration type is read here, so that the code that serde derives for it is compiled once.
pub(super) fn read<T: DeserializeOwned>(config: Json) -> Result<T, ConfigError> {
    serde_path_to_error::deserialize(config).map_err(|error| refused(&error))
}

fn refused(error: &serde_path_to_error::Error<serde_json::Error>) -> ConfigError {
    let key = (error.path().iter().len() > 0).then(|| error.path().to_string());
    ConfigError { key, message: error.inner().to_string(), advice: None }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;
    use serde_json::json;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)] // only read by serde
    struct Config {
        gain: f64,
        #[serde(default)]
        tasks: Vec<Task>,
        #[serde(default)]
        words: Vec<String>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)] // only read by serde
    struct Task {
        weight: f64,
        #[serde(default)]
        limits: [f64; 2],
    }

    fn refused(config: Json) -> (Option<String>, String) {
        let error = read::<Config>(config).unwrap_err();
        (error.key, error.message)
    }

    #[test]
    fn unknown_key_is_reported_with_the_existing_keys() {
        let (key, message) = refused(json!({ "gain": 1.0, "gian": 2.0, "words": ["a: b"] }));
        assert_eq!(key.as_deref(), Some("gian"));
        assert_eq!(message, "unknown field `gian`, expected one of `gain`, `tasks`, `words`");
    }

    #[test]
    fn key_in_a_list_is_reported_with_its_index() {
        let tasks =
            |second: Json| json!({ "gain": 1.0, "tasks": [{ "weight": 1.0, "limits": [0.0, 1.0] }, second] });
        for (second, expected) in [
            (json!({ "weight": "much" }), "tasks[1].weight"),
            (json!({ "weight": 1.0, "wieght": 2.0 }), "tasks[1].wieght"),
            (json!({ "weight": 1.0, "limits": [0.0, true] }), "tasks[1].limits[1]"),
            (json!({ "limits": [0.0, 1.0] }), "tasks[1]"),
        ] {
            assert_eq!(refused(tasks(second.clone())).0.as_deref(), Some(expected), "{second}");
        }
        assert_eq!(
            refused(json!({ "gain": 1.0, "words": ["\": x", "y", 3] })).0.as_deref(),
            Some("words[2]")
        );
    }

    #[test]
    fn missing_top_level_key_is_attributed_to_the_table() {
        assert_eq!(refused(json!({ "words": [] })), (None, "missing field `gain`".to_string()));
        assert_eq!(read::<Config>(json!({ "gain": 0.1 })).unwrap().gain.to_bits(), 0.1f64.to_bits());
    }
}
