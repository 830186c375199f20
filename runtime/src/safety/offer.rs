//! One step of a gate: the offered command, the measured state of the robot, and the verdict.

use crate::plan::SafeState;
use crate::state::JointCommand;

/// State of the robot as measured by its actuator at the beginning of a step.
pub struct Measured<'a> {
    /// Positions of the joints, rad or m.
    pub position: &'a [f64],
    /// Velocities of the joints, rad/s or m/s.
    pub velocity: &'a [f64],
    /// Writes the effort of each joint against gravity, N m or N. Only called if the gate needs it: in the
    /// safe states `hold` and `brake`, on entry to the others, and while resuming.
    pub gravity: &'a mut dyn FnMut(&mut [f64]),
}

impl core::fmt::Debug for Measured<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { position, velocity, .. } = self;
        f.debug_struct("Measured")
            .field("position", position)
            .field("velocity", velocity)
            .finish_non_exhaustive()
    }
}

/// Verdict of one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The newest command is applied, within the limits.
    Applied,
    /// The newest command is approached from the held pose, at limited rates.
    Resuming,
    /// The safe state is applied.
    Safe {
        /// The safe state of the graph.
        state: SafeState,
        /// True in its first step.
        entered: bool,
    },
}

/// A command offered to the gate.
#[derive(Debug, Clone, Copy)]
pub struct Offer<'a> {
    /// The command.
    pub command: &'a JointCommand,
    /// True if it was not offered in the previous step.
    pub is_new: bool,
    /// Time between its setpoints and the previous command's, s, over which rates are computed.
    pub ahead: f64,
}
