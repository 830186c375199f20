//! Channels and messages of an MCAP file.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use mcap::MAGIC;
use mcap::records::Record;

use super::decoder::{Decoder, Schema, Unsupported};
use super::framing::Summary;
use super::records::{Damage, Records};

/// A channel of an MCAP file.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name of the channel, such as `/joint_states`.
    pub topic: String,
    /// Encoding of the messages, such as `cdr`.
    pub encoding: String,
    /// Schema of the messages.
    pub schema: Option<Schema>,
    /// Metadata that the writer added.
    pub metadata: BTreeMap<String, String>,
    /// Number of messages of this channel in the file.
    pub messages: u64,
    /// Decoder of the messages, or the reason why they cannot be decoded.
    pub decoder: Result<Decoder, Unsupported>,
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` ({}", self.topic, self.encoding)?;
        match &self.schema {
            Some(schema) => write!(f, ", {})", schema.name),
            None => write!(f, ")"),
        }
    }
}

/// An error of reading an MCAP file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LogError {
    /// The file is not an MCAP file.
    #[error("the file is not a recording (MCAP)")]
    Format,
    /// The file has no channel.
    #[error("the file has no channels{}", if *.is_whole { "" } else { ": it is incomplete" })]
    Empty {
        /// `true` if the end of the file is present.
        is_whole: bool,
    },
    /// No channel has this name.
    #[error("the file has no channel `{topic}`; its channels are {known}")]
    NoChannel {
        /// The requested name.
        topic: String,
        /// The channels of the file.
        known: String,
    },
    /// The messages of a channel cannot be decoded.
    #[error("channel {channel}: {reason}")]
    Unsupported {
        /// Description of the channel, with its encoding and schema.
        channel: String,
        /// The reason.
        reason: Unsupported,
    },
    /// A message of a channel is damaged.
    #[error("channel `{topic}`, message {number}: {reason}")]
    Damaged {
        /// Name of the channel.
        topic: String,
        /// Number of the message, counted from 1.
        number: u64,
        /// The reason.
        reason: String,
    },
    /// The channel of a movement cannot be selected, because not exactly one channel has numbers in the
    /// field.
    #[error("{}", choice(.field, .found, .known))]
    Choice {
        /// Name of the field.
        field: String,
        /// The channels with such numbers.
        found: Vec<String>,
        /// All channels of the file.
        known: String,
    },
    /// The channels in a message differ from the channels in the first message.
    #[error("channel `{topic}`, message {number}: found {found}, expected {expected}")]
    Uneven {
        /// Name of the channel.
        topic: String,
        /// Number of the message, counted from 1.
        number: u64,
        /// Names of the numbers in the message.
        found: String,
        /// Names of the numbers in the first message.
        expected: String,
    },
}

fn choice(field: &str, found: &[String], known: &str) -> String {
    match found {
        [] => format!("no channel has numbers `{field}`; the channels of the file are {known}"),
        found => format!(
            "{} channels have a numeric field `{field}` ({}), expected one such channel; select it with `--topic` or the key `topic`",
            found.len(),
            found.join(", ")
        ),
    }
}

/// A message of an MCAP file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message<'l> {
    /// Index in [`MessageLog::channels`].
    pub channel: usize,
    /// Log time, ns.
    pub time_ns: u64,
    /// Encoded content.
    pub data: Cow<'l, [u8]>,
}

/// The channels and messages of an MCAP file, written by any program.
#[derive(Debug)]
pub struct MessageLog<B> {
    bytes: B,
    summary: Summary,
    channels: Vec<Channel>,
    /// Channel index by the channel number in the file.
    of_number: BTreeMap<u16, usize>,
    writer: String,
    times: Option<(u64, u64)>,
    damage: Damage,
    is_whole: bool,
}

impl<B: AsRef<[u8]>> MessageLog<B> {
    /// Opens the content of a file and reads everything except the messages. Channels with the same name and
    /// schema are merged.
    ///
    /// # Errors
    /// The content is not an MCAP file, or it has no channels.
    pub fn new(bytes: B) -> Result<Self, LogError> {
        if !bytes.as_ref().starts_with(MAGIC) {
            return Err(LogError::Format);
        }
        let summary = Summary::read(bytes.as_ref());
        let mut log = Self {
            bytes,
            summary: Summary::default(),
            channels: Vec::new(),
            of_number: BTreeMap::new(),
            writer: String::new(),
            times: None,
            damage: Damage::default(),
            is_whole: false,
        };
        let mut schemas = BTreeMap::new();
        // The end of a file repeats definitions, which may be damaged elsewhere.
        for record in &summary.definitions {
            define(&mut log.channels, &mut log.of_number, &mut schemas, record);
        }
        let mut records = Records::new(log.bytes.as_ref(), &summary, true);
        for record in records.by_ref() {
            match &record {
                Record::Header(header) => log.writer.clone_from(&header.library),
                Record::Message { header, .. } => {
                    let Some(channel) = log.of_number.get(&header.channel_id) else { continue };
                    log.channels[*channel].messages += 1;
                    let (first, last) = log.times.unwrap_or((header.log_time, header.log_time));
                    log.times = Some((first.min(header.log_time), last.max(header.log_time)));
                }
                record => define(&mut log.channels, &mut log.of_number, &mut schemas, record),
            }
        }
        (log.is_whole, log.damage) = (records.is_whole, records.damage.clone());
        log.summary = summary;
        match log.channels.is_empty() {
            true => Err(LogError::Empty { is_whole: log.is_whole }),
            false => Ok(log),
        }
    }

    /// Returns the channels, in the order of the file.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Returns a text for error messages that lists the channels with their encodings and schemas.
    pub fn described(&self) -> String {
        let known: Vec<String> = self.channels.iter().map(ToString::to_string).collect();
        known.join(", ")
    }

    /// Returns the index and the decoder of the channel named `topic`.
    ///
    /// # Errors
    /// No channel has this name, or its messages cannot be decoded.
    pub fn channel(&self, topic: &str) -> Result<(usize, &Decoder), LogError> {
        let index = self.channels.iter().position(|channel| channel.topic == topic);
        let index =
            index.ok_or_else(|| LogError::NoChannel { topic: topic.to_string(), known: self.described() })?;
        Ok((index, self.decoder(index)?))
    }

    /// Returns the decoder of the channel at `index`.
    ///
    /// # Errors
    /// The messages cannot be decoded.
    pub fn decoder(&self, index: usize) -> Result<&Decoder, LogError> {
        let channel = &self.channels[index];
        channel
            .decoder
            .as_ref()
            .map_err(|reason| LogError::Unsupported { channel: channel.to_string(), reason: reason.clone() })
    }

    /// Returns all messages, in the order of the file.
    pub fn messages(&self) -> impl Iterator<Item = Message<'_>> {
        Records::new(self.bytes.as_ref(), &self.summary, false).filter_map(|record| {
            let Record::Message { header, data } = record else { return None };
            let channel = *self.of_number.get(&header.channel_id)?;
            Some(Message { channel, time_ns: header.log_time, data })
        })
    }

    /// Returns the name of the program that wrote the file; empty if unknown.
    pub fn writer(&self) -> &str {
        &self.writer
    }

    /// Returns the times of the first and last message, ns; `None` without messages.
    pub fn times(&self) -> Option<(u64, u64)> {
        self.times
    }

    /// Returns descriptions of the file's faults: a missing end or damage. The list is empty for an intact
    /// file.
    pub fn faults(&self) -> Vec<String> {
        self.damage.faults(self.is_whole, self.times.map_or(0, |(first, _)| first))
    }
}

fn define(
    channels: &mut Vec<Channel>,
    of_number: &mut BTreeMap<u16, usize>,
    schemas: &mut BTreeMap<u16, Schema>,
    record: &Record<'_>,
) {
    match record {
        Record::Schema { header, data } => {
            let (name, encoding) = (header.name.clone(), header.encoding.clone());
            schemas.entry(header.id).or_insert_with(|| Schema { name, encoding, data: data.to_vec() });
        }
        Record::Channel(found) if !of_number.contains_key(&found.id) => {
            let schema = schemas.get(&found.schema_id).cloned();
            let encoding = match found.message_encoding.as_str() {
                // Some writers omit the encoding of messages that are text.
                "" if schema.as_ref().is_some_and(|schema| schema.encoding == "jsonschema") => "json",
                encoding => encoding,
            };
            let same = channels.iter().position(|known| {
                known.topic == found.topic && known.encoding == encoding && known.schema == schema
            });
            let index = same.unwrap_or_else(|| {
                channels.push(Channel {
                    topic: found.topic.clone(),
                    encoding: encoding.to_string(),
                    decoder: Decoder::new(encoding, schema.as_ref()),
                    schema,
                    metadata: found.metadata.clone(),
                    messages: 0,
                });
                channels.len() - 1
            });
            of_number.insert(found.id, index);
        }
        _ => {}
    }
}
