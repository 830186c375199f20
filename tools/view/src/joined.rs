//! A run that the viewer has joined: its topics, read by taps and sent to those who have subscribed.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use foxglove::{PartialMetadata, RawChannel, Schema, SinkId};
use motorium::declare::TopicPattern;
use motorium::os::monotonic_ns;
use motorium::plan::{ClockKind, Plan};
use motorium::region::{Command, Region};
use motorium::run_folder::RunFolder;
use motorium::state::Stamp;
use motorium::transport::{Domain, ParameterTable, Tap};
use motorium_bridges::foxglove::{Channel, channels, descriptions};

use crate::graph;
use crate::server::Server;
use crate::world;

/// Time after which a topic that could not be joined is tried again: its places for taps were taken.
const AGAIN: Duration = Duration::from_secs(1);
/// Most samples of a stream that are sent in one go.
const MOST: usize = 256;

/// A run, its channels, and the taps of the topics that somebody looks at.
#[derive(Debug)]
pub(crate) struct Joined {
    pub(crate) folder: RunFolder,
    pub(crate) plan: Plan,
    pub(crate) region: Region,
    pub(crate) parameters: ParameterTable,
    domain: Domain,
    topics: Vec<Topic>,
    /// Messages that never change, by topic: sent to each that subscribes.
    latched: BTreeMap<String, (Arc<RawChannel>, Vec<u8>)>,
    /// Added to times of the run's clock: ns since 1970.
    offset_ns: u64,
    message: Vec<u8>,
}

/// A topic and what is made of its samples.
#[derive(Debug)]
struct Topic {
    index: usize,
    channels: Vec<(Channel, Arc<RawChannel>)>,
    tap: Option<Tap>,
    /// Time before which it is not joined again.
    not_before: Instant,
    newest: Vec<u8>,
}

impl Joined {
    /// Joins a run and advertises its channels.
    pub(crate) fn open(folder: RunFolder, server: &Server) -> anyhow::Result<Self> {
        let (plan, region) = (folder.plan()?, folder.region()?);
        anyhow::ensure!(
            region.fits(&plan),
            "the control block of run {} is not that of its plan: its shared memory was damaged",
            folder.id()
        );
        let domain = folder.domain()?;
        let parameters = ParameterTable::open(&domain, plan.clone())?;
        let robots = graph::robots(&plan);
        let packages = robots.iter().flat_map(|robot| robot.package_path.iter().cloned()).collect();
        let files = robots.iter().filter_map(|robot| graph::file_of(robot)).collect();
        server.begin_session(folder.id(), packages, files);
        let mut topics = Vec::new();
        for index in 0..plan.topics.len() {
            let mut served = Vec::new();
            for channel in channels(&plan, index)? {
                let raw = server.channel(&channel.name, "protobuf", schema(&channel))?;
                served.push((channel, raw));
            }
            let not_before = Instant::now();
            topics.push(Topic { index, channels: served, tap: None, not_before, newest: Vec::new() });
        }
        let mut latched = BTreeMap::new();
        let mut keep = |channel: Arc<RawChannel>, message: Vec<u8>| {
            channel.log(&message);
            latched.insert(channel.topic().to_string(), (channel, message));
        };
        for description in descriptions(&plan) {
            let text = serde_json::json!({ "data": description.text }).to_string();
            keep(server.json_channel(&description.topic, "std_msgs/String", TEXT)?, text.into_bytes());
        }
        let text = graph::describe(folder.id(), &plan).to_string();
        keep(server.json_channel("/motorium/graph", "motorium.Graph", OBJECT)?, text.into_bytes());
        if let Some((schema, message)) = world::scene(&plan) {
            keep(server.channel("/world/scene", "protobuf", schema)?, message);
        }
        let offset_ns = offset_ns(&plan, &region);
        let message = Vec::with_capacity(16 * 1024);
        Ok(Self { folder, plan, region, parameters, domain, topics, latched, offset_ns, message })
    }

    /// True if the run is over.
    pub(crate) fn has_ended(&self) -> bool {
        self.region.header().command() == Command::Stop || !self.folder.is_alive()
    }

