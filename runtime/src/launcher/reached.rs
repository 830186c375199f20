//! States of actuators after a safe stop was ordered.

use std::sync::atomic::Ordering::Relaxed;

use crate::region::{ComponentBlock, Phase};

/// State of an actuator after a safe stop was ordered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reached {
    /// Alive, has stepped since the order, and applies its safe state.
    Safe {
        /// Time at which it entered the safe state, ns.
        since_ns: u64,
    },
    /// Applies its safe state, but joints that should be at rest still move.
    Moving,
    /// Alive, but has not reported its safe state.
    Not,
    /// Without a process, or failed: its last state is meaningless.
    Dead,
}

impl Reached {
    /// Reads the state from the control block, unless the component has ended.
    pub(super) fn from_block(block: &ComponentBlock, ended: bool, noticed: u64) -> Self {
        let stepped = block.last_step_ns.load(Relaxed) >= noticed;
        let is_safe = stepped && block.safe.load(Relaxed) != 0;
        match block.phase() {
            // The process was killed, so its phase is out of date.
            Phase::Running if ended => Self::Dead,
            // An actuator that stayed there for the settling time may have left on its own.
            Phase::Running | Phase::Stopped if is_safe && block.gate.moves() => Self::Moving,
            Phase::Running | Phase::Stopped if is_safe => {
                Self::Safe { since_ns: block.safe_since_ns.load(Relaxed) }
            }
            Phase::Running => Self::Not,
            _ => Self::Dead,
        }
    }
}
