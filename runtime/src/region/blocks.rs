//! The blocks of a region.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64};

use serde::{Deserialize, Serialize};

use super::CheckpointBlock;
use crate::telemetry::Histogram;

/// What the launcher wants of every worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Command {
    /// Configure, open all ports, report ready.
    Configure = 0,
    /// All ports exist: connect them, report connected.
    Connect = 1,
    /// Step.
    Run = 2,
    /// Go on stepping, but actuators apply the safe state.
    SafeStop = 3,
    /// Finish in good order.
    Stop = 4,
}

/// Where a component is in its life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum Phase {
    /// Its process was started or is being started.
    Created = 0,
    /// Configured, all its ports open.
    Ready = 1,
    /// All its ports connected; waits for the start.
    Connected = 2,
    /// Stepping.
    Running = 3,
    /// It failed.
    Faulted = 4,
    /// It ended in good order.
    Stopped = 5,
}

macro_rules! from_word {
    ($type:ident, $fallback:ident, $($variant:ident),*) => {
        impl $type {
            /// Reads a word of the region; an unknown value reads as the most careful variant.
            pub fn from_word(word: u32) -> Self {
                $( if word == Self::$variant as u32 { return Self::$variant; } )*
                Self::$fallback
            }
        }
    };
}
from_word!(Command, Stop, Configure, Connect, Run, SafeStop, Stop);
from_word!(Phase, Faulted, Created, Ready, Connected, Running, Faulted, Stopped);

/// The head of a region. Written by the launcher (and the guard, once the launcher is dead).
#[derive(Debug)]
#[repr(C, align(64))]
pub struct Header {
    pub(super) magic: AtomicU64,
    pub(super) components: AtomicU32,
    pub(super) topics: AtomicU32,
    pub(super) latencies: AtomicU32,
    pub(super) edges: AtomicU32,
    command: AtomicU32,
    /// Time zero of the run on `CLOCK_MONOTONIC`, ns.
    pub start_ns: AtomicU64,
    /// When the safe stop was ordered, ns; 0 if it was not.
    pub safe_stop_ns: AtomicU64,
    /// Process id of the launcher.
    pub launcher: AtomicU32,
    /// Process id of the guard.
    pub guard: AtomicU32,
}

impl Header {
    /// What the launcher wants.
    pub fn command(&self) -> Command {
        Command::from_word(self.command.load(Acquire))
    }

    /// The word that workers wait on for the next command.
    pub fn command_word(&self) -> &AtomicU32 {
        &self.command
    }

    /// Orders something of all workers. A safe stop is never taken back, only followed by a stop.
    pub fn order(&self, command: Command) {
        if self.command() == Command::SafeStop && command != Command::Stop {
            return;
        }
        self.command.store(command as u32, Release);
        crate::os::futex_wake(&self.command);
    }
}

/// Why a step missed its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MissCause {
    /// The component was ready to run, and another thread of this system had its core.
    LateWake,
    /// The step itself took too long.
    LongStep,
    /// Nobody in this system had the core, and still the component did not run: the host of a virtual machine had it, or
    /// the hardware woke late.
    Stolen,
    /// An input that should have been there was stale.
    LateInput,
}

/// Missed steps by cause.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Misses {
    /// The step ended after its deadline because others had the core for too long.
    pub late_wake: u64,
    /// The step ran past its deadline by its own length.
    pub long_step: u64,
    /// The step ended after its deadline because the host of the virtual machine, or idle hardware, took too long to run
    /// it at all.
    pub stolen: u64,
    /// An actuator found its command stale and applied the safe state instead.
    pub late_input: u64,
    /// Releases dropped by the overrun policy in consequence.
    pub skipped: u64,
    /// Steps longer than the budget, whether or not they met their deadline.
    pub over_budget: u64,
}

impl Misses {
    /// Steps that missed their time, whatever the cause.
    pub fn missed(&self) -> u64 {
        self.late_wake + self.long_step + self.stolen + self.late_input
    }
}

