//! Looking on at a topic from outside, knowing only its layout.

#![allow(unsafe_code)] // samples are read as bytes, by a type described at run time

use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::service::marker::CustomPayloadMarker;
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};

use super::topic::{refused, service_name};
use super::{Domain, PortError, Shared};
use crate::plan::TopicPlan;
use crate::state::{Stamp, TypeLayout};

/// Reads a topic of a running graph without being part of it. The graph keeps places free for observers, and no
/// component ever waits for one.
#[derive(Debug)]
pub struct Observer {
    layout: TypeLayout,
    subscriber: Subscriber<Shared, [CustomPayloadMarker], Stamp>,
    _node: Node<Shared>,
}

/// A sample as an observer sees it: a copy.
#[derive(Debug, Clone)]
pub struct Observed {
    /// When and by whom it was made.
    pub stamp: Stamp,
    /// Its bytes, in the layout of the topic.
    pub bytes: Vec<u8>,
}

impl Observer {
    /// Joins a topic.
    ///
    /// # Errors
    /// The run or the topic cannot be reached, or all places for observers are taken.
    pub fn open(domain: &Domain, topic: &TopicPlan) -> Result<Self, PortError> {
        let name = &topic.name;
        let node = domain.node().map_err(|error| refused(name, "joining the run")(&error))?;
        let layout = topic.layout.clone();
        let detail = TypeDetail::__internal_new_from_parts(
            TypeVariant::FixedSize,
            &layout.type_name,
            layout.size,
            layout.alignment,
        )
        .map_err(|error| refused(name, "describing its type")(&format!("{error:?}")))?;
        let builder = node
            .service_builder(&service_name("topic", name)?)
            .publish_subscribe::<[CustomPayloadMarker]>()
            .user_header::<Stamp>();
        // SAFETY: the detail is that of the topic's own plan; iceoryx2 compares it with the service's.
        let builder = unsafe { builder.__internal_set_payload_type_details(&detail) };
        let subscriber = builder
            .open()
            .map_err(|error| refused(name, "opening")(&error))?
            .subscriber_builder()
            .create()
            .map_err(|error| refused(name, "making a subscriber")(&error))?;
        Ok(Self { layout, subscriber, _node: node })
    }

    /// The layout of the topic's samples.
    pub fn layout(&self) -> &TypeLayout {
        &self.layout
    }

    /// The next unread sample.
    pub fn next_unread(&self) -> Option<Observed> {
        let sample = self.subscriber.receive().ok().flatten()?;
        // SAFETY: the payload of a fixed-size custom sample is one value of `layout.size` bytes; it is held while
        // the bytes are copied.
        let bytes = unsafe {
            core::slice::from_raw_parts(sample.payload().as_ptr().cast::<u8>(), self.layout.size).to_vec()
        };
        Some(Observed { stamp: *sample.user_header(), bytes })
    }
}
