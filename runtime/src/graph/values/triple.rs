//! Positions and angles.

use std::borrow::Cow;

use schemars::{Schema, SchemaGenerator, json_schema};
use toml::de::DeValue;

use crate::graph::diagnostic::Report;
use crate::graph::json::LARGEST;
use crate::graph::read::{Read, Value};

/// Three finite numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::graph) struct Triple(pub [f64; 3]);

impl<'i> Read<'i> for Triple {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let number = |item: &Value<'i>| match item.get_ref() {
            DeValue::Integer(number) if number.radix() == 10 => number.as_str().parse::<f64>().ok(),
            DeValue::Float(number) => number.as_str().parse().ok(),
            _ => None,
        };
        let numbers: Option<Vec<f64>> =
            value.get_ref().as_array().and_then(|array| array.iter().map(number).collect());
        let triple = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
        if let Some(triple) = triple.filter(|triple| triple.iter().all(|number| number.abs() <= LARGEST)) {
            return Some(Self(triple));
        }
        report
            .error(format!("`{key}` is not a list of three finite numbers"))
            .label(&value.span(), "expected three numbers")
            .advise(format!("write `{key} = [0.0, 0.0, 0.0]`"));
        None
    }
}

impl schemars::JsonSchema for Triple {
    fn schema_name() -> Cow<'static, str> {
        "Triple".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 })
    }
}
