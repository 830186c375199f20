//! The `config` table of `bridge.iceoryx2`.

use std::collections::BTreeMap;

use motorium::declare::{ConfigError, TopicPattern};
use motorium::state::{EmergencyStop, StateBuffer, TypeLayout, built_in};
use motorium::units::{Rate, TimeSpan, UnitError};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

/// Configuration of `bridge.iceoryx2`: names, types and limits of the bridge's ports. The keys `subscribe`
/// and `publish` of the component connect these ports to topics.
///
/// ```toml
/// out        = ["joint_state"]
/// out_slices = ["points"]
///
/// [in.target]
/// type     = "motorium.PoseTarget"
/// max_rate = "100 Hz"
///
/// [in.obstacles]
/// type    = "motorium.CloudPoint"
/// pattern = { slices = { longest = 4096, capacity = 4 } }
/// ```
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Iceoryx2BridgeConfig {
    /// Inputs whose latest value is mirrored to other programs. Inputs may be states or streams of any type.
    /// Default: an empty list.
    pub out: Vec<String>,
    /// Inputs whose streams, of any type, are mirrored to other programs value by value, in order. Default:
    /// an empty list.
    pub out_streams: Vec<String>,
    /// Inputs whose slices, such as images and clouds of any type, are mirrored to other programs one by one,
    /// in order. Default: an empty list.
    pub out_slices: Vec<String>,
    /// Outputs by name. Each publishes values from other programs on a topic of the graph. Default: an empty
    /// table.
    #[serde(rename = "in")]
    pub inbound: BTreeMap<String, InboundConfig>,
}

/// Type and limits of an inbound topic.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InboundConfig {
    /// Type of the values, or of the elements of slices: a built-in state, such as "motorium.PoseTarget", or
    /// a number, such as "u8".
    #[serde(rename = "type")]
    pub type_name: String,
    /// Pattern of the topic: "state"; a stream, such as `{ stream = { capacity = 16 } }`; or slices, such as
    /// `{ slices = { longest = 4096, capacity = 4 } }`. The capacity, from 1 to 1024, limits the number of
    /// values per program that wait for a step of the bridge. It also limits the number of values that a
    /// reader of the topic may lag behind. Default "state".
    #[serde(default = "state")]
    pub pattern: TopicPattern,
    /// Maximum publication rate, such as "500 Hz". For a state, the latest value is published at this rate.
    /// For a stream or slices, values above the rate are rejected; bursts up to the capacity are accepted.
    /// Default 1 kHz.
    #[serde(default = "max_rate", deserialize_with = "rate")]
    pub max_rate: Rate,
    /// Maximum time that a value may wait for a step of the bridge, such as "50 ms". Older values are
    /// rejected. Must not be less than one period of the bridge. Default 100 ms.
    #[serde(default = "max_age")]
    pub max_age: TimeSpan,
}

/// Largest capacity of a stream or of slices.
const LARGEST_CAPACITY: usize = 1024;

fn state() -> TopicPattern {
    TopicPattern::State
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
        let mirrored: Vec<(&str, &String)> = self.mirrored().collect();
        if mirrored.is_empty() && self.inbound.is_empty() {
            return Err(ConfigError::new("the bridge has no ports").advise(
                "name inputs in `out`, `out_streams` or `out_slices`, or outputs with their types in `in`",
            ));
        }
        for (index, (key, port)) in mirrored.iter().enumerate() {
            if mirrored[..index].iter().any(|(_, other)| other == port) || self.inbound.contains_key(*port) {
                return Err(ConfigError::key(*key, format!("two ports are named `{port}`")));
            }
        }
        self.inbound.iter().try_for_each(|(port, inbound)| inbound.check(port))
    }

    /// The inputs, with their keys.
    fn mirrored(&self) -> impl Iterator<Item = (&'static str, &String)> {
        let lists =
            [("out", &self.out), ("out_streams", &self.out_streams), ("out_slices", &self.out_slices)];
        lists.into_iter().flat_map(|(key, ports)| ports.iter().map(move |port| (key, port)))
    }
}

/// The layouts of single numbers.
fn numbers() -> [TypeLayout; 10] {
    [
        u8::layout(),
        u16::layout(),
        u32::layout(),
        u64::layout(),
        i8::layout(),
        i16::layout(),
        i32::layout(),
        i64::layout(),
        f32::layout(),
        f64::layout(),
    ]
}

impl InboundConfig {
    fn check(&self, port: &str) -> Result<(), ConfigError> {
        let refuse = |message: String, advice| {
            Err(ConfigError::key(format!("in.{port}.pattern"), message).advise(advice))
        };
        if let TopicPattern::Slices { longest: 0, .. } = self.pattern {
            return refuse(
                "the maximum length of a slice is 0, expected at least 1 element".to_string(),
                "set `longest` to the maximum number of elements",
            );
        }
        match self.pattern.capacity() {
            None => Ok(()),
            Some(capacity) if !(1..=LARGEST_CAPACITY).contains(&capacity) => refuse(
                format!("a capacity of {capacity}, expected 1 to {LARGEST_CAPACITY}"),
                "set the capacity to the number of values that arrive between two steps of the bridge, or slightly more",
            ),
            Some(_) if self.type_name == EmergencyStop::NAME => refuse(
                "an emergency stop must not wait in a queue, which can overflow".to_string(),
                "remove `pattern`; the default is a state, which has no queue",
            ),
            Some(_) => Ok(()),
        }
    }

    /// The layout of the type.
    pub(super) fn layout(&self, port: &str) -> Result<TypeLayout, ConfigError> {
        let layouts = built_in();
        if let Some(number) = numbers().into_iter().find(|layout| layout.type_name == self.type_name) {
            return Ok(number);
        }
        let found = layouts.iter().find(|layout| layout.type_name == self.type_name).cloned();
        found.ok_or_else(|| {
            let names: Vec<&str> = layouts.iter().map(|layout| layout.type_name.as_str()).collect();
            let message = format!("there is no built-in state `{}`", self.type_name);
            ConfigError::key(format!("in.{port}.type"), message)
                .advise(format!("use one of {}, or a number such as \"u8\"", names.join(", ")))
        })
    }
}
