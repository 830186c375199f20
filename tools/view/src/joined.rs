//! A joined run: its topics are read by taps and sent to subscribers.

use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use foxglove::SinkId;
use motorium::declare::TopicPattern;
use motorium::os::monotonic_ns;
use motorium::plan::{ClockKind, Plan, TopicPlan};
use motorium::region::{Command, Region};
use motorium::run_folder::RunFolder;
use motorium::schedule::Overheads;
use motorium::session::TopicReader;
use motorium::state::Stamp;
use motorium::transport::{Domain, ParameterTable, PortError, Tap};
use motorium_bridges::foxglove::world_scene;

use crate::channels::Channels;
use crate::server::Server;

/// Delay before a topic that could not be joined is retried; all its tap slots were occupied.
const AGAIN: Duration = Duration::from_secs(1);
/// Maximum number of samples of a stream that are sent per poll.
const MOST: usize = 256;

/// A run, its channels, and the taps of topics with subscribers.
#[derive(Debug)]
pub(crate) struct Joined {
    pub(crate) folder: RunFolder,
    pub(crate) plan: Plan,
    pub(crate) region: Region,
    pub(crate) parameters: ParameterTable,
    domain: Domain,
    channels: Channels,
    topics: Vec<Topic>,
    /// Offset from times of the run's clock to the time since 1970, ns.
    offset_ns: u64,
}

/// The reader of a topic.
#[derive(Debug)]
struct Topic {
    source: Option<Source>,
    /// Time before which the topic is not joined again.
    not_before: Instant,
}

/// Values read from a topic: the newest value of a state, every value of a stream.
#[derive(Debug)]
enum Source {
    Newest(Box<TopicReader>),
    Every(Tap),
}

impl Source {
    fn open(domain: &Domain, topic: &TopicPlan) -> Result<Self, PortError> {
        Ok(match topic.pattern {
            TopicPattern::State => Self::Newest(Box::new(TopicReader::open(domain, topic)?)),
            TopicPattern::Stream { .. } | TopicPattern::Slices { .. } => {
                Self::Every(Tap::open(domain, topic)?)
            }
        })
    }
}

impl Joined {
    /// Joins a run and advertises its channels. Viewers receive the timeline predicted from these overheads.
    pub(crate) fn open(folder: RunFolder, server: &Server, overheads: &Overheads) -> anyhow::Result<Self> {
        let (plan, region) = (folder.plan()?, folder.region()?);
        anyhow::ensure!(
            region.fits(&plan),
            "the control block of run {} does not match its plan: its shared memory was damaged",
            folder.id()
        );
        let domain = folder.domain()?;
        let parameters = ParameterTable::open(&domain, plan.clone())?;
        let channels = Channels::open(server, folder.id(), &plan, world_scene(&plan), overheads, |_| true)?;
        let not_before = Instant::now();
        let topics = plan.topics.iter().map(|_| Topic { source: None, not_before }).collect();
        let offset_ns = offset_ns(&plan, &region);
        Ok(Self { folder, plan, region, parameters, domain, channels, topics, offset_ns })
    }

    /// Returns `true` if the run has ended.
    pub(crate) fn has_ended(&self) -> bool {
        self.region.header().command() == Command::Stop || !self.folder.is_alive()
    }

    /// Sends the newest sample of each subscribed state, and all samples of subscribed streams.
    pub(crate) fn send(&mut self) {
        for (index, topic) in self.topics.iter_mut().enumerate() {
            if !self.channels.is_watched(index) {
                // Its slot is free for other observers.
                topic.source = None;
                continue;
            }
            if topic.source.is_none() {
                if Instant::now() < topic.not_before {
                    continue;
                }
                match Source::open(&self.domain, &self.plan.topics[index]) {
                    Ok(source) => topic.source = Some(source),
                    Err(error) => {
                        eprintln!("{error}");
                        topic.not_before = Instant::now() + AGAIN;
                        continue;
                    }
                }
            }
            topic.send(index, self.offset_ns, &mut self.channels);
        }
    }

    /// Sends the message of a constant topic to a new subscriber.
    pub(crate) fn send_latched(&self, topic: &str, sink: Option<SinkId>) {
        self.channels.send_latched(topic, sink);
    }
}

impl Topic {
    /// Sends the publications since the last call: the newest value of a state, in place.
    fn send(&mut self, index: usize, offset_ns: u64, channels: &mut Channels) {
        let mut send = |stamp: &Stamp, bytes: &[u8]| {
            channels.send(index, stamp, bytes, stamp.publish_time.saturating_add(offset_ns));
        };
        match &mut self.source {
            Some(Source::Newest(reader)) => {
                if reader.poll()
                    && let (Some(stamp), Some(bytes)) = (reader.stamp(), reader.bytes())
                {
                    send(stamp, bytes);
                }
            }
            Some(Source::Every(tap)) => {
                for _ in 0..MOST {
                    if !tap.read(&mut send) {
                        break;
                    }
                }
            }
            None => {}
        }
    }
}

/// Returns the offset from times of the run's clock to the time since 1970, ns.
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

/// Returns the newest live run that matches.
pub(crate) fn newest(fits: impl Fn(&RunFolder) -> bool) -> Option<RunFolder> {
    let goes_on = |folder: &RunFolder| {
        folder.region().is_ok_and(|region| region.header().command() != Command::Stop) && folder.is_alive()
    };
    RunFolder::list().into_iter().find(|folder| fits(folder) && goes_on(folder))
}

/// Returns the run with this id.
pub(crate) fn named(id: &str) -> anyhow::Result<RunFolder> {
    RunFolder::find(id).with_context(|| format!("no run is called `{id}`"))
}
