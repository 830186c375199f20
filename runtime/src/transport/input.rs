//! The reading side of a topic.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use iceoryx2::node::Node;

use super::latest::{StateReader, TopicMemory};
use super::stream::{StreamReader, Taken};
use super::topic::{refused, same_layout};
use super::{Connect, Context, PortError, Shared};
use crate::declare::TopicPattern;
use crate::plan::TopicPlan;
use crate::region::add;
use crate::state::{Stamp, StateBuffer};

/// An input port: reads one topic in place.
///
/// A *state* gives its newest value ([`latest`](Self::latest)), which does not change until the next look; a *stream*
/// gives every value in order ([`next_unread`](Self::next_unread)). An input that the graph leaves unwired never has a
/// value.
///
/// ```
/// # use motorium::prelude::*;
/// # use motorium::state::JointState;
/// fn largest_velocity(state: &mut Input<JointState>) -> Option<f64> {
///     let reading = state.latest()?; // `None` before the first publication
///     if reading.age_ns() > 5_000_000 {
///         return None; // older than 5 ms
///     }
///     reading.velocity().iter().copied().reduce(f64::max) // rad/s, read where it lies
/// }
/// ```
#[derive(Debug)]
pub struct Input<T: StateBuffer> {
    source: Source<T>,
    context: Rc<Context>,
    /// True if outputs of the step propagate this input's source time.
    is_cause: bool,
    /// Index of the edge from the topic to this component.
    edge: Option<usize>,
    lost: u64,
}

/// The memory that an input reads.
#[derive(Debug)]
enum Source<T: StateBuffer> {
    Unwired,
    State(StateReader),
    Stream {
        queue: Box<StreamReader<T>>,
        /// Index of the topic.
        topic: usize,
        memory: Rc<TopicMemory>,
        /// Number of the newest publication at the last look.
        seen: u64,
        /// The episode of that look.
        era: u32,
    },
}

/// A value in shared memory, as it was when its input was read.
#[derive(Debug)]
pub struct Reading<'a, T: StateBuffer> {
    stamp: &'a Stamp,
    payload: &'a T,
    context: &'a Context,
}

impl<T: StateBuffer> core::ops::Deref for Reading<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.payload
    }
}

impl<T: StateBuffer> Reading<'_, T> {
    /// The time and the publisher of the value.
    pub fn stamp(&self) -> Stamp {
        *self.stamp
    }

    /// The time that the state is for, ns since the run began: the scheduled release of the time-triggered step at the
    /// head of the chain of triggers. It keeps to the grid of that rate, so a difference quotient over it does not
    /// jitter;
    /// [`Tick::time_ns`](crate::component::Tick::time_ns) of a time-triggered component is on the same clock.
    pub fn time_ns(&self) -> u64 {
        self.stamp.state_time.saturating_sub(self.context.clock().start_ns())
    }

    /// Time since it was published, ns.
    pub fn age_ns(&self) -> u64 {
        self.context.clock().now_ns().saturating_sub(self.stamp.publish_time)
    }
}

/// The place of an input in the graph.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InputPlace<'a> {
    /// Index of the topic.
    pub(crate) index: usize,
    pub(crate) topic: &'a TopicPlan,
    /// Name of the port.
    pub(crate) port: &'a str,
    /// Number of the port among the readers of the topic.
    pub(crate) pin: usize,
    pub(crate) is_cause: bool,
    /// Index of the edge from the topic to the component, if its ages are recorded.
    pub(crate) edge: Option<usize>,
}

impl<T: StateBuffer> Input<T> {
    pub(crate) fn unwired(context: Rc<Context>) -> Self {
        Self { source: Source::Unwired, context, is_cause: false, edge: None, lost: 0 }
    }

