//! The state that the ports, the setup and the loop of one component share.

mod causality;
mod clock;
mod deferred;
mod first_lines;
mod reads;
mod signals;

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use crate::os::{current_core, monotonic_ns};
use crate::plan::{Activation, ClockKind, OnOverrun, Plan};
use crate::region::{Command, ComponentBlock, EpisodeStart, Region, TraceEvent, TraceWriter, add};
use crate::state::{FUTURE_TOLERANCE_NS, Stamp};

pub(crate) use causality::Causality;
pub(crate) use clock::Clock;
pub(crate) use deferred::{AfterStep, Deferred};
pub(crate) use first_lines::{Access, FirstLines, Line};
pub(crate) use reads::ReadEffects;
pub(crate) use signals::Signals;

/// Number of publications between two look-ups of the core.
const CORE_LOOK_UP: u32 = 64;

/// Reason why a valid value is not published.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Withheld {
    /// The step is past its deadline, and its overrun policy is `hold`.
    Late,
    /// The source time is this many nanoseconds ahead of the clock.
    InFuture { ahead_ns: u64 },
}

/// The state that the ports, the setup and the loop of one component share. It consists of its identity in
/// the run, its clock, the times that its step propagates, the work deferred to the end of the step, and the
/// signals it received.
#[derive(Debug)]
pub(crate) struct Context {
    region: Rc<Region>,
    index: usize,
    restart_count: u32,
    actuator: bool,
    hold_late_outputs: bool,
    settle_ns: u64,
    clock: Clock,
    causality: Causality,
    deferred: Deferred,
    first_lines: FirstLines,
    signals: Arc<Signals>,
    /// Trace of the component, if the run is traced.
    trace: Option<TraceWriter>,
    /// Index of the episode.
    episode: Cell<u64>,
    /// Number of started episodes; the content of a port belongs to one of them.
    era: Cell<u32>,
    /// Core found by the last look-up, and the number of calls so far.
    core: Cell<(usize, u32)>,
}

impl Context {
    pub(crate) fn new(plan: &Plan, index: usize, region: Rc<Region>) -> Self {
        let component = &plan.components[index];
        Self {
            restart_count: region.components()[index].restarts.load(Relaxed),
            index,
            actuator: component.actuator,
            hold_late_outputs: component.on_overrun == OnOverrun::Hold,
            settle_ns: plan.safety_of(component).settle_ns,
            clock: Clock::new(plan.clock, region.clone()),
            causality: Causality::new(matches!(component.activation, Activation::Triggered { .. })),
            deferred: Deferred::new(region.clone()),
            first_lines: FirstLines::default(),
            signals: Arc::default(),
            trace: None,
            episode: Cell::new(match plan.clock {
                ClockKind::Lockstep => region.header().episode.load(Relaxed),
                // A restarted component enters the episode that began while it was down.
                ClockKind::Realtime => region.components()[index].episode.load(Relaxed),
            }),
            era: Cell::new(0),
            core: Cell::new((0, 0)),
            region,
        }
    }

    /// Traces the steps of the component, if the run is traced. For its worker only.
    pub(crate) fn traced(mut self) -> Self {
        self.trace = TraceWriter::open(&self.region, self.index);
        self
    }

    #[inline]
    pub(crate) fn region(&self) -> &Region {
        &self.region
    }

    #[inline]
    pub(crate) fn block(&self) -> &ComponentBlock {
        &self.region.components()[self.index]
    }

    /// Returns the number of restarts of the component before this process.
    #[inline]
    pub(crate) fn restart_count(&self) -> u32 {
        self.restart_count
    }

    #[inline]
    pub(crate) fn clock(&self) -> &Clock {
        &self.clock
    }

    #[inline]
    pub(crate) fn causality(&self) -> &Causality {
        &self.causality
    }

    #[inline]
    pub(crate) fn deferred(&self) -> &Deferred {
        &self.deferred
    }

