//! Streams and slices whose type is only known at run time.

use std::rc::Rc;

use super::RawError;
use crate::context::{Context, ReadEffects};
use crate::declare::TopicPattern;
use crate::plan::PortPlan;
use crate::state::{ContentCheck, Digest, Stamp, TypeLayout};
use crate::transport::stream::{Lent, StreamReader, StreamWriter};
use crate::transport::{
    Connect, InputPlace, OutputPlace, Participant, PortError, TopicWriter, checked, fits, refused,
};

/// An input port that reads every value or every slice of a stream, in order and in place, as bytes in the
/// topic's layout.
///
/// Declare it with [`Declare::raw_stream_input`](crate::declare::Declare::raw_stream_input) or
/// [`Declare::raw_slice_input`](crate::declare::Declare::raw_slice_input).
///
/// ```
/// # use motorium::raw::RawStreamInput;
/// fn bytes_per_element(cloud: &mut RawStreamInput) -> Option<usize> {
///     let reading = cloud.next_unread()?;
///     Some(reading.bytes.len() / reading.count.max(1))
/// }
/// ```
#[derive(Debug)]
pub struct RawStreamInput {
    wired: Option<Wired>,
    effects: ReadEffects,
}

#[derive(Debug)]
struct Wired {
    topic: String,
    layout: TypeLayout,
    pattern: TopicPattern,
    check: ContentCheck,
    queue: StreamReader<u8>,
}

/// A value of a stream, or a slice, in shared memory.
#[derive(Debug, Clone, Copy)]
pub struct RawSlice<'a> {
    /// Stamp of the value: its sequence number, times and publisher.
    pub stamp: &'a Stamp,
    /// Bytes of all elements in sequence, each in the layout of the topic.
    pub bytes: &'a [u8],
    /// Number of elements; 1 in a stream of single values.
    pub count: usize,
}

fn check_of(layout: &TypeLayout, port: &str) -> Result<ContentCheck, PortError> {
    ContentCheck::new(layout).map_err(|error| refused(port, "reading the layout of its type")(&error))
}

impl RawStreamInput {
    pub(crate) fn unwired(context: Rc<Context>) -> Self {
        Self { wired: None, effects: ReadEffects::none(context) }
    }

    pub(crate) fn open(participant: &Participant, place: &InputPlace<'_>) -> Result<Self, PortError> {
        let topic = place.topic;
        if topic.pattern == TopicPattern::State {
            return Err(refused(&topic.name, "opening a port for every value")(
                &"the topic is a state, expected a stream",
            ));
        }
        let wired = Wired {
            topic: topic.name.clone(),
            layout: topic.layout.clone(),
            pattern: topic.pattern,
            check: check_of(&topic.layout, place.port)?,
            queue: StreamReader::open(participant, place)?,
        };
        Ok(Self { wired: Some(wired), effects: place.effects(participant) })
    }

    /// Returns the connection to establish before the first step, if the input is wired.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        self.wired.as_ref().map(|wired| wired.queue.connection())
    }

    /// Returns the name of the topic, or `None` if the input is unwired.
    pub fn topic(&self) -> Option<&str> {
        self.wired.as_ref().map(|wired| wired.topic.as_str())
    }

    /// Returns the layout of a value or of one element of a slice, or `None` if the input is unwired.
    pub fn layout(&self) -> Option<&TypeLayout> {
        self.wired.as_ref().map(|wired| &wired.layout)
    }

    /// Returns the pattern of the topic, which includes the maximum length of its slices, or `None` if the
    /// input is unwired.
    pub fn pattern(&self) -> Option<TopicPattern> {
        self.wired.as_ref().map(|wired| wired.pattern)
    }

    /// Returns the next unread value, in order. The value remains valid until the next call. Values with
    /// invalid content are skipped and counted as refused.
    pub fn next_unread(&mut self) -> Option<RawSlice<'_>> {
        let begins = self.effects.begins_episode();
        let Wired { check, queue, .. } = self.wired.as_mut()?;
        if begins {
            queue.begin_episode();
        }
        if !queue.take(self.effects.context(), |bytes| check.check_all(bytes).is_ok()) {
            return None;
        }
        let reading = self.current()?;
        self.effects.first_read(reading.stamp);
        self.effects.read(reading.stamp);
        Some(reading)
    }

    /// Returns the value or slice that was read last.
    pub fn current(&self) -> Option<RawSlice<'_>> {
        let wired = self.wired.as_ref().filter(|_| self.effects.is_of_this_episode())?;
        let (stamp, bytes) = wired.queue.current()?;
        Some(RawSlice { stamp, bytes, count: bytes.len() / wired.layout.size.max(1) })
    }

    /// Returns the number of values that were overwritten before this input read them.
    pub fn lost(&self) -> u64 {
        self.wired.as_ref().map_or(0, |wired| wired.queue.lost())
    }
}

