//! The header of a control block: the commands of the launcher, the phases of components, the latches of a
//! run, and its episode.

use std::sync::atomic::Ordering::{AcqRel, Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU32, AtomicU64};

use serde::{Deserialize, Serialize};

use super::{Latch, TurnBlock};

/// A command from the launcher to all workers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Command {
    /// Configure the component, open all ports, and enter the phase `Ready`.
    Configure = 0,
    /// Connect the ports, which all components have opened by now, and enter the phase `Connected`.
    Connect = 1,
    /// Start stepping.
    Run = 2,
    /// Continue to step; actuators apply the safe state.
    SafeStop = 3,
    /// End stepping, stop the component, and save its result.
    Stop = 4,
}

/// The phase of a component's life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum Phase {
    /// The process is starting.
    Created = 0,
    /// The component is configured, and all its ports are open.
    Ready = 1,
    /// All ports are connected; the component waits for the start.
    Connected = 2,
    /// The component is stepping.
    Running = 3,
    /// The component has failed.
    Faulted = 4,
    /// The component has ended in an orderly way.
    Stopped = 5,
}

macro_rules! from_word {
    ($type:ident, $fallback:ident, $($variant:ident),*) => {
        impl $type {
            /// Decodes a word of the control block. An unknown value decodes to the most cautious variant.
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

/// The header of a control block. Written by the launcher, and by the guard once the launcher is dead.
#[derive(Debug, Default)]
#[repr(C, align(64))]
pub struct Header {
    pub(super) magic: AtomicU64,
    pub(super) components: AtomicU32,
    pub(super) topics: AtomicU32,
    pub(super) latencies: AtomicU32,
    pub(super) edges: AtomicU32,
    /// Number of events that the trace of each component keeps; 0 if the run is not traced.
    pub(super) traced: AtomicU32,
    command: AtomicU32,
    /// Start of the run on `CLOCK_MONOTONIC`, ns.
    pub start_ns: AtomicU64,
    /// Index of the current episode. The field is on the cache line that workers read in every step.
    pub episode: AtomicU64,
    /// Process id of the launcher.
    pub launcher: AtomicU32,
    /// Process id of the guard.
    pub guard: AtomicU32,
    /// The latches of the run, as flags. Written by the commands `stop --now` and `resume` and by command
    /// gates.
    latch: AtomicU32,
    /// Number of times that `resume` released the latches.
    resumes: AtomicU32,
    /// Time at which the launcher last supervised the run, `CLOCK_MONOTONIC` ns; 0 before the run.
    pub launcher_alive_ns: AtomicU64,
    /// Time at which the guard last checked the launcher, `CLOCK_MONOTONIC` ns. Written by the guard.
    pub guard_alive_ns: AtomicU64,
    /// Time at which the safe stop was ordered, `CLOCK_MONOTONIC` ns; 0 before the order.
    pub safe_stop_ns: AtomicU64,
    /// Starts of the current and the previous episode, by the last bit of their indices.
    episode_starts: [StartBlock; 2],
    /// Real time: index of the episode that the launcher recorded last.
    episode_noted: AtomicU64,
    /// Index of the last episode ended by a component, plus 1. Written by that component.
    episode_over: AtomicU64,
    /// 1 while simulated time is paused. Written by tools, and by the program that drives the run.
    paused: AtomicU32,
    /// Number of rounds that tools have granted to the paused run since its start. Written by tools.
    pub rounds_granted: AtomicU64,
    /// Number of rounds that the run has executed while paused, since its start.
    pub rounds_taken: AtomicU64,
    /// Lockstep: simulated time reached in the current episode, ns.
    pub reached_ns: AtomicU64,
    /// Lockstep: the turn, which is the right to step.
    pub turn: TurnBlock,
}

/// Start of an episode in the control block. Written before the index of the episode.
#[derive(Debug, Default)]
#[repr(C)]
struct StartBlock {
    seed: AtomicU64,
    began_ns: AtomicU64,
}

/// Start of an episode: index, seed and time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EpisodeStart {
    /// Index of the episode, counted from 0.
    pub index: u64,
    /// Seed of the episode.
    pub seed: u64,
    /// Real time: start of the episode, `CLOCK_MONOTONIC` ns. 0 for the first episode, which starts with the
    /// run.
    pub began_ns: u64,
}

/// Maximum number of attempts to read the start of an episode while new episodes begin.
const READ_ATTEMPTS: u32 = 8;

impl Header {
    /// Returns the launcher's current command.
    #[inline]
    pub fn command(&self) -> Command {
        Command::from_word(self.command.load(Acquire))
    }

    /// Returns the futex word on which workers wait for the next command.
    pub fn command_word(&self) -> &AtomicU32 {
        &self.command
    }

    /// Orders all workers to execute a command. Has no effect if a later command in the order of [`Command`]
    /// has already been ordered. For example, a late `SafeStop` from a component or the guard does not
    /// replace a `Stop`.
    pub fn order(&self, command: Command) {
        self.command.fetch_max(command as u32, AcqRel);
        crate::os::futex_wake(&self.command);
    }

    /// Ends the episode with index `episode` at the end of the current round. Has no effect if this episode
    /// has already ended, even if the next episode has begun. This matters in real time, where the calling
    /// component may enter the next episode later than other components.
    pub fn end_episode(&self, episode: u64) {
        self.episode_over.store(episode.wrapping_add(1), Relaxed);
    }

    /// Returns `true` if a component has ended the current episode.
    #[inline]
    pub fn is_episode_over(&self) -> bool {
        self.episode_over.load(Relaxed) == self.episode.load(Relaxed).wrapping_add(1)
    }

    /// Begins an episode of simulated time.
    pub(crate) fn begin_episode(&self, index: u64, seed: u64) {
        self.start_episode(EpisodeStart { index, seed, began_ns: 0 });
        self.reached_ns.store(0, Relaxed);
    }

    /// Begins an episode. Workers enter it at their next step.
    fn start_episode(&self, start: EpisodeStart) {
        let block = &self.episode_starts[start.index as usize % 2];
        block.seed.store(start.seed, Release);
        block.began_ns.store(start.began_ns, Release);
        self.episode.store(start.index, Release);
    }

    /// Begins the next episode in real time. Only the episode driver of the run may call it. Returns `false`
    /// and has no effect if the launcher has not [recorded](Self::note_episode) the current episode yet.
    pub(crate) fn begin_next_episode(&self, seed: u64, now_ns: u64) -> bool {
        let index = self.episode.load(Relaxed);
        let is_noted = self.episode_noted.load(Acquire) == index;
        if is_noted {
            self.start_episode(EpisodeStart { index: index + 1, seed, began_ns: now_ns });
        }
        is_noted
    }

    /// Records the current episode, after which the next one may begin. Called by the launcher.
    pub(crate) fn note_episode(&self, index: u64) {
        self.episode_noted.store(index, Release);
    }

    /// Returns the start of the current episode. Returns `None` if new episodes begin faster than their start
    /// can be read, which only happens in a damaged control block.
    pub fn episode_start(&self) -> Option<EpisodeStart> {
        for _ in 0..READ_ATTEMPTS {
            let index = self.episode.load(Acquire);
            let block = &self.episode_starts[index as usize % 2];
            let (seed, began_ns) = (block.seed.load(Acquire), block.began_ns.load(Acquire));
            if self.episode.load(Acquire) == index {
                return Some(EpisodeStart { index, seed, began_ns });
            }
        }
        None
    }

    /// Pauses simulated time if `paused` is true, otherwise continues it.
    pub fn pause(&self, paused: bool) {
        self.paused.store(u32::from(paused), Release);
    }

    /// Returns `true` if simulated time is paused.
    pub fn is_paused(&self) -> bool {
        self.paused.load(Acquire) != 0
    }

    /// Keeps every command gate of the run in its safe state until [`release`](Self::release).
    pub fn latch(&self, latch: Latch) {
        if self.latch.load(Relaxed) & latch as u32 == 0 {
            self.latch.fetch_or(latch as u32, AcqRel);
        }
    }

    /// Returns the latch of the run, the most severe one if there are several, or `None`.
    #[inline]
    pub fn latched(&self) -> Option<Latch> {
        match self.latch.load(Acquire) {
            0 => None,
            word => Latch::from_word(word),
        }
    }

    /// Releases all latches of the run.
    pub fn release(&self) {
        self.latch.store(0, Release);
        self.resumes.fetch_add(1, AcqRel);
    }

    /// Returns the number of releases of the latches so far.
    #[inline]
    pub fn resumes(&self) -> u32 {
        self.resumes.load(Acquire)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn episode_waits_until_the_previous_one_is_recorded() {
        let header = Header::default();
        assert!(header.begin_next_episode(7, 100));
        assert_eq!(header.episode_start(), Some(EpisodeStart { index: 1, seed: 7, began_ns: 100 }));
        assert!(!header.begin_next_episode(8, 200), "the launcher has not recorded episode 1");
        header.end_episode(1);
        header.note_episode(1);
        assert!(header.begin_next_episode(8, 300));
        assert_eq!(header.episode_start(), Some(EpisodeStart { index: 2, seed: 8, began_ns: 300 }));
        assert!(!header.is_episode_over(), "a new episode is not over");
        header.end_episode(1);
        assert!(!header.is_episode_over(), "a late component ends the episode that it is in");
    }

    #[test]
    fn late_stops_and_runs_do_not_undo_each_other() {
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
