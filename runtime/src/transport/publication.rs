//! The stages of a publication that are common to all outputs: stamp, publish, wake, count.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use super::Participant;
use super::latest::protocol::Words as _;
use super::latest::{StateWriter, TopicMemory};
use crate::context::{Access, AfterStep, Context, FirstLines, Line, Withheld};
use crate::declare::StepError;
use crate::plan::{OnMiss, TopicPlan};
use crate::region::{Command, Latch, Region, add};
use crate::state::{Defect, Digest, Stamp};

/// Wiring of an output in the graph.
#[derive(Debug)]
pub(crate) struct OutputPlace<'a> {
    /// Index of the topic.
    pub(crate) index: usize,
    pub(crate) topic: &'a TopicPlan,
    /// The latency budgets that end at the output.
    pub(crate) probes: Vec<Probe>,
    /// True if triggered components are woken only at the end of the step, because a worker runs the steps
    /// and all triggered components run on its core.
    pub(crate) wakes_late: bool,
    /// True for the emergency-stop topic of the graph.
    pub(crate) is_emergency_stop: bool,
}

/// A latency budget that ends at an output.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Probe {
    pub(crate) index: usize,
    pub(crate) max_ns: u64,
    pub(crate) on_miss: OnMiss,
}

/// The writing end of a topic, common to all types.
#[derive(Debug)]
pub(crate) struct TopicWriter {
    topic: usize,
    after: Rc<AfterOutput>,
    wakes_late: bool,
    probes: Vec<Probe>,
    digest: Digest,
    /// True if values of this topic can stop the robot.
    is_emergency_stop: bool,
}

/// Reason why a value was not published.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Unpublished<D> {
    /// The content is invalid: a number is not finite, or a count exceeds its array.
    Invalid(D),
    /// The context withholds the value.
    Withheld(Withheld),
    /// iceoryx2 did not send the value.
    NotSent,
}

impl Unpublished<Defect> {
    /// Converts the reason to the outcome of the step. A value withheld by policy is counted, but is not an
    /// error.
    pub(crate) fn for_step(self, port: &'static str) -> Result<(), StepError> {
        match self {
            Self::Invalid(defect) => Err(StepError::InvalidOutput { port, defect }),
            Self::Withheld(Withheld::Late) => Ok(()),
            Self::Withheld(Withheld::InFuture { ahead_ns }) => {
                Err(StepError::SourceInFuture { port, ahead_ns })
            }
            Self::NotSent => Err(StepError::Transport { port, reason: "iceoryx2 did not send the sample" }),
        }
    }
}

impl TopicWriter {
    /// Creates the writing end of a topic. It uses the slots of `state` if given, otherwise queues.
    pub(crate) fn new(
        participant: &Participant,
        place: OutputPlace<'_>,
        memory: Rc<TopicMemory>,
        state: Option<Rc<StateWriter>>,
    ) -> Self {
        let OutputPlace { index, probes, wakes_late, is_emergency_stop, .. } = place;
        let after = Rc::new(AfterOutput::new(participant.context(), index, memory, state));
        participant.context().first_lines().note(Rc::as_ptr(&after), Access::Read);
        participant.context().deferred().add(after.clone());
        Self { topic: index, after, wakes_late, probes, digest: Digest::default(), is_emergency_stop }
    }

    /// Latches the emergency stop of the run if this is its topic and `stop` returns a value other than 0.
    ///
    /// A gate only reads the newest value. A stop that is replaced before the gate steps, or is withheld
    /// because its step is late, must still stop the robot.
    #[inline]
    pub(crate) fn latch_if_pressed(&self, context: &Context, stop: impl FnOnce() -> u64) {
        if self.is_emergency_stop && stop() != 0 {
            context.region().header().latch(Latch::EmergencyStop);
        }
    }

    /// Publishes the filled slot of a state, or else `value` through `send`. `check` validates the content
    /// and `digest` hashes it.
    #[inline(always)]
    pub(crate) fn publish<V, D>(
        &mut self,
        (context, source_ns): (&Context, Option<u64>),
        value: V,
        check: impl FnOnce(&V) -> Result<(), D>,
        digest: impl FnOnce(&V, &mut Digest),
        send: impl FnOnce(V, Stamp) -> bool,
    ) -> Result<(), Unpublished<D>> {
        // Read before the check: reading the clock waits for all earlier loads, and the loads of the check
        // wait until the numbers just written have reached the cache.
        let now = context.clock().now_ns();
        checked(context, check(&value))?;
        let sequence = match &self.after.state {
            Some(state) => state.number(),
            None => self.after.memory.newest().number() + 1,
        };
        let stamp = context.stamp(sequence, now, source_ns).map_err(Unpublished::Withheld)?;
        if context.clock().is_lockstep() {
            self.digest(context, &stamp, |all| digest(&value, all));
        }
        if self.after.state.is_none() && !send(value, stamp) {
            return Err(Unpublished::NotSent);
        }
        self.announce(context, &stamp);
        Ok(())
    }

