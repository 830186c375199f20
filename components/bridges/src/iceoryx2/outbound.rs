//! A topic of the graph mirrored to foreign programs.

use iceoryx2::node::Node;
use motorium::component::ConfigureError;
use motorium::declare::TopicPattern;
use motorium::raw::{RawInput, RawStreamInput};
use motorium::state::Stamp;
use motorium::telemetry::set_apart;
use motorium::transport::Shared;
use serde_json::{Value, json};

use super::service::{Sender, Service, send};

/// A mirrored topic.
pub(super) struct Outbound {
    source: Source,
    port: Sender,
    mirrored: u64,
    unsent: u64,
}

/// The input of a mirrored topic.
enum Source {
    /// The latest value, sent once by the first step that reads it.
    Newest(RawInput),
    /// All values of a stream, or all slices, sent in order. At most `most` are sent per step, so a fast
    /// writer cannot delay the step.
    Every { input: RawStreamInput, most: usize },
}

impl Outbound {
    /// Mirrors the newest value of a state or of a stream.
    pub(super) fn newest(node: &Node<Shared>, input: RawInput) -> Result<Self, ConfigureError> {
        let (Some(topic), Some(layout)) = (input.topic(), input.layout()) else { return Err(unwired("out")) };
        let port = Service::mirroring(topic, layout, TopicPattern::State).publish(node)?;
        Ok(Self { source: Source::Newest(input), port, mirrored: 0, unsent: 0 })
    }

    /// Mirrors every value of a stream, or every slice.
    pub(super) fn every(node: &Node<Shared>, input: RawStreamInput) -> Result<Self, ConfigureError> {
        let (Some(topic), Some(layout), Some(pattern)) = (input.topic(), input.layout(), input.pattern())
        else {
            return Err(unwired("out_streams` or `out_slices"));
        };
        let port = Service::mirroring(topic, layout, pattern).publish(node)?;
        let most = pattern.capacity().unwrap_or(1);
        Ok(Self { source: Source::Every { input, most }, port, mirrored: 0, unsent: 0 })
    }

    pub(super) fn step(&mut self) {
        let Self { source, port, mirrored, unsent } = self;
        let mut mirror = |stamp: &Stamp, bytes: &[u8], count: usize| {
            // iceoryx2 allocates when a subscriber connects or disconnects
            let is_sent = set_apart(|| send(port, Some(stamp), bytes, count));
            *(if is_sent { &mut *mirrored } else { &mut *unsent }) += 1;
        };
        match source {
            Source::Newest(input) => {
                if let Some(value) = input.next_unread() {
                    mirror(value.stamp, value.bytes, 1);
                }
            }
            Source::Every { input, most } => {
                for _ in 0..*most {
                    let Some(value) = input.next_unread() else { break };
                    mirror(value.stamp, value.bytes, value.count);
                }
            }
        }
    }

    pub(super) fn result(&self) -> (String, Value) {
        let (mirrored, unsent) = (self.mirrored, self.unsent);
        let (topic, value) = match &self.source {
            Source::Newest(input) => (input.topic(), json!({ "mirrored": mirrored, "unsent": unsent })),
            Source::Every { input, .. } => {
                (input.topic(), json!({ "mirrored": mirrored, "unsent": unsent, "lost": input.lost() }))
            }
        };
        (topic.unwrap_or_default().to_string(), value)
    }
}

fn unwired(key: &str) -> ConfigureError {
    ConfigureError::failed(format!("an input of `{key}` is not wired"))
}
