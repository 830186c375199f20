//! A recording instead of a run: its samples, sent to subscribers at the requested pace.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use foxglove::RawChannel;
use foxglove::messages::SceneUpdate;
use motorium::declare::TopicPattern;
use motorium::plan::Plan;
use motorium_bridges::foxglove::{Schema, WORLD_SCENE, world_scene};
use motorium_bridges::recording::{Entries, Entry, ReadError, Recording};
use serde_json::json;

use crate::ask::Ask;
use crate::channels::Channels;
use crate::player::Player;
use crate::request::Request;
use crate::schemas::{PLACE_SCHEMA, RUN, RUN_SCHEMA};
use crate::server::Server;

/// Interval between two reports of the displayed position.
const REPORT_PERIOD: Duration = Duration::from_millis(100);
const PLACE: &str = "/motorium/playback";
const NO_RUN: &str = "this is a recording: nothing runs";

/// A displayed recording.
struct Playback<'r> {
    recording: &'r Recording,
    plan: Plan,
    channels: Channels,
    /// The topic of the plan for each topic of the recording.
    topics: Vec<Option<usize>>,
    /// The topic of the plan for the pictures of each camera of the recording.
    pictures: Vec<Option<usize>>,
    rest: Entries<'r>,
    /// The first entry after the displayed position.
    later: Option<Entry>,
    /// The newest entry of each topic of the plan.
    newest: Vec<Option<Entry>>,
    /// `true` for a state or a picture that has changed since it was sent.
    changed: Vec<bool>,
}

/// Opens a recording and returns it with its times.
pub(crate) fn open(path: &Path) -> anyhow::Result<(Recording, (u64, u64))> {
    let recording = Recording::open(path)?;
    let times = recording.times().with_context(|| format!("{}: it holds no samples", path.display()))?;
    Ok((recording, times))
}

