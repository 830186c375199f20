//! Motorium's hop: the ports of a component and its worker's wait, without the worker itself.

use std::path::Path;

use motorium::os::yield_core;
use motorium::testing::{Endpoint, TopicSetError};
use motorium::transport::{Input, Output, Trigger};

use super::SIDES;
use super::link::Link;
use crate::payload::Payload;

/// A topic in each direction.
pub(super) struct Topics<P: Payload> {
    _endpoints: [Endpoint; 2],
    output: Output<P>,
    input: Input<P>,
    trigger: Trigger,
    waits: Waits,
    seen: u64,
}

/// Waiting strategy of the receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Waits {
    /// Sleeps until its trigger wakes it.
    Blocking,
    /// Polls.
    Spinning,
    /// Polls and yields to the sender, which is on the same core.
    Yielding,
}

impl<P: Payload> Topics<P> {
    pub(super) fn open(folder: &Path, side: usize, waits: Waits) -> Result<Self, TopicSetError> {
        let endpoints = [
            Endpoint::join(folder, SIDES[side])?,
            Endpoint::join(folder, &format!("{}-reader", SIDES[side]))?,
        ];
        let output = endpoints[0].output("out")?;
        let input = endpoints[1].input("in")?;
        let trigger = endpoints[1].trigger()?;
        Ok(Self { _endpoints: endpoints, output, input, trigger, waits, seen: 0 })
    }
}

impl<P: Payload> Link for Topics<P> {
    fn send(&mut self, time_ns: u64) -> Result<(), String> {
        let mut loan = self.output.loan().map_err(|error| error.to_string())?;
        P::write_into(&mut loan, time_ns);
        loan.publish().map_err(|error| error.to_string())
    }

    fn receive(&mut self) -> Result<u64, String> {
        loop {
            match self.waits {
                Waits::Blocking => self.trigger.wait(),
                Waits::Spinning => {
                    while !self.input.has_news() {
                        core::hint::spin_loop();
                    }
                }
                Waits::Yielding => {
                    while !self.input.has_news() {
                        yield_core();
                    }
                }
            }
            if let Some(reading) = self.input.latest()
                && reading.stamp().sequence != self.seen
            {
                self.seen = reading.stamp().sequence;
                return reading.read().ok_or_else(|| "a payload was torn".to_string());
            }
        }
    }
}
