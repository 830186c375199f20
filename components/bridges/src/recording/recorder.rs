//! Taps of all chosen topics, and the file that their samples go to.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

use mcap::McapError;
use motorium::component::Observer;
use motorium::declare::Taps;
use motorium::plan::{ClockKind, Plan};
use motorium::region::{EventReader, EventRecord, EventSeverity};
use motorium::state::{Event, Stamp, StateBuffer as _, TypeLayout};
use motorium::transport::{PortError, Tap};

use super::batch::{Batch, Ring};
use super::file::Writer;
use super::head::head;
use super::{COUNTS, EVENTS, HASH, LAYOUT, TOPIC};
use crate::foxglove::{Channel, Content, Derived, DerivedError, Schema, channels, log};
use foxglove::Encode as _;
use foxglove::messages::log::Level;

/// Most samples of one topic that are read at a time: a writer that never rests must not hold up the others.
const AT_A_TIME: usize = 4096;

/// The error of a recorder.
#[derive(Debug, thiserror::Error)]
pub(super) enum RecordError {
    /// The file cannot be written.
    #[error("{}: {}", .path.display(), super::file::reason(.source))]
    File {
        /// The file.
        path: PathBuf,
        /// The error of its writer.
        source: McapError,
    },
    /// A topic cannot be reached.
    #[error(transparent)]
    Topic(#[from] PortError),
    /// A topic whose type cannot be written.
    #[error(transparent)]
    Type(#[from] DerivedError),
}

/// The settings of a recorder.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    pub(super) output: PathBuf,
    pub(super) taps: Taps,
    /// Least time between two messages of a drawn channel, ns.
    pub(super) drawn_every_ns: u64,
    /// Time before the end of a run that ends badly which is kept, ns; the whole run if `None`.
    pub(super) last_ns: Option<u64>,
    /// Files to attach, by their names.
    pub(super) attachments: Vec<(String, Vec<u8>)>,
}

/// The counts of a recording.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) samples: u64,
    pub(super) lost: u64,
    pub(super) bytes: u64,
}

/// Taps of all chosen topics, and the file that their samples go to.
pub(super) struct Recorder {
    observer: Observer,
    path: PathBuf,
    writer: Writer,
    topics: Vec<Topic>,
    /// Channels of the events: exact, and lines.
    events: (u16, u16),
    event: Derived,
    reader: EventReader,
    told: u64,
    clock: Clock,
    drawn_every_ns: u64,
    batch: Batch,
    /// The messages of the last moments, of a recorder that keeps no more.
    ring: Option<Ring>,
    /// An error was told: the run ends badly.
    has_failed: bool,
}

/// One topic that is recorded.
struct Topic {
    /// Its index in the plan.
    index: usize,
    tap: Tap,
    channels: Vec<Recorded>,
    samples: u64,
}

/// One channel of a topic.
struct Recorded {
    id: u16,
    channel: Channel,
    /// Time from which on the next drawn message is due.
    due_ns: u64,
}

/// From times of stamps to times in the file.
struct Clock {
    /// Time since 1970 at time zero of the stamps; 0 in lockstep.
    zero_ns: u64,
    /// In lockstep: the episode, the time in the file at which it began, and the last one in it.
    episode: (u64, u64, u64),
}

impl Clock {
    fn new(plan: &Plan, observer: &Observer) -> Self {
        let zero_ns = match plan.clock {
            ClockKind::Realtime => unix_ns().saturating_sub(observer.now_ns()),
            ClockKind::Lockstep => 0,
        };
        Self { zero_ns, episode: (0, 0, 0) }
    }

    fn of(&mut self, stamp: &Stamp) -> u64 {
        let (episode, began, last) = &mut self.episode;
        if stamp.episode > *episode {
            (*episode, *began) = (stamp.episode, *last);
        }
        let time = self.zero_ns + *began + stamp.publish_time;
        *last = (*last).max(time - self.zero_ns);
        time
    }
}

pub(super) fn unix_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