/// An output port that writes every value or every slice of a stream, with a layout given at run time.
///
/// Declare it with [`Declare::raw_stream_output`](crate::declare::Declare::raw_stream_output) or
/// [`Declare::raw_slice_output`](crate::declare::Declare::raw_slice_output). Values published on an unwired
/// output are checked and discarded.
#[derive(Debug)]
pub struct RawStreamOutput {
    layout: TypeLayout,
    check: ContentCheck,
    pattern: TopicPattern,
    wired: Option<(String, StreamWriter<u8>, TopicWriter)>,
    context: Rc<Context>,
}

impl RawStreamOutput {
    pub(crate) fn unwired(port: &PortPlan, context: Rc<Context>) -> Result<Self, PortError> {
        if port.pattern == TopicPattern::State {
            return Err(refused(&port.port, "opening a port for every value")(
                &"the port was declared as a state, expected a stream",
            ));
        }
        let (layout, check) = (port.layout.clone(), check_of(&port.layout, &port.port)?);
        Ok(Self { layout, check, pattern: port.pattern, wired: None, context })
    }

    pub(crate) fn open(
        participant: &Participant,
        place: OutputPlace<'_>,
        port: &PortPlan,
    ) -> Result<Self, PortError> {
        let topic = place.topic;
        fits(&port.layout, topic, &port.port)?;
        let mut output = Self::unwired(port, participant.context().clone())?;
        output.pattern = topic.pattern;
        let stream = StreamWriter::open(participant, topic, output.longest())?;
        let name = topic.name.clone();
        let writer = TopicWriter::new(participant, place, participant.memory(topic)?, None);
        output.wired = Some((name, stream, writer));
        Ok(output)
    }

    /// Returns the connection to establish before the first step, if the output is wired.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        self.wired.as_ref().map(|(_, stream, _)| stream.connection())
    }

    /// Returns the name of the topic, or `None` if the output is unwired.
    pub fn topic(&self) -> Option<&str> {
        self.wired.as_ref().map(|(name, ..)| name.as_str())
    }

    /// Returns the layout of a value or of one element of a slice.
    pub fn layout(&self) -> &TypeLayout {
        &self.layout
    }

    /// Returns the maximum number of elements per slice; 1 for a stream of single values.
    pub fn longest(&self) -> usize {
        if let TopicPattern::Slices { longest, .. } = self.pattern { longest } else { 1 }
    }

    /// Checks the content of a value, or of all elements of a slice, without publishing anything.
    ///
    /// # Errors
    /// Returns the first defect in the content, or [`RawError::Length`] if the number of elements does not
    /// fit the port.
    pub fn check(&self, bytes: &[u8]) -> Result<(), RawError> {
        let found = bytes.len() / self.layout.size.max(1);
        let fits = match self.pattern {
            TopicPattern::Slices { longest, .. } => found <= longest,
            TopicPattern::State | TopicPattern::Stream { .. } => found == 1,
        };
        if !fits {
            return Err(RawError::Length { found, longest: self.longest() });
        }
        Ok(self.check.check_all(bytes)?)
    }

    /// Publishes a copy of a value or of all elements of a slice, stamped by this component, and wakes the
    /// components that the topic triggers.
    ///
    /// # Errors
    /// A number is not finite, a count exceeds its array, the slice is longer than declared or ends within an
    /// element, the step is past its deadline, or readers still use all samples. In each case nothing is
    /// published.
    pub fn publish(&mut self, bytes: &[u8]) -> Result<(), RawError> {
        self.finish(bytes, None)
    }

    /// Publishes a value or slice like [`publish`](Self::publish), but with an explicit source time, ns on
    /// the clock of stamps. See [`Loan::publish_from`](crate::transport::Loan::publish_from).
    ///
    /// # Errors
    /// Same as [`publish`](Self::publish), or the source time is more than 1 ms in the future.
    pub fn publish_from(&mut self, bytes: &[u8], source_ns: u64) -> Result<(), RawError> {
        self.finish(bytes, Some(source_ns))
    }

    fn finish(&mut self, bytes: &[u8], source_ns: Option<u64>) -> Result<(), RawError> {
        checked(&self.context, Self::check(self, bytes))?;
        let is_slice = matches!(self.pattern, TopicPattern::Slices { .. });
        let Self { layout, check, wired, context, .. } = self;
        let Some((_, stream, topic)) = wired else { return Ok(()) };
        let stop = || bytes.first_chunk().map_or(0, |stop| u64::from_ne_bytes(*stop));
        topic.latch_if_pressed(context, stop);
        let count = bytes.len() / layout.size.max(1);
        let Some(mut sample) = stream.lend(count) else { return Err(RawError::NotSent) };
        sample.payload_mut().copy_from_slice(bytes);
        let digest = |sample: &Lent<u8>, digest: &mut Digest| {
            if is_slice {
                digest.write_u64(count as u64);
            }
            check.digest_all(sample.payload(), digest);
        };
        let good = |_: &Lent<u8>| Ok::<(), RawError>(());
        topic.publish((context, source_ns), sample, good, digest, |sample, stamp| sample.send(stamp))?;
        Ok(())
    }
}
