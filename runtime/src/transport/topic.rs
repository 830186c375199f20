//! Topics as iceoryx2 services.

#![allow(unsafe_code)] // services are made from layouts, so that the launcher need not know the Rust types

use std::path::Path;
use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2::prelude::{AttributeSpecifier, AttributeVerifier, ServiceName};
use iceoryx2::service::marker::CustomPayloadMarker;
use iceoryx2::service::port_factory::publish_subscribe;
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable as _;

use super::latest::{SIDE_PINS, TopicMemory};
use super::{Context, SHARED_MEMORY, Shared, Trigger};
use crate::declare::TopicPattern;
use crate::os::with_shortage;
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
    #[error("topic `{topic}`: {action} failed: {reason}")]
    Refused {
        /// The topic.
        topic: String,
        /// The operation that failed.
        action: &'static str,
        /// The error of iceoryx2.
        reason: String,
    },
}

pub(super) fn refused(
    topic: &str,
    action: &'static str,
) -> impl Fn(&dyn core::fmt::Display) -> PortError + use<> {
    let topic = topic.to_string();
    move |reason| {
        let reason = with_shortage(reason.to_string(), Path::new(SHARED_MEMORY));
        PortError::Refused { topic: topic.clone(), action, reason }
    }
}

pub(super) fn service_name(kind: &str, name: &str) -> Result<ServiceName, PortError> {
    ServiceName::new(&format!("{kind}/{name}"))
        .map_err(|error| refused(name, "naming the service")(&format!("{error:?}")))
}

/// The services of one topic, held by the launcher so that they outlive every component.
#[derive(Debug)]
pub(crate) struct TopicService {
    samples: publish_subscribe::PortFactory<Shared, [CustomPayloadMarker], Stamp>,
    memory: Rc<TopicMemory>,
    wakes: bool,
}

impl TopicService {
    /// Makes the services of a topic with the exact limits the plan implies.
    pub(crate) fn create(node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let name = &topic.name;
        let layout = &topic.layout;
        let variant = match topic.pattern {
            TopicPattern::State | TopicPattern::Stream { .. } => TypeVariant::FixedSize,
            TopicPattern::Slices { .. } => TypeVariant::Dynamic,
        };
        let detail = type_detail(name, layout, variant)?;
        let attributes = layout_attribute(name, layout)?;
        let depth = match topic.pattern {
            TopicPattern::State => 1,
            TopicPattern::Stream { capacity } | TopicPattern::Slices { capacity, .. } => capacity,
        };
        let parties = topic.readers.len() + SIDE_PINS;
        let builder = node
            .service_builder(&service_name("topic", name)?)
            .publish_subscribe::<[CustomPayloadMarker]>()
            .user_header::<Stamp>();
        // SAFETY: the detail describes a `StateBuffer`: `repr(C)`, fixed size, the alignment it was declared with.
        let builder = unsafe { builder.__internal_set_payload_type_details(&detail) };
        let samples = builder
            .subscriber_max_buffer_size(depth)
            .subscriber_max_borrowed_samples(2)
            .history_size(1)
            .enable_safe_overflow(true)
            // spare ones: a killed publisher holds its place until it is cleaned up
            .max_publishers(4)
            .max_subscribers(2 * parties)
            .max_nodes(2 * parties + 4)
            .create_with_attributes(&attributes)
            .map_err(|error| refused(name, "creating")(&error))?;
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

/// The type of a topic as iceoryx2 describes it.
pub(super) fn type_detail(
    topic: &str,
    layout: &TypeLayout,
    variant: TypeVariant,
) -> Result<TypeDetail, PortError> {
    TypeDetail::__internal_new_from_parts(variant, &layout.type_name, layout.size, layout.alignment)
        .map_err(|error| refused(topic, "describing its type")(&format!("{error:?}")))
}

fn layout_attribute(topic: &str, layout: &TypeLayout) -> Result<AttributeSpecifier, PortError> {
    let bad = refused(topic, "describing its layout");
    let key = LAYOUT_ATTRIBUTE.try_into().map_err(|_| bad(&"attribute key"))?;
    let value = layout.hash().as_str().try_into().map_err(|_| bad(&"attribute value"))?;
    AttributeSpecifier::new().define(&key, &value).map_err(|error| bad(&error))
}

type Samples<T> = publish_subscribe::PortFactory<Shared, T, Stamp>;

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

/// Opens the iceoryx2 service of a stream of slices as a component.
pub(super) fn open_slices<T: StateBuffer>(
    node: &Node<Shared>,
    topic: &TopicPlan,
    port: &str,
) -> Result<Samples<[T]>, PortError> {
    same_layout::<T>(topic, port)?;
    node.service_builder(&service_name("topic", &topic.name)?)
        .publish_subscribe::<[T]>()
        .user_header::<Stamp>()
        .open_with_attributes(&layout_required(topic, &T::layout())?)
        .map_err(|error| refused(&topic.name, "opening")(&error))
}

/// The attribute that a topic's service must have.
fn layout_required(topic: &TopicPlan, layout: &TypeLayout) -> Result<AttributeVerifier, PortError> {
    let bad = refused(&topic.name, "opening");
    let key = LAYOUT_ATTRIBUTE.try_into().map_err(|_| bad(&"attribute key"))?;
    let value = layout.hash().as_str().try_into().map_err(|_| bad(&"attribute value"))?;
    AttributeVerifier::new().require(&key, &value).map_err(|error| bad(&error))
}

/// Opens the iceoryx2 service of a stream as a component.
pub(super) fn open<T: StateBuffer>(
    node: &Node<Shared>,
    topic: &TopicPlan,
    port: &str,
) -> Result<Samples<T>, PortError> {
    same_layout::<T>(topic, port)?;
    node.service_builder(&service_name("topic", &topic.name)?)
        .publish_subscribe::<T>()
        .user_header::<Stamp>()
        .open_with_attributes(&layout_required(topic, &T::layout())?)
        .map_err(|error| refused(&topic.name, "opening")(&error))
}

/// The waiting side of a topic's wake-up.
pub(crate) fn open_trigger(
    node: &Node<Shared>,
    topic: &TopicPlan,
    context: &Context,
) -> Result<Trigger, PortError> {
    context.memory(node, topic).map(|memory| Trigger::new(memory, context.restart_count()))
}