    /// Sends the newest sample of each topic that somebody looks at, and all of those of which none may be left out.
    pub(crate) fn send(&mut self) {
        let looked_at =
            self.topics.iter().flat_map(|topic| &topic.channels).filter(|(_, raw)| raw.has_sinks());
        let told: Vec<usize> = looked_at.filter_map(|(channel, _)| channel.form_topic()).collect();
        for place in 0..self.topics.len() {
            let topic = &mut self.topics[place];
            let tells = told.contains(&topic.index);
            if !tells && !topic.channels.iter().any(|(_, raw)| raw.has_sinks()) {
                // Its place is free for others.
                topic.tap = None;
                continue;
            }
            if topic.tap.is_none() {
                if Instant::now() < topic.not_before {
                    continue;
                }
                let planned = &self.plan.topics[topic.index];
                let tap = match planned.pattern {
                    TopicPattern::Slices { .. } => Tap::of_slices(&self.domain, planned),
                    TopicPattern::State | TopicPattern::Stream { .. } => Tap::open(&self.domain, planned),
                };
                match tap {
                    Ok(tap) => topic.tap = Some(tap),
                    Err(error) => {
                        eprintln!("{error}");
                        topic.not_before = Instant::now() + AGAIN;
                        continue;
                    }
                }
            }
            topic.send(&self.plan, self.offset_ns, &mut self.message);
            if tells {
                let (index, form) = (topic.index, std::mem::take(&mut topic.newest));
                let channels = self.topics.iter_mut().flat_map(|topic| &mut topic.channels);
                channels.for_each(|(channel, _)| channel.note(index, &form));
                self.topics[place].newest = form;
            }
        }
    }

    /// Sends the message of a topic that never changes to one that has subscribed to it.
    pub(crate) fn send_latched(&self, topic: &str, sink: Option<SinkId>) {
        if let Some((channel, message)) = self.latched.get(topic) {
            channel.log_to_sink(message, sink);
        }
    }
}

impl Drop for Joined {
    /// Closes its channels: nothing more comes through them.
    fn drop(&mut self) {
        self.topics.iter().flat_map(|topic| &topic.channels).for_each(|(_, raw)| raw.close());
        self.latched.values().for_each(|(raw, _)| raw.close());
    }
}

impl Topic {
    fn send(&mut self, plan: &Plan, offset_ns: u64, message: &mut Vec<u8>) {
        let Some(tap) = &mut self.tap else { return };
        let is_state = plan.topics[self.index].pattern == TopicPattern::State;
        if is_state {
            let (newest, mut stamp) = (&mut self.newest, None);
            // The slot is held for the time of the copy alone.
            while tap.read(|read, bytes| {
                newest.clear();
                newest.extend_from_slice(bytes);
                stamp = Some(*read);
            }) {}
            if let Some(stamp) = stamp {
                encode(&mut self.channels, &stamp, &self.newest, offset_ns, message);
            }
            return;
        }
        for _ in 0..MOST {
            let channels = &mut self.channels;
            if !tap.read(|stamp, bytes| encode(channels, stamp, bytes, offset_ns, message)) {
                break;
            }
        }
    }
}

/// Sends one sample through those of its channels that somebody looks at.
fn encode(
    channels: &mut [(Channel, Arc<RawChannel>)],
    stamp: &Stamp,
    bytes: &[u8],
    offset_ns: u64,
    message: &mut Vec<u8>,
) {
    let time_ns = stamp.publish_time.saturating_add(offset_ns);
    for (channel, raw) in channels.iter_mut().filter(|(_, raw)| raw.has_sinks()) {
        message.clear();
        // A sample that does not fit its robot is not drawn; the exact channel has it.
        if channel.encode(stamp, bytes, time_ns, message).is_ok() {
            raw.log_with_meta(message, PartialMetadata { log_time: Some(time_ns) });
        }
    }
}

fn schema(channel: &Channel) -> Schema {
    let schema = channel.schema();
    Schema::new(schema.name.clone(), schema.encoding, schema.data.clone())
}

/// What is to be added to times of the run's clock for the time since 1970, ns.
fn offset_ns(plan: &Plan, region: &Region) -> u64 {
    let wall = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let wall_ns = u64::try_from(wall.as_nanos()).unwrap_or(u64::MAX);
    let run_ns = match plan.clock {
        ClockKind::Realtime => monotonic_ns(),
        ClockKind::Lockstep => {
            let ticks = region.components().iter().map(|block| block.tick_time_ns.load(Relaxed));
            ticks.max().unwrap_or(0)
        }
    };
    wall_ns.saturating_sub(run_ns)
}

/// The newest run that is alive and fits.
pub(crate) fn newest(fits: impl Fn(&RunFolder) -> bool) -> Option<RunFolder> {
    let goes_on = |folder: &RunFolder| {
        folder.region().is_ok_and(|region| region.header().command() != Command::Stop) && folder.is_alive()
    };
    RunFolder::list().into_iter().find(|folder| fits(folder) && goes_on(folder))
}

/// The run with this id.
pub(crate) fn named(id: &str) -> anyhow::Result<RunFolder> {
    RunFolder::find(id).with_context(|| format!("no run is called `{id}`"))
}

const TEXT: &str = r#"{"type": "object", "required": ["data"], "properties": {"data": {"type": "string"}}}"#;
const OBJECT: &str = r#"{"type": "object"}"#;