    /// Returns the cache lines that a step needs first.
    #[inline]
    pub(crate) fn first_lines(&self) -> &FirstLines {
        &self.first_lines
    }

    /// Records the cache lines that the stepping loop needs first. For the worker only.
    pub(crate) fn note_first_lines(&self) {
        let (header, block) = (self.region.header(), self.block());
        let read = |address: *const u8| self.first_lines.note(address, Access::Read);
        read(core::ptr::from_ref(header).cast());
        read(Arc::as_ptr(&self.signals).cast());
        read(Rc::as_ptr(&self.region).cast());
        read(crate::telemetry::place_of_counts());
        for word in [&block.begun, &block.steps] {
            self.first_lines.note(core::ptr::from_ref(word), Access::Write);
        }
    }

    pub(crate) fn signals(&self) -> &Arc<Signals> {
        &self.signals
    }

    /// Returns the core of this thread, looked up once in 64 calls: either the thread is pinned, or its core
    /// matters little.
    #[inline]
    pub(crate) fn core(&self) -> usize {
        let (mut core, calls) = self.core.get();
        if calls.is_multiple_of(CORE_LOOK_UP) {
            core = current_core();
        }
        self.core.set((core, calls.wrapping_add(1)));
        core
    }

    /// Prepares a step: sets its times (ns on the clock of stamps) and clears the source time of the previous
    /// step.
    #[inline]
    pub(crate) fn enter_step(&self, time_ns: u64, woken_ns: u64, deadline_ns: u64) {
        self.clock.enter_step(time_ns, woken_ns, deadline_ns);
        self.causality.enter_step();
    }

    /// Returns the index of the episode.
    #[inline]
    pub(crate) fn episode(&self) -> u64 {
        self.episode.get()
    }

    /// Returns the number of started episodes; a port drops values of other episodes.
    #[inline]
    pub(crate) fn era(&self) -> u32 {
        self.era.get()
    }

    /// Enters a real-time episode that began since the last call, and returns its start. Costs one load if no
    /// episode began.
    #[inline]
    pub(crate) fn enter_new_episode(&self) -> Option<EpisodeStart> {
        let start = self.new_episode()?;
        self.enter_episode(start.index);
        Some(start)
    }

    /// Returns the index of a real-time episode that has not been entered.
    #[inline(always)]
    pub(crate) fn new_episode_index(&self) -> Option<u64> {
        let index = self.region.header().episode.load(Relaxed);
        // In lockstep the launcher resets every component before it steps in a new episode.
        (index != self.episode.get() && !self.clock.is_lockstep()).then_some(index)
    }

    /// Returns the start of a real-time episode that has not been entered.
    pub(crate) fn new_episode(&self) -> Option<EpisodeStart> {
        self.new_episode_index().and_then(|_| self.region.header().episode_start())
    }

    /// Enters a real-time episode.
    pub(crate) fn enter_episode(&self, index: u64) {
        self.episode.set(index);
    }

    /// Begins an episode of simulated time: resets the clock, empties the inputs, and forgets what the
    /// outputs published.
    pub(crate) fn begin_episode(&self, index: u64) {
        self.episode.set(index);
        self.era.set(self.era.get().wrapping_add(1));
        self.clock.begin();
        self.causality.enter_step();
        self.deferred.begin_episode();
    }

    /// Records the first read of a sample. The sample's age at the start of the step is added to the
    /// statistics and the trace at the end of the step. A sample published later has age 0.
    #[inline(never)]
    pub(crate) fn note_read(&self, edge: usize, stamp: &Stamp) {
        self.deferred.note_age(edge, self.clock.woken_ns().saturating_sub(stamp.publish_time));
        if let Some(trace) = &self.trace {
            let (sequence, publish_ns) = (stamp.sequence, stamp.publish_time);
            trace.write(TraceEvent::Read { edge, sequence, publish_ns });
        }
    }

