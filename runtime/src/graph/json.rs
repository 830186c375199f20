//! Conversion of the `config` table to JSON, the format in which it is sent to the component's process.

use serde_json::{Map, Value as Json};
use toml::de::DeValue;

use super::diagnostic::Report;
use super::read::{Value, entries};
use super::source::Span;

/// Largest number in a configuration. Larger numbers overflow in the first product and are typing errors.
pub(super) const LARGEST: f64 = 1e15;

/// Converts a TOML value to JSON; unsupported values are reported.
pub(super) fn to_json(value: &Value<'_>, report: &mut Report) -> Option<Json> {
    Some(match value.get_ref() {
        DeValue::String(text) => Json::String(text.to_string()),
        DeValue::Boolean(flag) => Json::Bool(*flag),
        DeValue::Datetime(time) => Json::String(time.to_string()),
        DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
            Ok(number) => Json::from(number),
            Err(_) => {
                report
                    .error(format!("the number {} is too large", number.as_str()))
                    .label(&value.span(), "does not fit into 64 bits")
                    .advise("write the number as a decimal, such as 1e20, if the component accepts decimals");
                return None;
            }
        },
        DeValue::Float(number) => {
            let parsed: Option<f64> = number.as_str().parse().ok();
            if let Some(found) = parsed.filter(|found| found.is_finite() && found.abs() > LARGEST) {
                report
                    .error(format!("{found:e} is larger than any length, angle, force or gain"))
                    .label(&value.span(), format!("expected a number between -{LARGEST:e} and {LARGEST:e}"))
                    .advise("check its exponent; leave the key out if it means \"no limit\"");
                return None;
            }
            match parsed.and_then(serde_json::Number::from_f64) {
                Some(number) => Json::Number(number),
                None => {
                    report
                        .error(format!("{} is not a finite number", number.as_str()))
                        .label(&value.span(), "expected a finite number")
                        .advise("leave the key out if it means \"no limit\"");
                    return None;
                }
            }
        }
        DeValue::Array(array) => {
            let elements: Vec<_> = array.iter().map(|element| to_json(element, report)).collect();
            Json::Array(elements.into_iter().collect::<Option<_>>()?)
        }
        DeValue::Table(table) => {
            let mut map = Some(Map::new());
            for (key, value) in entries(table) {
                match (to_json(value, report), &mut map) {
                    (Some(value), Some(map)) => {
                        map.insert(key.get_ref().to_string(), value);
                    }
                    _ => map = None,
                }
            }
            Json::Object(map?)
        }
    })
}

/// Positions of a key in a `config` table.
pub(super) struct Found {
    /// Position of the key itself, or of an element of an array.
    pub key: Span,
    /// Position of the value.
    pub value: Span,
}

/// Finds the position of a dotted key in a `config` table, such as `tasks.0.gain` or `tasks[0].gain`, as deep
/// as the path exists.
pub(super) fn find(config: &Value<'_>, path: &str) -> Option<Found> {
    let mut place = None;
    let mut value = config;
    for step in path.split(['.', '[', ']']).filter(|step| !step.is_empty()) {
        let next = match value.get_ref() {
            DeValue::Table(table) => table.get_key_value(step).map(|(key, value)| (key.span(), value)),
            DeValue::Array(array) => {
                let element = step.parse().ok().and_then(|index: usize| array.get(index));
                element.map(|element| (element.span(), element))
            }
            _ => None,
        };
        let Some((key, next)) = next else { break };
        value = next;
        place = Some(Found { key, value: value.span() });
    }
    place
}
