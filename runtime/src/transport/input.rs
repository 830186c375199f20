//! The reading side of a topic.

use std::rc::Rc;
use std::time::Duration;

use super::latest::{StateReader, TopicMemory};
use super::layout::same_layout;
use super::stream::StreamReader;
use super::{Connect, InputPlace, Participant, PortError, refused};
use crate::context::{Context, ReadEffects};
use crate::declare::TopicPattern;
use crate::state::{Stamp, StateBuffer};

/// An input port: reads one topic in place.
///
/// On a *state*, [`latest`](Self::latest) returns the newest value, which does not change until the next
/// read. On a *stream*, [`next_unread`](Self::next_unread) returns every value in order. An unwired input
/// never has a value.
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
    effects: ReadEffects,
}

/// Memory that an input reads.
#[derive(Debug)]
enum Source<T: StateBuffer> {
    Unwired,
    State(StateReader),
    Stream {
        queue: Box<StreamReader<T>>,
        memory: Rc<TopicMemory>,
        /// Number of the newest publication at the last check.
        seen: u64,
    },
}

/// A value that an input has read, in place in shared memory.
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
    /// Returns the stamp of the value: its sequence number, times and publisher.
    pub fn stamp(&self) -> Stamp {
        *self.stamp
    }

    /// Returns the time of the state, ns since the start of the run. The time of a state is the scheduled
    /// release of the time-triggered step that started the trigger chain. It does not depend on how late this
    /// step ran, so difference quotients do not jitter. `Tick::time_ns` of a time-triggered component is on
    /// the same clock.
    pub fn time_ns(&self) -> u64 {
        self.stamp.state_time.saturating_sub(self.context.clock().start_ns())
    }

    /// Returns the time since the value was published, ns.
    pub fn age_ns(&self) -> u64 {
        self.context.clock().now_ns().saturating_sub(self.stamp.publish_time)
    }
}

impl<T: StateBuffer> Input<T> {
    pub(crate) fn unwired(context: Rc<Context>) -> Self {
        Self { source: Source::Unwired, effects: ReadEffects::none(context) }
    }

    pub(crate) fn open(participant: &Participant, place: &InputPlace<'_>) -> Result<Self, PortError> {
        let topic = place.topic;
        same_layout::<T>(topic, place.port)?;
        let memory = participant.memory(topic)?;
        let source = match topic.pattern {
            TopicPattern::State => {
                let reader = StateReader::new(memory, place.pin);
                reader.note_first_lines(participant.context().first_lines());
                Source::State(reader)
            }
            TopicPattern::Stream { .. } => {
                let queue = Box::new(StreamReader::open(participant, place)?);
                Source::Stream { queue, memory, seen: 0 }
            }
            TopicPattern::Slices { .. } => {
                let reason = &"the topic contains slices; open the port with `Setup::slice_input`";
                return Err(refused(&topic.name, "opening a port for single values")(reason));
            }
        };
        Ok(Self { source, effects: place.effects(participant) })
    }

