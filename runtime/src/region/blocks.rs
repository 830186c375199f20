//! Blocks of the control block: one per component, topic, edge and latency budget.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::counter::add;
use super::end::END_WORDS;
use super::{CheckpointBlock, End, Failure, GateBlock, Phase};
use crate::telemetry::Histogram;

/// The cause of a missed step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MissCause {
    /// The component was ready to run, but a different thread of the operating system occupied its core.
    LateWake,
    /// The step itself lasted too long.
    LongStep,
    /// The component did not run although its core was free: the host of a virtual machine used the core, or
    /// idle hardware woke late.
    Stolen,
    /// An actuator found its command stale.
    LateInput,
}

/// Number of missed steps by cause.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Misses {
    /// Steps that ended late because other threads occupied the core.
    pub late_wake: u64,
    /// Steps that ended late because of their own duration.
    pub long_step: u64,
    /// Steps that ended late because the host of the virtual machine or idle hardware delayed them.
    pub stolen: u64,
    /// Steps in which an actuator found its command stale and applied the safe state.
    pub late_input: u64,
    /// Releases that the overrun policy dropped.
    pub skipped: u64,
    /// Steps that lasted longer than the budget, whether or not they ended late.
    pub over_budget: u64,
}

impl Misses {
    /// Returns the number of missed steps: late steps and steps with a stale command.
    pub fn missed(&self) -> u64 {
        [self.long_step, self.stolen, self.late_input].into_iter().fold(self.late_wake, u64::saturating_add)
    }
}

/// Stalls of the machine, measured while a component was spinning before its releases and did nothing but
/// read the clock.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Stalls {
    /// Time spent spinning, ns.
    pub watched_ns: u64,
    /// Number of stalls longer than 10 us.
    pub count: u64,
    /// Total duration of the stalls, ns.
    pub total_ns: u64,
    /// Duration of the longest stall, ns.
    pub longest_ns: u64,
}