/// What a component saw of the machine while it did nothing but read the clock: spinning before its releases.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Stalls {
    /// For how long it watched, ns.
    pub watched_ns: u64,
    /// Times it was stopped for longer than 10 us.
    pub count: u64,
    /// For how long in all, ns.
    pub total_ns: u64,
    /// The longest, ns.
    pub longest_ns: u64,
}

/// What one component says of itself. Written by its worker, but for the fields named otherwise.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct ComponentBlock {
    phase: AtomicU32,
    /// Process id. Written by the launcher.
    pub pid: AtomicU32,
    /// Thread id of the stepping thread.
    pub thread: AtomicU32,
    /// How often it was restarted. Written by the launcher.
    pub restarts: AtomicU32,
    /// Lockstep: counts the ticks handed out. Written by the launcher.
    pub tick_given: AtomicU32,
    /// Lockstep: counts the ticks done.
    pub tick_done: AtomicU32,
    /// Lockstep: simulated time of the given tick, ns. Written by the launcher.
    pub tick_time_ns: AtomicU64,
    /// Steps done, through restarts.
    pub steps: AtomicU64,
    /// When the first step began, on the run's clock, ns.
    pub first_step_ns: AtomicU64,
    /// When the last step began, on the run's clock, ns.
    pub last_step_ns: AtomicU64,
    late_wake: AtomicU64,
    long_step: AtomicU64,
    stolen: AtomicU64,
    late_input: AtomicU64,
    /// Releases dropped.
    pub skipped: AtomicU64,
    /// Steps longer than the budget.
    pub over_budget: AtomicU64,
    /// Steps that returned an error and were tolerated.
    pub errors: AtomicU64,
    /// Samples withheld or refused because of their content.
    pub refused: AtomicU64,
    /// Heap allocations in steps, after the warm-up.
    pub allocations: AtomicU64,
    /// Heap allocations in steps made by named foreign code, after the warm-up.
    pub allocations_apart: AtomicU64,
    /// 1 if the program counts allocations at all.
    pub counts_allocations: AtomicU32,
    /// 1 while an actuator applies the safe state.
    pub safe: AtomicU32,
    /// When it last entered the safe state, on `CLOCK_MONOTONIC`, ns.
    pub safe_since_ns: AtomicU64,
    /// Page faults of the stepping thread, after the warm-up.
    pub page_faults: AtomicU64,
    stall_watched_ns: AtomicU64,
    stall_count: AtomicU64,
    stall_total_ns: AtomicU64,
    stall_longest_ns: AtomicU64,
    /// How long it now spins before a release, ns.
    pub spin_ns: AtomicU64,
    /// 1 if it runs under `SCHED_DEADLINE`, read back.
    pub deadline: AtomicU32,
    /// `SCHED_FIFO` priority read back, 0 for none.
    pub fifo_priority: AtomicU32,
    /// Cores read back, as a mask of the first 32.
    pub cores: AtomicU32,
    /// 1 if memory is locked, read back.
    pub memory_locked: AtomicU32,
    failure_length: AtomicU32,
    /// Tick at which it failed.
    pub failure_tick: AtomicU64,
    failure: [AtomicU8; 2048],
    /// Release lateness, ns.
    pub lateness: Histogram,
    /// Execution time of steps on the clock on the wall, ns.
    pub execution: Histogram,
    /// Time of the core that each step took, its waiting and waking included, its spinning not, ns.
    pub cpu: Histogram,
    /// What a restarted component may resume from.
    pub(crate) checkpoint: CheckpointBlock,
}

impl ComponentBlock {
    /// Where it is in its life.
    pub fn phase(&self) -> Phase {
        Phase::from_word(self.phase.load(Acquire))
    }

    /// Enters a phase and wakes whoever waits for it.
    pub fn enter(&self, phase: Phase) {
        self.phase.store(phase as u32, Release);
        crate::os::futex_wake(&self.phase);
    }

