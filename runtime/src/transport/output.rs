//! The writing side of a topic.

#![allow(unsafe_code)] // a loan is a place in shared memory that any bit pattern makes a valid value of

use core::cell::UnsafeCell;
use core::ptr::NonNull;
use std::cell::Cell;
use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use iceoryx2::node::Node;

use super::context::AfterStep;
use super::latest::{StateWriter, TopicMemory};
use super::stamping::{source_time, stamp};
use super::stream::{Lent, StreamWriter};
use super::topic::{refused, same_layout};
use super::{Context, PortError, Shared};
use crate::declare::{StepError, TopicPattern};
use crate::plan::{OnMiss, TopicPlan};
use crate::region::{Command, add};
use crate::state::{Digest, Stamp, StateBuffer};

/// A port whose connections can be made before the first step.
pub(crate) trait Connect {
    fn connect(&self) -> Result<(), String>;

    /// Drops what is left from the episode before.
    fn begin_episode(&self) {}
}

/// A latency budget that ends at an output.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Probe {
    pub(crate) index: usize,
    pub(crate) max_ns: u64,
    pub(crate) on_miss: OnMiss,
}

/// An output port: the one writer of a topic. A value is filled where its readers will find it. Values published on an
/// output that the graph leaves unwired are read by nobody.
///
/// ```
/// # use motorium::prelude::*;
/// # use motorium::state::JointState;
/// fn publish_rest(rest: &mut Output<JointState>, joints: usize) -> Result<(), StepError> {
///     let mut loan = rest.loan()?; // holds whatever an earlier value left there
///     loan.set_count(joints);
///     loan.position_mut().fill(0.0);
///     loan.velocity_mut().fill(0.0);
///     loan.effort_mut().fill(0.0);
///     loan.publish() // dropping it instead publishes nothing
/// }
/// ```
#[derive(Debug)]
pub struct Output<T: StateBuffer> {
    port: &'static str,
    sink: Sink<T>,
    wired: Option<Wired>,
    context: Rc<Context>,
}

/// The place that an output fills.
#[derive(Debug)]
enum Sink<T: StateBuffer> {
    Unwired(Box<UnsafeCell<T>>),
    State(Rc<StateWriter>),
    Stream(StreamWriter<T>),
}

/// The rest of a wired output, the same for all types.
#[derive(Debug)]
pub(super) struct Wired {
    topic: usize,
    memory: Rc<TopicMemory>,
    after: Rc<AfterOutput>,
    /// True if the worker runs deferred work at the end of each step.
    ends_steps: bool,
    /// True if all components that the topic triggers run on this core, and so are woken at the end of the step.
    wakes_late: bool,
    probes: Vec<Probe>,
    digest: Digest,
}

/// The work of one output at the end of a step.
#[derive(Debug)]
struct AfterOutput {
    memory: Rc<TopicMemory>,
    state: Option<Rc<StateWriter>>,
    owes_wake: Cell<bool>,
    owes_slot: Cell<bool>,
}

impl AfterStep for AfterOutput {
    fn begin_episode(&self) {
        self.owes_wake.set(false);
        self.owes_slot.set(false);
        if let Some(state) = &self.state {
            state.begin_episode();
        }
    }

    fn wake(&self) {
        if self.owes_wake.take() {
            self.memory.notify();
        }
    }

    fn prepare(&self) {
        if self.owes_slot.take()
            && let Some(state) = &self.state
        {
            state.prepare();
        }
    }
}

/// A value to fill in place and publish. Dropping it publishes nothing.
///
/// It holds whatever an earlier value left there: write every field that is meant to be read.
#[derive(Debug)]
pub struct Loan<'a, T: StateBuffer> {
    value: NonNull<T>,
    sample: Option<Lent<T>>,
    output: &'a mut Output<T>,
}

impl<T: StateBuffer> Output<T> {
    pub(crate) fn unwired(port: &'static str, context: Rc<Context>) -> Self {
        Self { port, sink: Sink::Unwired(Box::new(UnsafeCell::new(T::ZERO))), wired: None, context }
    }

