//! One step of a gate: the offered command, the measured state of the robot, and the verdict.

use crate::plan::SafeState;
use crate::state::JointCommand;

/// State of the robot as measured by its actuator at the beginning of a step.
pub struct Measured<'a> {
    /// Positions of the joints, rad or m.
    pub position: &'a [f64],
    /// Velocities of the joints, rad/s or m/s.
    pub velocity: &'a [f64],
    /// Callback that writes the effort which holds each joint against gravity, N m or N. Only called when the
    /// gate needs it: in the safe states `hold` and `brake`, on entry to the other safe states, and while
    /// resuming.
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

/// Result of one step of a gate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The newest command is applied, within the limits.
    Applied,
    /// The robot moves from the held pose to the newest command at limited rates.
    Resuming,
    /// The safe state is applied.
    Safe {
        /// The safe state, as set in the graph.
        state: SafeState,
        /// True in the first step of the safe state.
        entered: bool,
    },
}

/// A command offered to the gate.
#[derive(Debug, Clone, Copy)]
pub struct Offer<'a> {
    /// The command.
    pub command: &'a JointCommand,
    /// True if the command has not been offered in an earlier step.
    pub is_new: bool,
    /// Time from the setpoints of the previous command to the setpoints of this command, s. The gate computes
    /// rates of change over this time.
    pub ahead: f64,
}
