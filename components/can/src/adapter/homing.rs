//! Homing of joints whose position is unknown after power-up.
//!
//! A drive with its own homing procedure executes this procedure, and then reads zero at its mark. The
//! adapter slowly moves all other joints against their mechanical stops.

mod stop;

use crate::protocols::entries::{HomingBy, HomingEntry};
use crate::protocols::homing_fault::HomingFault;
pub(crate) use stop::{EASED, RUNAWAY, STILL};
pub(super) use stop::{Outcome, Stop};

/// Progress of a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomingState {
    /// Homing waits to start; the position is unknown.
    Waiting,
    /// Homing is running.
    Running,
    /// The joint is homed, and its position is known.
    Homed,
    /// Homing failed.
    Failed(HomingFault),
}

/// Homing of one joint.
#[derive(Clone, Debug)]
pub(super) struct Homing {
    pub(super) order: u8,
    pub(super) state: HomingState,
    timeout_ns: u64,
    elapsed_ns: u64,
    /// Homing at a stop by the adapter; `None` for homing by the drive.
    pub(super) stop: Option<Stop>,
}

impl Homing {
    pub(super) fn from_entry(entry: &HomingEntry) -> Self {
        Self {
            order: entry.order.unwrap_or(0),
            state: HomingState::Waiting,
            timeout_ns: entry.timeout().as_nanos() as u64,
            elapsed_ns: 0,
            stop: (entry.by == HomingBy::Stop).then(|| Stop::from_entry(entry)),
        }
    }

    /// Starts the homing.
    pub(super) fn begin(&mut self) {
        (self.state, self.elapsed_ns) = (HomingState::Running, 0);
        if let Some(stop) = &mut self.stop {
            stop.begin();
        }
    }

    /// Discards the position, whether known or being determined.
    pub(super) fn forget(&mut self) {
        self.state = HomingState::Waiting;
    }

    /// Advances the time by a cycle. Returns `true` if the timeout has expired.
    pub(super) fn pass(&mut self, cycle_ns: u64) -> bool {
        self.elapsed_ns += cycle_ns;
        self.elapsed_ns > self.timeout_ns
    }
}