    /// Returns the connection to establish before the first step, if the input reads a stream.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        match &self.source {
            Source::Stream { queue, .. } => Some(queue.connection()),
            Source::Unwired | Source::State(_) => None,
        }
    }

    /// Returns `true` if the graph wires this input.
    pub fn is_wired(&self) -> bool {
        !matches!(self.source, Source::Unwired)
    }

    /// Returns `true` if the topic has been published since the last read of this input. Cheap enough for
    /// polling loops: the call reads one word and does not disturb the publisher.
    #[inline]
    pub fn has_news(&self) -> bool {
        let (newest, seen) = match &self.source {
            Source::Unwired => return false,
            Source::State(state) => (state.newest(), state.seen()),
            Source::Stream { memory, seen, .. } => (memory.newest().number(), *seen),
        };
        newest != if self.effects.is_of_this_episode() { seen } else { 0 }
    }

    /// Waits for a publication after the last read of this input, but at most for `longest`. Returns `true`
    /// if there is a new value. Returns early on a launcher command or a signal.
    ///
    /// Use this function in a step that publishes a value and needs the reply of a component, such as a bus
    /// that publishes a state and needs the controller's command. The function first wakes the components
    /// that the step triggers. It then sleeps, so that these components can use the core. Declare the maximum
    /// waiting time with [`Declare::waits`](crate::declare::Declare::waits). In lockstep only one component
    /// steps at a time, so the function returns immediately.
    ///
    /// ```
    /// # use motorium::prelude::*;
    /// # use std::time::Duration;
    /// fn newest_command(command: &mut Input<JointCommand>) -> Option<f64> {
    ///     command.wait(Duration::from_micros(200)); // without one, the one before
    ///     Some(command.latest()?.effort()[0])
    /// }
    /// ```
    pub fn wait(&self, longest: Duration) -> bool {
        let memory = match &self.source {
            Source::Unwired => return false,
            Source::State(state) => state.memory(),
            Source::Stream { memory, .. } => memory,
        };
        let context = self.effects.context();
        if context.clock().is_lockstep() {
            return self.has_news();
        }
        context.deferred().wake();
        let seen = memory.newest();
        if !self.has_news() {
            let longest_ns = u64::try_from(longest.as_nanos()).unwrap_or(u64::MAX);
            memory.sleep(seen, Some(context.clock().now_ns().saturating_add(longest_ns)));
        }
        self.has_news()
    }

    /// Returns the newest value, or `None` before the first publication. On a stream, this skips earlier
    /// values.
    #[inline]
    pub fn latest(&mut self) -> Option<Reading<'_, T>> {
        while self.advance() && matches!(self.source, Source::Stream { .. }) {}
        self.read()
    }

    /// Returns the next unread value: the next value in the queue of a stream, or the newest value of a
    /// state. Returns `None` if there is no unread value.
    pub fn next_unread(&mut self) -> Option<Reading<'_, T>> {
        if self.advance() { self.read() } else { None }
    }

    /// Returns the value that was read last, even if the topic has a newer value.
    #[inline]
    pub fn current(&self) -> Option<Reading<'_, T>> {
        if !self.effects.is_of_this_episode() {
            return None;
        }
        let (stamp, payload) = match &self.source {
            Source::Unwired => return None,
            Source::State(state) => state.current()?,
            Source::Stream { queue, .. } => queue.value()?,
        };
        Some(Reading { stamp, payload, context: self.effects.context() })
    }

    /// Returns the number of stream values that were overwritten before this input read them.
    pub fn lost(&self) -> u64 {
        if let Source::Stream { queue, .. } = &self.source { queue.lost() } else { 0 }
    }

    /// Advances to the next value: the next one in the queue of a stream, the newest one of a state. Returns
    /// `false` if there is no new value.
    #[inline]
    fn advance(&mut self) -> bool {
        let Source::State(state) = &mut self.source else { return self.advance_in_queue() };
        if self.effects.begins_episode() {
            state.begin_episode();
        }
        let is_new = state.look();
        if is_new && let Some((stamp, _)) = state.current::<T>() {
            self.effects.first_read(stamp);
        }
        is_new
    }

    /// Advances to the next value in the queue of a stream. Separate from [`advance`](Self::advance) to keep
    /// the instructions of a step contiguous.
    #[inline(never)]
    fn advance_in_queue(&mut self) -> bool {
        let Source::Stream { queue, memory, seen } = &mut self.source else { return false };
        if self.effects.begins_episode() {
            queue.begin_episode();
        }
        *seen = memory.newest().number();
        let is_valid = |values: &[T]| values.len() == 1 && values[0].check().is_ok();
        let is_new = queue.take(self.effects.context(), is_valid);
        if is_new && let Some((stamp, _)) = queue.current() {
            self.effects.first_read(stamp);
        }
        is_new
    }

    /// Returns the current value. Its source time is propagated to the outputs if this input is their cause.
    #[inline]
    fn read(&self) -> Option<Reading<'_, T>> {
        let reading = self.current()?;
        self.effects.read(reading.stamp);
        Some(reading)
    }
}
