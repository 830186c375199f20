//! Simulated drives on simulated buses.

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::CanFrame;
use motorium::transport::{SliceInput, SliceOutput};

use super::{Axis, BABBLE_NS, Drives};
use crate::bus::simulated::Event;
use crate::component::adapter::BATCH;
use crate::component::faults::FaultKind;
use crate::component::wire;
use crate::{Condition, ErrorState, Frame, Id, Report, SimulatedBus, Table};

/// Simulated buses, with the topics that lead to them.
pub(super) struct Simulated {
    sent: SliceInput<CanFrame>,
    received: SliceOutput<CanFrame>,
    buses: Vec<Wire>,
    answers: Vec<CanFrame>,
    lost: u64,
}

/// One bus: node 0 is the adapter, those from 1 on are drives, then comes one that babbles, and one like a drive.
pub(super) struct Wire {
    bus: SimulatedBus,
    babbler: usize,
    twin: usize,
    babbled_ns: u64,
    /// Condition of the adapter's interface, as it was told last.
    condition: Condition,
    is_down: bool,
    was_off: bool,
    /// The nodes that are on the bus, unless their errors drove them off.
    connected: Vec<bool>,
    /// Frames of the adapter that wait at most, as in the queue of an interface of Linux and its controller.
    room: usize,
    unsent: u8,
    is_unacknowledged: bool,
}

impl Wire {
    /// Plugs a node in or out; one that comes back begins anew.
    fn connect(&mut self, node: usize, is_connected: bool) {
        match (self.connected[node], is_connected) {
            (true, false) => self.bus.switch_off(node),
            (false, true) => self.bus.restart(node),
            _ => {}
        }
        self.connected[node] = is_connected;
    }
}

/// Frames that an interface of Linux keeps: ten in its queue, two in its controller.
const ROOM: usize = 12;

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
        self.begin_faults(drives, now_ns);
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
                let Some(data) = wire::from_topic(frame) else { continue };
                let fits = wire.bus.waiting(0) < wire.room && wire.bus.enqueue(0, data, ready_ns);
                wire.unsent = wire.unsent.saturating_add(u8::from(!fits));
            }
        }
    }

    /// The faults of buses, and the nodes that are on them.
    fn begin_faults(&mut self, drives: &mut Drives<'_>, now_ns: u64) {
        let faults = drives.faults;
        for (index, wire) in self.buses.iter_mut().enumerate() {
            let is_on = |kind| faults.iter().any(|fault| fault.befalls(kind, index, now_ns));
            let is_alone = is_on(FaultKind::Alone);
            let mut has_twin = false;
            for axis in drives.axes.iter_mut().filter(|axis| axis.bus == index) {
                has_twin |= faults.iter().any(|fault| fault.befalls(FaultKind::Twin, axis.entry, now_ns));
                wire.connect(axis.node, !is_alone && !axis.was_off);
                axis.is_cut_off = wire.bus.state(axis.node) == ErrorState::Off;
            }
            wire.connect(wire.babbler, !is_alone && is_on(FaultKind::Babbling));
            wire.connect(wire.twin, !is_alone && has_twin);
            wire.is_down = is_on(FaultKind::Down);
            let is_off = is_on(FaultKind::BusOff) || wire.is_down;
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
        let Wire { bus, twin, .. } = &mut self.buses[index];
        drives.report(index, now_ns, &mut |sender, frame, ready_ns| {
            bus.enqueue(sender.node(*twin), frame, ready_ns);
        });
        while let Some(event) = self.buses[index].bus.next(now_ns) {
            let wire = &mut self.buses[index];
            match event {
                Event::Delivered { sender: 0, frame, time_ns } => {
                    let Wire { bus, twin, .. } = wire;
                    drives.hear(index, &frame, time_ns, &mut |sender, answer, ready_ns| {
                        bus.enqueue(sender.node(*twin), answer, ready_ns);
                    });
                }
                Event::Delivered { frame, time_ns, .. } if wire.bus.state(0) != ErrorState::Off => {
                    self.tell(wire::to_topic(&frame, index, time_ns));
                }
                Event::Disturbed { sender: 0, is_unacknowledged: true, .. } => wire.is_unacknowledged = true,
                Event::Delivered { .. } | Event::Disturbed { .. } => {}
            }
        }
        self.tell_news(index, now_ns);
    }

    /// Lets the adapter know what has become of its interface since the last step.
    fn tell_news(&mut self, index: usize, now_ns: u64) {
        let wire = &mut self.buses[index];
        let state = wire.bus.state(0);
        let condition = if wire.is_down { Condition::Down } else { state.into() };
        let (before, unsent) = (core::mem::replace(&mut wire.condition, condition), wire.unsent);
        let is_unacknowledged = core::mem::take(&mut wire.is_unacknowledged);
        wire.unsent = 0;
        if condition == Condition::Down {
            if before != condition {
                self.tell(wire::down(index, now_ns));
            }
        } else if before != condition || is_unacknowledged || unsent > 0 {
            let report = Report {
                state: (before != condition).then_some(state),
                is_unacknowledged,
                is_overflow: unsent > 0,
                is_restart: !before.can_send() && condition.can_send(),
                ..Report::default()
            };
            self.tell(wire::report(&report, unsent, index, now_ns));
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
            bus: SimulatedBus::new(table.rates(index), nodes + 2, BATCH),
            babbler: nodes,
            twin: nodes + 1,
            babbled_ns: 0,
            condition: Condition::Active,
            is_down: false,
            was_off: false,
            connected: vec![true; nodes + 2],
            room: ROOM.max(nodes - 1),
            unsent: 0,
            is_unacknowledged: false,
        }
    };
    (0..table.buses.len()).map(wire).collect()
}