/// State and counters of one component. Written by the component's worker, unless a field names another
/// writer.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct ComponentBlock {
    phase: AtomicU32,
    /// Process id of the component. Written by the launcher.
    pub pid: AtomicU32,
    /// Thread id of the stepping thread.
    pub thread: AtomicU32,
    /// Futex word held by a thread of the component's process for as long as the process lives.
    pub(crate) held: AtomicU32,
    /// Number of restarts of the component. Written by the launcher.
    pub restarts: AtomicU32,
    /// Lockstep: number of times that the component was called to a tick. The component sleeps on this word.
    /// Written by the party that passes the turn.
    tick_calls: AtomicU32,
    /// Lockstep: simulated time of the tick, ns. Written by the component or launcher that passes the turn.
    pub tick_time_ns: AtomicU64,
    /// Lockstep: 1 if the tick is a reset for the episode in the header, 0 if it is a step. Written by the
    /// component or launcher that passes the turn.
    pub tick_resets: AtomicU32,
    /// 1 if the program that launched the run publishes in place of the component, which then never steps.
    /// Written by the launcher.
    pub played: AtomicU32,
    /// Number of steps completed before the current episode of simulated time.
    pub episode_first: AtomicU64,
    /// Index of the episode that the component entered last.
    pub(crate) episode: AtomicU64,
    /// Lockstep: number of publications on the trigger topic that the component had seen at its last tick.
    /// Written by the component or launcher that passes the turn.
    pub trigger_seen: AtomicU64,
    /// Number of steps begun, summed over restarts; one more than `steps` during a step.
    pub begun: AtomicU64,
    /// Number of steps completed, summed over restarts.
    pub steps: AtomicU64,
    /// Start of the first step, on the run's clock, ns.
    pub first_step_ns: AtomicU64,
    /// Start of the last step, on the run's clock, ns.
    pub last_step_ns: AtomicU64,
    late_wake: AtomicU64,
    long_step: AtomicU64,
    stolen: AtomicU64,
    late_input: AtomicU64,
    /// Number of releases that were dropped.
    pub skipped: AtomicU64,
    /// Number of releases by a descriptor that were delayed by `min_interval`.
    pub deferred: AtomicU64,
    /// Number of steps that lasted longer than the budget.
    pub over_budget: AtomicU64,
    /// Number of steps that returned an error and were tolerated.
    pub errors: AtomicU64,
    /// Number of samples withheld because they were late, or refused because of their content.
    pub refused: AtomicU64,
    /// Number of heap allocations in steps, after the warm-up.
    pub allocations: AtomicU64,
    /// Number of heap allocations that documented third-party code made in steps, after the warm-up.
    pub allocations_apart: AtomicU64,
    /// 1 if the program of the component counts allocations.
    pub counts_allocations: AtomicU32,
    /// 1 while an actuator applies the safe state.
    pub safe: AtomicU32,
    /// Time at which the actuator last entered its safe state, `CLOCK_MONOTONIC` ns.
    pub safe_since_ns: AtomicU64,
    /// Number of page faults of the stepping thread, after the warm-up.
    pub page_faults: AtomicU64,
    stall_watched_ns: AtomicU64,
    stall_count: AtomicU64,
    stall_total_ns: AtomicU64,
    stall_longest_ns: AtomicU64,
    /// Current time of spinning before each release, ns.
    pub spin_ns: AtomicU64,
    /// 1 if the stepping thread runs under `SCHED_DEADLINE`, as read back from the kernel.
    pub deadline: AtomicU32,
    /// `SCHED_FIFO` priority of the stepping thread, as read back from the kernel; 0 if its class is not
    /// `SCHED_FIFO`.
    pub fifo_priority: AtomicU32,
    /// Bit mask of the cores on which the stepping thread may run, as read back from the kernel. Covers the
    /// first 32 cores.
    pub cores: AtomicU32,
    /// 1 if the memory of the process is locked, as read back from the kernel.
    pub memory_locked: AtomicU32,
    /// Length of the text of the component's failure, bytes.
    failure_length: AtomicU32,
    /// Index of the step at which the component failed.
    failure_tick: AtomicU64,
    /// Encoded end of the component; the first word is 0 before a failure.
    end: [AtomicU64; END_WORDS],
    failure: [AtomicU8; 2048],
    /// Lateness of releases, ns.
    pub lateness: Histogram,
    /// Execution times of steps, ns of wall-clock time.
    pub execution: Histogram,
    /// CPU times of steps, ns, including waiting and waking but not spinning.
    pub cpu: Histogram,
    /// Statistics of the actuator's command gate.
    pub gate: GateBlock,
    /// Saved numbers from which the component may resume after a restart.
    pub(crate) checkpoint: CheckpointBlock,
}

impl ComponentBlock {
    /// Returns the phase of the component's life.
    pub fn phase(&self) -> Phase {
        Phase::from_word(self.phase.load(Acquire))
    }

    /// Enters a phase and wakes the processes that wait for it.
    pub fn enter(&self, phase: Phase) {
        self.phase.store(phase as u32, Release);
        crate::os::futex_wake(&self.phase);
    }

    /// Returns the futex word on which a process waits for the next phase.
    pub fn phase_word(&self) -> &AtomicU32 {
        &self.phase
    }

    /// Returns the number of times that the component was called to a tick, to wait for the next call.
    #[inline]
    pub(crate) fn tick_calls(&self) -> u32 {
        self.tick_calls.load(Acquire)
    }

    /// Wakes the component for its tick.
    #[inline]
    pub(crate) fn call(&self) {
        self.tick_calls.fetch_add(1, Release);
        crate::os::futex_wake(&self.tick_calls);
    }

