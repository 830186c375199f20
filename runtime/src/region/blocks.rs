//! Blocks of a control block for components, topics, edges and latency budgets.

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
    /// The component was ready to run, but another thread of this system occupied its core.
    LateWake,
    /// The step itself took too long.
    LongStep,
    /// The component did not run although its core was free: the host of a virtual machine had it, or the
    /// hardware woke late.
    Stolen,
    /// The command of an actuator was stale.
    LateInput,
}

/// Missed steps by cause.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Misses {
    /// Steps that ended late because other threads occupied the core for too long.
    pub late_wake: u64,
    /// Steps that ran past their deadline because of their own duration.
    pub long_step: u64,
    /// Steps that ended late because the host of the virtual machine, or idle hardware, delayed them.
    pub stolen: u64,
    /// Steps of an actuator that found the command stale and applied the safe state.
    pub late_input: u64,
    /// Releases dropped by the overrun policy.
    pub skipped: u64,
    /// Steps longer than the budget, late or not.
    pub over_budget: u64,
}

impl Misses {
    /// Returns the number of missed steps of all causes.
    pub fn missed(&self) -> u64 {
        [self.long_step, self.stolen, self.late_input].into_iter().fold(self.late_wake, u64::saturating_add)
    }
}

/// Machine stalls measured by a component while it was spinning before its releases and only read the clock.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Stalls {
    /// Time spent spinning, ns.
    pub watched_ns: u64,
    /// Number of stalls longer than 10 us.
    pub count: u64,
    /// Sum of the stalls, ns.
    pub total_ns: u64,
    /// The longest stall, ns.
    pub longest_ns: u64,
}

/// State and counters of one component. Written by its worker, unless a field names another writer.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct ComponentBlock {
    phase: AtomicU32,
    /// Process id. Written by the launcher.
    pub pid: AtomicU32,
    /// Thread id of the stepping thread.
    pub thread: AtomicU32,
    /// Word held by a thread of its process while the process lives.
    pub(crate) held: AtomicU32,
    /// Restarts. Written by the launcher.
    pub restarts: AtomicU32,
    /// Lockstep: number of calls to a tick, which is the word that the component sleeps on. Written by the
    /// giver of the turn.
    tick_calls: AtomicU32,
    /// Lockstep: simulated time of the tick, ns. Written by the giver of the turn.
    pub tick_time_ns: AtomicU64,
    /// Lockstep: 1 if the tick is a reset for the episode in the header, 0 if it is a step. Written by the
    /// giver of the turn.
    pub tick_resets: AtomicU32,
    /// 1 if the program that launched the run replaces the component, which then gets no ticks. Written by
    /// the launcher.
    pub played: AtomicU32,
    /// Steps done before the current episode of simulated time.
    pub episode_first: AtomicU64,
    /// Index of the episode entered last.
    pub(crate) episode: AtomicU64,
    /// Lockstep: publications of its trigger at its last tick. Written by the giver of the turn.
    pub trigger_seen: AtomicU64,
    /// Steps begun, across restarts: one more than `steps` during a step.
    pub begun: AtomicU64,
    /// Steps done, across restarts.
    pub steps: AtomicU64,
    /// Start of the first step, on the run's clock, ns.
    pub first_step_ns: AtomicU64,
    /// Start of the last step, on the run's clock, ns.
    pub last_step_ns: AtomicU64,
    late_wake: AtomicU64,
    long_step: AtomicU64,
    stolen: AtomicU64,
    late_input: AtomicU64,
    /// Releases dropped.
    pub skipped: AtomicU64,
    /// Releases by a descriptor that waited for `min_interval`.
    pub deferred: AtomicU64,
    /// Steps longer than the budget.
    pub over_budget: AtomicU64,
    /// Steps that returned an error and were tolerated.
    pub errors: AtomicU64,
    /// Samples withheld because they were late, or refused because of their content.
    pub refused: AtomicU64,
    /// Heap allocations in steps, after the warm-up.
    pub allocations: AtomicU64,
    /// Heap allocations in steps by documented foreign code, after the warm-up.
    pub allocations_apart: AtomicU64,
    /// 1 if the program counts allocations.
    pub counts_allocations: AtomicU32,
    /// 1 while an actuator applies the safe state.
    pub safe: AtomicU32,
    /// Last entry into the safe state, on `CLOCK_MONOTONIC`, ns.
    pub safe_since_ns: AtomicU64,
    /// Page faults of the stepping thread, after the warm-up.
    pub page_faults: AtomicU64,
    stall_watched_ns: AtomicU64,
    stall_count: AtomicU64,
    stall_total_ns: AtomicU64,
    stall_longest_ns: AtomicU64,
    /// Current spin time before a release, ns.
    pub spin_ns: AtomicU64,
    /// 1 if it runs under `SCHED_DEADLINE`, read back.
    pub deadline: AtomicU32,
    /// `SCHED_FIFO` priority, read back; 0 for none.
    pub fifo_priority: AtomicU32,
    /// Cores, read back, as a mask of the first 32.
    pub cores: AtomicU32,
    /// 1 if memory is locked, read back.
    pub memory_locked: AtomicU32,
    /// Number of bytes of the text of its failure.
    failure_length: AtomicU32,
    /// Tick at which it failed.
    failure_tick: AtomicU64,
    /// Its encoded end; the first word is 0 before a failure.
    end: [AtomicU64; END_WORDS],
    failure: [AtomicU8; 2048],
    /// Release lateness, ns.
    pub lateness: Histogram,
    /// Execution time of steps, wall-clock ns.
    pub execution: Histogram,
    /// CPU time of each step, ns, including waiting and waking but not spinning.
    pub cpu: Histogram,
    /// Statistics of an actuator's command gate.
    pub gate: GateBlock,
    /// Numbers from which a restarted component may resume.
    pub(crate) checkpoint: CheckpointBlock,
}

