//! `bridge.iceoryx2`: topics for programs that use stock iceoryx2, in any language.

mod config;
mod feed;
mod inbound;
mod outbound;
mod service;

pub use config::{Iceoryx2BridgeConfig, InboundConfig};
pub use feed::{Feed, FeedError};

use motorium::component::{Component, ConfigureError, RunClock, Setup, Tick};
use motorium::declare::{ClockKind, ConfigError, Declare, StepError};
use motorium::os::monotonic_ns;
use serde_json::{Map, Value, json};

use inbound::Inbound;
use outbound::Outbound;

/// Mirrors topics of the graph to stock iceoryx2 programs, and publishes their values on topics of the graph.
///
/// A mirrored topic `NAME` is the service `out/NAME`, with the publisher's [`Stamp`](motorium::state::Stamp)
/// as user header. An inbound topic `NAME` is fed by the service `in/NAME`, which has no user header. A value
/// gets the bridge's own stamp; its source time is the step that received it.
pub struct Iceoryx2Bridge {
    outbound: Vec<Outbound>,
    inbound: Vec<Inbound>,
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
        for (port, inbound) in &config.inbound {
            declare.raw_output(port, inbound.layout(port)?, "topic fed by foreign programs");
        }
        if declare.clock() == ClockKind::Lockstep {
            let warning = declare.warn(
                "simulated time does not wait for foreign programs: they may miss every value, and no two runs are the same",
            );
            warning
                .advise("run it in real time, or simulate the foreign program by a component in its place");
        }
        Ok(())
    }

    fn configure(config: Iceoryx2BridgeConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let node = setup.domain().node().map_err(ConfigureError::failed)?;
        let mut bridge = Self { outbound: Vec::new(), inbound: Vec::new(), clock: setup.clock() };
        for port in &config.out {
            bridge.outbound.push(Outbound::new(&node, setup.raw_input(port)?)?);
        }
        for (port, inbound) in &config.inbound {
            let period_ns = setup.period().as_nanos() as u64;
            if inbound.max_age.ns < period_ns {
                let message = format!("max_age is {}, less than a period of the bridge", inbound.max_age);
                return Err(ConfigError::key(format!("in.{port}.max_age"), message).into());
            }
            bridge.inbound.extend(Inbound::new(&node, setup.raw_output(port)?, inbound)?);
        }
        Ok(bridge)
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let now_ns = monotonic_ns();
        self.inbound.iter_mut().for_each(|inbound| inbound.step(tick.time_ns, now_ns, &self.clock));
        self.outbound.iter_mut().for_each(Outbound::step);
        Ok(())
    }

    fn result(&self) -> Option<Value> {
        let outbound: Map<String, Value> = self.outbound.iter().map(Outbound::result).collect();
        let inbound: Map<String, Value> = self.inbound.iter().map(Inbound::result).collect();
        Some(json!({ "out": outbound, "in": inbound }))
    }
}