    /// Sleeps until the number of calls differs from `calls`, or until the timeout.
    pub(crate) fn await_call(&self, calls: u32, timeout: Duration) {
        crate::os::futex_wait(&self.tick_calls, calls, Some(timeout));
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

    /// Returns the number of missed steps so far, by cause.
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

    /// Adds `ns` of time spent spinning.
    pub(crate) fn watched(&self, ns: u64) {
        add(&self.stall_watched_ns, ns);
    }

    /// Counts a stall of `ns` that occurred while spinning.
    pub(crate) fn stalled(&self, ns: u64) {
        add(&self.stall_count, 1);
        add(&self.stall_total_ns, ns);
        if ns > self.stall_longest_ns.load(Relaxed) {
            self.stall_longest_ns.store(ns, Relaxed);
        }
    }

    /// Returns the stalls measured so far.
    pub fn stalls(&self) -> Stalls {
        Stalls {
            watched_ns: self.stall_watched_ns.load(Relaxed),
            count: self.stall_count.load(Relaxed),
            total_ns: self.stall_total_ns.load(Relaxed),
            longest_ns: self.stall_longest_ns.load(Relaxed),
        }
    }

    /// Saves a failure of the component for the launcher. The text is truncated to the capacity.
    pub fn set_failure(&self, failure: &Failure) {
        let text = &failure.text;
        let mut length = text.len().min(self.failure.len());
        while !text.is_char_boundary(length) {
            length -= 1;
        }
        for (cell, byte) in self.failure.iter().zip(text[..length].bytes()) {
            cell.store(byte, Relaxed);
        }
        self.failure_tick.store(failure.tick, Relaxed);
        self.failure_length.store(length as u32, Relaxed);
        let [head, rest @ ..] = &self.end;
        let [word, words @ ..] = failure.end.to_words();
        rest.iter().zip(words).for_each(|(cell, word)| cell.store(word, Relaxed));
        head.store(word, Release);
    }

    /// Returns the saved failure of the component, or `None` if it has not failed.
    pub fn failure(&self) -> Option<Failure> {
        let head = self.end[0].load(Acquire);
        let words = core::array::from_fn(|at| if at == 0 { head } else { self.end[at].load(Relaxed) });
        let end = End::from_words(words)?;
        let length = (self.failure_length.load(Relaxed) as usize).min(self.failure.len());
        let bytes: Vec<u8> = self.failure[..length].iter().map(|cell| cell.load(Relaxed)).collect();
        let text = String::from_utf8_lossy(&bytes).into_owned();
        Some(Failure { tick: self.failure_tick.load(Relaxed), end, text })
    }

    /// Resets the values that count from the start of the episode.
    pub(crate) fn begin_episode(&self) {
        self.episode_first.store(self.steps.load(Relaxed), Relaxed);
        self.trigger_seen.store(0, Relaxed);
        self.tick_time_ns.store(0, Relaxed);
        self.last_step_ns.store(0, Relaxed);
        self.checkpoint.forget();
    }

    /// Deletes the saved failure. Called before a restart.
    pub fn forget_failure(&self) {
        self.end[0].store(0, Release);
    }
}

/// Counters of one topic. Written by the topic's publisher.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct TopicBlock {
    /// Number of samples published in the current episode, across restarts of the publisher.
    pub published: AtomicU64,
    /// Time of the last publication, on the run's clock, ns.
    pub last_publish_ns: AtomicU64,
    /// Lockstep: digest of all values published on the topic.
    pub digest: AtomicU64,
    /// Number of samples that readers of the stream lost.
    pub dropped: AtomicU64,
}

impl TopicBlock {
    /// Resets the values that count from the start of the episode.
    pub(crate) fn begin_episode(&self) {
        for counter in [&self.published, &self.last_publish_ns, &self.digest] {
            counter.store(0, Release);
        }
    }
}

/// Measurements of one edge of the graph: a topic and one of its readers. Written by the reader.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct EdgeBlock {
    /// Ages of samples since their publication, at the start of the step that first read them, ns.
    pub age: Histogram,
}

/// Measurements of one latency budget. Written by the component that publishes the end of the chain.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct LatencyBlock {
    /// Measured latencies, ns.
    pub latency: Histogram,
    /// Number of latencies above the budget.
    pub missed: AtomicU64,
}