    /// Records a publication in the trace.
    #[inline]
    pub(crate) fn note_published(&self, topic: usize, stamp: &Stamp) {
        if let Some(trace) = &self.trace {
            let (sequence, publish_ns) = (stamp.sequence, stamp.publish_time);
            let at_ns = if self.clock.is_lockstep() { monotonic_ns() } else { publish_ns };
            trace.write(TraceEvent::Published { topic, sequence, publish_ns, at_ns });
        }
    }

    /// Returns the current `CLOCK_MONOTONIC` time, ns, if the lockstep trace needs it, or else `known_ns`.
    #[inline]
    pub(crate) fn traced_ns(&self, known_ns: u64) -> u64 {
        if self.trace.is_some() && self.clock.is_lockstep() { monotonic_ns() } else { known_ns }
    }

    /// Records a finished step in the trace.
    #[inline]
    pub(crate) fn note_step(&self, number: u64, release_ns: u64, begin_ns: u64, end_ns: u64) {
        if let Some(trace) = &self.trace {
            trace.write(TraceEvent::Step { number, release_ns, begin_ns, end_ns });
        }
    }

    /// Returns the stamp of a value published at `now_ns`, with the source time `source_ns` if the component
    /// sets one. A withheld value is counted as refused.
    #[inline(never)]
    pub(crate) fn stamp(
        &self,
        sequence: u64,
        now_ns: u64,
        source_ns: Option<u64>,
    ) -> Result<Stamp, Withheld> {
        let withhold = |reason| {
            add(&self.block().refused, 1);
            Err(reason)
        };
        if self.hold_late_outputs && now_ns > self.clock.deadline_ns() {
            return withhold(Withheld::Late);
        }
        let source_time = match source_ns {
            None => self.causality.source_time_or(now_ns),
            Some(given) if given > now_ns.saturating_add(FUTURE_TOLERANCE_NS) => {
                return withhold(Withheld::InFuture { ahead_ns: given - now_ns });
            }
            Some(given) => given.min(now_ns),
        };
        Ok(Stamp {
            sequence,
            source_time,
            publish_time: now_ns,
            state_time: self.causality.state_time_or(self.clock.step_ns_or(|| now_ns)),
            episode: self.episode(),
            publisher: self.index as u32,
            restart_count: self.restart_count,
        })
    }

    /// Returns `true` if actuators must be in their safe state, regardless of the command.
    #[inline]
    pub(crate) fn is_stopping(&self) -> bool {
        self.signals.on_its_own_since_ns().is_some()
    }

    /// Returns `true` for a component after its last step. While the robot settles only actuators step, so
    /// the statistics of other components cover the run only, and actuators have the cores to themselves.
    #[inline]
    pub(crate) fn has_stepped_last(&self) -> bool {
        !self.actuator && self.region.header().command() as u32 > Command::Run as u32
    }

    /// Waits for the end of the run.
    pub(crate) fn await_end(&self) {
        while !self.must_leave() {
            let word = self.region.header().command_word();
            crate::os::futex_wait(word, Command::SafeStop as u32, Some(Duration::from_millis(50)));
        }
    }

    /// Returns `true` if an actuator outside its safe state must enter it without waiting for a command.
    pub(crate) fn must_turn_safe(&self) -> bool {
        let stopping = self.is_stopping() || self.region.header().command() != Command::Run;
        stopping && self.block().safe.load(Relaxed) == 0
    }

    /// Returns `true` if the loop ends: the run stops, this process received a request to end, or the
    /// launcher died. In the last two cases, a real-time actuator first stays in its safe state for the
    /// settling time.
    #[inline]
    pub(crate) fn must_leave(&self) -> bool {
        self.signals.acknowledge();
        if self.region.header().command() == Command::Stop {
            return true;
        }
        self.signals.on_its_own_since_ns().is_some_and(|since_ns| {
            let settles = self.actuator && !self.clock.is_lockstep();
            !settles || crate::os::monotonic_ns() > since_ns.saturating_add(self.settle_ns)
        })
    }
}
