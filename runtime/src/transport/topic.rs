//! Topics as iceoryx2 services.

#![allow(unsafe_code)] // services are made from layouts, so that the launcher need not know the Rust types

use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2::prelude::{AttributeSpecifier, AttributeVerifier};
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::publish_subscribe;
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable as _;

use super::error::{PortError, refused};
use super::latest::{SIDE_PINS, TopicMemory};
use super::stream::{Bytes, Header, Queue, Sender};
use crate::declare::TopicPattern;
use crate::domain::{Shared, service_name};
use crate::plan::TopicPlan;
use crate::state::{Stamp, StateBuffer, TypeLayout};

const LAYOUT_ATTRIBUTE: &str = "layout";

/// The services of one topic, held by the launcher so that they outlive every component.
#[derive(Debug)]
pub(crate) struct TopicService {
    samples: Samples,
    memory: Rc<TopicMemory>,
    wakes: bool,
}

impl TopicService {
    /// Makes the services of a topic with the exact limits the plan implies.
    pub(crate) fn create(node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let depth = match topic.pattern {
            TopicPattern::State => 1,
            TopicPattern::Stream { capacity } | TopicPattern::Slices { capacity, .. } => capacity,
        };
        let parties = topic.readers.len() + SIDE_PINS;
        let (key, value) = layout_attribute(topic)?;
        let failed = refused(&topic.name, "creating");
        let attributes = AttributeSpecifier::new().define(&key, &value).map_err(|error| failed(&error))?;
        let samples = builder(node, topic)?
            .subscriber_max_buffer_size(depth)
            .subscriber_max_borrowed_samples(2)
            .history_size(1)
            .enable_safe_overflow(true)
            // A few spare places: a killed publisher keeps its place until it is cleaned up.
            .max_publishers(4)
            .max_subscribers(2 * parties)
            .max_nodes(2 * parties + 4)
            .create_with_attributes(&attributes)
            .map_err(|error| failed(&error))?;
        let memory = Rc::new(TopicMemory::create(node, topic)?);
        Ok(Self { samples, memory, wakes: !topic.triggers.is_empty() })
    }

    /// Drops the topic without reading what iceoryx2 keeps in shared memory, because its words may be
    /// damaged. Everything is removed together with the domain.
    pub(crate) fn abandon(self) {
        self.samples.abandon();
    }

    /// The memory of the topic.
    pub(crate) fn memory(&self) -> &TopicMemory {
        &self.memory
    }

    /// Returns the topic's memory if components wait for it, to interrupt them so that they read the run's
    /// command.
    pub(crate) fn waited_for(&self) -> Option<Rc<TopicMemory>> {
        self.wakes.then(|| self.memory.clone())
    }
}

/// The iceoryx2 service of a topic.
type Samples = publish_subscribe::PortFactory<Shared, Bytes, Header>;

/// The attribute of a topic's service that names the layout of its values.
fn layout_attribute(topic: &TopicPlan) -> Result<(AttributeKey, AttributeValue), PortError> {
    let failed = refused(&topic.name, "describing its layout");
    let key = LAYOUT_ATTRIBUTE.try_into().map_err(|_| failed(&"attribute key"))?;
    let value = topic.layout.hash().as_str().try_into().map_err(|_| failed(&"attribute value"))?;
    Ok((key, value))
}

/// Returns the service of a topic, whose types only the plan describes.
fn builder(node: &Node<Shared>, topic: &TopicPlan) -> Result<Builder<Bytes, Header, Shared>, PortError> {
    let variant = match topic.pattern {
        TopicPattern::State | TopicPattern::Stream { .. } => TypeVariant::FixedSize,
        TopicPattern::Slices { .. } => TypeVariant::Dynamic,
    };
    let TypeLayout { type_name, size, alignment, .. } = &topic.layout;
    let payload = TypeDetail::__internal_new_from_parts(variant, type_name, *size, *alignment)
        .map_err(|error| refused(&topic.name, "describing its type")(&format!("{error:?}")))?;
    let stamp = TypeDetail::new::<Stamp>(TypeVariant::FixedSize);
    let service = node.service_builder(&service_name("topic", &topic.name)?);
    let builder = service.publish_subscribe::<Bytes>().user_header::<Header>();
    // SAFETY: the details describe a `StateBuffer` (`repr(C)`, fixed size, with its declared alignment) and a
    // `Stamp`. iceoryx2 compares them with those of an existing service.
    Ok(unsafe {
        builder.__internal_set_payload_type_details(&payload).__internal_set_user_header_type_details(&stamp)
    })
}

/// Checks that the topic's layout is the one this program was built with.
pub(crate) fn same_layout<T: StateBuffer>(topic: &TopicPlan, port: &str) -> Result<(), PortError> {
    fits(&T::layout(), topic, port)
}

/// Checks that the topic's layout matches that of a port.
pub(crate) fn fits(mine: &TypeLayout, topic: &TopicPlan, port: &str) -> Result<(), PortError> {
    if mine.hash() == topic.layout.hash() {
        return Ok(());
    }
    Err(PortError::Layout {
        topic: topic.name.clone(),
        port: port.to_string(),
        difference: mine.difference("this program", &topic.layout, "the topic"),
    })
}

/// Opens the service of a topic, which the launcher has created.
fn open(node: &Node<Shared>, topic: &TopicPlan) -> Result<Samples, PortError> {
    builder(node, topic)?
        .open_with_attributes(&required(topic)?)
        .map_err(|error| refused(&topic.name, "opening")(&error))
}

/// A queue of a topic's samples.
pub(crate) fn open_queue(node: &Node<Shared>, topic: &TopicPlan) -> Result<Queue, PortError> {
    let queue = open(node, topic)?.subscriber_builder().create();
    queue.map_err(|error| refused(&topic.name, "making a subscriber")(&error))
}

/// Opens the sender of a topic's samples, with at most this many elements.
pub(super) fn open_sender(
    node: &Node<Shared>,
    topic: &TopicPlan,
    longest: usize,
) -> Result<Sender, PortError> {
    let service = open(node, topic)?;
    let sender = service.publisher_builder().max_loaned_samples(1).initial_max_slice_len(longest).create();
    sender.map_err(|error| refused(&topic.name, "making a publisher")(&error))
}

/// The attribute that the service of a topic must have.
fn required(topic: &TopicPlan) -> Result<AttributeVerifier, PortError> {
    let (key, value) = layout_attribute(topic)?;
    AttributeVerifier::new()
        .require(&key, &value)
        .map_err(|error| refused(&topic.name, "describing its layout")(&error))
}