    pub(crate) fn open(
        node: &Node<Shared>,
        place: InputPlace<'_>,
        context: Rc<Context>,
    ) -> Result<Self, PortError> {
        let InputPlace { index, topic, port, pin, is_cause, edge } = place;
        same_layout::<T>(topic, port)?;
        let memory = context.memory(node, topic)?;
        let source = match topic.pattern {
            TopicPattern::State => Source::State(StateReader::new(memory, pin)),
            TopicPattern::Stream { .. } => Source::Stream {
                queue: Box::new(StreamReader::open(node, topic, port)?),
                topic: index,
                era: memory.era(),
                memory,
                seen: 0,
            },
            TopicPattern::Slices { .. } => {
                let reason = &"it carries slices: open the port with `Setup::slice_input`";
                return Err(refused(&topic.name, "opening a port for single values")(reason));
            }
        };
        Ok(Self { source, context, is_cause, edge, lost: 0 })
    }

    /// The connection to be made before the first step.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        match &self.source {
            Source::Stream { queue, .. } => Some(queue.connection()),
            Source::Unwired | Source::State(_) => None,
        }
    }

    /// True if the graph wires this input.
    pub fn is_wired(&self) -> bool {
        !matches!(self.source, Source::Unwired)
    }

    /// True if the topic was published since the last read of this input. For loops that poll: this reads one word and
    /// does not disturb the publisher.
    #[inline]
    pub fn has_news(&self) -> bool {
        match &self.source {
            Source::Unwired => false,
            Source::State(state) => state.has_news(),
            Source::Stream { memory, seen, era, .. } => {
                memory.newest().number() != if *era == memory.era() { *seen } else { 0 }
            }
        }
    }

    /// The newest value, if anything was ever published. Reading a stream this way skips the values before.
    #[inline]
    pub fn latest(&mut self) -> Option<Reading<'_, T>> {
        match &mut self.source {
            Source::Unwired => return None,
            Source::State(state) => {
                if state.look()
                    && let Some(edge) = self.edge
                    && let Some((stamp, _)) = state.current::<T>()
                {
                    self.context.note_read(edge, stamp);
                }
            }
            Source::Stream { .. } => while self.take() {},
        }
        self.read()
    }

    /// The next value that was not read, in order: of a stream the next in the queue, of a state the newest one if it
    /// is new.
    pub fn next_unread(&mut self) -> Option<Reading<'_, T>> {
        let is_new = match &self.source {
            Source::Unwired => false,
            Source::State(state) => state.has_news(),
            Source::Stream { .. } => self.take(),
        };
        if !is_new {
            return None;
        }
        if matches!(self.source, Source::State(_)) { self.latest() } else { self.read() }
    }

    /// The value read last, without looking for a newer one.
    #[inline]
    pub fn current(&self) -> Option<Reading<'_, T>> {
        let (stamp, payload) = match &self.source {
            Source::Unwired => return None,
            Source::State(state) => state.current()?,
            Source::Stream { memory, era, .. } if *era != memory.era() => return None,
            Source::Stream { queue, .. } => queue.current()?,
        };
        Some(Reading { stamp, payload, context: &self.context })
    }

    /// Values of a stream that were overwritten before they were read.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Takes the next valid value of a stream from its queue; whether there was one.
    fn take(&mut self) -> bool {
        let Source::Stream { queue, topic, memory, seen, era } = &mut self.source else { return false };
        if *era != memory.era() {
            *era = memory.era();
            queue.forget();
        }
        *seen = memory.newest().number();
        while let Some(taken) = queue.take() {
            let Taken::Next { lost } = taken else {
                add(&self.context.block().refused, 1);
                continue;
            };
            if lost > 0 {
                self.lost += lost;
                self.context.region().topics()[*topic].dropped.fetch_add(lost, Relaxed);
            }
            if let (Some(edge), Some((stamp, _))) = (self.edge, queue.current()) {
                self.context.note_read(edge, stamp);
            }
            return true;
        }
        false
    }

    /// The current value, whose source time goes on to the outputs if this input is their cause.
    #[inline]
    fn read(&self) -> Option<Reading<'_, T>> {
        let reading = self.current()?;
        if self.is_cause {
            self.context.causality().propagate(reading.stamp);
        }
        Some(reading)
    }
}
