//! Topics as iceoryx2 services.

#![allow(unsafe_code)] // services are made from layouts, so that the launcher need not know the Rust types

use core::fmt::Debug;
use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2::prelude::{AttributeSpecifier, AttributeVerifier};
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::publish_subscribe;
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};
use iceoryx2_bb_elementary_traits::iceoryx_send::IceoryxSend;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable as _;

use super::Participant;
use super::latest::{SIDE_PINS, TopicMemory};
use super::stream::Bytes;
use crate::declare::TopicPattern;
use crate::domain::{self, ServiceError, Shared, service_name};
use crate::plan::TopicPlan;
use crate::state::{Stamp, StateBuffer, TypeLayout};

const LAYOUT_ATTRIBUTE: &str = "layout";

/// A port could not be opened or a topic not be made.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The component asked for a port it did not declare.
    #[error("port `{port}` is not declared; declare it in `Component::declare`")]
    NotDeclared {
        /// The port.
        port: String,
    },
    /// The component opened the port as another type than it declared.
    #[error("port `{port}` was declared with one type and opened with another:\n{difference}")]
    TypeChanged {
        /// The port.
        port: String,
        /// Both layouts.
        difference: String,
    },
    /// The topic holds another type.
    #[error("topic `{topic}` holds another type than port `{port}` expects:\n{difference}")]
    Layout {
        /// The topic.
        topic: String,
        /// The port.
        port: String,
        /// Both layouts.
        difference: String,
    },
    /// iceoryx2 refused.
    #[error(transparent)]
    Refused(#[from] ServiceError),
}

/// The error of an operation on a topic.
pub(super) fn refused(
    topic: &str,
    action: &'static str,
) -> impl Fn(&dyn core::fmt::Display) -> PortError + use<> {
    let refused = domain::refused(format!("topic `{topic}`"), action);
    move |reason| PortError::Refused(refused(reason))
}

/// The services of one topic, held by the launcher so that they outlive every component.
#[derive(Debug)]
pub(crate) struct TopicService {
    samples: Samples<Bytes>,
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
        let samples = bytes_builder(node, topic)?
            .subscriber_max_buffer_size(depth)
            .subscriber_max_borrowed_samples(2)
            .history_size(1)
            .enable_safe_overflow(true)
            // spare ones: a killed publisher holds its place until it is cleaned up
            .max_publishers(4)
            .max_subscribers(2 * parties)
            .max_nodes(2 * parties + 4)
            .create_with_attributes(&attributes)
            .map_err(|error| failed(&error))?;
        let memory = Rc::new(TopicMemory::create(node, topic)?);
        Ok(Self { samples, memory, wakes: !topic.triggers.is_empty() })
    }

    /// Lets go of the topic without a look at what iceoryx2 keeps in shared memory: its words may have been damaged. All of
    /// it is removed with the domain.
    pub(crate) fn abandon(self) {
        self.samples.abandon();
    }

    /// The memory of the topic.
    pub(crate) fn memory(&self) -> &TopicMemory {
        &self.memory
    }

    /// The topic, if components wait for it: to interrupt them, so that they look at the run's command.
    pub(crate) fn waited_for(&self) -> Option<Rc<TopicMemory>> {
        self.wakes.then(|| self.memory.clone())
    }
}

/// The iceoryx2 service of a topic.
pub(super) type Samples<P> = publish_subscribe::PortFactory<Shared, P, Stamp>;

/// The attribute of a topic's service that names the layout of its values.
fn layout_attribute(topic: &TopicPlan) -> Result<(AttributeKey, AttributeValue), PortError> {
    let failed = refused(&topic.name, "describing its layout");
    let key = LAYOUT_ATTRIBUTE.try_into().map_err(|_| failed(&"attribute key"))?;
    let value = topic.layout.hash().as_str().try_into().map_err(|_| failed(&"attribute value"))?;
    Ok((key, value))
}

fn builder<P: IceoryxSend + Debug + ?Sized>(
    node: &Node<Shared>,
    topic: &TopicPlan,
) -> Result<Builder<P, Stamp, Shared>, PortError> {
    let service = node.service_builder(&service_name("topic", &topic.name)?);
    Ok(service.publish_subscribe::<P>().user_header::<Stamp>())
}

/// As [`builder`], of a type that is described by the plan alone.
fn bytes_builder(node: &Node<Shared>, topic: &TopicPlan) -> Result<Builder<Bytes, Stamp, Shared>, PortError> {
    let variant = match topic.pattern {
        TopicPattern::State | TopicPattern::Stream { .. } => TypeVariant::FixedSize,
        TopicPattern::Slices { .. } => TypeVariant::Dynamic,
    };
    let TypeLayout { type_name, size, alignment, .. } = &topic.layout;
    let detail = TypeDetail::__internal_new_from_parts(variant, type_name, *size, *alignment)
        .map_err(|error| refused(&topic.name, "describing its type")(&format!("{error:?}")))?;
    // SAFETY: the detail describes a `StateBuffer`: `repr(C)`, fixed size, the alignment it was declared with. iceoryx2
    // compares it with that of a service that is there.
    Ok(unsafe { builder(node, topic)?.__internal_set_payload_type_details(&detail) })
}

/// Checks that the topic's layout is the one this program was built with.
pub(crate) fn same_layout<T: StateBuffer>(topic: &TopicPlan, port: &str) -> Result<(), PortError> {
    fits(&T::layout(), topic, port)
}

/// Checks that the topic's layout is that of a port.
pub(super) fn fits(mine: &TypeLayout, topic: &TopicPlan, port: &str) -> Result<(), PortError> {
    if mine.hash() == topic.layout.hash() {
        return Ok(());
    }
    Err(PortError::Layout {
        topic: topic.name.clone(),
        port: port.to_string(),
        difference: mine.difference("this program", &topic.layout, "the topic"),
    })
}

/// Opens the iceoryx2 service of a topic for values of a type whose layout fits.
pub(super) fn open<T: StateBuffer>(
    participant: &Participant,
    topic: &TopicPlan,
) -> Result<Samples<T>, PortError> {
    let builder = builder::<T>(participant.node(), topic)?;
    builder.open_with_attributes(&required(topic)?).map_err(|error| refused(&topic.name, "opening")(&error))
}

/// As [`open`], for slices.
pub(super) fn open_slices<T: StateBuffer>(
    participant: &Participant,
    topic: &TopicPlan,
) -> Result<Samples<[T]>, PortError> {
    let builder = builder::<[T]>(participant.node(), topic)?;
    builder.open_with_attributes(&required(topic)?).map_err(|error| refused(&topic.name, "opening")(&error))
}

/// As [`open`], for bytes in the layout of the plan.
pub(super) fn open_bytes(node: &Node<Shared>, topic: &TopicPlan) -> Result<Samples<Bytes>, PortError> {
    let builder = bytes_builder(node, topic)?;
    builder.open_with_attributes(&required(topic)?).map_err(|error| refused(&topic.name, "opening")(&error))
}

/// The attribute that the service of a topic must have.
fn required(topic: &TopicPlan) -> Result<AttributeVerifier, PortError> {
    let (key, value) = layout_attribute(topic)?;
    AttributeVerifier::new()
        .require(&key, &value)
        .map_err(|error| refused(&topic.name, "describing its layout")(&error))
}
