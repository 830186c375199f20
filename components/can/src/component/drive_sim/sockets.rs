//! Simulated drives on real buses, which receive frames from an interface and answer on it.

use motorium::component::RunClock;
use motorium::prelude::*;

use super::axis::Axis;
use super::drives::Drives;
use super::fault_injector::{BABBLE_NS, Sender};
use crate::bus::{Bus, Received};
use crate::component::faults::{Fault, FaultKind};
use crate::component::interfaces;
use crate::component::wire::BATCH;
use crate::{Condition, ErrorState, Frame, Id, RealBus, Report, Table};

/// Interfaces of the drives.
pub(super) struct Sockets {
    lines: Vec<Line>,
    inbox: Vec<Received>,
    /// Delayed answers: time, bus, frame.
    pending: Vec<(u64, usize, Frame)>,
    clock: RunClock,
}

struct Line {
    bus: RealBus,
    babbled_ns: u64,
    /// Controller state of the bus according to the scripted faults.
    state: ErrorState,
}

/// Maximum number of delayed answers.
const PENDING: usize = 4 * BATCH;
/// Frames of a babbling node per step.
const NOISE: usize = 32;

impl Sockets {
    /// Opens the interfaces of a table.
    pub(super) fn open(
        table: &Table,
        axes: &[Axis],
        faults: &[Fault],
        clock: RunClock,
    ) -> Result<Self, ConfigError> {
        let mut lines = Vec::new();
        for (index, mut bus) in interfaces::open(table)?.into_iter().enumerate() {
            let needs_simulation = |fault: &Fault| {
                fault.target == index && matches!(fault.kind, FaultKind::BusOff | FaultKind::Disturbed)
            };
            let alone = |fault: &Fault| {
                fault.target == index && matches!(fault.kind, FaultKind::Alone | FaultKind::Down)
            };
            if faults.iter().any(alone) {
                let message = format!("`{}` is an interface of the computer", bus.name());
                return Err(ConfigError::key("faults", message).advise(
                    "script \"alone\" and \"down\" on simulated buses; unplug a real interface, or use `ip link set`",
                ));
            }
            let injects = bus.is_virtual() && matches!(bus, RealBus::Socket(_));
            if !injects && faults.iter().any(needs_simulation) {
                let message =
                    format!("`{}` has a real controller, whose errors cannot be scripted", bus.name());
                return Err(ConfigError::key("faults", message)
                    .advise("script \"bus_off\" and \"disturbed\" on simulated and virtual buses"));
            }
            let ids = axes.iter().filter(|axis| axis.bus == index).flat_map(|axis| axis.drive.ids());
            let ids: Vec<Id> = ids.collect();
            bus.receive_only(&ids).map_err(|error| {
                ConfigError::key("drives", format!("the filters of `{}`: {error}", bus.name()))
            })?;
            lines.push(Line { bus, babbled_ns: 0, state: ErrorState::Active });
        }
        let inbox = vec![Received::default(); BATCH];
        Ok(Self { lines, inbox, pending: Vec::with_capacity(PENDING), clock })
    }

    /// Applies the faults of buses.
    pub(super) fn begin_faults(&mut self, faults: &[Fault], now_ns: u64) {
        for (index, line) in self.lines.iter_mut().enumerate() {
            let is_on = |kind| faults.iter().any(|fault| fault.befalls(kind, index, now_ns));
            let state = match () {
                () if is_on(FaultKind::BusOff) => ErrorState::Off,
                () if is_on(FaultKind::Disturbed) => ErrorState::Passive,
                () => ErrorState::Active,
            };
            if state != line.state {
                let report = Report {
                    state: Some(state),
                    is_disturbed: state == ErrorState::Passive,
                    is_restart: line.state == ErrorState::Off,
                    counters: (state == ErrorState::Passive).then_some([136, 0]),
                    ..Report::default()
                };
                // an interface that is down has no participants
                if line.bus.inject(&report).is_ok() {
                    line.state = state;
                }
            }
            if is_on(FaultKind::Babbling) {
                line.babbled_ns = line.babbled_ns.max(now_ns.saturating_sub(1_000_000));
                let missing = now_ns.saturating_sub(line.babbled_ns) / BABBLE_NS;
                let noise = [Frame::classic(Id::Standard(0), &[0xff; 8]); NOISE];
                let count = (missing as usize).min(NOISE);
                line.bus.send(&noise[..count]);
                line.babbled_ns += missing * BABBLE_NS;
            } else {
                line.babbled_ns = now_ns;
            }
        }
    }

    /// Delivers each received frame to the drives, and collects their reports. Answers are sent when they are
    /// due.
    pub(super) fn receive(&mut self, drives: &mut Drives<'_>, now_ns: u64) {
        let start_ns = self.clock.stamp_ns(0);
        let Self { lines, inbox, pending, .. } = self;
        let mut lost = 0;
        for (index, line) in lines.iter_mut().enumerate() {
            let count = line.bus.receive(inbox);
            if line.state == ErrorState::Off {
                continue;
            }
            let mut answer = |_: Sender, frame: Frame, ready_ns: u64| {
                if pending.len() < PENDING {
                    pending.push((ready_ns, index, frame));
                } else {
                    lost += 1;
                }
            };
            drives.report(index, now_ns, &mut answer);
            for received in &inbox[..count] {
                let time_ns = received.time_ns.saturating_sub(start_ns);
                drives.receive(index, &received.frame, time_ns, &mut answer);
            }
        }
        drives.lost += lost;
    }

    /// Sends the answers that are due. Returns the number of frames that the interfaces did not accept.
    pub(super) fn send(&mut self, now_ns: u64) -> u64 {
        let Self { lines, pending, .. } = self;
        let mut lost = 0;
        for (index, line) in lines.iter_mut().enumerate() {
            let mut batch = [Frame::default(); BATCH];
            let mut count = 0;
            pending.retain(|(ready_ns, bus, frame)| {
                let is_due = *bus == index && *ready_ns <= now_ns && count < BATCH;
                if is_due {
                    batch[count] = *frame;
                    count += 1;
                }
                !is_due
            });
            if count > 0 {
                lost += (count - line.bus.send(&batch[..count])) as u64;
            }
        }
        lost
    }

    /// Returns the name and condition of each interface.
    pub(super) fn conditions(&self) -> impl Iterator<Item = (&str, Condition)> {
        self.lines.iter().map(|line| (line.bus.name(), line.bus.condition()))
    }
}
