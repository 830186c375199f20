//! Streams of slices, such as images, point clouds and frames, whose lengths vary up to a declared maximum.

use std::rc::Rc;

use super::{Connect, Lent, StreamReader, StreamWriter};
use crate::context::{Context, ReadEffects};
use crate::declare::{StepError, TopicPattern};
use crate::state::{Digest, Stamp, StateBuffer};
use crate::transport::layout::same_layout;
use crate::transport::publication::{TopicWriter, checked};
use crate::transport::{InputPlace, OutputPlace, Participant, PortError, refused};

/// An input port that reads every slice of a stream, in order and in place.
///
/// ```
/// # use motorium::prelude::*;
/// # use motorium::transport::SliceInput;
/// fn mean_brightness(image: &mut SliceInput<u8>) -> Option<f64> {
///     let (_, pixels) = image.next_unread()?;
///     let sum: u64 = pixels.iter().map(|pixel| u64::from(*pixel)).sum();
///     Some(sum as f64 / pixels.len().max(1) as f64)
/// }
/// ```
#[derive(Debug)]
pub struct SliceInput<T: StateBuffer> {
    queue: Option<StreamReader<T>>,
    effects: ReadEffects,
}

impl<T: StateBuffer> SliceInput<T> {
    pub(crate) fn unwired(context: Rc<Context>) -> Self {
        Self { queue: None, effects: ReadEffects::none(context) }
    }

    pub(crate) fn open(participant: &Participant, place: &InputPlace<'_>) -> Result<Self, PortError> {
        same_layout::<T>(place.topic, place.port)?;
        let queue = StreamReader::open(participant, place)?;
        Ok(Self { queue: Some(queue), effects: place.effects(participant) })
    }

    /// Returns the connection to make before the first step.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        self.queue.as_ref().map(StreamReader::connection)
    }

    /// Returns `true` if the graph wires this input.
    pub fn is_wired(&self) -> bool {
        self.queue.is_some()
    }

    /// Returns the next unread slice, in order, with its stamp. The slice remains valid until the next call.
    pub fn next_unread(&mut self) -> Option<(Stamp, &[T])> {
        let queue = self.queue.as_mut()?;
        if self.effects.begins_episode() {
            queue.begin_episode();
        }
        if !queue.take(self.effects.context(), |values| T::check_all(values).is_ok()) {
            return None;
        }
        let (stamp, values) = queue.current()?;
        self.effects.first_read(stamp);
        self.effects.read(stamp);
        Some((*stamp, values))
    }

    /// Returns the slice that was read last, with its stamp.
    pub fn current(&self) -> Option<(Stamp, &[T])> {
        let queue = self.queue.as_ref().filter(|_| self.effects.is_of_this_episode())?;
        queue.current().map(|(stamp, values)| (*stamp, values))
    }

    /// Returns the number of slices that were overwritten before this input read them.
    pub fn lost(&self) -> u64 {
        self.queue.as_ref().map_or(0, StreamReader::lost)
    }
}

/// An output port for slices, filled in place, with lengths up to a declared maximum.
///
/// ```
/// # use motorium::prelude::*;
/// # use motorium::transport::SliceOutput;
/// fn publish_black(image: &mut SliceOutput<u8>, pixels: usize) -> Result<(), StepError> {
///     let mut loan = image.loan(pixels)?; // holds whatever an earlier slice left there
///     loan.fill(0);
///     loan.publish()
/// }
/// ```
#[derive(Debug)]
pub struct SliceOutput<T: StateBuffer> {
    port: &'static str,
    longest: usize,
    wired: Option<(StreamWriter<T>, TopicWriter)>,
    scratch: Vec<T>,
    context: Rc<Context>,
}

/// A slice to fill in place and publish. Dropping the loan publishes nothing.
#[derive(Debug)]
pub struct SliceLoan<'a, T: StateBuffer> {
    sample: Option<Lent<T>>,
    length: usize,
    output: &'a mut SliceOutput<T>,
    /// True if the whole slice was checked while it was filled and has not been written to since.
    checked: bool,
}

impl<T: StateBuffer> SliceOutput<T> {
    pub(crate) fn unwired(port: &'static str, longest: usize, context: Rc<Context>) -> Self {
        Self { port, longest, wired: None, scratch: vec![T::ZERO; longest], context }
    }

    pub(crate) fn open(
        participant: &Participant,
        place: OutputPlace<'_>,
        port: &'static str,
    ) -> Result<Self, PortError> {
        let topic = place.topic;
        same_layout::<T>(topic, port)?;
        let TopicPattern::Slices { longest, .. } = topic.pattern else {
            return Err(refused(&topic.name, "opening a port for slices")(
                &"the topic contains single values",
            ));
        };
        let stream = StreamWriter::<T>::open(participant, topic, longest)?;
        let topic = TopicWriter::new(participant, place, participant.memory(topic)?, None);
        let context = participant.context().clone();
        Ok(Self { port, longest, wired: Some((stream, topic)), scratch: Vec::new(), context })
    }

