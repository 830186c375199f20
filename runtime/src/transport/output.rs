//! The writing side of a topic.

#![allow(unsafe_code)] // a loan is a place in shared memory in which any bit pattern is a valid value

use core::cell::UnsafeCell;
use core::ptr::NonNull;
use std::rc::Rc;

use super::latest::StateWriter;
use super::layout::same_layout;
use super::publication::{TopicWriter, checked};
use super::stream::{Lent, StreamWriter};
use super::{Connect, OutputPlace, Participant, PortError, refused};
use crate::context::Context;
use crate::declare::{StepError, TopicPattern};
use crate::state::{Checked, Field, StateBuffer};

/// An output port: the only writer of a topic. Values are filled in place, in shared memory. Values published
/// on an unwired output are discarded.
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
    topic: Option<TopicWriter>,
    context: Rc<Context>,
}

/// Destination of an output's samples.
#[derive(Debug)]
enum Sink<T: StateBuffer> {
    Unwired(Box<UnsafeCell<T>>),
    State(Rc<StateWriter>),
    Stream(StreamWriter<T>),
}

/// A value to fill in place and publish. Dropping the loan publishes nothing.
///
/// A loan initially contains the data of an earlier value, so write every field.
#[derive(Debug)]
pub struct Loan<'a, T: StateBuffer> {
    value: NonNull<T>,
    sample: Option<Lent<T>>,
    output: &'a mut Output<T>,
    /// Part of the value that was checked while it was written. Any other write invalidates it.
    checked: Checked,
}

impl<T: StateBuffer> Output<T> {
    pub(crate) fn unwired(port: &'static str, context: Rc<Context>) -> Self {
        Self { port, sink: Sink::Unwired(Box::new(UnsafeCell::new(T::ZERO))), topic: None, context }
    }

    pub(crate) fn open(
        participant: &Participant,
        place: OutputPlace<'_>,
        port: &'static str,
    ) -> Result<Self, PortError> {
        let topic = place.topic;
        same_layout::<T>(topic, port)?;
        let memory = participant.memory(topic)?;
        let (sink, state) = match topic.pattern {
            TopicPattern::State => {
                let state = Rc::new(StateWriter::new(memory.clone()));
                (Sink::State(state.clone()), Some(state))
            }
            TopicPattern::Stream { .. } => (Sink::Stream(StreamWriter::open(participant, topic, 1)?), None),
            TopicPattern::Slices { .. } => {
                let reason = &"the topic contains slices; open the port with `Setup::slice_output`";
                return Err(refused(&topic.name, "opening a port for single values")(reason));
            }
        };
        let topic = Some(TopicWriter::new(participant, place, memory, state));
        Ok(Self { port, sink, topic, context: participant.context().clone() })
    }

    /// Returns the connection to establish before the first step, if the output writes a stream.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        match &self.sink {
            Sink::Stream(stream) => Some(stream.connection()),
            Sink::Unwired(_) | Sink::State(_) => None,
        }
    }

    /// Returns `true` if the graph wires this output.
    pub fn is_wired(&self) -> bool {
        self.topic.is_some()
    }

    /// Lends the memory of the next value, to be filled and published.
    ///
    /// # Errors
    /// Readers still use all samples of a stream. This only happens if a reader holds more samples than it
    /// may.
    #[inline]
    pub fn loan(&mut self) -> Result<Loan<'_, T>, StepError> {
        let (value, sample) = match &mut self.sink {
            Sink::Unwired(scratch) => (NonNull::from_mut(scratch.get_mut()), None),
            // SAFETY: the loan made here is the only user of the slot, because it borrows the output mutably.
            Sink::State(state) => (NonNull::from_mut(unsafe { state.value_mut::<T>() }), None),
            Sink::Stream(stream) => {
                let mut sample = stream.lend(1).ok_or(StepError::Transport {
                    port: self.port,
                    reason: "readers still use all samples",
                })?;
                (NonNull::from_mut(sample.payload_mut()).cast::<T>(), Some(sample))
            }
        };
        Ok(Loan { value, sample, output: self, checked: Checked::default() })
    }

    /// Publishes a copy of a value.
    ///
    /// # Errors
    /// Same as [`Loan::publish`].
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
        // SAFETY: the value is the claimed slot, the lent sample or the scratch space of the output that this
        // loan borrows mutably: it stays in place, and nobody else uses it.
        unsafe { self.value.as_ref() }
    }
}

impl<T: StateBuffer> core::ops::DerefMut for Loan<'_, T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut T {
        self.checked = Checked::default();
        // SAFETY: as in `deref`.
        unsafe { self.value.as_mut() }
    }
}

