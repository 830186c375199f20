//! Server of Foxglove's WebSocket protocol and its advertised channels.

use std::net::SocketAddr;
use std::sync::{Arc, RwLock};

use anyhow::Context as _;
use foxglove::websocket::service::{Service, ServiceSchema};
use foxglove::websocket::{Capability, Parameter, PlaybackState};
use foxglove::{ChannelBuilder, Context, RawChannel, Schema, WebSocketServer, WebSocketServerHandle};
use motorium_bridges::recording::Recording;

use crate::ask::{self, Asks, Command};
use crate::assets::Assets;
use crate::player::Shared;
use crate::schemas::PLACE_SCHEMA;

/// The server.
pub(crate) struct Server {
    handle: WebSocketServerHandle,
    context: Arc<Context>,
    assets: Arc<RwLock<Assets>>,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server").field("port", &self.handle.port()).finish_non_exhaustive()
    }
}

impl Server {
    /// Starts the server on a free port of the loopback interface, on this runtime: for a run, or for a
    /// recording and its times.
    pub(crate) async fn start(
        asks: Asks,
        recorded: Option<(Arc<Recording>, (u64, u64))>,
    ) -> anyhow::Result<Self> {
        let context = Context::new();
        let assets = Arc::new(RwLock::new(Assets::default()));
        let served = assets.clone();
        let services = match (&asks.player, &recorded) {
            (Some(player), Some((recording, _))) => vec![play(player.clone()), curves(recording.clone())],
            _ => Command::ALL.iter().map(|command| service(*command, asks.clone())).collect(),
        };
        let mut server = WebSocketServer::new();
        if let Some((_, (start_ns, end_ns))) = recorded {
            server = server.playback_time_range(start_ns, end_ns);
        }
        let server = server
            .name("motorium view")
            .bind("127.0.0.1", 0)
            .context(&context)
            .capabilities([Capability::Parameters, Capability::Services, Capability::Assets])
            .supported_encodings(["json"])
            .services(services)
            .parameter_handler(Arc::new(asks.clone()))
            .listener(Arc::new(asks))
            .fetch_asset_handler_blocking_fn(move |_, uri| {
                served.read().unwrap_or_else(std::sync::PoisonError::into_inner).fetch(&uri)
            });
        let handle = server.start().await.context("the server of the WebSocket protocol")?;
        Ok(Self { handle, context, assets })
    }

    /// Returns the internal address, behind the port of the viewer.
    pub(crate) fn address(&self) -> SocketAddr {
        ([127, 0, 0, 1], self.handle.port()).into()
    }

    /// Starts a session for another run: viewers discard the previous one. Channels are advertised
    /// afterwards.
    pub(crate) fn begin_session(&self, run: &str, assets: Assets) {
        self.handle.clear_session(Some(run.to_string()));
        *self.assets.write().unwrap_or_else(std::sync::PoisonError::into_inner) = assets;
    }

    /// Advertises a channel.
    pub(crate) fn channel(
        &self,
        topic: &str,
        encoding: &str,
        schema: Schema,
    ) -> anyhow::Result<Arc<RawChannel>> {
        let builder = ChannelBuilder::new(topic).context(&self.context).message_encoding(encoding);
        builder.schema(schema).build_raw().with_context(|| format!("channel {topic}"))
    }

    /// Advertises a channel of JSON texts with this JSON Schema.
    pub(crate) fn json_channel(
        &self,
        topic: &str,
        name: &str,
        schema: &str,
    ) -> anyhow::Result<Arc<RawChannel>> {
        self.channel(topic, "json", Schema::new(name, "jsonschema", schema.as_bytes().to_vec()))
    }

    /// Sends the playback state to viewers.
    pub(crate) fn tell_playback(&self, state: PlaybackState) {
        self.handle.broadcast_playback_state(state);
    }

    /// Sends parameter values to viewers.
    pub(crate) fn publish_parameters(&self, parameters: Vec<Parameter>) {
        if !parameters.is_empty() {
            self.handle.publish_parameter_values(parameters);
        }
    }
}

fn play(player: Shared) -> Service {
    let object = |name: &str, schema: &str| Schema::new(name, "jsonschema", schema.as_bytes().to_vec());
    let schema = ServiceSchema::new("motorium.Play")
        .with_request("json", object("motorium.PlayRequest", PLAY))
        .with_response("json", object("motorium.Playback", PLACE_SCHEMA));
    Service::builder("/motorium/play", schema).handler(ask::Play(player))
}

fn curves(recording: Arc<Recording>) -> Service {
    let object = |name: &str, schema: &str| Schema::new(name, "jsonschema", schema.as_bytes().to_vec());
    let schema = ServiceSchema::new("motorium.Curves")
        .with_request("json", object("motorium.CurvesRequest", CURVES_REQUEST))
        .with_response("json", object("motorium.Curves", CURVES));
    Service::builder("/motorium/curves", schema).handler(ask::Curves(recording))
}

fn service(command: Command, asks: Asks) -> Service {
    let nothing = || Schema::new("motorium.Nothing", "jsonschema", br#"{"type": "object"}"#.as_slice());
    let done = Schema::new("motorium.Outcome", "jsonschema", OUTCOME.as_bytes());
    let schema =
        ServiceSchema::new("motorium.Command").with_request("json", nothing()).with_response("json", done);
    Service::builder(command.service(), schema).handler(ask::Service(command, asks))
}

/// JSON Schema of the request to play a recording.
const PLAY: &str = r#"{
  "type": "object",
  "required": ["plays"],
  "properties": {
    "plays": { "type": "boolean", "description": "True to play, false to hold" },
    "speed": { "type": "number", "description": "Speed, relative to the recording" },
    "place_s": { "type": "number", "description": "Position to seek: time since the start, s" }
  }
}"#;

/// JSON Schema of the request for curves of the whole recording.
const CURVES_REQUEST: &str = r#"{
  "type": "object",
  "required": ["topic", "field"],
  "properties": {
    "topic": { "type": "string", "description": "Name of the topic" },
    "field": { "type": "string", "description": "Name of the field" },
    "first": { "type": "integer", "description": "First entry of an array; 0 if absent" },
    "count": { "type": "integer", "description": "Maximum number of entries; 64 if absent" },
    "points": { "type": "integer", "description": "Maximum number of points of a curve; 10000 if absent" }
  }
}"#;

/// JSON Schema of curves of the whole recording.
const CURVES: &str = r#"{
  "type": "object",
  "required": ["entries", "curves"],
  "properties": {
    "entries": { "type": "integer", "description": "Number of entries of the field" },
    "curves": {
      "type": "array",
      "description": "For each entry its points: time since the start, s, and value",
      "items": { "type": "array", "items": { "type": "array", "items": { "type": "number" } } }
    }
  }
}"#;

/// JSON Schema of the answer of a command.
const OUTCOME: &str = r#"{
  "type": "object",
  "required": ["done", "message"],
  "properties": {
    "done": { "type": "boolean", "description": "True if the request was fulfilled" },
    "message": { "type": "string", "description": "The outcome as text" }
  }
}"#;
