//! The `config` table of `bridge.iceoryx2`.

use std::collections::BTreeMap;

use motorium::declare::ConfigError;
use motorium::state::{TypeLayout, built_in};
use motorium::units::{Rate, TimeSpan, UnitError};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

/// The `config` table of `bridge.iceoryx2`: names and limits of its ports, which `subscribe` and `publish`
/// wire.
///
/// ```toml
/// out = ["joint_state"]
///
/// [in.target]
/// type     = "motorium.PoseTarget"
/// max_rate = "100 Hz"
/// ```
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Iceoryx2BridgeConfig {
    /// Inputs whose topics are mirrored to other programs, of any type. Default none.
    pub out: Vec<String>,
    /// Outputs whose topics are fed by other programs, by name. Default none.
    #[serde(rename = "in")]
    pub inbound: BTreeMap<String, InboundConfig>,
}

/// The type of an inbound topic, and its limits.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InboundConfig {
    /// Type of the values: a built-in state, such as "motorium.PoseTarget".
    #[serde(rename = "type")]
    pub type_name: String,
    /// Largest rate of publication, such as "500 Hz"; the newest value is published. Default 1 kHz.
    #[serde(default = "max_rate", deserialize_with = "rate")]
    pub max_rate: Rate,
    /// Longest time that a value may have waited for a step of the bridge, such as "50 ms"; older ones are
    /// refused. At least a period of the bridge. Default 100 ms.
    #[serde(default = "max_age")]
    pub max_age: TimeSpan,
}

fn max_rate() -> Rate {
    Rate { period_ns: 1_000_000 }
}

fn max_age() -> TimeSpan {
    TimeSpan { ns: 100_000_000 }
}

fn rate<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Rate, D::Error> {
    String::deserialize(deserializer)?.parse().map_err(|error: UnitError| {
        serde::de::Error::custom(format!("the rate {}: {}", error.found, error.expected))
    })
}

impl Iceoryx2BridgeConfig {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        if self.out.is_empty() && self.inbound.is_empty() {
            return Err(ConfigError::new("it bridges nothing")
                .advise("name inputs in `out`, or outputs with their types in `in`"));
        }
        for (index, port) in self.out.iter().enumerate() {
            if self.out[..index].contains(port) || self.inbound.contains_key(port) {
                return Err(ConfigError::key("out", format!("there are two ports named `{port}`")));
            }
        }
        Ok(())
    }
}

impl InboundConfig {
    /// The layout of the type.
    pub(super) fn layout(&self, port: &str) -> Result<TypeLayout, ConfigError> {
        let layouts = built_in();
        let found = layouts.iter().find(|layout| layout.type_name == self.type_name).cloned();
        found.ok_or_else(|| {
            let names: Vec<&str> = layouts.iter().map(|layout| layout.type_name.as_str()).collect();
            let message = format!("there is no built-in state `{}`", self.type_name);
            ConfigError::key(format!("in.{port}.type"), message)
                .advise(format!("the built-in states are {}", names.join(", ")))
        })
    }
}
