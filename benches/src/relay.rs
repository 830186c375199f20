//! Component of the measurements: passes a payload on and records its latency.

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::os::monotonic_ns;
use motorium::telemetry::Histogram;
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::Distribution;
use crate::payload::{Payload, PayloadVisitor, SIZES, with_payload};

/// The `config` table of `bench.relay`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RelayConfig {
    /// Size of the payload: 64, 512, 4096, 65536 or 1048576 bytes.
    #[serde(default = "default_bytes")]
    bytes: usize,
}

fn default_bytes() -> usize {
    512
}

/// Returns the kind of the component, for a host program.
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub(crate) fn kind() -> Kind {
    Kind::of::<Relay>()
}

/// Reads all of a payload and writes all of the next. Without an input it is the head of a chain, without an
/// output its tail, and the one that measures.
pub(crate) struct Relay {
    ports: Box<dyn Ports>,
    passes_on: bool,
    way: Histogram,
    hop: Histogram,
}

/// The ports of a relay for one size of payload.
trait Ports {
    /// Reads the input: source time and publish time, ns. `None` without input.
    fn read(&mut self) -> Result<Option<(u64, u64)>, StepError>;

    /// Publishes the payload if the relay has an output.
    fn write(&mut self) -> Result<(), StepError>;

    /// Returns `true` if the relay has an output.
    fn passes_on(&self) -> bool;
}

struct Sized<P: Payload> {
    input: Input<P>,
    output: Output<P>,
}

impl<P: Payload> Ports for Sized<P> {
    fn read(&mut self) -> Result<Option<(u64, u64)>, StepError> {
        let Some(reading) = self.input.latest() else { return Ok(None) };
        if reading.read().is_none() {
            return Err(StepError::failed("a payload was torn"));
        }
        let stamp = reading.stamp();
        Ok(Some((stamp.source_time, stamp.publish_time)))
    }

    fn write(&mut self) -> Result<(), StepError> {
        if !self.output.is_wired() {
            return Ok(());
        }
        let mut loan = self.output.loan()?;
        P::write_into(&mut loan, monotonic_ns());
        loan.publish()
    }

    fn passes_on(&self) -> bool {
        self.output.is_wired()
    }
}

struct DeclarePorts<'a>(&'a mut Declare);

impl PayloadVisitor for DeclarePorts<'_> {
    type Output = ();

    fn visit<P: Payload>(self) {
        self.0.optional_input::<P>("in", "the payload to pass on; the head of a chain has none");
        self.0.output::<P>("out", "the payload passed on");
    }
}

struct OpenPorts<'a>(&'a mut Setup);

impl PayloadVisitor for OpenPorts<'_> {
    type Output = Result<Box<dyn Ports>, ConfigureError>;

    fn visit<P: Payload>(self) -> Self::Output {
        let (input, output) = (self.0.input::<P>("in")?, self.0.output::<P>("out")?);
        Ok(Box::new(Sized { input, output }))
    }
}

impl Component for Relay {
    const KIND: &'static str = "bench.relay";
    const SUMMARY: &'static str = "passes a payload on and measures its latency, for benchmarks";
    type Config = RelayConfig;

    fn declare(config: &RelayConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        with_payload(config.bytes, DeclarePorts(declare)).ok_or_else(|| {
            let sizes: Vec<String> = SIZES.iter().map(usize::to_string).collect();
            let message = format!("{} bytes, expected one of {}", config.bytes, sizes.join(", "));
            ConfigError::key("bytes", message)
        })
    }

    fn configure(config: RelayConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let ports = with_payload(config.bytes, OpenPorts(setup))
            .ok_or_else(|| ConfigureError::failed("no payload of this size"))??;
        let passes_on = ports.passes_on();
        Ok(Self { ports, passes_on, way: Histogram::default(), hop: Histogram::default() })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        let read = self.ports.read()?;
        if self.passes_on {
            // The next process on this core runs after this step: recording here would add to the latency.
            return self.ports.write();
        }
        if let Some((source, published)) = read {
            let now = monotonic_ns();
            self.way.record(now.saturating_sub(source));
            self.hop.record(now.saturating_sub(published));
        }
        Ok(())
    }

    /// Latencies from the head of the chain, and from the previous relay, to the read of the payload.
    fn result(&self) -> Option<serde_json::Value> {
        let ways = [("way_ns", &self.way), ("hop_ns", &self.hop)];
        let ways = ways.map(|(name, histogram)| (name.to_string(), Distribution::from_histogram(histogram)));
        (self.way.count() > 0)
            .then(|| ways.into_iter().map(|(name, seen)| (name, serde_json::json!(seen))).collect())
    }
}
