//! The iceoryx2 services of topics.

#![allow(unsafe_code)] // services are created from layouts, so that the launcher need not know the Rust types

use iceoryx2::node::Node;
use iceoryx2::prelude::AttributeVerifier;
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::publish_subscribe;
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};

use super::sample::{Bytes, Header, Queue, Sender};
use crate::declare::TopicPattern;
use crate::domain::{Shared, service_name};
use crate::plan::TopicPlan;
use crate::state::{Stamp, TypeLayout};
use crate::transport::error::{PortError, refused};

const LAYOUT_ATTRIBUTE: &str = "layout";

/// The iceoryx2 service of a topic.
pub(in crate::transport) type Samples = publish_subscribe::PortFactory<Shared, Bytes, Header>;

/// Returns the attribute of a topic's service that names the layout of its values.
pub(in crate::transport) fn layout_attribute(
    topic: &TopicPlan,
) -> Result<(AttributeKey, AttributeValue), PortError> {
    let failed = refused(&topic.name, "describing its layout");
    let key = LAYOUT_ATTRIBUTE.try_into().map_err(|_| failed(&"attribute key"))?;
    let value = topic.layout.hash().as_str().try_into().map_err(|_| failed(&"attribute value"))?;
    Ok((key, value))
}

/// Returns the builder of a topic's service, with types described by the plan.
pub(in crate::transport) fn builder(
    node: &Node<Shared>,
    topic: &TopicPlan,
) -> Result<Builder<Bytes, Header, Shared>, PortError> {
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
    // `Stamp`. iceoryx2 compares them with an existing service's.
    Ok(unsafe {
        builder.__internal_set_payload_type_details(&payload).__internal_set_user_header_type_details(&stamp)
    })
}

/// Opens the service of a topic, which the launcher has created.
fn open(node: &Node<Shared>, topic: &TopicPlan) -> Result<Samples, PortError> {
    builder(node, topic)?
        .open_with_attributes(&required(topic)?)
        .map_err(|error| refused(&topic.name, "opening")(&error))
}

/// Opens a queue of a topic's samples.
pub(crate) fn open_queue(node: &Node<Shared>, topic: &TopicPlan) -> Result<Queue, PortError> {
    let queue = open(node, topic)?.subscriber_builder().create();
    queue.map_err(|error| refused(&topic.name, "creating a subscriber")(&error))
}

/// Opens the sender of a topic's samples, with at most `longest` elements per sample.
pub(super) fn open_sender(
    node: &Node<Shared>,
    topic: &TopicPlan,
    longest: usize,
) -> Result<Sender, PortError> {
    let service = open(node, topic)?;
    let sender = service.publisher_builder().max_loaned_samples(1).initial_max_slice_len(longest).create();
    sender.map_err(|error| refused(&topic.name, "creating a publisher")(&error))
}

/// Returns the attribute that the service of a topic must have.
fn required(topic: &TopicPlan) -> Result<AttributeVerifier, PortError> {
    let (key, value) = layout_attribute(topic)?;
    AttributeVerifier::new()
        .require(&key, &value)
        .map_err(|error| refused(&topic.name, "describing its layout")(&error))
}
