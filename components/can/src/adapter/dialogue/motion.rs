//! Setpoints derived from the state of a drive.

use super::order::Order;
use crate::mit::{Command, Ranges};
use crate::table::LoopEntry;

/// Newest state of a drive commanded by positions or torques, from which its setpoints are derived.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion {
    pub(super) position: f64,
    pub(super) velocity: f64,
    /// Position held while commands have no position gain.
    pub(super) held: Option<f64>,
}

impl Motion {
    /// Begins a cycle. A drive that is not yet following commands has no held position, since its joint may
    /// have been moved.
    pub(super) fn begin(&mut self, order: &Order) {
        if !matches!(order, Order::Follow(_)) {
            self.held = None;
        }
    }

    /// Position of a command. Without a position gain, it is the drive's position at the first such command.
    pub(super) fn target(&mut self, command: &Command) -> f64 {
        if command.kp > 0.0 {
            self.held = None;
            command.position
        } else {
            *self.held.get_or_insert(self.position)
        }
    }

    /// Velocity setpoint for a command at the newest state: the commanded velocity, and the velocity at which
    /// the drive's own loop would approach the commanded position.
    pub(super) fn velocity(&self, command: &Command, gains: LoopEntry, ranges: &Ranges) -> f64 {
        let towards =
            if command.kp > 0.0 { gains.kp / gains.kd * (command.position - self.position) } else { 0.0 };
        (command.velocity + towards).clamp(ranges.velocity.min, ranges.velocity.max)
    }

    /// Torque for a command at the newest state.
    pub(super) fn torque(&self, command: &Command, ranges: &Ranges) -> f64 {
        command.torque_at(self.position, self.velocity).clamp(ranges.torque.min, ranges.torque.max)
    }
}
