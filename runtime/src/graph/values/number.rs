//! Numbers of arrays and tables.

use toml::de::DeValue;

use crate::graph::diagnostic::Report;
use crate::graph::read::{Read, Value, mismatch};

/// A number of an array or a table.
#[derive(Debug, Clone, Copy, schemars::JsonSchema)]
#[schemars(inline)]
pub(in crate::graph) struct Number(pub f64);

impl<'i> Read<'i> for Number {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let number = match value.get_ref() {
            DeValue::Integer(_) => return i64::read(key, value, report).map(|number| Self(number as f64)),
            DeValue::Float(number) => number.as_str().parse().ok().map(Self),
            _ => None,
        };
        if number.is_none() {
            mismatch(key, value, "a number", report);
        }
        number
    }
}