    /// Adds a value to the digest of all values published on the topic.
    #[cold]
    fn digest(&mut self, context: &Context, stamp: &Stamp, value: impl FnOnce(&mut Digest)) {
        if stamp.sequence == 1 {
            // The first publication of an episode.
            self.digest = Digest::default();
        }
        self.digest.write_u64(stamp.sequence);
        self.digest.write_u64(stamp.publish_time);
        value(&mut self.digest);
        context.region().topics()[self.topic].digest.store(self.digest.finish(), Relaxed);
    }

    /// Announces the value, wakes the waiting components, counts the publication and measures its latency.
    #[inline(never)]
    fn announce(&self, context: &Context, stamp: &Stamp) {
        let memory = &self.after.memory;
        memory.publish_from(context.core());
        match &self.after.state {
            Some(state) => state.publish(stamp),
            None => memory.count(stamp.publish_time),
        }
        self.after.uncounted.set(Some((stamp.sequence, stamp.publish_time)));
        if self.wakes_late {
            // Updating the control block here would delay the waiters, because its lines may be in another
            // core's cache.
            self.after.owes_wake.set(true);
        } else {
            if !context.clock().is_lockstep() {
                memory.notify();
            }
            self.after.finish(context.region(), context.first_lines());
        }
        if !self.probes.is_empty() {
            self.measure(context, stamp);
        }
        context.note_published(self.topic, stamp);
    }

    /// Measures the latencies that end at the output.
    #[cold]
    #[inline(never)]
    fn measure(&self, context: &Context, stamp: &Stamp) {
        let region = context.region();
        for probe in &self.probes {
            let latency = stamp.publish_time.saturating_sub(stamp.source_time);
            let measured = &region.latencies()[probe.index];
            measured.latency.record(latency);
            if latency > probe.max_ns {
                add(&measured.missed, 1);
                if probe.on_miss == OnMiss::SafeStop {
                    region.header().order(Command::SafeStop);
                }
            }
        }
    }
}

/// Returns the outcome of the check of a value; an invalid value is counted as refused.
#[inline(always)]
pub(crate) fn checked<D>(context: &Context, outcome: Result<(), D>) -> Result<(), Unpublished<D>> {
    outcome.map_err(|defect| {
        add(&context.block().refused, 1);
        Unpublished::Invalid(defect)
    })
}

/// Work of one output at the end of a step.
#[derive(Debug)]
struct AfterOutput {
    /// Index of the topic.
    topic: usize,
    memory: Rc<TopicMemory>,
    state: Option<Rc<StateWriter>>,
    owes_wake: Cell<bool>,
    /// Number and time (ns) of the last publication until it is counted in the control block.
    uncounted: Cell<Option<(u64, u64)>>,
    /// First line of the slot to be filled next.
    slot: Option<Line>,
}

impl AfterOutput {
    fn new(context: &Context, topic: usize, memory: Rc<TopicMemory>, state: Option<Rc<StateWriter>>) -> Self {
        let lines = context.first_lines();
        lines.note(memory.head(), Access::Write);
        lines.note(Rc::as_ptr(&memory), Access::Read);
        if let Some(state) = &state {
            lines.note(Rc::as_ptr(state), Access::Write);
        }
        let slot = state.as_ref().and_then(|_| lines.note(memory.head(), Access::Write));
        Self { topic, memory, state, owes_wake: Cell::new(false), uncounted: Cell::new(None), slot }
    }
}

impl AfterStep for AfterOutput {
    fn begin_episode(&self) {
        self.owes_wake.set(false);
        self.uncounted.set(None);
        if let Some(state) = &self.state {
            state.begin_episode();
        }
    }

    fn wake(&self) {
        if self.owes_wake.take() {
            self.memory.notify();
        }
    }

    fn finish(&self, region: &Region, first_lines: &FirstLines) {
        let Some((number, time_ns)) = self.uncounted.take() else { return };
        let block = &region.topics()[self.topic];
        block.last_publish_ns.store(time_ns, Relaxed);
        block.published.store(number, Relaxed);
        let next = self.state.as_ref().and_then(|state| state.prepare());
        if let Some((line, next)) = self.slot.zip(next) {
            first_lines.replace(line, next, Access::Write);
        }
    }
}