    pub(crate) fn open(
        node: &Node<Shared>,
        topic: (usize, &TopicPlan),
        port: &'static str,
        probes: Vec<Probe>,
        context: Rc<Context>,
    ) -> Result<Self, PortError> {
        let (index, topic) = topic;
        same_layout::<T>(topic, port)?;
        let memory = context.memory(node, topic)?;
        let (sink, state) = match topic.pattern {
            TopicPattern::State => {
                let state = Rc::new(StateWriter::new(memory.clone()));
                (Sink::State(state.clone()), Some(state))
            }
            TopicPattern::Stream { .. } => (Sink::Stream(StreamWriter::open(node, topic, port)?), None),
            TopicPattern::Slices { .. } => {
                let reason = &"it carries slices: open the port with `Setup::slice_output`";
                return Err(refused(&topic.name, "opening a port for single values")(reason));
            }
        };
        let wired = Wired::new(index, memory, state, probes);
        Ok(Self { port, sink, wired: Some(wired), context })
    }

    /// The worker ends every step of this output's component; only then the components are woken that it triggers, if
    /// they are all on its own core.
    pub(crate) fn ending_steps(mut self, stays_on_core: bool) -> Self {
        if let Some(wired) = &mut self.wired {
            wired.ending_steps(&self.context, stays_on_core);
        }
        self
    }

    /// The connection to be made before the first step.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        match &self.sink {
            Sink::Stream(stream) => Some(stream.connection()),
            Sink::Unwired(_) | Sink::State(_) => None,
        }
    }

    /// True if the graph wires this output.
    pub fn is_wired(&self) -> bool {
        self.wired.is_some()
    }

    /// Lends the memory of the next value.
    ///
    /// # Errors
    /// Readers hold all samples of a stream, which cannot happen while every reader keeps to its limits.
    #[inline]
    pub fn loan(&mut self) -> Result<Loan<'_, T>, StepError> {
        let (value, sample) = match &mut self.sink {
            Sink::Unwired(scratch) => (NonNull::from_mut(scratch.get_mut()), None),
            // SAFETY: the loan to come is the only user of the slot: it borrows the output mutably.
            Sink::State(state) => (NonNull::from_mut(unsafe { state.value_mut::<T>() }), None),
            Sink::Stream(stream) => {
                let mut sample = stream
                    .lend()
                    .ok_or(StepError::Transport { port: self.port, reason: "no sample could be lent" })?;
                (NonNull::from_mut(sample.payload_mut()), Some(sample))
            }
        };
        Ok(Loan { value, sample, output: self })
    }

    /// Publishes a copy of a value.
    ///
    /// # Errors
    /// As [`Loan::publish`].
    pub fn send(&mut self, value: &T) -> Result<(), StepError> {
        let mut loan = self.loan()?;
        *loan = *value;
        loan.publish()
    }
}

impl<T: StateBuffer> core::ops::Deref for Loan<'_, T> {
    type Target = T;

    #[inline]
    fn deref(&self) -> &T {
        // SAFETY: the value is the claimed slot, the lent sample or the scratch of the output that this loan borrows
        // mutably: it stays where it is, and nobody else uses it.
        unsafe { self.value.as_ref() }
    }
}

impl<T: StateBuffer> core::ops::DerefMut for Loan<'_, T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: as in `deref`.
        unsafe { self.value.as_mut() }
    }
}