    /// The word to wait on for the next phase.
    pub fn phase_word(&self) -> &AtomicU32 {
        &self.phase
    }

    /// Counts a missed step.
    pub fn miss(&self, cause: MissCause) {
        let cell = match cause {
            MissCause::LateWake => &self.late_wake,
            MissCause::LongStep => &self.long_step,
            MissCause::Stolen => &self.stolen,
            MissCause::LateInput => &self.late_input,
        };
        add(cell, 1);
    }

    /// Missed steps so far.
    pub fn misses(&self) -> Misses {
        Misses {
            late_wake: self.late_wake.load(Relaxed),
            long_step: self.long_step.load(Relaxed),
            stolen: self.stolen.load(Relaxed),
            late_input: self.late_input.load(Relaxed),
            skipped: self.skipped.load(Relaxed),
            over_budget: self.over_budget.load(Relaxed),
        }
    }

    /// Counts time spent reading nothing but the clock.
    pub(crate) fn watched(&self, ns: u64) {
        add(&self.stall_watched_ns, ns);
    }

    /// Counts a time for which it was stopped while reading nothing but the clock.
    pub(crate) fn stalled(&self, ns: u64) {
        add(&self.stall_count, 1);
        add(&self.stall_total_ns, ns);
        if ns > self.stall_longest_ns.load(Relaxed) {
            self.stall_longest_ns.store(ns, Relaxed);
        }
    }

    /// What it saw of the machine so far.
    pub fn stalls(&self) -> Stalls {
        Stalls {
            watched_ns: self.stall_watched_ns.load(Relaxed),
            count: self.stall_count.load(Relaxed),
            total_ns: self.stall_total_ns.load(Relaxed),
            longest_ns: self.stall_longest_ns.load(Relaxed),
        }
    }

    /// Leaves the last words of a failing component for the launcher; what does not fit is cut.
    pub fn set_failure(&self, tick: u64, message: &str) {
        let mut end = message.len().min(self.failure.len());
        while !message.is_char_boundary(end) {
            end -= 1;
        }
        for (cell, byte) in self.failure.iter().zip(message[..end].bytes()) {
            cell.store(byte, Relaxed);
        }
        self.failure_tick.store(tick, Relaxed);
        self.failure_length.store(end as u32, Release);
    }

    /// The last words of a failed component, if it left any.
    pub fn failure(&self) -> Option<(u64, String)> {
        let length = (self.failure_length.load(Acquire) as usize).min(self.failure.len());
        let bytes: Vec<u8> = self.failure[..length].iter().map(|cell| cell.load(Relaxed)).collect();
        (length > 0).then(|| (self.failure_tick.load(Relaxed), String::from_utf8_lossy(&bytes).into_owned()))
    }

    /// Makes the block ready for a restarted process.
    pub fn forget_failure(&self) {
        self.failure_length.store(0, Release);
    }
}

/// What is known of one topic. Written by its publisher.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct TopicBlock {
    /// Samples published, through restarts of the publisher.
    pub published: AtomicU64,
    /// When the last sample was published, on the run's clock, ns.
    pub last_publish_ns: AtomicU64,
    /// Lockstep: digest of everything published.
    pub digest: AtomicU64,
    /// Samples that readers of a stream lost.
    pub dropped: AtomicU64,
}

/// Measurements of one edge of the graph: a topic and one of its readers. Written by the reader.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct EdgeBlock {
    /// Age of each sample, since its publication, at the beginning of the step that first looked at it, ns.
    pub age: Histogram,
}

/// Measurements of one latency budget. Written by the component that publishes the end of the chain.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct LatencyBlock {
    /// Latencies, ns.
    pub latency: Histogram,
    /// Latencies above the budget.
    pub missed: AtomicU64,
}

/// Adds to a counter that has one writer.
#[inline]
pub(crate) fn add(cell: &AtomicU64, value: u64) {
    cell.store(cell.load(Relaxed).wrapping_add(value), Relaxed);
}
