//! The reading side of a topic whose type is known only at run time.

use std::rc::Rc;

use crate::context::{Context, ReadEffects};
use crate::declare::TopicPattern;
use crate::state::{Stamp, TypeLayout};
use crate::transport::latest::StateReader;
use crate::transport::stream::StreamReader;
use crate::transport::{Connect, InputPlace, Participant, PortError, refused};

/// An input port that reads the newest value of a topic of any type, in place, as bytes in the topic's
/// layout.
///
/// Intended for code that forwards values without knowing their type. Declare the port with
/// [`Declare::raw_input`](crate::declare::Declare::raw_input).
#[derive(Debug)]
pub struct RawInput {
    topic: Option<(String, TypeLayout)>,
    source: Source,
    effects: ReadEffects,
}

/// Memory that the input reads.
#[derive(Debug)]
enum Source {
    Unwired,
    State(StateReader),
    Stream(StreamReader<u8>),
}

/// A value in shared memory, unchanged since the input was read.
#[derive(Debug, Clone, Copy)]
pub struct RawReading<'a> {
    /// Stamp of the value: its sequence number, times and publisher.
    pub stamp: &'a Stamp,
    /// Bytes of the value, in the layout of the topic.
    pub bytes: &'a [u8],
}

impl RawInput {
    pub(crate) fn unwired(context: Rc<Context>) -> Self {
        Self { topic: None, source: Source::Unwired, effects: ReadEffects::none(context) }
    }

    pub(crate) fn open(participant: &Participant, place: &InputPlace<'_>) -> Result<Self, PortError> {
        let topic = place.topic;
        let source = match topic.pattern {
            TopicPattern::State => Source::State(StateReader::new(participant.memory(topic)?, place.pin)),
            TopicPattern::Slices { .. } => {
                return Err(refused(&topic.name, "opening a port for bytes")(
                    &"the topic contains slices, expected single values",
                ));
            }
            TopicPattern::Stream { .. } => Source::Stream(StreamReader::open(participant, place)?),
        };
        let topic = Some((topic.name.clone(), topic.layout.clone()));
        Ok(Self { topic, source, effects: place.effects(participant) })
    }

    /// Returns the connection to establish before the first step, if the input reads a stream.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        if let Source::Stream(queue) = &self.source { Some(queue.connection()) } else { None }
    }

    /// Returns the name of the topic, or `None` if the input is unwired.
    pub fn topic(&self) -> Option<&str> {
        self.topic.as_ref().map(|(name, _)| name.as_str())
    }

    /// Returns the layout of the topic's values, or `None` if the input is unwired.
    pub fn layout(&self) -> Option<&TypeLayout> {
        self.topic.as_ref().map(|(_, layout)| layout)
    }

    /// Returns the newest value, or `None` if it has already been read.
    pub fn next_unread(&mut self) -> Option<RawReading<'_>> {
        let begins = self.effects.begins_episode();
        let is_new = match &mut self.source {
            Source::Unwired => false,
            Source::State(state) => {
                if begins {
                    state.begin_episode();
                }
                state.look()
            }
            Source::Stream(queue) => {
                if begins {
                    queue.begin_episode();
                }
                let mut is_new = false;
                while queue.take(self.effects.context(), |_| true) {
                    is_new = true;
                }
                is_new
            }
        };
        if !is_new {
            return None;
        }
        let reading = self.current()?;
        self.effects.first_read(reading.stamp);
        self.effects.read(reading.stamp);
        Some(reading)
    }

    /// Returns the value that was read last, even if the topic has a newer value. Returns `None` before the
    /// first read.
    pub fn current(&self) -> Option<RawReading<'_>> {
        if !self.effects.is_of_this_episode() {
            return None;
        }
        let (stamp, bytes) = match &self.source {
            Source::Unwired => return None,
            Source::State(state) => state.current_bytes()?,
            Source::Stream(queue) => queue.current()?,
        };
        Some(RawReading { stamp, bytes })
    }
}
