//! The reading side of a topic whose type is known at run time only.

#![allow(unsafe_code)] // samples of a stream are read as bytes, by a type described at run time

use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample::Sample;
use iceoryx2::service::marker::CustomPayloadMarker;
use iceoryx2::service::static_config::message_type_details::TypeVariant;

use super::latest::StateReader;
use super::topic::{refused, service_name, type_detail};
use super::{Connect, Context, InputPlace, PortError, Shared};
use crate::declare::TopicPattern;
use crate::state::{Stamp, TypeLayout};

/// An input port that reads a topic of any type in place, as bytes of the topic's layout: the newest value.
///
/// For what passes values on without knowing them. Declare it with
/// [`Declare::raw_input`](crate::declare::Declare::raw_input).
#[derive(Debug)]
pub struct RawInput {
    topic: Option<(String, TypeLayout)>,
    source: Source,
    context: Rc<Context>,
    is_cause: bool,
    edge: Option<usize>,
    /// The episode of the last look.
    episode: u64,
}

type Bytes = Subscriber<Shared, [CustomPayloadMarker], Stamp>;

/// The memory that the input reads.
#[derive(Debug)]
enum Source {
    Unwired,
    State(StateReader),
    Stream { queue: Rc<Bytes>, current: Option<Sample<Shared, [CustomPayloadMarker], Stamp>>, size: usize },
}

/// A value in shared memory, as it was when its input was read.
#[derive(Debug, Clone, Copy)]
pub struct RawReading<'a> {
    /// The time and the publisher of the value.
    pub stamp: &'a Stamp,
    /// The value, in the layout of the topic.
    pub bytes: &'a [u8],
}

impl RawInput {
    pub(crate) fn unwired(context: Rc<Context>) -> Self {
        Self { topic: None, source: Source::Unwired, context, is_cause: false, edge: None, episode: 0 }
    }

    pub(crate) fn open(
        node: &Node<Shared>,
        place: InputPlace<'_>,
        context: Rc<Context>,
    ) -> Result<Self, PortError> {
        let InputPlace { topic, pin, is_cause, edge, .. } = place;
        let (name, layout) = (&topic.name, &topic.layout);
        let source = match topic.pattern {
            TopicPattern::State => Source::State(StateReader::new(context.memory(node, topic)?, pin)),
            TopicPattern::Slices { .. } => {
                return Err(refused(name, "opening a port for bytes")(&"it carries slices"));
            }
            TopicPattern::Stream { .. } => {
                let builder = node
                    .service_builder(&service_name("topic", name)?)
                    .publish_subscribe::<[CustomPayloadMarker]>()
                    .user_header::<Stamp>();
                let detail = type_detail(name, layout, TypeVariant::FixedSize)?;
                // SAFETY: the detail is that of the topic's own plan; iceoryx2 compares it with the service's.
                let builder = unsafe { builder.__internal_set_payload_type_details(&detail) };
                let service = builder.open().map_err(|error| refused(name, "opening")(&error))?;
                let queue = service.subscriber_builder().create();
                let queue = queue.map_err(|error| refused(name, "making a subscriber")(&error))?;
                Source::Stream { queue: Rc::new(queue), current: None, size: layout.size }
            }
        };
        Ok(Self { topic: Some((name.clone(), layout.clone())), source, context, is_cause, edge, episode: 0 })
    }

    /// The connection to be made before the first step.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        match &self.source {
            Source::Stream { queue, .. } => Some(queue.clone()),
            Source::Unwired | Source::State(_) => None,
        }
    }

    /// Name of the topic, if the graph wires this input.
    pub fn topic(&self) -> Option<&str> {
        self.topic.as_ref().map(|(name, _)| name.as_str())
    }

    /// Layout of the topic's values, if the graph wires this input.
    pub fn layout(&self) -> Option<&TypeLayout> {
        self.topic.as_ref().map(|(_, layout)| layout)
    }

    /// The newest value if it was not read before.
    pub fn next_unread(&mut self) -> Option<RawReading<'_>> {
        let episode = self.context.episode();
        if core::mem::replace(&mut self.episode, episode) != episode
            && let Source::Stream { current, .. } = &mut self.source
        {
            *current = None;
        }
        let is_new = match &mut self.source {
            Source::Unwired => false,
            Source::State(state) => state.look(),
            Source::Stream { queue, current, .. } => {
                let mut is_new = false;
                // An error means that a connection could not be made to a publisher that is just dying or being born.
                while let Some(sample) = queue.receive().ok().flatten() {
                    is_new |= sample.user_header().sequence > 0;
                    *current = Some(sample);
                }
                is_new
            }
        };
        if !is_new {
            return None;
        }
        if let (Some(edge), Some(reading)) = (self.edge, self.current()) {
            self.context.note_read(edge, reading.stamp);
        }
        let reading = self.current()?;
        if self.is_cause {
            self.context.causality().propagate(reading.stamp);
        }
        Some(reading)
    }

    /// The value read last, without looking for a newer one.
    pub fn current(&self) -> Option<RawReading<'_>> {
        let (stamp, bytes) = match &self.source {
            Source::Unwired => return None,
            Source::State(state) => state.current_bytes()?,
            Source::Stream { .. } if self.episode != self.context.episode() => return None,
            Source::Stream { current, size, .. } => {
                let sample = current.as_ref()?;
                let first = sample.payload().as_ptr().cast::<u8>();
                // SAFETY: the payload of a fixed-size custom sample is one value of `size` bytes; the sample is held.
                (sample.user_header(), unsafe { core::slice::from_raw_parts(first, *size) })
            }
        };
        Some(RawReading { stamp, bytes })
    }
}

impl Connect for Bytes {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }

    fn begin_episode(&self) {
        while matches!(self.receive(), Ok(Some(_))) {}
    }
}
