//! Expectations of a graph: figures of the report and their conditions.

use std::borrow::Cow;

use schemars::{Schema, SchemaGenerator, json_schema};
use toml::de::DeValue;

use crate::graph::diagnostic::Report;
use crate::graph::read::{Read, Value, entries, mismatch, table};
use crate::graph::source::Span;
use crate::plan::Expectation;

/// Conditions on values in the report, with their positions: `"controller.position_error_m" = "<= 1e-3"`. The
/// path of a value is a quoted key or nested tables.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::graph) struct Expectations(pub Vec<(Expectation, Span)>);

impl<'i> Read<'i> for Expectations {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        table(key, value, report)?;
        let mut expectations = Vec::new();
        collect("", value, &mut expectations, report);
        Some(Self(expectations))
    }
}

/// Collects the expectations below a figure.
fn collect(
    figure: &str,
    value: &Value<'_>,
    expectations: &mut Vec<(Expectation, Span)>,
    report: &mut Report,
) {
    let condition = match value.get_ref() {
        DeValue::Table(table) => {
            for (key, value) in entries(table) {
                let name = key.get_ref();
                let figure = if figure.is_empty() { name.to_string() } else { format!("{figure}.{name}") };
                collect(&figure, value, expectations, report);
            }
            return;
        }
        DeValue::String(text) => text.to_string(),
        DeValue::Integer(number) => format!("== {}", number.as_str()),
        DeValue::Float(number) => format!("== {}", number.as_str()),
        DeValue::Boolean(flag) => format!("== {flag}"),
        DeValue::Datetime(_) | DeValue::Array(_) => {
            mismatch(figure, value, "a condition", report)
                .advise("write a condition such as \"<= 1e-3\" or \"== 4\"");
            return;
        }
    };
    match Expectation::new(figure, &condition) {
        Ok(expectation) => expectations.push((expectation, value.span())),
        Err(error) => {
            report
                .error(error.to_string())
                .label(&value.span(), "expected a condition")
                .advise("write a comparison and its bound, such as \"<= 1e-3\", \"== 4\" or \"!= 0\"");
        }
    }
}

impl schemars::JsonSchema for Expectations {
    fn schema_name() -> Cow<'static, str> {
        "Expectations".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "object",
            "additionalProperties": {
                "type": ["string", "number", "boolean", "object"],
                "description": "A condition, such as `<= 1e-3`, `== 4` or `!= 0`. A number, true or false alone requires an equal value.",
            },
        })
    }
}
