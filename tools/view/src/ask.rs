//! Requests of viewers, passed from the server's threads to the thread that follows the run.

use std::sync::mpsc::Sender;
use std::sync::{Arc, PoisonError};

use foxglove::SinkId;
use foxglove::websocket::service::{Handler, Request, Responder};
use foxglove::websocket::{
    AnyClient, ChannelView, Client, GetParametersResponder, Parameter, ParameterHandler, ServerListener,
    SetParametersResponder,
};
use foxglove::websocket::{PlaybackControlRequest, PlaybackState};

use motorium_bridges::recording::{Recording, Signal, curves};
use serde_json::json;

use crate::player::Shared;
use crate::rights::Rights;

/// A request of a viewer.
#[derive(Debug)]
pub(crate) enum Ask {
    /// The values of these parameters, or of all if none is named.
    Get(Vec<String>, GetParametersResponder),
    /// Sets parameters for a client with the right to command.
    Set(Vec<Parameter>, AnyClient, SetParametersResponder),
    /// A command of a client with the right to command.
    Command(Command, Responder),
    /// Sends the constant messages of a topic to which the client has subscribed.
    Latched(String, Option<SinkId>),
}

/// A command to the run, called as a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Command {
    /// Brings the robot to its safe state immediately and latches it there.
    Stop,
    /// Release the robot from a stop.
    Resume,
    /// End the run in good order.
    End,
    /// Start the graph again.
    Start,
}

impl Command {
    pub(crate) const ALL: [Self; 4] = [Self::Stop, Self::Resume, Self::End, Self::Start];

    /// Returns the name of the command's service.
    pub(crate) fn service(self) -> &'static str {
        match self {
            Self::Stop => "/motorium/stop",
            Self::Resume => "/motorium/resume",
            Self::End => "/motorium/end",
            Self::Start => "/motorium/start",
        }
    }
}

/// Server callbacks that forward requests.
#[derive(Debug, Clone)]
pub(crate) struct Asks {
    pub(crate) sender: Sender<Ask>,
    pub(crate) rights: Arc<Rights>,
    /// Player of a recording; `None` for a run.
    pub(crate) player: Option<Shared>,
}

impl Asks {
    fn send(&self, ask: Ask) {
        // Nobody follows the run any more because the program is ending. The dropped responder reports this
        // to the client.
        let _ = self.sender.send(ask);
    }
}

/// The message for a client without the right to command.
const REFUSED: &str = "commands need the token: connect to the address that `motorium view` printed, or set the parameter \
                       `motorium/token` to it";

impl ParameterHandler for Asks {
    fn get(&self, _: AnyClient, names: Vec<String>, _: Option<String>, responder: GetParametersResponder) {
        self.send(Ask::Get(names, responder));
    }

    fn set(
        &self,
        client: AnyClient,
        mut parameters: Vec<Parameter>,
        _: Option<String>,
        responder: SetParametersResponder,
    ) {
        if !self.rights.take_token(client.id(), &mut parameters) {
            client.send_error("this is not the token of this `motorium view`");
        }
        if parameters.is_empty() {
            return responder.respond(Vec::new());
        }
        if !self.rights.may_command(client.id()) {
            client.send_error(REFUSED);
            return responder.respond(Vec::new());
        }
        self.send(Ask::Set(parameters, client, responder));
    }
}

impl ServerListener for Asks {
    fn on_subscribe(&self, client: Client, channel: ChannelView) {
        self.send(Ask::Latched(channel.topic().to_string(), client.sink_id()));
    }

    fn on_playback_control_request(&self, request: PlaybackControlRequest) -> Option<PlaybackState> {
        let mut player = self.player.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner);
        Some(player.obey(request))
    }
}

/// The service of a command.
pub(crate) struct Service(pub(crate) Command, pub(crate) Asks);

impl Handler for Service {
    fn call(&self, request: Request, responder: Responder) {
        if self.1.rights.may_command(request.client_id()) {
            self.1.send(Ask::Command(self.0, responder));
        } else {
            responder.respond_err(REFUSED.to_string());
        }
    }
}

/// The service that plays, pauses and seeks a recording. The viewer's own page may call it without the token,
/// since no robot moves.
pub(crate) struct Play(pub(crate) Shared);

/// Request of [`Play`].
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct PlayRequest {
    plays: bool,
    /// Speed relative to the recording; unchanged if missing.
    speed: Option<f64>,
    /// Time since the start, s.
    place_s: Option<f64>,
}

impl Handler for Play {
    fn call(&self, request: Request, responder: Responder) {
        let asked = match serde_json::from_slice::<PlayRequest>(request.payload()) {
            Ok(asked) => asked,
            Err(error) => return responder.respond_err(error.to_string()),
        };
        let mut player = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let speed = asked.speed.unwrap_or(player.speed());
        let seek_ns = asked.place_s.map(|place_s| player.time_at(place_s));
        player.set(asked.plays, speed, seek_ns);
        responder.respond_ok(player.position_json().to_string());
    }
}

/// The service that sends curves of the whole recording, thinned for a plot. Like [`Play`] it needs no token.
pub(crate) struct Curves(pub(crate) Arc<Recording>);

/// Request of [`Curves`].
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct CurvesRequest {
    topic: String,
    field: String,
    /// First entry of an array.
    #[serde(default)]
    first: usize,
    /// Maximum number of entries.
    #[serde(default = "most_curves")]
    count: usize,
    /// Maximum number of points of each curve.
    #[serde(default = "most_points")]
    points: usize,
}

/// Returns the maximum number of entries in one answer, and its default.
const fn most_curves() -> usize {
    64
}

/// Returns the maximum number of points of a curve, and its default.
const fn most_points() -> usize {
    10_000
}

impl Handler for Curves {
    fn call(&self, request: Request, responder: Responder) {
        let recording = self.0.clone();
        // Reading a long recording lasts seconds; the server continues meanwhile.
        std::thread::spawn(move || match read_curves(&recording, request.payload()) {
            Ok(answer) => responder.respond_ok(answer.to_string()),
            Err(error) => responder.respond_err(error),
        });
    }
}

/// Answers a request for curves: the number of entries of the field, and the points of each curve (time since
/// the start in s, and value).
fn read_curves(recording: &Recording, request: &[u8]) -> Result<serde_json::Value, String> {
    let asked: CurvesRequest = serde_json::from_slice(request).map_err(|error| error.to_string())?;
    let signal = Signal { topic: asked.topic, field: Some(asked.field), entries: None };
    let found = curves(recording, &[signal]).map_err(|error| error.to_string())?;
    let points = asked.points.clamp(2, most_points());
    let shown = found.iter().skip(asked.first).take(asked.count.min(most_curves()));
    Ok(json!({
        "entries": found.len(),
        "curves": shown.map(|curve| curve.thinned(points)).collect::<Vec<_>>(),
    }))
}
