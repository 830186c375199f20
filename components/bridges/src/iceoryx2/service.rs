//! The iceoryx2 services shared by the bridge and foreign programs.

#![allow(unsafe_code)] // services are created from layouts: the bridge does not know the Rust types

use iceoryx2::identifiers::UniquePublisherId;
use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AttributeVerifier, ServiceName};
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::marker::{CustomHeaderMarker, CustomPayloadMarker};
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};
use motorium::component::ConfigureError;
use motorium::declare::TopicPattern;
use motorium::state::{EmergencyStop, Stamp, StateBuffer as _, TypeLayout};
use motorium::transport::Shared;

/// Maximum number of waiting values per foreign publisher of a state; the oldest are dropped.
const WAITING: usize = 8;
/// Queue length for emergency stops, which must not be lost.
const STOPS_WAITING: usize = 64;
/// Maximum number of publishers of a service: one, plus the slot of a publisher that was killed.
pub(super) const PUBLISHERS: usize = 2;
/// Maximum number of foreign subscribers of a mirrored topic.
const SUBSCRIBERS: usize = 8;

/// Writing end of a service.
pub(super) type Sender = Publisher<Shared, [CustomPayloadMarker], CustomHeaderMarker>;
/// Reading end of a service.
pub(super) type Queue = Subscriber<Shared, [CustomPayloadMarker], CustomHeaderMarker>;
type Typed = Builder<[CustomPayloadMarker], CustomHeaderMarker, Shared>;

/// A service cannot be created, opened or used.
#[derive(Debug, thiserror::Error)]
#[error("service `{service}`: {reason}")]
pub struct ServiceError {
    /// Name of the service.
    pub service: String,
    /// Cause of the failure.
    pub reason: String,
}

impl From<ServiceError> for ConfigureError {
    fn from(error: ServiceError) -> Self {
        let ServiceError { service, reason } = error;
        Self::failed(format!("service `{service}` cannot be created: {reason}"))
    }
}

/// A service that carries the values of one topic.
#[derive(Debug, Clone)]
pub(super) struct Service<'a> {
    name: String,
    layout: &'a TypeLayout,
    pattern: TopicPattern,
    is_stamped: bool,
}

impl<'a> Service<'a> {
    /// Returns the service `out/TOPIC` of a mirrored topic. Each value has the publisher's stamp as its
    /// header.
    pub(super) fn mirroring(topic: &str, layout: &'a TypeLayout, pattern: TopicPattern) -> Self {
        Self { name: format!("out/{topic}"), layout, pattern, is_stamped: true }
    }

    /// Returns the service `in/TOPIC` of a topic that foreign programs feed. Values of streams and slices
    /// have a stamp as their header, with the program's sequence number.
    pub(super) fn feeding(topic: &str, layout: &'a TypeLayout, pattern: TopicPattern) -> Self {
        let is_stamped = pattern != TopicPattern::State;
        Self { name: format!("in/{topic}"), layout, pattern, is_stamped }
    }

    /// Maximum number of waiting values per foreign publisher.
    pub(super) fn waiting(&self) -> usize {
        match self.pattern.capacity() {
            Some(capacity) => capacity,
            None if self.layout.type_name == EmergencyStop::NAME => STOPS_WAITING,
            None => WAITING,
        }
    }

    /// Creates the service, or joins it after a restart, as its publisher.
    pub(super) fn publish(&self, node: &Node<Shared>) -> Result<Sender, ServiceError> {
        let (depth, history) = match self.pattern.capacity() {
            Some(capacity) => (capacity, 0),
            // a program that joins late receives the latest value
            None => (1, 1),
        };
        let service = self
            .builder(node)?
            .subscriber_max_buffer_size(depth)
            .subscriber_max_borrowed_samples(2)
            .history_size(history)
            .enable_safe_overflow(true)
            .max_publishers(PUBLISHERS)
            .max_subscribers(SUBSCRIBERS)
            .max_nodes(SUBSCRIBERS + PUBLISHERS + 2)
            .open_or_create_with_attributes(&self.attributes()?)
            .map_err(|error| self.failed(&error))?;
        let longest = if let TopicPattern::Slices { longest, .. } = self.pattern { longest } else { 1 };
        let sender = service.publisher_builder().max_loaned_samples(1).initial_max_slice_len(longest);
        sender.create().map_err(|error| self.failed(&error))
    }

    /// Creates the service, or joins it after a restart, as its subscriber.
    pub(super) fn subscribe(&self, node: &Node<Shared>) -> Result<Queue, ServiceError> {
        self.builder(node)?
            .subscriber_max_buffer_size(self.waiting())
            .subscriber_max_borrowed_samples(2)
            .history_size(0)
            .enable_safe_overflow(true)
            .max_publishers(PUBLISHERS)
            .max_subscribers(2)
            .max_nodes(PUBLISHERS + 4)
            .open_or_create_with_attributes(&self.attributes()?)
            .map_err(|error| self.failed(&error))?
            .subscriber_builder()
            .create()
            .map_err(|error| self.failed(&error))
    }

