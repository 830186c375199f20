//! Rewording of serde's messages in terms of graph files.

/// Rewords a serde message about a `config` table in terms of graph files: keys, numbers, lists and tables
/// instead of fields, Rust types, sequences and maps. Other messages are unchanged.
pub(super) fn reworded(message: &str) -> String {
    reword(message).unwrap_or_else(|| message.to_string())
}

fn reword(message: &str) -> Option<String> {
    if let Some(rest) = message.strip_prefix("missing field ") {
        return Some(format!("key {rest} is missing"));
    }
    if let Some(rest) = message.strip_prefix("duplicate field ") {
        return Some(format!("key {rest} is given twice"));
    }
    if let Some(rest) = message.strip_prefix("unknown field ") {
        return Some(format!("unknown key {}", rest.replace("there are no fields", "expected none")));
    }
    if let Some(rest) = message.strip_prefix("unknown variant ") {
        return Some(format!("found {rest}"));
    }
    if let Some(rest) = message.strip_prefix("invalid length ") {
        let (count, expectation) = rest.split_once(", expected ")?;
        let noun = if count == "1" { "value" } else { "values" };
        return Some(format!("found {count} {noun}, expected {}", expected(expectation)));
    }
    let rest = ["invalid type: ", "invalid value: "].iter().find_map(|start| message.strip_prefix(start))?;
    // The value may contain the same words; serde's are the last ones.
    let (value, expectation) = rest.rsplit_once(", expected ")?;
    Some(format!("found {}, expected {}", found(value), expected(expectation)))
}

/// Rewords a value that serde names with its type.
fn found(value: &str) -> String {
    let (kind, rest) = value.split_once(' ').unwrap_or((value, ""));
    match (kind, rest) {
        ("string", text) => text.to_string(),
        ("integer" | "boolean", number) | ("floating", number) => {
            number.trim_start_matches("point ").trim_matches('`').to_string()
        }
        ("sequence", _) => "a list".to_string(),
        ("map", _) => "a table".to_string(),
        ("null", _) | ("unit", "value") => "nothing".to_string(),
        _ => value.to_string(),
    }
}

/// Rewords the expectation of a type.
fn expected(expectation: &str) -> String {
    let words: Vec<&str> = expectation.split(' ').collect();
    match words.as_slice() {
        ["f32" | "f64"] => "a number".to_string(),
        ["u8" | "u16" | "u32" | "u64" | "usize" | "u128"] => "a whole number of at least 0".to_string(),
        ["i8" | "i16" | "i32" | "i64" | "isize" | "i128"] => "a whole number".to_string(),
        ["a", "boolean"] => "`true` or `false`".to_string(),
        ["a", "string"] | ["string"] => "text".to_string(),
        ["a", "sequence"] => "a list".to_string(),
        ["a", "map"] | ["map"] | ["struct", _] => "a table".to_string(),
        ["map", "with", "a", "single", "key"] => "a table with a single key".to_string(),
        ["string", "or", "map"] | ["enum", _] => "text or a table".to_string(),
        ["an", "array", "of", "length", count] | ["a", "tuple", "of", "size", count] => {
            format!("a list of {count}")
        }
        _ => expectation.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde::Deserialize;
    use serde::de::DeserializeOwned;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Choice {
        Walk,
        Trot,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    #[allow(dead_code)] // only read by serde
    enum Kind {
        Reach(f64),
        Rest(f64),
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)] // only read by serde
    struct Table {
        gain: f64,
    }

    /// Returns the reworded error for a TOML value.
    fn refusal<T: DeserializeOwned + std::fmt::Debug>(value: &str) -> String {
        let text = format!("key = {value}");
        let error = toml::from_str::<BTreeMap<String, T>>(&text).expect_err("refused");
        reworded(error.message())
    }

    #[test]
    fn type_errors_avoid_rust_terms() {
        assert_eq!(refusal::<f64>("\"heavy\""), "found \"heavy\", expected a number");
        assert_eq!(refusal::<f64>("\"a, expected b\""), "found \"a, expected b\", expected a number");
        assert_eq!(refusal::<usize>("1.5"), "found 1.5, expected a whole number of at least 0");
        assert_eq!(refusal::<u32>("-1"), "found -1, expected a whole number of at least 0");
        assert_eq!(refusal::<bool>("1"), "found 1, expected `true` or `false`");
        assert_eq!(refusal::<String>("[1]"), "found a list, expected text");
        assert_eq!(refusal::<Vec<f64>>("{ a = 1 }"), "found a table, expected a list");
        assert_eq!(refusal::<[f64; 3]>("[1.0, 2.0]"), "found 2 values, expected a list of 3");
        assert_eq!(refusal::<Table>("true"), "found true, expected a table");
    }

    #[test]
    fn fields_and_variants_are_called_keys_and_choices() {
        assert_eq!(refusal::<Table>("{ gian = 1.0 }"), "unknown key `gian`, expected `gain`");
        assert_eq!(refusal::<Table>("{}"), "key `gain` is missing");
        assert_eq!(refusal::<Choice>("\"wlak\""), "found `wlak`, expected `walk` or `trot`");
        let two = serde_json::json!({ "reach": 1.0, "rest": 2.0 });
        let error = serde_json::from_value::<Kind>(two).expect_err("refused").to_string();
        assert_eq!(reworded(&error), "found a table, expected a table with a single key");
    }

    #[test]
    fn component_messages_are_unchanged() {
        for message in ["2 m, expected 0 to 0.5 m", "no pose is named \"hoem\"", ""] {
            assert_eq!(reworded(message), message);
        }
    }
}