impl<T: StateBuffer> Loan<'_, T> {
    /// Publishes the value and wakes the components that it triggers.
    ///
    /// # Errors
    /// [`StepError::InvalidOutput`] if it holds a number that is not finite or a count that does not fit: it is then
    /// not published, and its readers keep the older value.
    pub fn publish(self) -> Result<(), StepError> {
        self.finish(None)
    }

    /// As [`publish`](Self::publish), with the source time of the value: the time at which it was measured, received or
    /// recorded, ns on the clock of [`Stamp`]s (`CLOCK_MONOTONIC`, or simulated time in lockstep).
    ///
    /// It stands in the place of the source time of the step's input, and of the time of publication in a step without
    /// one. End-to-end latencies count from it, and a [`CommandGate`](crate::safety::CommandGate) refuses a command whose
    /// source is too old. A source time up to 1 ms after the present becomes the present.
    ///
    /// ```
    /// # use motorium::component::RunClock;
    /// # use motorium::prelude::*;
    /// /// Publishes a wrench that the sensor took two milliseconds before the step.
    /// fn publish(output: &mut Output<Wrench>, clock: &RunClock, tick: &Tick, wrench: &Wrench) -> Result<(), StepError> {
    ///     let mut loan = output.loan()?;
    ///     *loan = *wrench;
    ///     loan.publish_from(clock.stamp_ns(tick.time_ns.saturating_sub(2_000_000)))
    /// }
    /// ```
    ///
    /// # Errors
    /// As [`publish`](Self::publish); and [`StepError::SourceInFuture`] if the source time is later than that: the value is
    /// not published, and counted as refused.
    pub fn publish_from(self, source_ns: u64) -> Result<(), StepError> {
        self.finish(Some(source_ns))
    }

    #[inline(always)]
    fn finish(self, source_ns: Option<u64>) -> Result<(), StepError> {
        if let Err(defect) = self.check() {
            add(&self.output.context.block().refused, 1);
            return Err(StepError::InvalidOutput { port: self.output.port, defect });
        }
        let Self { value, sample, output } = self;
        let context = &*output.context;
        let Some(wired) = &mut output.wired else { return Ok(()) };
        let now = context.clock().now_ns();
        if context.withholds(now) {
            add(&context.block().refused, 1);
            return Ok(());
        }
        let source = source_time(context, source_ns, now)
            .map_err(|ahead_ns| StepError::SourceInFuture { port: output.port, ahead_ns })?;
        let sequence = match &output.sink {
            Sink::State(state) => state.number(),
            Sink::Unwired(_) | Sink::Stream(_) => wired.next_number(),
        };
        let stamp = stamp(context, sequence, now, source);
        if context.clock().is_lockstep() {
            // SAFETY: as in `deref`.
            wired.digest(context, stamp, |digest| unsafe { value.as_ref() }.digest(digest));
        }
        match (&output.sink, sample) {
            (Sink::State(state), _) => {
                wired.memory.publish_from(context.core());
                state.publish(stamp);
            }
            (Sink::Stream(stream), Some(sample)) => {
                if !stream.send(sample, stamp) {
                    let reason = "the sample was not sent";
                    return Err(StepError::Transport { port: output.port, reason });
                }
                wired.count(context, now);
            }
            (Sink::Stream(_) | Sink::Unwired(_), _) => {}
        }
        wired.announce(context, stamp);
        Ok(())
    }
}

impl Wired {
    pub(super) fn new(
        topic: usize,
        memory: Rc<TopicMemory>,
        state: Option<Rc<StateWriter>>,
        probes: Vec<Probe>,
    ) -> Self {
        let (owes_wake, owes_slot) = (Cell::new(false), Cell::new(false));
        let after = Rc::new(AfterOutput { memory: memory.clone(), state, owes_wake, owes_slot });
        let digest = Digest::default();
        Self { topic, memory, after, ends_steps: false, wakes_late: false, probes, digest }
    }

    /// The worker ends every step of the component.
    pub(super) fn ending_steps(&mut self, context: &Context, stays_on_core: bool) {
        (self.ends_steps, self.wakes_late) = (true, stays_on_core);
        context.deferred().add(self.after.clone());
    }

    /// Number of the publication to come, of a stream.
    pub(super) fn next_number(&self) -> u64 {
        self.memory.newest().number() + 1
    }

    /// Announces a publication of a stream.
    pub(super) fn count(&self, context: &Context, now_ns: u64) {
        self.memory.publish_from(context.core());
        self.memory.count(now_ns);
    }

    /// Takes a value into the digest of everything published on the topic.
    pub(super) fn digest(&mut self, context: &Context, stamp: Stamp, value: impl FnOnce(&mut Digest)) {
        if stamp.sequence == 1 {
            // The first of an episode.
            self.digest = Digest::default();
        }
        self.digest.write_u64(stamp.sequence);
        self.digest.write_u64(stamp.publish_time);
        value(&mut self.digest);
        context.region().topics()[self.topic].digest.store(self.digest.finish(), Relaxed);
    }

    /// Wakes the waiting components, counts the publication and measures its latency.
    pub(super) fn announce(&self, context: &Context, stamp: Stamp) {
        let region = context.region();
        if self.wakes_late {
            self.after.owes_wake.set(true);
        } else if !context.clock().is_lockstep() {
            self.memory.notify();
        }
        self.after.owes_slot.set(true);
        if !self.ends_steps || !self.wakes_late {
            self.after.prepare();
        }
        let block = &region.topics()[self.topic];
        block.last_publish_ns.store(stamp.publish_time, Relaxed);
        block.published.store(stamp.sequence, Relaxed);
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
        context.note_published(self.topic, &stamp);
    }
}
