//! Simulated drives on simulated buses.

use motorium::component::RunClock;
use motorium::prelude::*;

use super::ends::Ends;
use super::{Axis, BABBLE_NS, Drives};
use crate::bus::simulated::Event;
use crate::component::adapter::BATCH;
use crate::component::faults::FaultKind;
use crate::{Condition, ErrorState, Form, Frame, Id, Report, SimulatedBus, Table};

/// Simulated buses, with what leads to them.
pub(super) struct Simulated {
    ends: Ends,
    buses: Vec<Wire>,
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
    /// Frames of the computer that it has room for.
    pub(super) fn room(&self) -> usize {
        self.room.saturating_sub(self.bus.waiting(0))
    }

    /// Hands a frame of the computer over; one that finds no room is not sent.
    pub(super) fn hand_over(&mut self, frame: Frame, ready_ns: u64) {
        let fits = self.room() > 0 && self.bus.enqueue(0, frame, ready_ns);
        self.unsent = self.unsent.saturating_add(u8::from(!fits));
    }

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
    pub(super) fn new(ends: Ends, buses: Vec<Wire>) -> Self {
        Self { ends, buses }
    }

    /// Moves the buses on to the present, and publishes what the adapter receives.
    pub(super) fn run(
        &mut self,
        drives: &mut Drives<'_>,
        clock: &RunClock,
        now_ns: u64,
    ) -> Result<(), StepError> {
        let Self { ends, buses } = self;
        ends.hear(clock.stamp_ns(0), buses);
        self.begin_faults(drives, now_ns);
        for index in 0..self.buses.len() {
            self.run_bus(index, now_ns, drives);
        }
        drives.lost += self.ends.publish()?;
        Ok(())
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
                    if frame.form == Form::Packet {
                        let Wire { bus, twin, .. } = wire;
                        drives.overhear(index, &frame, time_ns, &mut |sender, answer, ready_ns| {
                            bus.enqueue(sender.node(*twin), answer, ready_ns);
                        });
                    }
                    self.ends.tell(index, &frame, time_ns);
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
                self.ends.set_down(index, true, now_ns);
            }
            return;
        }
        if before == Condition::Down {
            self.ends.set_down(index, false, now_ns);
        }
        if before != condition || is_unacknowledged || unsent > 0 {
            let report = Report {
                state: (before != condition).then_some(state),
                is_unacknowledged,
                is_overflow: unsent > 0,
                is_restart: !before.can_send() && condition.can_send(),
                ..Report::default()
            };
            self.ends.report(index, &report, unsent, now_ns);
        }
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
