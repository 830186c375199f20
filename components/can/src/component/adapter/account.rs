//! Statistics of one bus: counters, state and load.

use motorium::prelude::*;
use motorium::state::BusHealth;

use crate::component::wire::News;
use crate::{Bits, Condition, ErrorState, Frame, Rates, RealBus, SocketCounts};

/// Window for measuring the load of a real bus, ns; single steps of the adapter vary too much.
const WINDOW_NS: u64 = 100_000_000;

/// Statistics of one bus.
pub(super) struct BusAccount {
    pub(super) name: String,
    rates: Rates,
    pub(super) health: Output<BusHealth>,
    pub(super) counts: BusHealth,
    /// Time for which the bus carried bits, since the start of the window and in total, ns.
    busy_ns: u64,
    total_ns: u64,
    opened_ns: u64,
    /// Peak load of a cycle or, on a real bus, of a window.
    pub(super) peak: f64,
    /// `true` if the bus is a real interface of the computer.
    is_real: bool,
    pub(super) condition: Condition,
    /// Worst condition of the run.
    pub(super) worst: Condition,
    /// Counters of events on the bus.
    pub(super) events: SocketCounts,
}

impl BusAccount {
    pub(super) fn new(index: usize, name: &str, rates: Rates, health: Output<BusHealth>) -> Self {
        let counts = BusHealth { bus: index as u32, state: BusHealth::ACTIVE, ..BusHealth::default() };
        let name = name.to_string();
        Self {
            name,
            rates,
            health,
            counts,
            busy_ns: 0,
            total_ns: 0,
            opened_ns: 0,
            peak: 0.0,
            is_real: false,
            condition: Condition::Active,
            worst: Condition::Active,
            events: SocketCounts::default(),
        }
    }

    pub(super) fn received(&mut self, frame: &Frame) {
        self.counts.received += 1;
        self.busy_ns += Bits::from_frame(frame).ns(&self.rates);
    }

    /// Records that the first `count` of these frames were sent, and the others were not.
    pub(super) fn sent(&mut self, frames: &[Frame], count: usize) {
        self.counts.sent += count as u64;
        self.counts.unsent += (frames.len() - count) as u64;
        self.busy_ns +=
            frames[..count].iter().map(|frame| Bits::from_frame(frame).ns(&self.rates)).sum::<u64>();
    }

    /// Applies a status change of a simulated interface.
    pub(super) fn apply(&mut self, news: &News) {
        let Self { events, condition, .. } = self;
        match news {
            News::Down => {
                events.down += u64::from(*condition != Condition::Down);
                *condition = Condition::Down;
            }
            News::Report(report, unsent) => {
                events.reports += u64::from(report.state != Some(ErrorState::Active));
                events.unacknowledged += u64::from(report.is_unacknowledged);
                events.queue_full += u64::from(*unsent > 0);
                if let Some(state) = report.state {
                    events.bus_off += u64::from(state == ErrorState::Off && *condition != Condition::Off);
                    *condition = state.into();
                }
                self.counts.sent = self.counts.sent.saturating_sub((*unsent).into());
                self.counts.unsent += u64::from(*unsent);
            }
        }
        self.update_health();
    }

    /// Updates the condition from a real bus.
    pub(super) fn follow(&mut self, bus: &RealBus) {
        (self.is_real, self.condition, self.events) = (true, bus.condition(), *bus.counts());
        self.update_health();
    }

    /// Copies condition and events into the published state.
    fn update_health(&mut self) {
        let (counts, condition) = (&self.events, self.condition);
        self.worst = self.worst.max(condition);
        self.counts.state = match condition {
            Condition::Active => BusHealth::ACTIVE,
            Condition::Warning => BusHealth::WARNING,
            Condition::Passive => BusHealth::PASSIVE,
            Condition::Off => BusHealth::BUS_OFF,
            Condition::Down | Condition::Gone => BusHealth::DOWN,
        };
        self.counts.errors = counts.reports + counts.queue_full + counts.down;
        (self.counts.bus_off, self.counts.dropped) = (counts.bus_off, counts.overflows + counts.other);
    }

    /// Ends cycle `cycles`, `now_ns` after the start of the run.
    pub(super) fn close(&mut self, now_ns: u64, cycles: u64, period_ns: u64) {
        self.counts.load = ((self.total_ns + self.busy_ns) as f64 / (cycles * period_ns) as f64).min(1.0);
        let window_ns = now_ns.saturating_sub(self.opened_ns);
        let length_ns = match self.is_real {
            false => period_ns,
            true if window_ns >= WINDOW_NS => window_ns,
            true => return,
        };
        self.peak = self.peak.max(self.busy_ns as f64 / length_ns as f64);
        self.total_ns += core::mem::take(&mut self.busy_ns);
        self.opened_ns = now_ns;
    }

    /// Returns the likely cause of the problems on the bus, and the next step; `None` without problems.
    pub(super) fn diagnosis(&self) -> Option<String> {
        let (condition, counts) = (self.condition, &self.events);
        let name = &self.name;
        let unheard = counts.unacknowledged > 0 || counts.queue_full > 0;
        Some(match condition {
            Condition::Gone => format!("`{name}` has disappeared: is its adapter plugged in?"),
            Condition::Down => {
                format!("`{name}` is down: `sudo ip link set {name} up`, then `motorium resume`")
            }
            Condition::Off => format!(
                "the controller of `{name}` has left the bus: check for a short circuit or a wrong bitrate, then `sudo ip link set {name} down && sudo ip link set {name} up`, and `motorium resume`"
            ),
            _ if unheard => format!("nobody acknowledges on `{name}`: power, bitrate, termination?"),
            Condition::Passive | Condition::Warning => {
                format!("many errors on `{name}`: check wires, termination and the bitrate of every node")
            }
            Condition::Active if counts.down > 0 => format!("`{name}` was down, and is up again"),
            Condition::Active if counts.overflows > 0 => {
                format!("frames were lost on `{name}`: does a node send continuously?")
            }
            Condition::Active => return None,
        })
    }
}
