//! Endpoints of simulated buses: topics for the adapter, or sockets and terminals that any program can open.

use motorium::prelude::*;
use motorium::state::CanFrame;
use motorium::transport::{SliceInput, SliceOutput};

use super::channel::Channel;
use crate::bus::Received;
use crate::bus::offered::Offer;
use crate::component::wire::BATCH;
use crate::component::{interfaces, wire};
use crate::{Frame, Report, Table};

/// Endpoints of simulated buses.
pub(super) enum Endpoints {
    /// Topics, with one batch of frames for all buses.
    Topics(Box<Topics>),
    /// Sockets and terminals that offer the buses.
    Offers(Offers),
}

/// Topics of simulated buses.
pub(super) struct Topics {
    sent: SliceInput<CanFrame>,
    received: SliceOutput<CanFrame>,
    answers: Vec<CanFrame>,
    lost: u64,
}

/// Simulated buses offered to other programs.
pub(super) struct Offers {
    offers: Vec<Offer>,
    inbox: Vec<Received>,
    /// Start time of the run, ns.
    start_ns: u64,
}

impl Endpoints {
    pub(super) fn topics(sent: SliceInput<CanFrame>, received: SliceOutput<CanFrame>) -> Self {
        let answers = Vec::with_capacity(BATCH);
        Self::Topics(Box::new(Topics { sent, received, answers, lost: 0 }))
    }

    /// Offers the buses of a table at their addresses.
    pub(super) fn offers(table: &Table) -> Result<Self, ConfigError> {
        let offers = interfaces::offer(table)?;
        Ok(Self::Offers(Offers { offers, inbox: vec![Received::default(); BATCH], start_ns: 0 }))
    }

    /// Queues the frames of the computer on their buses, with their send times.
    pub(super) fn receive(&mut self, start_ns: u64, buses: &mut [Channel]) {
        match self {
            Self::Topics(topics) => {
                topics.answers.clear();
                while let Some((stamp, frames)) = topics.sent.next_unread() {
                    let ready_ns = stamp.publish_time.saturating_sub(start_ns);
                    for frame in frames {
                        let Some(channel) = buses.get_mut(frame.bus as usize) else { continue };
                        let Some(data) = wire::from_topic(frame) else { continue };
                        channel.hand_over(data, ready_ns);
                    }
                }
            }
            Self::Offers(all) => {
                all.start_ns = start_ns;
                for (offer, channel) in all.offers.iter_mut().zip(buses) {
                    // a socket delivers all frames, and the interface drops frames without room; a terminal
                    // keeps them, like an adapter's serial line
                    let room = match offer {
                        Offer::Socket(_) => BATCH,
                        Offer::Terminal(_) => channel.room().min(BATCH),
                    };
                    let count = offer.receive(&mut all.inbox[..room]);
                    for received in &all.inbox[..count] {
                        channel.hand_over(received.frame, received.time_ns.saturating_sub(start_ns));
                    }
                }
            }
        }
    }

    /// Delivers a frame to the adapter.
    pub(super) fn deliver(&mut self, bus: usize, frame: &Frame, time_ns: u64) {
        match self {
            Self::Topics(topics) => topics.push(wire::to_topic(frame, bus, time_ns)),
            Self::Offers(Offers { offers, start_ns, .. }) => {
                offers[bus].deliver(&Received { frame: *frame, time_ns: *start_ns + time_ns });
            }
        }
    }

    /// Delivers a report of its controller to the adapter, with the number of frames that did not fit into
    /// its queue.
    pub(super) fn report(&mut self, bus: usize, report: &Report, unsent: u8, now_ns: u64) {
        match self {
            Self::Topics(topics) => topics.push(wire::report(report, unsent, bus, now_ns)),
            Self::Offers(Offers { offers, .. }) => offers[bus].report(report, unsent),
        }
    }

    /// Takes the adapter's interface down, or brings it up.
    pub(super) fn set_link_down(&mut self, bus: usize, is_down: bool, now_ns: u64) {
        match self {
            Self::Topics(topics) if is_down => topics.push(wire::down(bus, now_ns)),
            // the controller's report announces that the interface is up
            Self::Topics(_) => {}
            Self::Offers(Offers { offers, .. }) => offers[bus].set_link_down(is_down),
        }
    }

    /// Sends all queued frames and reports. Returns the number of frames lost for lack of room.
    pub(super) fn publish(&mut self) -> Result<u64, StepError> {
        match self {
            Self::Topics(topics) => topics.publish(),
            Self::Offers(Offers { offers, .. }) => Ok(offers.iter_mut().map(Offer::flush).sum()),
        }
    }
}

impl Topics {
    /// Appends a frame to the adapter's batch. A frame without room is lost, as with a full buffer.
    fn push(&mut self, frame: CanFrame) {
        if self.answers.len() < BATCH {
            self.answers.push(frame);
        } else {
            self.lost += 1;
        }
    }

    fn publish(&mut self) -> Result<u64, StepError> {
        if !self.answers.is_empty() {
            let mut out = self.received.loan(self.answers.len())?;
            out.copy_from_slice(&self.answers);
            out.publish()?;
        }
        Ok(core::mem::take(&mut self.lost))
    }
}