impl Recorder {
    /// Opens the file and all taps. Gives the file once more, so that another thread can bring it to the disk.
    pub(super) fn open(observer: Observer, settings: Settings) -> Result<(Self, File), RecordError> {
        let path = settings.output.clone();
        let of_file = |source| RecordError::File { path: path.clone(), source };
        let (mut writer, file) = Writer::create(&settings.output).map_err(of_file)?;
        let clock = Clock::new(observer.plan(), &observer);
        let start_ns = clock.zero_ns + if clock.zero_ns > 0 { observer.now_ns() } else { 0 };
        head(&mut writer, observer.plan(), &settings, start_ns).map_err(of_file)?;
        let event = Derived::new(&Event::layout())?;
        let events = event_channels(&mut writer, &event).map_err(of_file)?;
        let mut topics = Vec::new();
        for (index, topic) in observer.plan().topics.iter().enumerate() {
            if !settings.taps.includes(&topic.name) {
                continue;
            }
            let channels = channels(observer.plan(), index)?.into_iter().map(|channel| {
                let metadata = metadata(&channel, &topic.name, &topic.layout);
                let id = writer.channel(&channel.name, channel.schema(), &metadata).map_err(of_file)?;
                Ok::<_, RecordError>(Recorded { id, channel, due_ns: 0 })
            });
            let channels = channels.collect::<Result<Vec<_>, _>>()?;
            // of slices that nobody can draw
            if !channels.is_empty() {
                topics.push(Topic { index, tap: observer.tap(index)?, channels, samples: 0 });
            }
        }
        // A topic that describes another is read before it.
        let told: Vec<usize> = topics.iter().flat_map(Topic::forms).collect();
        topics.sort_by_key(|topic| !told.contains(&topic.index));
        writer.flush().map_err(of_file)?;
        let recorder = Self {
            observer,
            path: settings.output,
            writer,
            topics,
            events,
            event,
            reader: EventReader::default(),
            told: 0,
            clock,
            drawn_every_ns: settings.drawn_every_ns,
            batch: Batch::default(),
            ring: settings.last_ns.map(Ring::new),
            has_failed: false,
        };
        Ok((recorder, file))
    }

    /// Writes what was published since the last call.
    pub(super) fn drain(&mut self) -> Result<(), RecordError> {
        let Self { topics, batch, clock, drawn_every_ns, .. } = self;
        let told: Vec<usize> = topics.iter().flat_map(Topic::forms).collect();
        for place in 0..topics.len() {
            let Topic { index, tap, channels, samples } = &mut topics[place];
            let index = *index;
            let mut form = None;
            for _ in 0..AT_A_TIME {
                let read = tap.read(|stamp, bytes| {
                    *samples += 1;
                    let time_ns = clock.of(stamp);
                    channels.iter_mut().for_each(|channel| {
                        channel.take((stamp, bytes), time_ns, *drawn_every_ns, batch);
                    });
                    if told.contains(&index) {
                        form = Some(bytes.to_vec());
                    }
                });
                if !read {
                    break;
                }
            }
            if let Some(form) = form {
                let channels = topics.iter_mut().flat_map(|topic| &mut topic.channels);
                channels.for_each(|recorded| recorded.channel.note(index, &form));
            }
        }
        self.drain_events();
        self.write().map_err(|source| RecordError::File { path: self.path.clone(), source })
    }

    fn drain_events(&mut self) {
        let lockstep = self.observer.plan().clock == ClockKind::Lockstep;
        for record in self.observer.events(&mut self.reader) {
            self.told += 1;
            self.has_failed |= record.severity == EventSeverity::Error;
            let (episode, publish_time) = match record.simulated {
                Some(simulated) if lockstep => simulated,
                _ if lockstep => (0, 0),
                _ => (0, record.time_ns),
            };
            let stamp = Stamp {
                sequence: self.told,
                source_time: publish_time,
                publish_time,
                state_time: publish_time,
                episode,
                publisher: record.component.map_or(u32::MAX, |index| index as u32),
                restart_count: 0,
            };
            let time_ns = self.clock.of(&stamp);
            let text = format!("{}: {}", record.kind.name(), record.text);
            let bytes = event_bytes(&record);
            self.batch.push(self.events.0, &stamp, time_ns, |out| self.event.encode(&stamp, &bytes, out));
            let level = match record.severity as u32 {
                Event::INFORMATION => Level::Info,
                Event::WARNING => Level::Warning,
                _ => Level::Error,
            };
            let component = record.component.and_then(|index| self.observer.plan().components.get(index));
            let name = component.map_or("motorium", |component| component.name.as_str());
            self.batch.push(self.events.1, &stamp, time_ns, |out| {
                // A buffer that grows has room.
                let _ = log(time_ns, level, name, &text).encode(out);
            });
        }
    }

    fn write(&mut self) -> Result<(), McapError> {
        let Batch { bytes, messages } = &mut self.batch;
        messages.sort_by_key(|message| message.time_ns);
        for message in messages.drain(..) {
            let data = &bytes[message.start..message.end];
            match &mut self.ring {
                Some(ring) => ring.push(message, data),
                None => message.write(data, &mut self.writer)?,
            }
        }
        bytes.clear();
        self.writer.flush_if_due().map(|_| ())
    }