/// Plays a recording until `over` or `interrupted` is set.
pub(crate) fn play(
    request: &Request,
    recording: &Recording,
    server: &Server,
    player: &Mutex<Player>,
    asks: &Receiver<Ask>,
    [over, interrupted]: [&AtomicBool; 2],
) -> anyhow::Result<()> {
    let player = || player.lock().unwrap_or_else(PoisonError::into_inner);
    let run_channel = server.json_channel(RUN, "motorium.Run", RUN_SCHEMA)?;
    let place_channel = server.json_channel(PLACE, "motorium.Playback", PLACE_SCHEMA)?;
    let mut playback = Playback::open(request, recording, server)?;
    let period = Duration::from_secs_f64(1.0 / request.rate_hz);
    let (mut last, mut reported) = (Instant::now(), None::<Instant>);
    let mut next = last;
    while !over.load(Relaxed) && !interrupted.load(Relaxed) {
        match asks.recv_timeout(next.saturating_duration_since(Instant::now())) {
            Ok(ask) => {
                if matches!(ask, Ask::Latched(..)) {
                    player().begin();
                }
                playback.answer(ask, &run_channel);
                continue;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        let now = Instant::now();
        // Missed periods are skipped.
        next = (next + period).max(now);
        let moved = player().step(now - last);
        last = now;
        if moved.sought {
            playback.seek(moved.to_ns)?;
        } else {
            playback.go_on(moved.to_ns)?;
        }
        playback.send_changed();
        if moved.ended {
            server.tell_playback(player().state());
        }
        if moved.ended || moved.sought || reported.is_none_or(|reported| now - reported >= REPORT_PERIOD) {
            reported = Some(now);
            place_channel.log(player().position_json().to_string().as_bytes());
            run_channel.log(playback.state().as_bytes());
        }
    }
    Ok(())
}

impl<'r> Playback<'r> {
    fn open(request: &Request, recording: &'r Recording, server: &Server) -> anyhow::Result<Self> {
        let plan = recording.plan()?;
        let of_plan = |name: &str| plan.topics.iter().position(|topic| topic.name == name);
        let topics: Vec<Option<usize>> =
            recording.topics().iter().map(|topic| of_plan(&topic.name)).collect();
        let pictures: Vec<Option<usize>> =
            recording.pictures().iter().map(|camera| of_plan(&camera.topic)).collect();
        let id = recording.path().display().to_string();
        let overheads = request.overheads.unwrap_or_default();
        let is_recorded = |index: usize| topics.contains(&Some(index)) || pictures.contains(&Some(index));
        // Its files may have been removed or changed since.
        let scene = match recording.latched(WORLD_SCENE) {
            Some(message) => Some((Schema::of::<SceneUpdate>(), message.to_vec())),
            None => world_scene(&plan),
        };
        let channels = Channels::open(server, &id, &plan, scene, &overheads, is_recorded)?;
        let count = plan.topics.len();
        let (rest, later) = (recording.entries(), None);
        let (newest, changed) = (vec![None; count], vec![false; count]);
        Ok(Self { recording, plan, channels, topics, pictures, rest, later, newest, changed })
    }

    /// Returns the topic of the plan that an entry belongs to.
    fn topic_of(&self, entry: &Entry) -> Option<usize> {
        match entry {
            Entry::Sample(sample) => self.topics[sample.topic],
            Entry::Picture(picture) => self.pictures[picture.pictures],
        }
    }

    /// Shows a position again: the newest sample of each topic and the newest picture of each camera.
    fn seek(&mut self, time_ns: u64) -> Result<(), ReadError> {
        let (newest, rest) = self.recording.newest_at(time_ns)?;
        (self.rest, self.later) = (rest, None);
        self.newest.fill(None);
        for entry in newest {
            let Some(topic) = self.topic_of(&entry) else { continue };
            self.send(topic, &entry);
            self.newest[topic] = Some(entry);
        }
        self.changed.fill(false);
        Ok(())
    }

    /// Advances to a position: sends every sample of a stream, and for a state and a camera the newest by
    /// [`send_changed`](Self::send_changed).
    fn go_on(&mut self, time_ns: u64) -> Result<(), ReadError> {
        loop {
            let Some(entry) = self.later.take().map(Ok).or_else(|| self.rest.next()).transpose()? else {
                return Ok(());
            };
            if entry.time_ns() > time_ns {
                self.later = Some(entry);
                return Ok(());
            }
            let Some(topic) = self.topic_of(&entry) else { continue };
            let is_state = self.plan.topics[topic].pattern == TopicPattern::State;
            if is_state || matches!(entry, Entry::Picture(_)) {
                self.changed[topic] = true;
            } else {
                self.send(topic, &entry);
            }
            self.newest[topic] = Some(entry);
        }
    }

    fn send_changed(&mut self) {
        for topic in 0..self.newest.len() {
            if !std::mem::take(&mut self.changed[topic]) {
                continue;
            }
            if let Some(entry) = self.newest[topic].take() {
                self.send(topic, &entry);
                self.newest[topic] = Some(entry);
            }
        }
    }

    fn send(&mut self, topic: usize, entry: &Entry) {
        match entry {
            Entry::Sample(sample) => {
                self.channels.send(topic, &sample.stamp, &sample.bytes, sample.time_ns);
            }
            Entry::Picture(picture) => {
                let channel = &self.recording.pictures()[picture.pictures].channel;
                self.channels.send_recorded(topic, channel, &picture.message, picture.time_ns);
            }
        }
    }

    fn answer(&mut self, ask: Ask, run_channel: &RawChannel) {
        match ask {
            Ask::Get(_, responder) => responder.respond(Vec::new()),
            Ask::Set(_, client, responder) => {
                client.send_error(NO_RUN);
                responder.respond(Vec::new());
            }
            Ask::Command(_, responder) => responder.respond_err(NO_RUN.to_string()),
            Ask::Latched(topic, sink) => {
                if topic == RUN {
                    run_channel.log_to_sink(self.state().as_bytes(), sink);
                } else if let Some(topic) = self.channels.topic_of(&topic) {
                    // The display while the recording is paused.
                    self.changed[topic] = true;
                } else {
                    self.channels.send_latched(&topic, sink);
                }
            }
        }
    }

    fn state(&self) -> String {
        json!({
            "run": self.recording.path().display().to_string(),
            "graph": self.plan.name,
            "state": "playback",
            "clock": self.plan.clock,
            "latched": null,
            "can_start": false,
        })
        .to_string()
    }
}
