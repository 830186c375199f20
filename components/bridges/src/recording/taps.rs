//! Taps of all selected topics of a run, and the conversion of their samples to messages.

use std::collections::BTreeMap;

use foxglove::Encode as _;
use foxglove::messages::log::Level;
use motorium::component::Observer;
use motorium::plan::{ClockKind, Plan};
use motorium::region::{EventReader, EventRecord, EventSeverity};
use motorium::state::{Event, Stamp, StateBuffer as _};
use motorium::transport::Tap;

use super::batch::Batch;
use super::settings::{Counts, unix_ns};
use crate::foxglove::{Channel, Derived, log};

/// Maximum number of samples read from one topic at a time, so that a fast publisher does not delay the
/// others.
const AT_A_TIME: usize = 4096;

/// Taps of all selected topics, and the events of the run.
pub(super) struct Readers {
    observer: Observer,
    topics: Vec<Topic>,
    /// Topics that describe the samples of others.
    derived: Vec<usize>,
    events: Events,
    clock: Clock,
    drawn_every_ns: u64,
}

/// Events of a run.
pub(super) struct Events {
    /// Channels: exact messages, and log lines.
    pub(super) channels: (u16, u16),
    pub(super) derived: Derived,
    pub(super) reader: EventReader,
    pub(super) published: u64,
}

/// One recorded topic.
pub(super) struct Topic {
    /// Its index in the plan.
    pub(super) index: usize,
    pub(super) tap: Tap,
    pub(super) channels: Vec<Recorded>,
    pub(super) samples: u64,
}

/// One channel of a topic.
pub(super) struct Recorded {
    pub(super) id: u16,
    pub(super) channel: Channel,
    /// Time at which the next drawn message is due.
    pub(super) due_ns: u64,
}

/// Converts stamp times to file times.
pub(super) struct Clock {
    /// Unix time at time zero of the stamps, ns; 0 in lockstep.
    pub(super) zero_ns: u64,
    /// In lockstep, where time restarts with each episode: the episode, the file time at which it began, and
    /// its latest file time.
    episode: Option<(u64, u64, u64)>,
}

impl Clock {
    pub(super) fn new(plan: &Plan, observer: &Observer) -> Self {
        let zero_ns = match plan.clock {
            ClockKind::Realtime => unix_ns().saturating_sub(observer.now_ns()),
            ClockKind::Lockstep => 0,
        };
        Self { zero_ns, episode: (plan.clock == ClockKind::Lockstep).then_some((0, 0, 0)) }
    }

    fn log_time(&mut self, stamp: &Stamp) -> u64 {
        let Some((episode, began, last)) = &mut self.episode else {
            return self.zero_ns + stamp.publish_time;
        };
        if stamp.episode > *episode {
            (*episode, *began) = (stamp.episode, *last);
        }
        let time = self.zero_ns + *began + stamp.publish_time;
        *last = (*last).max(time - self.zero_ns);
        time
    }
}

impl Readers {
    pub(super) fn new(
        observer: Observer,
        mut topics: Vec<Topic>,
        events: Events,
        clock: Clock,
        drawn_every_ns: u64,
    ) -> Self {
        let derived: Vec<usize> = topics.iter().flat_map(Topic::forms).collect();
        // Topics that describe others are read first.
        topics.sort_by_key(|topic| !derived.contains(&topic.index));
        Self { observer, topics, derived, events, clock, drawn_every_ns }
    }

    /// Adds the last samples to a batch. A run whose launcher died counts as failed, even without a reported
    /// event.
    pub(super) fn read_last(&mut self, batch: &mut Batch) {
        batch.has_failed |= self.observer.is_orphaned();
        self.read(batch);
    }

    /// Adds the values published since the last call to a batch.
    pub(super) fn read(&mut self, batch: &mut Batch) {
        let Self { topics, derived, clock, drawn_every_ns, .. } = self;
        for place in 0..topics.len() {
            let Topic { index, tap, channels, samples } = &mut topics[place];
            let index = *index;
            let mut form = None;
            for _ in 0..AT_A_TIME {
                let read = tap.read(|stamp, bytes| {
                    *samples += 1;
                    let time_ns = clock.log_time(stamp);
                    channels.iter_mut().for_each(|channel| {
                        channel.take((stamp, bytes), time_ns, *drawn_every_ns, batch);
                    });
                    if derived.contains(&index) {
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
        self.read_events(batch);
    }

    fn read_events(&mut self, batch: &mut Batch) {
        let lockstep = self.observer.plan().clock == ClockKind::Lockstep;
        for record in self.observer.events(&mut self.events.reader) {
            self.events.published += 1;
            batch.has_failed |= record.severity == EventSeverity::Error;
            let publish_time = if lockstep { record.simulated_ns.unwrap_or(0) } else { record.time_ns };
            let stamp = Stamp {
                sequence: self.events.published,
                source_time: publish_time,
                publish_time,
                state_time: publish_time,
                episode: record.episode,
                publisher: record.component.map_or(u32::MAX, |index| index as u32),
                restart_count: 0,
            };
            let time_ns = self.clock.log_time(&stamp);
            let text = format!("{}: {}", record.kind.name(), record.text);
            let bytes = event_bytes(&record);
            batch.push(self.events.channels.0, &stamp, time_ns, |out| {
                self.events.derived.encode(&stamp, &bytes, out)
            });
            let level = match record.severity as u32 {
                Event::INFORMATION => Level::Info,
                Event::WARNING => Level::Warning,
                _ => Level::Error,
            };
            let component = record.component.and_then(|index| self.observer.plan().components.get(index));
            let name = component.map_or("motorium", |component| component.name.as_str());
            batch.push(self.events.channels.1, &stamp, time_ns, |out| {
                // Encoding into a growable buffer does not fail.
                let _ = log(time_ns, level, name, &text).encode(out);
            });
        }
    }

    /// Number of samples that were read, and of samples that were overwritten before they were read.
    pub(super) fn counts(&self) -> Counts {
        Counts {
            samples: self.topics.iter().map(|topic| topic.samples).sum(),
            lost: self.topics.iter().map(|topic| topic.tap.missed()).sum(),
            bytes: 0,
        }
    }

    /// Returns the counts per topic, in the format of the file.
    pub(super) fn summary(&self) -> BTreeMap<String, String> {
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
        values
    }
}

impl Topic {
    /// Topics that describe the samples of this one.
    fn forms(&self) -> impl Iterator<Item = usize> {
        self.channels.iter().filter_map(|recorded| recorded.channel.form_topic())
    }
}

impl Recorded {
    /// Adds the message of a sample to a batch.
    fn take(&mut self, (stamp, bytes): (&Stamp, &[u8]), time_ns: u64, every_ns: u64, batch: &mut Batch) {
        if !self.channel.needs_every_sample() {
            if time_ns < self.due_ns {
                return;
            }
            self.due_ns = time_ns + every_ns;
        }
        let channel = &mut self.channel;
        // A sample that cannot be drawn is still in the exact channel.
        batch.push(self.id, stamp, time_ns, |out| {
            let _ = channel.encode(stamp, bytes, time_ns, out);
        });
    }
}

/// Converts an event to the bytes of an [`Event`].
fn event_bytes(record: &EventRecord) -> Vec<u8> {
    let (layout, event) = (Event::layout(), Event::truncated(&record.text));
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
