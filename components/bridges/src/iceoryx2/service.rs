//! The iceoryx2 services in which the bridge meets foreign programs.

#![allow(unsafe_code)] // services are made from layouts, so that the bridge need not know the Rust types

use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AttributeVerifier, ServiceName};
use iceoryx2::service::marker::{CustomHeaderMarker, CustomPayloadMarker};
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};
use motorium::component::ConfigureError;
use motorium::state::{EmergencyStop, Stamp, StateBuffer as _, TypeLayout};
use motorium::transport::Shared;

/// Values of each foreign publisher that wait for the bridge at most; the oldest are dropped.
const WAITING: usize = 8;
/// Queue length for an emergency stop, which must not be lost.
const STOPS_WAITING: usize = 64;
/// Maximum number of publishers of a service: one, and the slot of a killed one.
pub(super) const PUBLISHERS: usize = 2;
/// Foreign subscribers of a mirrored topic.
const SUBSCRIBERS: usize = 8;

/// Values of each foreign publisher of a type that wait for the bridge at most.
pub(super) fn waiting(layout: &TypeLayout) -> usize {
    if layout.type_name == EmergencyStop::NAME { STOPS_WAITING } else { WAITING }
}

pub(super) type OutboundPort = Publisher<Shared, [CustomPayloadMarker], CustomHeaderMarker>;
pub(super) type InboundPort = Subscriber<Shared, [CustomPayloadMarker], ()>;

/// The publisher of a service for foreign subscribers.
pub(super) fn publish(
    node: &Node<Shared>,
    topic: &str,
    layout: &TypeLayout,
) -> Result<OutboundPort, ConfigureError> {
    let service = format!("out/{topic}");
    let fail = |error: &dyn core::fmt::Debug| failed(&service, error);
    let builder = node
        .service_builder(&name(&service)?)
        .publish_subscribe::<[CustomPayloadMarker]>()
        .user_header::<CustomHeaderMarker>();
    // SAFETY: both details describe `repr(C)` types of fixed size and their alignment.
    let builder = unsafe {
        builder
            .__internal_set_payload_type_details(&detail(layout).map_err(|e| fail(&e))?)
            .__internal_set_user_header_type_details(&detail(&Stamp::layout()).map_err(|e| fail(&e))?)
    };
    builder
        .subscriber_max_buffer_size(1)
        .subscriber_max_borrowed_samples(2)
        .history_size(1)
        .enable_safe_overflow(true)
        .max_publishers(PUBLISHERS)
        .max_subscribers(SUBSCRIBERS)
        .max_nodes(SUBSCRIBERS + PUBLISHERS + 2)
        .open_or_create_with_attributes(&attributes(&service, layout)?)
        .map_err(|error| fail(&error))?
        .publisher_builder()
        .max_loaned_samples(1)
        .create()
        .map_err(|error| fail(&error))
}

/// The subscriber of a service for foreign publishers.
pub(super) fn subscribe(
    node: &Node<Shared>,
    topic: &str,
    layout: &TypeLayout,
) -> Result<InboundPort, ConfigureError> {
    let service = format!("in/{topic}");
    let fail = |error: &dyn core::fmt::Debug| failed(&service, error);
    let builder = node.service_builder(&name(&service)?).publish_subscribe::<[CustomPayloadMarker]>();
    // SAFETY: the detail describes a `repr(C)` type of fixed size and its alignment.
    let builder =
        unsafe { builder.__internal_set_payload_type_details(&detail(layout).map_err(|e| fail(&e))?) };
    builder
        .subscriber_max_buffer_size(waiting(layout))
        .subscriber_max_borrowed_samples(2)
        .history_size(0)
        .enable_safe_overflow(true)
        .max_publishers(PUBLISHERS)
        .max_subscribers(2)
        .max_nodes(PUBLISHERS + 4)
        .open_or_create_with_attributes(&attributes(&service, layout)?)
        .map_err(|error| fail(&error))?
        .subscriber_builder()
        .create()
        .map_err(|error| fail(&error))
}

/// Sends a value and its stamp; returns `false` on failure.
pub(super) fn send(port: &OutboundPort, stamp: &Stamp, bytes: &[u8]) -> bool {
    // SAFETY: the service was made for one value of fixed size.
    let Ok(mut sample) = (unsafe { port.loan_custom_payload(1) }) else { return false };
    let header = (&raw mut *sample.user_header_mut()).cast::<Stamp>();
    let payload = sample.payload_mut().as_mut_ptr().cast::<u8>();
    // SAFETY: the service was created with `Stamp` as user header and a payload with the layout of `bytes`.
    // The sample is loaned to this call only and is filled completely.
    let sample = unsafe {
        header.write(*stamp);
        payload.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len());
        sample.assume_init()
    };
    sample.send().is_ok()
}

/// Copies the next value into `value`, which has the size of the service's type; returns `false` if there is
/// none.
///
/// A foreign program may still write to the memory of a sent value, so only the copy is inspected.
pub(super) fn receive(port: &InboundPort, value: &mut [u8]) -> bool {
    // An error means that the connection to a starting or dying publisher failed.
    let Some(sample) = port.receive().ok().flatten() else { return false };
    let payload = sample.payload().as_ptr().cast::<u8>();
    // SAFETY: the service was created for one value of the size of `value`; iceoryx2 keeps the sample mapped
    // while it is held.
    unsafe { value.as_mut_ptr().copy_from_nonoverlapping(payload, value.len()) };
    true
}

fn name(service: &str) -> Result<ServiceName, ConfigureError> {
    ServiceName::new(service).map_err(|error| failed(service, &error))
}

pub(super) fn detail(layout: &TypeLayout) -> Result<TypeDetail, impl core::fmt::Debug + use<>> {
    TypeDetail::__internal_new_from_parts(
        TypeVariant::FixedSize,
        &layout.type_name,
        layout.size,
        layout.alignment,
    )
}

fn attributes(service: &str, layout: &TypeLayout) -> Result<AttributeVerifier, ConfigureError> {
    let key = "layout".try_into().map_err(|_| failed(service, &"attribute key"))?;
    let value = layout.hash().as_str().try_into().map_err(|_| failed(service, &"attribute value"))?;
    AttributeVerifier::new().require(&key, &value).map_err(|error| failed(service, &error))
}

fn failed(service: &str, error: &dyn core::fmt::Debug) -> ConfigureError {
    ConfigureError::failed(format!("service `{service}` could not be made: {error:?}"))
}