impl<T: StateBuffer> Loan<'_, T> {
    /// Fills an array of the value with numbers, until the array is full or the numbers run out. Each number
    /// is checked while it is written, and [`publish`](Self::publish) does not read the array again. Returns
    /// the count of numbers written; the remaining entries are unchanged.
    ///
    /// Use this function for arrays of `f64` and `f32` that are too large for the L1 cache, such as maps,
    /// weights and images: a separate check of such an array takes as long as filling it. Only the last array
    /// that this function fills skips the check in `publish`. Set counts and other fields before the call:
    /// any later write through `&mut` makes `publish` check the whole value.
    ///
    /// ```
    /// # use motorium::prelude::*;
    /// use motorium::state::HeightScan;
    ///
    /// fn publish_flat_ground(heights: &mut Output<HeightScan>, ground: f32) -> Result<(), StepError> {
    ///     let mut loan = heights.loan()?;
    ///     (loan.rows, loan.columns) = (30, 30);
    ///     loan.set_count(900);
    ///     loan.fill_from(HeightScan::height, std::iter::repeat_n(ground, 900));
    ///     loan.publish()
    /// }
    /// ```
    ///
    /// # Panics
    /// If `array` returns a slice outside the value.
    pub fn fill_from<E: Field>(
        &mut self,
        array: impl FnOnce(&T) -> &[E],
        values: impl IntoIterator<Item = E>,
    ) -> usize {
        let whole = self.value.addr().get();
        let found = array(self);
        let (bytes, length) = (size_of_val(found), found.len());
        let offset = found.as_ptr().addr().wrapping_sub(whole);
        let inside = offset <= size_of::<T>() && bytes <= size_of::<T>() - offset;
        assert!(inside, "`array` returned {} bytes outside the loaned {}", bytes, T::NAME);
        // SAFETY: the `bytes` bytes from `offset` on are within the value and contained an array of this
        // type; any bit pattern is valid for it and for any other field there. Nobody else uses the value, as
        // in `deref`, and the reference to it has ended.
        let places = unsafe {
            core::slice::from_raw_parts_mut(self.value.cast::<E>().byte_add(offset).as_ptr(), length)
        };
        let (written, valid) = E::write_checked(places, values.into_iter());
        // Publication finds an invalid number again and names it.
        let spared =
            if valid && written == length { Checked::from_values(places) } else { Checked::default() };
        self.checked = spared;
        written
    }

    /// Publishes the value and wakes the components that the topic triggers.
    ///
    /// # Errors
    /// [`StepError::InvalidOutput`] if a number of the value is not finite or a count exceeds its array. In
    /// this case nothing is published, and readers keep the previous value.
    pub fn publish(self) -> Result<(), StepError> {
        self.finish(None)
    }

    /// Publishes the value like [`publish`](Self::publish), but with an explicit source time: the time at
    /// which the value was measured, received or recorded, in ns on the clock of
    /// [`Stamp`](crate::state::Stamp)s (`CLOCK_MONOTONIC`, or simulated time in lockstep).
    ///
    /// With `publish`, the source time is inherited from the step's input or, without an input, is the time
    /// of publication. End-to-end latencies are measured from the source time, and a `CommandGate` refuses a
    /// command whose source time is too old. A source time at most 1 ms in the future is replaced by the
    /// current time.
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
    /// Same as [`publish`](Self::publish). Also [`StepError::SourceInFuture`] if the source time is more than
    /// 1 ms in the future. In this case the value is counted as refused and not published.
    pub fn publish_from(self, source_ns: u64) -> Result<(), StepError> {
        self.finish(Some(source_ns))
    }

    #[inline(always)]
    fn finish(self, source_ns: Option<u64>) -> Result<(), StepError> {
        let Self { value, sample, output: Output { port, topic, context, .. }, checked: part } = self;
        // SAFETY: as in `deref`.
        let check = |_: &_| unsafe { value.as_ref() }.check_rest(&part);
        // SAFETY: as in `deref`.
        let digest = |_: &_, digest: &mut _| unsafe { value.as_ref() }.digest(digest);
        let send = |sample: Option<Lent<T>>, stamp| sample.is_some_and(|sample| sample.send(stamp));
        let published = match topic {
            Some(topic) => {
                // SAFETY: as in `deref`; the emergency-stop topic carries an `EmergencyStop`, whose only
                // field is this number.
                topic.latch_if_pressed(context, || unsafe { value.cast::<u64>().read() });
                topic.publish((context, source_ns), sample, check, digest, send)
            }
            None => checked(context, check(&sample)),
        };
        published.or_else(|reason| reason.for_step(port))
    }
}
