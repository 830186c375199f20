//! Values that define the scheduling of a component.

use std::borrow::Cow;

use schemars::{Schema, SchemaGenerator, json_schema};
use serde::Serialize;
use toml::de::DeValue;

use crate::graph::diagnostic::Report;
use crate::graph::read::{Read, Value, mismatch};
use crate::units::TimeSpan;

/// The scheduling of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(in crate::graph) enum Schedule {
    /// Real-time: `SCHED_FIFO`, on a real-time core.
    Fifo,
    /// Real-time: `SCHED_DEADLINE`. The kernel guarantees the budget in every period, on any core.
    Deadline,
    /// Not real-time: the system's time sharing, on the shared cores.
    Normal,
}

/// A source of events outside the graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(in crate::graph) enum EventSource {
    /// A readable file descriptor of the component, such as a socket or a bus.
    Fd,
}

/// The spin time before a release.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::graph) enum SpinChoice {
    /// A time that adapts to the wake-up errors measured on the machine.
    Auto,
    /// A fixed time.
    Fixed(TimeSpan),
}

impl<'i> Read<'i> for SpinChoice {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        if value.get_ref().as_str() == Some("auto") {
            return Some(Self::Auto);
        }
        TimeSpan::read(key, value, report).map(Self::Fixed)
    }
}

impl Serialize for SpinChoice {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Fixed(time) => time.serialize(serializer),
        }
    }
}

impl schemars::JsonSchema for SpinChoice {
    fn schema_name() -> Cow<'static, str> {
        "SpinChoice".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "const": "auto" }, generator.subschema_for::<TimeSpan>()] })
    }
}

/// A share, above 0 and at most 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(transparent)]
pub(in crate::graph) struct Share(pub f64);

impl<'i> Read<'i> for Share {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let number: Option<f64> = match value.get_ref() {
            DeValue::Float(number) => number.as_str().parse().ok(),
            DeValue::Integer(number) => number.as_str().parse().ok(),
            _ => None,
        };
        let Some(number) = number else {
            mismatch(key, value, "a share, as a number", report).advise("a tenth of a core: 0.1");
            return None;
        };
        if number > 0.0 && number <= 1.0 {
            return Some(Self(number));
        }
        report
            .error(format!("`{key}` is {number}, expected a share above 0 and at most 1"))
            .label(&value.span(), "expected more than 0 and at most 1")
            .advise("a tenth of a core: 0.1");
        None
    }
}

impl schemars::JsonSchema for Share {
    fn schema_name() -> Cow<'static, str> {
        "Share".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number", "exclusiveMinimum": 0, "maximum": 1 })
    }
}
