//! Simulated drives on simulated buses.

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::CanFrame;
use motorium::transport::{SliceInput, SliceOutput};

use super::{Axis, BABBLE_NS, Drives};
use crate::bus::simulated::Event;
use crate::component::adapter::BATCH;
use crate::component::faults::{Fault, FaultKind};
use crate::component::wire;
use crate::{ErrorState, Frame, Id, SimulatedBus, Table};

/// Simulated buses, with the topics that lead to them.
pub(super) struct Simulated {
    sent: SliceInput<CanFrame>,
    received: SliceOutput<CanFrame>,
    buses: Vec<Wire>,
    answers: Vec<CanFrame>,
    lost: u64,
}

/// One bus: node 0 is the adapter, the last one babbles, those between are drives.
pub(super) struct Wire {
    bus: SimulatedBus,
    babbler: usize,
    babbled_ns: u64,
    state: ErrorState,
    was_off: bool,
}

impl Simulated {
    pub(super) fn new(sent: SliceInput<CanFrame>, received: SliceOutput<CanFrame>, buses: Vec<Wire>) -> Self {
        Self { sent, received, buses, answers: Vec::with_capacity(BATCH), lost: 0 }
    }

    /// Moves the buses on to the present, and publishes what the adapter receives.
    pub(super) fn run(
        &mut self,
        drives: &mut Drives<'_>,
        clock: &RunClock,
        now_ns: u64,
    ) -> Result<(), StepError> {
        self.hear(clock);
        self.begin_faults(drives.faults, now_ns);
        self.answers.clear();
        for index in 0..self.buses.len() {
            self.run_bus(index, now_ns, drives);
        }
        drives.lost += core::mem::take(&mut self.lost);
        self.publish()
    }

    /// Hands the frames of the adapter to their buses, at the time at which it sent them.
    fn hear(&mut self, clock: &RunClock) {
        let start_ns = clock.stamp_ns(0);
        while let Some((stamp, frames)) = self.sent.next_unread() {
            let ready_ns = stamp.publish_time.saturating_sub(start_ns);
            for frame in frames {
                let Some(wire) = self.buses.get_mut(frame.bus as usize) else { continue };
                if let Some(data) = wire::from_topic(frame) {
                    wire.bus.enqueue(0, data, ready_ns);
                }
            }
        }
    }

    /// The faults of buses.
    fn begin_faults(&mut self, faults: &[Fault], now_ns: u64) {
        for (index, wire) in self.buses.iter_mut().enumerate() {
            let is_on = |kind| faults.iter().any(|fault| fault.befalls(kind, index, now_ns));
            let is_off = is_on(FaultKind::BusOff);
            match (is_off, wire.was_off) {
                (true, _) => wire.bus.switch_off(0),
                (false, true) => wire.bus.restart(0),
                (false, false) => {}
            }
            wire.was_off = is_off;
            if is_on(FaultKind::Disturbed) {
                wire.bus.disturb(1);
            }
            if is_on(FaultKind::Babbling) {
                // it goes on where it was, and never saves up
                wire.babbled_ns = wire.babbled_ns.max(now_ns.saturating_sub(1_000_000));
                while wire.babbled_ns < now_ns {
                    let noise = Frame::classic(Id::Standard(0), &[0xff; 8]);
                    wire.bus.enqueue(wire.babbler, noise, wire.babbled_ns);
                    wire.babbled_ns += BABBLE_NS;
                }
            } else {
                wire.babbled_ns = now_ns;
            }
        }
    }

    /// Moves a bus on to the present: drives hear what is delivered, and their answers are sent in turn.
    fn run_bus(&mut self, index: usize, now_ns: u64, drives: &mut Drives<'_>) {
        while let Some(event) = self.buses[index].bus.next(now_ns) {
            if let Event::Delivered { sender, frame, time_ns } = event {
                if sender == 0 {
                    let bus = &mut self.buses[index].bus;
                    drives.hear(index, &frame, time_ns, &mut |node, answer, ready_ns| {
                        bus.enqueue(node, answer, ready_ns);
                    });
                } else if self.buses[index].bus.state(0) != ErrorState::Off {
                    self.tell(wire::to_topic(&frame, index, time_ns));
                }
            }
        }
        let wire = &mut self.buses[index];
        let state = wire.bus.state(0);
        if state != wire.state {
            let is_back = wire.state == ErrorState::Off;
            wire.state = state;
            self.tell(wire::report(state, is_back, index, now_ns));
        }
    }

    /// Lets the adapter receive a frame; what its batch has no room for is lost, as with a full buffer.
    fn tell(&mut self, frame: CanFrame) {
        if self.answers.len() < BATCH {
            self.answers.push(frame);
        } else {
            self.lost += 1;
        }
    }

    fn publish(&mut self) -> Result<(), StepError> {
        if self.answers.is_empty() {
            return Ok(());
        }
        let mut out = self.received.loan(self.answers.len())?;
        out.copy_from_slice(&self.answers);
        out.publish()
    }
}

/// Simulated buses; each drive gets its node.
pub(super) fn wires(table: &Table, axes: &mut [Axis]) -> Vec<Wire> {
    let wire = |index: usize| {
        let mut nodes = 1;
        for axis in axes.iter_mut().filter(|axis| axis.bus == index) {
            (axis.node, nodes) = (nodes, nodes + 1);
        }
        Wire {
            bus: SimulatedBus::new(table.rates(index), nodes + 1, BATCH),
            babbler: nodes,
            babbled_ns: 0,
            state: ErrorState::Active,
            was_off: false,
        }
    };
    (0..table.buses.len()).map(wire).collect()
}
