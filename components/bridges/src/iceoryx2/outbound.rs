//! A topic of the graph, mirrored to foreign programs.

use iceoryx2::node::Node;
use motorium::component::ConfigureError;
use motorium::raw::RawInput;
use motorium::telemetry::set_apart;
use motorium::transport::Shared;
use serde_json::{Value, json};

use super::service::{OutboundPort, publish, send};

/// A mirrored topic. Its newest value is sent once, at the first step that sees it.
pub(super) struct Outbound {
    input: RawInput,
    port: OutboundPort,
    mirrored: u64,
    unsent: u64,
}

impl Outbound {
    pub(super) fn new(node: &Node<Shared>, input: RawInput) -> Result<Self, ConfigureError> {
        let (Some(topic), Some(layout)) = (input.topic(), input.layout()) else {
            return Err(ConfigureError::failed("an input of `out` is not wired"));
        };
        let port = publish(node, topic, layout)?;
        Ok(Self { input, port, mirrored: 0, unsent: 0 })
    }

    pub(super) fn step(&mut self) {
        let Some(value) = self.input.next_unread() else { return };
        // iceoryx2 allocates when a subscriber connects or disconnects
        if set_apart(|| send(&self.port, value.stamp, value.bytes)) {
            self.mirrored += 1;
        } else {
            self.unsent += 1;
        }
    }

    pub(super) fn result(&self) -> (String, Value) {
        let topic = self.input.topic().unwrap_or_default().to_string();
        (topic, json!({ "mirrored": self.mirrored, "unsent": self.unsent }))
    }
}