    /// The counts so far.
    pub(super) fn counts(&self) -> Counts {
        Counts {
            samples: self.topics.iter().map(|topic| topic.samples).sum(),
            lost: self.topics.iter().map(|topic| topic.tap.missed()).sum(),
            bytes: self.writer.bytes(),
        }
    }

    /// Writes what is left, and ends the file. One that was to keep the end of a bad run is removed after a good one.
    pub(super) fn finish(mut self) -> Result<Counts, RecordError> {
        self.drain()?;
        if let Some(ring) = self.ring.take() {
            if !self.has_failed {
                let counts = self.counts();
                drop(self.writer);
                return match std::fs::remove_file(&self.path) {
                    Ok(()) => Ok(counts),
                    Err(error) => Err(RecordError::File { path: self.path, source: error.into() }),
                };
            }
            for (message, data) in &ring.messages {
                let written = message.write(data, &mut self.writer);
                written.map_err(|source| RecordError::File { path: self.path.clone(), source })?;
            }
        }
        let counts = self.counts();
        let mut values = BTreeMap::from([
            ("samples".to_string(), counts.samples.to_string()),
            ("lost".to_string(), counts.lost.to_string()),
        ]);
        for topic in &self.topics {
            let name = &self.observer.plan().topics[topic.index].name;
            values.insert(format!("samples {name}"), topic.samples.to_string());
            values.insert(format!("lost {name}"), topic.tap.missed().to_string());
        }
        let Self { path, mut writer, .. } = self;
        let ended = writer.metadata(COUNTS, values).and_then(|()| writer.finish());
        ended.map_err(|source| RecordError::File { path, source })?;
        Ok(counts)
    }
}

impl Topic {
    /// The topics that tell how to read this one.
    fn forms(&self) -> impl Iterator<Item = usize> {
        self.channels.iter().filter_map(|recorded| recorded.channel.form_topic())
    }
}

impl Recorded {
    /// Puts the message of a sample into a batch.
    fn take(&mut self, (stamp, bytes): (&Stamp, &[u8]), time_ns: u64, every_ns: u64, batch: &mut Batch) {
        if !self.channel.needs_every_sample() {
            if time_ns < self.due_ns {
                return;
            }
            self.due_ns = time_ns + every_ns;
        }
        let channel = &mut self.channel;
        // A sample that cannot be drawn is in the exact channel.
        batch.push(self.id, stamp, time_ns, |out| {
            let _ = channel.encode(stamp, bytes, time_ns, out);
        });
    }
}

/// The channels of the events: exact, and lines of a log.
fn event_channels(writer: &mut Writer, event: &Derived) -> Result<(u16, u16), McapError> {
    let exact = writer.channel(EVENTS, event.schema(), &exact_metadata(EVENTS, &Event::layout()))?;
    let log = Schema::of::<foxglove::messages::Log>();
    Ok((exact, writer.channel("/log", &log, &BTreeMap::from([(TOPIC.to_string(), EVENTS.to_string())]))?))
}

fn metadata(channel: &Channel, topic: &str, layout: &TypeLayout) -> BTreeMap<String, String> {
    match channel.content {
        Content::Exact(_) => exact_metadata(topic, layout),
        Content::Drawn(_) => BTreeMap::from([(TOPIC.to_string(), topic.to_string())]),
    }
}

fn exact_metadata(topic: &str, layout: &TypeLayout) -> BTreeMap<String, String> {
    BTreeMap::from([
        (TOPIC.to_string(), topic.to_string()),
        (LAYOUT.to_string(), serde_json::to_string(layout).unwrap_or_default()),
        (HASH.to_string(), layout.hash()),
    ])
}

/// An event as the bytes of a [`Event`].
fn event_bytes(record: &EventRecord) -> Vec<u8> {
    let (layout, event) = (Event::layout(), Event::of(&record.text));
    let mut bytes = vec![0; layout.size];
    let mut put = |field: &str, content: &[u8]| {
        if let Some(field) = layout.fields.iter().find(|known| known.name == field) {
            bytes[field.offset..field.offset + content.len()].copy_from_slice(content);
        }
    };
    put("code", &(record.kind as u32).to_ne_bytes());
    put("severity", &(record.severity as u32).to_ne_bytes());
    put("value", &record.value.to_ne_bytes());
    put("count", &(event.as_str().len() as u32).to_ne_bytes());
    put("text", event.as_str().as_bytes());
    bytes
}
