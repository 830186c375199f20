//! The head of a control block: the commands of the launcher, the phases of components, the latches of a run,
//! its episode.

use std::sync::atomic::Ordering::{AcqRel, Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU32, AtomicU64};

use serde::{Deserialize, Serialize};

use super::{Latch, TurnBlock};

/// A command of the launcher to all workers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Command {
    /// Configure, open all ports, enter the phase `Ready`.
    Configure = 0,
    /// All ports exist: connect them, enter the phase `Connected`.
    Connect = 1,
    /// Step.
    Run = 2,
    /// Go on stepping, but actuators apply the safe state.
    SafeStop = 3,
    /// End the loop, stop the component, save its result.
    Stop = 4,
}

/// The phase of a component's life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum Phase {
    /// The process is starting.
    Created = 0,
    /// Configured; all ports are open.
    Ready = 1,
    /// All ports are connected; it waits for the start.
    Connected = 2,
    /// Stepping.
    Running = 3,
    /// Failed.
    Faulted = 4,
    /// Ended in good order.
    Stopped = 5,
}

macro_rules! from_word {
    ($type:ident, $fallback:ident, $($variant:ident),*) => {
        impl $type {
            /// Decodes a word of the control block; an unknown value reads as the most careful variant.
            #[inline]
            pub fn from_word(word: u32) -> Self {
                $( if word == Self::$variant as u32 { return Self::$variant; } )*
                Self::$fallback
            }
        }
    };
}
from_word!(Command, Stop, Configure, Connect, Run, SafeStop, Stop);
from_word!(Phase, Faulted, Created, Ready, Connected, Running, Faulted, Stopped);

/// The head of a control block. Written by the launcher, and by the guard once the launcher is dead.
#[derive(Debug, Default)]
#[repr(C, align(64))]
pub struct Header {
    pub(super) magic: AtomicU64,
    pub(super) components: AtomicU32,
    pub(super) topics: AtomicU32,
    pub(super) latencies: AtomicU32,
    pub(super) edges: AtomicU32,
    /// Number of events kept in the trace of each component; 0 without a trace.
    pub(super) traced: AtomicU32,
    command: AtomicU32,
    /// Start of the run on `CLOCK_MONOTONIC`, ns.
    pub start_ns: AtomicU64,
    /// Time of the safe stop order, `CLOCK_MONOTONIC` ns; 0 before.
    pub safe_stop_ns: AtomicU64,
    /// Process id of the launcher.
    pub launcher: AtomicU32,
    /// Process id of the guard.
    pub guard: AtomicU32,
    /// The latches of the run, as flags. Written by the commands `stop --now` and `resume` and by command
    /// gates.
    latch: AtomicU32,
    /// Number of times that `resume` released the latches.
    resumes: AtomicU32,
    /// Time of the launcher's last supervision, `CLOCK_MONOTONIC` ns; 0 before the run.
    pub launcher_alive_ns: AtomicU64,
    /// Time at which the guard last checked the launcher, `CLOCK_MONOTONIC` ns. Written by the guard.
    pub guard_alive_ns: AtomicU64,
    /// Lockstep: number of the episode.
    pub episode: AtomicU64,
    /// Lockstep: seed of the episode.
    pub episode_seed: AtomicU64,
    /// 1 once a component has ended the episode. Written by that component.
    episode_over: AtomicU32,
    /// 1 while simulated time is held. Written by tools, and by the program that drives the run.
    paused: AtomicU32,
    /// Rounds of simulated time granted to a held run since its start. Written by tools.
    pub rounds_granted: AtomicU64,
    /// Rounds completed by a held run since its start.
    pub rounds_taken: AtomicU64,
    /// Lockstep: simulated time reached in the episode, ns.
    pub reached_ns: AtomicU64,
    /// Lockstep: the right to step.
    pub turn: TurnBlock,
}

impl Header {
    /// The current command.
    #[inline]
    pub fn command(&self) -> Command {
        Command::from_word(self.command.load(Acquire))
    }

    /// The word that workers wait on for the next command.
    pub fn command_word(&self) -> &AtomicU32 {
        &self.command
    }

    /// Orders a command for all workers. Commands only increase: a safe stop is never revoked, and a late one
    /// of a component or the guard does not revoke a stop.
    pub fn order(&self, command: Command) {
        self.command.fetch_max(command as u32, AcqRel);
        crate::os::futex_wake(&self.command);
    }

    /// Ends the episode when the round is over.
    pub fn end_episode(&self) {
        self.episode_over.store(1, Relaxed);
    }

    /// True if a component has ended the episode.
    #[inline]
    pub fn is_episode_over(&self) -> bool {
        self.episode_over.load(Relaxed) != 0
    }

    /// Begins an episode.
    pub(crate) fn begin_episode(&self, index: u64, seed: u64) {
        self.episode.store(index, Relaxed);
        self.episode_seed.store(seed, Relaxed);
        self.episode_over.store(0, Relaxed);
        self.reached_ns.store(0, Relaxed);
    }

    /// Holds or resumes simulated time.
    pub fn pause(&self, paused: bool) {
        self.paused.store(u32::from(paused), Release);
    }

    /// True if simulated time is held.
    pub fn is_paused(&self) -> bool {
        self.paused.load(Acquire) != 0
    }

    /// Latches every command gate of the run in its safe state until [`release`](Self::release).
    pub fn latch(&self, latch: Latch) {
        if self.latch.load(Relaxed) & latch as u32 == 0 {
            self.latch.fetch_or(latch as u32, AcqRel);
        }
    }

    /// The latch of the run, the gravest if there are several.
    #[inline]
    pub fn latched(&self) -> Option<Latch> {
        match self.latch.load(Acquire) {
            0 => None,
            word => Latch::from_word(word),
        }
    }

    /// Releases all latches.
    pub fn release(&self) {
        self.latch.store(0, Release);
        self.resumes.fetch_add(1, AcqRel);
    }

    /// Number of releases so far.
    #[inline]
    pub fn resumes(&self) -> u32 {
        self.resumes.load(Acquire)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_commands_never_revoke_a_stop() {
        let header = Header::default();
        for (order, expected) in [
            (Command::Connect, Command::Connect),
            (Command::Run, Command::Run),
            (Command::SafeStop, Command::SafeStop),
            (Command::Run, Command::SafeStop),
            (Command::Stop, Command::Stop),
            (Command::SafeStop, Command::Stop),
        ] {
            header.order(order);
            assert_eq!(header.command(), expected, "after {order:?}");
        }
    }
}
