//! Two components for the measurement of raw ports: the source publishes a value in each step, and the sink
//! reads all values.

use motorium::component::{Component, ConfigureError, RunClock, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::raw::{RawStreamInput, RawStreamOutput};
use motorium::state::{StateBuffer as _, Wrench};
use motorium::telemetry::Histogram;
use motorium::worker::Kind;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::Distribution;

/// Values that a queue holds.
const CAPACITY: usize = 64;
/// Elements of the longest slice. The slices published have 0, 1, ... elements, and 0 again after the
/// longest.
const LONGEST: usize = 8;

/// Returns the kinds of both components, for a host program.
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub(crate) fn kinds() -> [Kind; 2] {
    [Kind::of::<RawSource>(), Kind::of::<RawSink>()]
}

/// The `config` table of `bench.raw_source` and of `bench.raw_sink`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPortsConfig {
    /// `true` for slices, `false` for a stream of single values.
    slices: bool,
}

/// Publishes a value in each step.
pub(crate) struct RawSource {
    values: RawStreamOutput,
    bytes: Vec<u8>,
    size: usize,
    slices: bool,
}

impl Component for RawSource {
    const KIND: &'static str = "bench.raw_source";
    const SUMMARY: &'static str = "publishes a value in each step on a raw port, for benchmarks";
    type Config = RawPortsConfig;

    fn declare(config: &RawPortsConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let (layout, doc) = (Wrench::layout(), "a value for each step");
        if config.slices {
            declare.raw_slice_output("values", layout, LONGEST, CAPACITY, doc);
        } else {
            declare.raw_stream_output("values", layout, CAPACITY, doc);
        }
        Ok(())
    }

    fn configure(config: RawPortsConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let values = setup.raw_stream_output("values")?;
        let size = values.layout().size;
        Ok(Self { values, bytes: vec![0; LONGEST * size], size, slices: config.slices })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let count = if self.slices { tick.index as usize % (LONGEST + 1) } else { 1 };
        let bytes = &self.bytes[..count * self.size];
        self.values.publish(bytes).map_err(|error| StepError::failed(error.to_string()))
    }
}

/// Reads every value, and records the time from its publication and the values that are missing.
pub(crate) struct RawSink {
    values: RawStreamInput,
    clock: RunClock,
    age: Histogram,
    /// The sequence number of the value read last.
    last: u64,
    lost: u64,
}

impl Component for RawSink {
    const KIND: &'static str = "bench.raw_sink";
    const SUMMARY: &'static str = "reads every value of a raw port, for benchmarks";
    type Config = RawPortsConfig;

    fn declare(config: &RawPortsConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        if config.slices {
            declare.raw_slice_input("values", CAPACITY, "the values to read");
        } else {
            declare.raw_stream_input("values", CAPACITY, "the values to read");
        }
        Ok(())
    }

    fn configure(_: RawPortsConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (values, clock) = (setup.raw_stream_input("values")?, setup.clock());
        Ok(Self { values, clock, age: Histogram::default(), last: 0, lost: 0 })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        while let Some(value) = self.values.next_unread() {
            let (sequence, published) = (value.stamp.sequence, value.stamp.publish_time);
            self.age.record(self.clock.stamp_ns(self.clock.now_ns()).saturating_sub(published));
            self.lost += sequence.saturating_sub(self.last + 1);
            self.last = sequence;
        }
        Ok(())
    }

    /// Returns the ages of the values read, and the number of values that are missing.
    fn result(&self) -> Option<serde_json::Value> {
        let age = Distribution::from_histogram(&self.age);
        (age.count > 0).then(|| serde_json::json!({ "age_ns": age, "lost": self.lost }))
    }
}
