//! The key of a `config` table that serde refuses, of a table that came as JSON and so without places.

use serde::de::DeserializeOwned;
use serde_json::Value as Json;

use crate::declare::ConfigError;

/// Reads a `config` table; an error names the key at fault, dotted: `tasks[0].gain`.
pub(super) fn read<T: DeserializeOwned>(config: Json) -> Result<T, ConfigError> {
    serde_json::from_value(config.clone()).map_err(|error| {
        // Read once more as a text, one key a line: serde says in which line it stopped.
        let text = serde_json::to_string_pretty(&config).unwrap_or_default();
        match serde_json::from_str::<T>(&text) {
            Ok(_) => ConfigError::new(error.to_string()),
            Err(error) => {
                let message = error.to_string();
                let ending = format!(" at line {} column {}", error.line(), error.column());
                let message = message.strip_suffix(&ending).unwrap_or(&message).to_string();
                ConfigError { key: key_in_line(&text, error.line()), message, advice: None }
            }
        }
    })
}

/// The key that stands in a line of pretty-printed JSON, or whose value does; `None` for the table as a whole.
fn key_in_line(text: &str, line: usize) -> Option<String> {
    // By depth, the key or the index that is being read; an array counts up from its first element.
    let mut steps: Vec<Step> = Vec::new();
    for line in text.lines().take(line) {
        let depth = (line.len() - line.trim_start().len()) / 2;
        let line = line.trim_start();
        steps.truncate(depth);
        // A closing bracket is the end of what began in a line above at its depth.
        if depth == 0 || line.starts_with(['}', ']']) {
            continue;
        }
        let index = depth - 1;
        match (key_of(line), steps.get_mut(index)) {
            (Some(key), Some(step)) => *step = Step::Key(key),
            (Some(key), None) => steps.push(Step::Key(key)),
            (None, Some(Step::Index(count))) => *count += 1,
            (None, _) => {
                steps.truncate(index);
                steps.push(Step::Index(0));
            }
        }
    }
    let mut path = String::new();
    for step in steps {
        match step {
            Step::Key(key) if path.is_empty() => path = key,
            Step::Key(key) => path = format!("{path}.{key}"),
            Step::Index(index) => path = format!("{path}[{index}]"),
        }
    }
    (!path.is_empty()).then_some(path)
}

enum Step {
    Key(String),
    Index(usize),
}

/// The key at the beginning of a line: `"gain": 1.0`, but not `"a: b",`, which is an element of an array.
fn key_of(line: &str) -> Option<String> {
    let mut stream = serde_json::Deserializer::from_str(line).into_iter::<Json>();
    let Some(Ok(Json::String(key))) = stream.next() else { return None };
    line[stream.byte_offset()..].starts_with(':').then_some(key)
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
    fn an_unknown_key_is_named_with_those_that_exist() {
        let (key, message) = refused(json!({ "gain": 1.0, "gian": 2.0, "words": ["a: b"] }));
        assert_eq!(key.as_deref(), Some("gian"));
        assert_eq!(message, "unknown field `gian`, expected one of `gain`, `tasks`, `words`");
    }

    #[test]
    fn the_key_of_a_table_in_a_list_has_its_place_in_the_list() {
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
    fn a_key_that_is_missing_at_the_top_is_one_of_the_whole_table() {
        assert_eq!(refused(json!({ "words": [] })), (None, "missing field `gain`".to_string()));
        assert_eq!(read::<Config>(json!({ "gain": 0.1 })).unwrap().gain.to_bits(), 0.1f64.to_bits());
    }
}
