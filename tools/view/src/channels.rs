//! Channels of a plan: its topics and its constant messages.

use std::collections::BTreeMap;
use std::sync::Arc;

use foxglove::{PartialMetadata, RawChannel, Schema, SinkId};
use motorium::plan::Plan;
use motorium::schedule::Overheads;
use motorium::state::Stamp;
use motorium_bridges::foxglove::{self as drawn, Channel, WORLD_SCENE, channels, descriptions};

use crate::assets::Assets;
use crate::graph;
use crate::server::Server;

/// Channels of a plan. They close when this value is dropped.
#[derive(Debug)]
pub(crate) struct Channels {
    /// Channels of each topic, in the order of the plan.
    topics: Vec<Vec<(Channel, Arc<RawChannel>)>>,
    /// Constant messages by topic, sent to every new subscriber.
    latched: BTreeMap<String, (Arc<RawChannel>, Vec<u8>)>,
    message: Vec<u8>,
}

impl Channels {
    /// Begins a session `id` and advertises the channels of the `served` topics. Viewers receive the timeline
    /// predicted from these overheads. The world is the plan's, drawn as in `scene`.
    pub(crate) fn open(
        server: &Server,
        id: &str,
        plan: &Plan,
        scene: Option<(drawn::Schema, Vec<u8>)>,
        overheads: &Overheads,
        served: impl Fn(usize) -> bool,
    ) -> anyhow::Result<Self> {
        let robots = graph::robots(plan);
        let packages = robots.iter().flat_map(|robot| robot.package_path.iter().cloned()).collect();
        let files = robots.iter().filter_map(|robot| graph::file_of(robot)).collect();
        let described = descriptions(plan);
        let meshes = described.iter().flat_map(|description| description.meshes.iter().cloned()).collect();
        server.begin_session(id, Assets::new(packages, files, meshes));
        let mut topics = Vec::new();
        for index in 0..plan.topics.len() {
            let of_topic = if served(index) { channels(plan, index)? } else { Vec::new() };
            let mut advertised = Vec::new();
            for channel in of_topic {
                let raw = server.channel(&channel.name, "protobuf", schema(channel.schema()))?;
                advertised.push((channel, raw));
            }
            topics.push(advertised);
        }
        let mut latched = BTreeMap::new();
        let mut keep = |channel: Arc<RawChannel>, message: Vec<u8>| {
            channel.log(&message);
            latched.insert(channel.topic().to_string(), (channel, message));
        };
        for description in described {
            let text = serde_json::json!({ "data": description.text }).to_string();
            keep(server.json_channel(&description.topic, "std_msgs/String", TEXT)?, text.into_bytes());
        }
        let text = graph::describe(id, plan, overheads).to_string();
        keep(server.json_channel("/motorium/graph", "motorium.Graph", OBJECT)?, text.into_bytes());
        if let Some((of_scene, message)) = scene {
            keep(server.channel(WORLD_SCENE, "protobuf", schema(&of_scene))?, message);
        }
        Ok(Self { topics, latched, message: Vec::with_capacity(16 * 1024) })
    }

    /// Returns `true` if a client has subscribed to a topic, or to images whose form it describes.
    pub(crate) fn is_watched(&self, topic: usize) -> bool {
        let mut watched = self.topics.iter().flatten().filter(|(_, raw)| raw.has_sinks());
        watched.any(|(channel, _)| channel.topic == topic || channel.form_topic() == Some(topic))
    }

    /// Sends one sample through the subscribed channels of its topic.
    pub(crate) fn send(&mut self, topic: usize, stamp: &Stamp, bytes: &[u8], time_ns: u64) {
        self.topics.iter_mut().flatten().for_each(|(channel, _)| channel.note(topic, bytes));
        for (channel, raw) in self.topics[topic].iter_mut().filter(|(_, raw)| raw.has_sinks()) {
            self.message.clear();
            // A sample that does not match its robot is not drawn; the exact channel contains it.
            if channel.encode(stamp, bytes, time_ns, &mut self.message).is_ok() {
                raw.log_with_meta(&self.message, PartialMetadata { log_time: Some(time_ns) });
            }
        }
    }

    /// Sends a recorded message of a topic's channel.
    pub(crate) fn send_recorded(&self, topic: usize, channel: &str, message: &[u8], time_ns: u64) {
        for (_, raw) in self.topics[topic].iter().filter(|(_, raw)| raw.topic() == channel) {
            raw.log_with_meta(message, PartialMetadata { log_time: Some(time_ns) });
        }
    }

    /// Returns the topic of the plan that a channel shows.
    pub(crate) fn topic_of(&self, channel: &str) -> Option<usize> {
        self.topics.iter().position(|all| all.iter().any(|(_, raw)| raw.topic() == channel))
    }

    /// Sends the constant message of a topic to a new subscriber.
    pub(crate) fn send_latched(&self, topic: &str, sink: Option<SinkId>) {
        if let Some((channel, message)) = self.latched.get(topic) {
            channel.log_to_sink(message, sink);
        }
    }
}

impl Drop for Channels {
    fn drop(&mut self) {
        self.topics.iter().flatten().for_each(|(_, raw)| raw.close());
        self.latched.values().for_each(|(raw, _)| raw.close());
    }
}

fn schema(schema: &drawn::Schema) -> Schema {
    Schema::new(schema.name.clone(), schema.encoding, schema.data.clone())
}

const TEXT: &str = r#"{"type": "object", "required": ["data"], "properties": {"data": {"type": "string"}}}"#;
const OBJECT: &str = r#"{"type": "object"}"#;
