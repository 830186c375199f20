//! Scan of a file: all content of a recording except its samples.

use std::collections::{BTreeMap, BTreeSet};

use mcap::records::Record;
use motorium::state::TypeLayout;
use motorium_recordings::messages::{Damage, Records, Summary};

use super::recorded::{RecordedPictures, RecordedTopic, Source};
use super::{COUNTS, KEPT, LAYOUT, TOPIC};
use crate::foxglove::Derived;

/// Schema name of images.
const PICTURES: &str = "foxglove.RawImage";

/// All content of a file except its samples.
#[derive(Debug, Default)]
pub(super) struct Scan {
    pub(super) topics: Vec<RecordedTopic>,
    pub(super) pictures: Vec<RecordedPictures>,
    /// Source of the messages of each channel, by channel number.
    pub(super) of_channel: BTreeMap<u16, Source>,
    pub(super) attachments: Vec<(String, Vec<u8>)>,
    /// Last message of each channel without a topic.
    pub(super) latched: BTreeMap<String, Vec<u8>>,
    pub(super) metadata: BTreeMap<String, BTreeMap<String, String>>,
    pub(super) is_whole: bool,
    pub(super) times: Option<(u64, u64)>,
    /// Maximum time by which a message in the file is earlier than a preceding one, ns.
    pub(super) disorder_ns: u64,
    pub(super) damage: Damage,
    /// Number of messages that are declared in the file but missing from it.
    pub(super) missing: u64,
    /// Profile of the header.
    pub(super) profile: String,
    channels: BTreeSet<u16>,
    schemas: BTreeMap<u16, String>,
    of_no_topic: BTreeMap<u16, String>,
    counts: BTreeMap<u16, u64>,
}

impl Scan {
    /// Scans a file.
    ///
    /// # Errors
    /// Returns an error if a motorium channel has a layout that this version cannot read.
    pub(super) fn of_file(file: &[u8], summary: &Summary) -> Result<Self, String> {
        let mut scan = Self::default();
        let mut records = Records::new(file, summary, true);
        for record in records.by_ref() {
            match record {
                Record::Message { header, data } => {
                    if !scan.channels.contains(&header.channel_id) {
                        // The chunk with the channel's definition is damaged; the end of the file repeats it.
                        scan.define(summary, header.channel_id)?;
                    }
                    scan.message(header.channel_id, header.log_time, &data);
                }
                Record::Header(header) => scan.profile = header.profile,
                Record::Attachment { header, data, .. } => {
                    scan.attachments.push((header.name, data.into_owned()));
                }
                Record::Metadata(found) => {
                    scan.metadata.insert(found.name, found.metadata);
                }
                other => scan.definition(&other)?,
            }
        }
        (scan.is_whole, scan.damage) = (records.is_whole, records.damage);
        for record in &summary.definitions {
            scan.definition(record)?;
        }
        scan.missing = scan.missing_messages(summary);
        Ok(scan)
    }

    /// Returns `true` if the file defines a channel.
    pub(super) fn has_channels(&self) -> bool {
        !self.channels.is_empty()
    }

    /// Defines a channel from its definition at the end of the file.
    fn define(&mut self, summary: &Summary, channel: u16) -> Result<(), String> {
        for record in &summary.definitions {
            match record {
                Record::Channel(found) if found.id != channel => {}
                record => self.definition(record)?,
            }
        }
        Ok(())
    }

    fn definition(&mut self, record: &Record<'_>) -> Result<(), String> {
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name.clone());
            }
            Record::Channel(channel) if !self.channels.contains(&channel.id) => {
                let (id, name) = (channel.id, channel.topic.clone());
                self.channels.insert(id);
                let topic = channel.metadata.get(TOPIC);
                let is_picture =
                    self.schemas.get(&channel.schema_id).is_some_and(|schema| schema == PICTURES);
                if let (true, Some(topic)) = (is_picture, topic) {
                    self.of_channel.insert(id, Source::Pictures(self.pictures.len()));
                    self.pictures.push(RecordedPictures { topic: topic.clone(), channel: name, count: 0 });
                    return Ok(());
                }
                if topic.is_none() {
                    self.of_no_topic.insert(id, name.clone());
                }
                let Some(layout) = channel.metadata.get(LAYOUT) else { return Ok(()) };
                let layout: TypeLayout = serde_json::from_str(layout).map_err(|error| error.to_string())?;
                let derived = Derived::new(&layout).map_err(|error| error.to_string())?;
                self.of_channel.insert(id, Source::Topic(self.topics.len()));
                let name = topic.unwrap_or(&name).clone();
                self.topics.push(RecordedTopic { name, layout, samples: 0, derived });
            }
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, channel: u16, time_ns: u64, data: &[u8]) {
        *self.counts.entry(channel).or_default() += 1;
        if let Some(name) = self.of_no_topic.get(&channel) {
            self.latched.insert(name.clone(), data.to_vec());
        }
        let Some(source) = self.of_channel.get(&channel) else { return };
        match *source {
            Source::Topic(topic) => self.topics[topic].samples += 1,
            Source::Pictures(of_camera) => self.pictures[of_camera].count += 1,
        }
        let (first, last) = self.times.unwrap_or((time_ns, time_ns));
        self.times = Some((first.min(time_ns), last.max(time_ns)));
        self.disorder_ns = self.disorder_ns.max(last.saturating_sub(time_ns));
    }

    /// Number of messages that are declared at the end of the file but missing from it. The index counts the
    /// messages of all channels; the recorder counts those on its topics.
    fn missing_messages(&self, summary: &Summary) -> u64 {
        let stated = summary.statistics.iter().flat_map(|statistics| &statistics.channel_message_counts);
        let by_index: u64 = stated
            .map(|(channel, stated)| stated.saturating_sub(self.counts.get(channel).copied().unwrap_or(0)))
            .sum();
        let Some(counts) = self.metadata.get(COUNTS).filter(|counts| !counts.contains_key(KEPT)) else {
            return by_index;
        };
        let by_recorder: u64 = self
            .topics
            .iter()
            .filter_map(|topic| Some((topic, counts.get(&format!("samples {}", topic.name))?)))
            .map(|(topic, stated)| stated.parse::<u64>().unwrap_or(0).saturating_sub(topic.samples))
            .sum();
        by_index.max(by_recorder)
    }
}