    /// Returns the connection to make before the first step.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        self.wired.as_ref().map(|(stream, _)| stream.connection())
    }

    /// Returns `true` if the graph wires this output.
    pub fn is_wired(&self) -> bool {
        self.wired.is_some()
    }

    /// Returns the maximum number of elements per slice.
    pub fn longest(&self) -> usize {
        self.longest
    }

    /// Lends the memory of the next slice. `length` is its number of elements.
    ///
    /// # Errors
    /// The slice is longer than declared, or readers still use all samples of the topic.
    pub fn loan(&mut self, length: usize) -> Result<SliceLoan<'_, T>, StepError> {
        let failed = |reason| StepError::Transport { port: self.port, reason };
        if length > self.longest {
            return Err(failed("the slice is longer than the declared maximum"));
        }
        let sample = match &self.wired {
            None => None,
            Some((stream, _)) => {
                Some(stream.lend(length).ok_or_else(|| failed("readers still use all samples"))?)
            }
        };
        Ok(SliceLoan { sample, length, output: self, checked: false })
    }
}

impl<T: StateBuffer> core::ops::Deref for SliceLoan<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.sample {
            Some(sample) => sample.payload(),
            None => &self.output.scratch[..self.length],
        }
    }
}

impl<T: StateBuffer> core::ops::DerefMut for SliceLoan<'_, T> {
    fn deref_mut(&mut self) -> &mut [T] {
        self.checked = false;
        match &mut self.sample {
            Some(sample) => sample.payload_mut(),
            None => &mut self.output.scratch[..self.length],
        }
    }
}

impl<T: StateBuffer> SliceLoan<'_, T> {
    /// Fills the slice with values, until the slice is full or the values run out. Each element is checked
    /// while it is written. [`publish`](Self::publish) then skips its own check, provided that the slice was
    /// filled completely and not written to since. Returns the number of elements written.
    ///
    /// ```
    /// # use motorium::prelude::*;
    /// # use motorium::state::CloudPoint;
    /// # use motorium::transport::SliceOutput;
    /// fn publish_copy(cloud: &mut SliceOutput<CloudPoint>, points: &[CloudPoint]) -> Result<(), StepError> {
    ///     let mut loan = cloud.loan(points.len())?;
    ///     loan.fill_from(points.iter().copied());
    ///     loan.publish()
    /// }
    /// ```
    pub fn fill_from(&mut self, values: impl IntoIterator<Item = T>) -> usize {
        let (written, valid) = T::write_checked(self, values.into_iter());
        self.checked = valid && written == self.length;
        written
    }

    /// Publishes the slice and wakes the components that the topic triggers.
    ///
    /// # Errors
    /// [`StepError::InvalidOutput`] if a number of the slice is not finite. In this case nothing is
    /// published.
    pub fn publish(self) -> Result<(), StepError> {
        self.finish(None)
    }

    /// Publishes the slice like [`publish`](Self::publish), but with an explicit source time, such as the
    /// time at which an image was exposed, in ns on the clock of stamps. See
    /// [`Loan::publish_from`](crate::transport::Loan::publish_from).
    ///
    /// # Errors
    /// Same as [`publish`](Self::publish). Also [`StepError::SourceInFuture`] if the source time is more than
    /// 1 ms in the future.
    pub fn publish_from(self, source_ns: u64) -> Result<(), StepError> {
        self.finish(Some(source_ns))
    }

    #[inline(always)]
    fn finish(self, source_ns: Option<u64>) -> Result<(), StepError> {
        let checked_before = self.checked;
        let check = |values: &[T]| if checked_before { Ok(()) } else { T::check_all(values) };
        let unwired = if self.sample.is_none() { check(&self) } else { Ok(()) };
        let Self { sample, output: SliceOutput { port, wired, context, .. }, .. } = self;
        let (Some(sample), Some((_, topic))) = (sample, wired) else {
            return checked(context, unwired).or_else(|reason| reason.for_step(port));
        };
        let check = |sample: &Lent<T>| check(sample.payload());
        let digest = |sample: &Lent<T>, digest: &mut Digest| {
            digest.write_u64(sample.payload().len() as u64);
            T::digest_all(sample.payload(), digest);
        };
        let send = |sample: Lent<T>, stamp| sample.send(stamp);
        let published = topic.publish((context, source_ns), sample, check, digest, send);
        published.or_else(|reason| reason.for_step(port))
    }
}