impl ComponentBlock {
    /// Returns the phase.
    pub fn phase(&self) -> Phase {
        Phase::from_word(self.phase.load(Acquire))
    }

    /// Enters a phase and wakes the waiting processes.
    pub fn enter(&self, phase: Phase) {
        self.phase.store(phase as u32, Release);
        crate::os::futex_wake(&self.phase);
    }

    /// Returns the word to wait on for the next phase.
    pub fn phase_word(&self) -> &AtomicU32 {
        &self.phase
    }

    /// Returns the number of calls to a tick so far, to wait for the next one.
    #[inline]
    pub(crate) fn tick_calls(&self) -> u32 {
        self.tick_calls.load(Acquire)
    }

    /// Calls the component to its tick.
    #[inline]
    pub(crate) fn call(&self) {
        self.tick_calls.fetch_add(1, Release);
        crate::os::futex_wake(&self.tick_calls);
    }

    /// Sleeps until the next call to a tick or a timeout.
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

    /// Returns the missed steps so far.
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

    /// Adds time spent spinning.
    pub(crate) fn watched(&self, ns: u64) {
        add(&self.stall_watched_ns, ns);
    }

    /// Counts a stall while spinning.
    pub(crate) fn stalled(&self, ns: u64) {
        add(&self.stall_count, 1);
        add(&self.stall_total_ns, ns);
        if ns > self.stall_longest_ns.load(Relaxed) {
            self.stall_longest_ns.store(ns, Relaxed);
        }
    }

    /// Returns the stalls so far.
    pub fn stalls(&self) -> Stalls {
        Stalls {
            watched_ns: self.stall_watched_ns.load(Relaxed),
            count: self.stall_count.load(Relaxed),
            total_ns: self.stall_total_ns.load(Relaxed),
            longest_ns: self.stall_longest_ns.load(Relaxed),
        }
    }

    /// Saves a failure of the component for the launcher, with its text cut to the capacity.
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

    /// Returns the saved failure of the component, if there is one.
    pub fn failure(&self) -> Option<Failure> {
        let head = self.end[0].load(Acquire);
        let words = core::array::from_fn(|at| if at == 0 { head } else { self.end[at].load(Relaxed) });
        let end = End::from_words(words)?;
        let length = (self.failure_length.load(Relaxed) as usize).min(self.failure.len());
        let bytes: Vec<u8> = self.failure[..length].iter().map(|cell| cell.load(Relaxed)).collect();
        let text = String::from_utf8_lossy(&bytes).into_owned();
        Some(Failure { tick: self.failure_tick.load(Relaxed), end, text })
    }

    /// Resets the values of the current episode.
    pub(crate) fn begin_episode(&self) {
        self.episode_first.store(self.steps.load(Relaxed), Relaxed);
        self.trigger_seen.store(0, Relaxed);
        self.tick_time_ns.store(0, Relaxed);
        self.last_step_ns.store(0, Relaxed);
        self.checkpoint.forget();
    }

    /// Clears the failure before a restart.
    pub fn forget_failure(&self) {
        self.end[0].store(0, Release);
    }
}

/// Counters of one topic. Written by its publisher.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct TopicBlock {
    /// Samples published in the current episode, across restarts of the publisher.
    pub published: AtomicU64,
    /// Time of the last publication, on the run's clock, ns.
    pub last_publish_ns: AtomicU64,
    /// Lockstep: digest of all published values.
    pub digest: AtomicU64,
    /// Samples that readers of a stream lost.
    pub dropped: AtomicU64,
}

impl TopicBlock {
    /// Resets the values of the current episode.
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
    /// Age of each sample since its publication, at the start of the step that first read it, ns.
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