    /// Joins the service as a publisher, if a bridge has created it.
    pub(super) fn feed(&self, node: &Node<Shared>) -> Result<Sender, ServiceError> {
        let service = self.builder(node)?.open_with_attributes(&self.attributes()?);
        let service = service.map_err(|error| self.failed(&error))?;
        let sender = service.publisher_builder().max_loaned_samples(1).create();
        sender.map_err(|error| self.failed(&error))
    }

    /// Builder of the service with its types, without limits.
    fn builder(&self, node: &Node<Shared>) -> Result<Typed, ServiceError> {
        let name = ServiceName::new(&self.name).map_err(|error| self.failed(&error))?;
        let variant = match self.pattern {
            TopicPattern::State | TopicPattern::Stream { .. } => TypeVariant::FixedSize,
            TopicPattern::Slices { .. } => TypeVariant::Dynamic,
        };
        let detail = |variant, layout: &TypeLayout| {
            let TypeLayout { type_name, size, alignment, .. } = layout;
            TypeDetail::__internal_new_from_parts(variant, type_name, *size, *alignment)
                .map_err(|error| self.failed(&error))
        };
        let payload = detail(variant, self.layout)?;
        let header = match self.is_stamped {
            true => detail(TypeVariant::FixedSize, &Stamp::layout())?,
            false => TypeDetail::new::<()>(TypeVariant::FixedSize),
        };
        let builder = node.service_builder(&name).publish_subscribe::<[CustomPayloadMarker]>();
        // SAFETY: the details describe `repr(C)` types of fixed size with their alignments, or no header.
        // iceoryx2 compares them with the details of an existing service.
        Ok(unsafe {
            builder
                .user_header::<CustomHeaderMarker>()
                .__internal_set_payload_type_details(&payload)
                .__internal_set_user_header_type_details(&header)
        })
    }

    /// Required attribute of the service: the hash of its layout.
    fn attributes(&self) -> Result<AttributeVerifier, ServiceError> {
        let key = "layout".try_into().map_err(|_| self.failed(&"attribute key"))?;
        let value = self.layout.hash().as_str().try_into().map_err(|_| self.failed(&"attribute value"))?;
        AttributeVerifier::new().require(&key, &value).map_err(|error| self.failed(&error))
    }

    fn failed(&self, error: &dyn core::fmt::Debug) -> ServiceError {
        ServiceError { service: self.name.clone(), reason: format!("{error:?}") }
    }
}

/// Sends `count` elements, and their stamp if the service has a header; returns `false` on failure.
pub(super) fn send(port: &Sender, stamp: Option<&Stamp>, bytes: &[u8], count: usize) -> bool {
    // SAFETY: the count is 1 unless the service was made for slices.
    let Ok(mut sample) = (unsafe { port.loan_custom_payload(count) }) else { return false };
    let header = (&raw mut *sample.user_header_mut()).cast::<Stamp>();
    let payload = sample.payload_mut();
    if payload.len() != bytes.len() {
        return false;
    }
    let payload = payload.as_mut_ptr().cast::<u8>();
    // SAFETY: a service with a header was created with `Stamp`, and the payload has the length of `bytes`.
    // The sample is loaned to this call only and is filled completely.
    let sample = unsafe {
        if let Some(stamp) = stamp {
            header.write(*stamp);
        }
        payload.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len());
        sample.assume_init()
    };
    sample.send().is_ok()
}

/// Value sent by a foreign program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Arrived {
    /// Number of bytes sent; only as many as fit were copied.
    pub(super) length: usize,
    /// The publisher.
    pub(super) publisher: UniquePublisherId,
    /// Sequence number assigned by the program in the header; 0 without a header.
    pub(super) sequence: u64,
}

/// Copies the next value into `value`. Returns `None` if there is no value.
///
/// A foreign program may still write to the memory of a sent value, so only the copy is inspected.
pub(super) fn receive(port: &Queue, has_header: bool, value: &mut [u8]) -> Option<Arrived> {
    // An error means that connecting to a starting or dying publisher failed.
    let sample = port.receive().ok().flatten()?;
    let payload = sample.payload();
    let (length, payload) = (payload.len(), payload.as_ptr().cast::<u8>());
    let header =
        core::ptr::with_exposed_provenance::<Stamp>(core::ptr::from_ref(sample.user_header()).addr());
    // SAFETY: a service with a header was created with `Stamp`; iceoryx2 keeps the sample mapped while it is
    // borrowed, and at most its length is copied.
    let sequence = unsafe {
        value.as_mut_ptr().copy_from_nonoverlapping(payload, length.min(value.len()));
        if has_header { (&raw const (*header).sequence).read() } else { 0 }
    };
    Some(Arrived { length, publisher: sample.origin(), sequence })
}
