//! The sending end of an inbound topic, for programs that know only a layout, such as `motorium topic pub`.

#![allow(unsafe_code)] // the service carries a layout, not a Rust type

use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::{AttributeVerifier, ServiceName};
use iceoryx2::service::marker::{CustomHeaderMarker, CustomPayloadMarker};
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};
use motorium::state::TypeLayout;
use motorium::transport::{Domain, Shared};

use super::service::detail;

/// A publisher of the service `in/TOPIC`, from which a bridge reads the values of a topic.
///
/// It never creates the service: without a running bridge there is no topic to feed.
#[derive(Debug)]
pub struct Feed {
    port: Publisher<Shared, [CustomPayloadMarker], CustomHeaderMarker>,
    size: usize,
    // the node outlives its port
    _node: Node<Shared>,
}

/// A topic that cannot be fed.
#[derive(Debug, thiserror::Error)]
#[error("service `{service}`: {reason}")]
pub struct FeedError {
    /// The service.
    pub service: String,
    /// Cause.
    pub reason: String,
}

impl Feed {
    /// Joins the service of an inbound topic in the domain of a run.
    ///
    /// # Errors
    /// No bridge has created the service, its layout differs, or the maximum number of publishers is reached.
    pub fn open(domain: &Domain, topic: &str, layout: &TypeLayout) -> Result<Self, FeedError> {
        let service = format!("in/{topic}");
        let fail = |reason: String| FeedError { service: service.clone(), reason };
        let node = domain.node().map_err(|error| fail(error.to_string()))?;
        let name = ServiceName::new(&service).map_err(|error| fail(format!("{error:?}")))?;
        let builder = node
            .service_builder(&name)
            .publish_subscribe::<[CustomPayloadMarker]>()
            .user_header::<CustomHeaderMarker>();
        let detail = detail(layout).map_err(|error| fail(format!("{error:?}")))?;
        let no_header = TypeDetail::new::<()>(TypeVariant::FixedSize);
        // SAFETY: the details describe a `repr(C)` type of fixed size and no header; iceoryx2 compares them
        // with the service's.
        let builder = unsafe {
            builder
                .__internal_set_payload_type_details(&detail)
                .__internal_set_user_header_type_details(&no_header)
        };
        let key = "layout".try_into().map_err(|_| fail("attribute key".to_string()))?;
        let value = layout.hash().as_str().try_into().map_err(|_| fail("attribute value".to_string()))?;
        let layouts = AttributeVerifier::new().require(&key, &value);
        let layouts = layouts.map_err(|error| fail(format!("{error:?}")))?;
        let opened = builder.open_with_attributes(&layouts).map_err(|error| fail(format!("{error:?}")))?;
        let port = opened.publisher_builder().max_loaned_samples(1).create();
        let port = port.map_err(|error| fail(format!("{error:?}")))?;
        Ok(Self { port, size: layout.size, _node: node })
    }

    /// Sends a value to the bridge, which validates it and publishes it at its next step.
    ///
    /// # Errors
    /// The size differs from the type's, or shared memory is exhausted.
    pub fn send(&self, bytes: &[u8]) -> Result<(), FeedError> {
        let fail = |reason: String| FeedError { service: "in".to_string(), reason };
        if bytes.len() != self.size {
            return Err(fail(format!("{} bytes, expected {}", bytes.len(), self.size)));
        }
        // SAFETY: the service was made for one value of fixed size.
        let mut sample =
            unsafe { self.port.loan_custom_payload(1) }.map_err(|error| fail(format!("{error:?}")))?;
        let payload = sample.payload_mut().as_mut_ptr().cast::<u8>();
        // SAFETY: the payload has the size of the layout, which `bytes` has; all of it is filled.
        let sample = unsafe {
            payload.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len());
            sample.assume_init()
        };
        sample.send().map(drop).map_err(|error| fail(format!("{error:?}")))
    }
}
