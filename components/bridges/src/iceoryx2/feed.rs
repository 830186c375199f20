//! Publisher for inbound topics. It serves programs that know only the layout of a topic, such as
//! `motorium topic pub`.

use core::cell::Cell;

use iceoryx2::node::Node;
use motorium::declare::TopicPattern;
use motorium::plan::TopicPlan;
use motorium::state::Stamp;
use motorium::transport::{Domain, Shared};

use super::service::{Sender, Service, ServiceError, send};

/// Publisher on the service `in/TOPIC`, from which a bridge reads the values of a topic.
///
/// A feed never creates the service, so it requires a running bridge.
#[derive(Debug)]
pub struct Feed {
    port: Sender,
    service: String,
    size: usize,
    pattern: TopicPattern,
    /// Number of values sent on a stream.
    sent: Cell<u64>,
    // the node outlives its port
    _node: Node<Shared>,
}

impl Feed {
    /// Opens the service of an inbound topic in the iceoryx2 domain of a run.
    ///
    /// # Errors
    /// Returns an error if the topic carries slices, no bridge has created the service, its layout differs,
    /// or the maximum number of publishers is reached.
    pub fn open(domain: &Domain, topic: &TopicPlan) -> Result<Self, ServiceError> {
        let service = format!("in/{}", topic.name);
        let fail = |reason: String| ServiceError { service: service.clone(), reason };
        if let TopicPattern::Slices { .. } = topic.pattern {
            return Err(fail("the topic carries slices, expected single values".to_string()));
        }
        let node = domain.node().map_err(|error| fail(error.to_string()))?;
        let port = Service::feeding(&topic.name, &topic.layout, topic.pattern).feed(&node)?;
        let (size, pattern) = (topic.layout.size, topic.pattern);
        Ok(Self { port, service, size, pattern, sent: Cell::new(0), _node: node })
    }

    /// Sends a value to the bridge, which validates it and publishes it at its next step.
    ///
    /// # Errors
    /// Returns an error if the number of bytes differs from the size of the type, or if shared memory is
    /// exhausted.
    pub fn send(&self, bytes: &[u8]) -> Result<(), ServiceError> {
        let fail = |reason: String| Err(ServiceError { service: self.service.clone(), reason });
        if bytes.len() != self.size {
            return fail(format!("{} bytes, expected {}", bytes.len(), self.size));
        }
        let stamp = Stamp { sequence: self.sent.get() + 1, ..Stamp::default() };
        let stamp = (self.pattern != TopicPattern::State).then_some(&stamp);
        if !send(&self.port, stamp, bytes, 1) {
            return fail("the value was not sent, probably because shared memory is exhausted".to_string());
        }
        self.sent.set(self.sent.get() + 1);
        Ok(())
    }
}
