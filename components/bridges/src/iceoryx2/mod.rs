//! `bridge.iceoryx2`: exchanges topics with programs in any language that use stock iceoryx2.

mod config;
mod counts;
mod feed;
mod inbound;
mod inbound_stream;
mod outbound;
mod service;

pub use config::{Iceoryx2BridgeConfig, InboundConfig};
pub use feed::Feed;
pub use service::ServiceError;

use motorium::component::{Component, ConfigureError, RunClock, Setup, Tick};
use motorium::declare::{ClockKind, ConfigError, Declare, StepError, TopicPattern};
use motorium::os::monotonic_ns;
use serde_json::{Map, Value, json};

use inbound::Inbound;
use inbound_stream::InboundStream;
use outbound::Outbound;

/// Minimum queue length of a mirrored stream, values. The queue is longer if the writer or another reader of
/// the topic declares a longer one.
const MIRRORED_CAPACITY: usize = 16;

/// A component that mirrors topics of the graph to programs that use stock iceoryx2, and publishes values
/// from such programs on topics of the graph.
///
/// A mirrored topic `NAME` is the service `out/NAME`, with the publisher's [`Stamp`](motorium::state::Stamp)
/// as user header. An inbound topic `NAME` is fed by the service `in/NAME`. On inbound services, states have
/// no user header, while streams and slices have a `Stamp` in which the program numbers its values with
/// `sequence`. The bridge publishes each value with its own stamp, whose source time is the time of the step
/// that received the value.
pub struct Iceoryx2Bridge {
    outbound: Vec<Outbound>,
    inbound: Vec<Inbound>,
    inbound_streams: Vec<InboundStream>,
    clock: RunClock,
}

impl Component for Iceoryx2Bridge {
    const KIND: &'static str = "bridge.iceoryx2";
    const SUMMARY: &'static str = "topics for programs in other languages, by iceoryx2";
    type Config = Iceoryx2BridgeConfig;

    fn declare(config: &Iceoryx2BridgeConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        config.check()?;
        for port in &config.out {
            declare.raw_input(port, "topic to mirror, of any type");
        }
        for port in &config.out_streams {
            declare.raw_stream_input(port, MIRRORED_CAPACITY, "stream to mirror, of any type");
        }
        for port in &config.out_slices {
            // slices may be large, so the writer determines the queue length
            declare.raw_slice_input(port, 1, "slices to mirror, of any type");
        }
        for (port, inbound) in &config.inbound {
            let (layout, doc) = (inbound.layout(port)?, "topic fed by foreign programs");
            match inbound.pattern {
                TopicPattern::State => declare.raw_output(port, layout, doc),
                TopicPattern::Stream { capacity } => declare.raw_stream_output(port, layout, capacity, doc),
                TopicPattern::Slices { capacity, longest } => {
                    declare.raw_slice_output(port, layout, longest, capacity, doc);
                }
            }
        }
        if declare.clock() == ClockKind::Lockstep {
            let warning = declare.warn(
                "simulated time does not wait for foreign programs, so they may miss values, and runs are not reproducible",
            );
            warning.advise("run the graph in real time, or replace the foreign program by a component");
        }
        Ok(())
    }

    fn configure(config: Iceoryx2BridgeConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let node = setup.domain().node().map_err(ConfigureError::failed)?;
        let mut bridge = Self {
            outbound: Vec::new(),
            inbound: Vec::new(),
            inbound_streams: Vec::new(),
            clock: setup.clock(),
        };
        for port in &config.out {
            bridge.outbound.push(Outbound::newest(&node, setup.raw_input(port)?)?);
        }
        for port in config.out_streams.iter().chain(&config.out_slices) {
            bridge.outbound.push(Outbound::every(&node, setup.raw_stream_input(port)?)?);
        }
        for (port, inbound) in &config.inbound {
            let period_ns = setup.period().as_nanos() as u64;
            if inbound.max_age.ns < period_ns {
                let message =
                    format!("max_age is {}, expected at least one period of the bridge", inbound.max_age);
                return Err(ConfigError::key(format!("in.{port}.max_age"), message).into());
            }
            if inbound.pattern == TopicPattern::State {
                bridge.inbound.extend(Inbound::new(&node, setup.raw_output(port)?, inbound)?);
            } else {
                let output = setup.raw_stream_output(port)?;
                bridge.inbound_streams.extend(InboundStream::new(&node, output, inbound)?);
            }
        }
        Ok(bridge)
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let now_ns = monotonic_ns();
        let (time_ns, clock) = (tick.time_ns, &self.clock);
        self.inbound.iter_mut().for_each(|inbound| inbound.step(time_ns, now_ns, clock));
        self.inbound_streams.iter_mut().for_each(|stream| stream.step(time_ns, now_ns, clock));
        self.outbound.iter_mut().for_each(Outbound::step);
        Ok(())
    }

    fn result(&self) -> Option<Value> {
        let outbound: Map<String, Value> = self.outbound.iter().map(Outbound::result).collect();
        let streams = self.inbound_streams.iter().map(InboundStream::result);
        let inbound: Map<String, Value> = self.inbound.iter().map(Inbound::result).chain(streams).collect();
        Some(json!({ "out": outbound, "in": inbound }))
    }
}
