//! A recorder: the taps of a run, and the output file.

use std::collections::BTreeMap;
use std::fs::File;

use mcap::McapError;
use motorium::component::Observer;
use motorium::region::EventReader;
use motorium::state::{Event, StateBuffer as _, TypeLayout};

use super::batch::Batch;
use super::file::Writer;
use super::head::head;
use super::settings::{Counts, RecordError, Settings};
use super::sink::Sink;
use super::taps::{Clock, Events, Readers, Recorded, Topic};
use super::{EVENTS, HASH, LAYOUT, TOPIC};
use crate::foxglove::{Channel, Content, Derived, Schema, channels};

/// Taps of a run and the output file, in one thread.
pub(super) struct Recorder {
    readers: Readers,
    sink: Sink,
    batch: Batch,
}

impl Recorder {
    /// Opens the file and all taps. Also returns a second file handle, with which another thread syncs the
    /// file to disk.
    pub(super) fn open(observer: Observer, settings: Settings) -> Result<(Self, File), RecordError> {
        let path = settings.output.clone();
        let of_file = |source| RecordError::File { path: path.clone(), source };
        let (mut writer, file) = Writer::create(&settings.output).map_err(of_file)?;
        let clock = Clock::new(observer.plan(), &observer);
        let start_ns = clock.zero_ns + if clock.zero_ns > 0 { observer.now_ns() } else { 0 };
        head(&mut writer, observer.plan(), &settings, start_ns).map_err(of_file)?;
        let event = Derived::new(&Event::layout())?;
        let events = event_channels(&mut writer, &event).map_err(of_file)?;
        let mut chosen = Vec::new();
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
            // slices without a drawing have no channel
            if !channels.is_empty() {
                chosen.push((index, channels));
            }
        }
        writer.flush().map_err(of_file)?;
        // From here on, reading does not wait for the file, so every published value is read.
        let opened = chosen.into_iter().map(|(index, channels)| {
            Ok::<_, RecordError>(Topic { index, tap: observer.tap(index)?, channels, samples: 0 })
        });
        let topics = opened.collect::<Result<Vec<_>, _>>()?;
        let events =
            Events { channels: events, derived: event, reader: EventReader::default(), published: 0 };
        let readers = Readers::new(observer, topics, events, clock, settings.drawn_every_ns);
        let sink = Sink::new(settings.output, writer, settings.last_ns);
        Ok((Self { readers, sink, batch: Batch::default() }, file))
    }

    /// Splits into two halves for separate threads.
    pub(super) fn split(self) -> (Readers, Sink) {
        (self.readers, self.sink)
    }

    /// Writes the values published since the last call.
    pub(super) fn drain(&mut self) -> Result<(), RecordError> {
        self.readers.read(&mut self.batch);
        self.sink.write(&mut self.batch)
    }

    /// The counts so far.
    pub(super) fn counts(&self) -> Counts {
        Counts { bytes: self.sink.bytes(), ..self.readers.counts() }
    }

    /// Writes the remaining values and ends the file. If only failures are recorded, the file of a successful
    /// run is removed.
    pub(super) fn finish(mut self) -> Result<Counts, RecordError> {
        self.readers.read_last(&mut self.batch);
        self.sink.write(&mut self.batch)?;
        let counts = self.readers.counts();
        let bytes = self.sink.finish(self.readers.summary())?;
        Ok(Counts { bytes, ..counts })
    }
}

/// Channels of the events: exact messages, and log lines.
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
