//! Reading recordings.

#![allow(unsafe_code)] // a file is mapped rather than read: recordings are larger than memory

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::read::{ChunkFlattener, LinearReader, Options};
use mcap::records::{ChunkHeader, Record};
use memmap2::Mmap;
use motorium::plan::Plan;
use motorium::state::TypeLayout;

use super::{LAYOUT, PLAN, RUN, TOPIC};
use crate::foxglove::{Derived, DerivedError};

/// Name of the schema of pictures.
const PICTURES: &str = "foxglove.RawImage";

/// A recording, opened for reading.
///
/// ```no_run
/// use motorium_bridges::recording::Recording;
///
/// let recording = Recording::open("out/run.mcap".as_ref())?;
/// println!("graph {}", recording.plan()?.name);
/// for sample in recording.samples() {
///     let sample = sample?;
///     println!("{} {}", recording.topics()[sample.topic].name, sample.stamp.sequence);
/// }
/// # Ok::<(), motorium_bridges::recording::ReadError>(())
/// ```
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    map: Mmap,
    topics: Vec<RecordedTopic>,
    pictures: Vec<RecordedPictures>,
    /// Kind of the messages of each channel, by the number of the channel.
    pub(super) of_channel: BTreeMap<u16, Source>,
    attachments: Vec<(String, Vec<u8>)>,
    /// The last message of each channel that belongs to no topic.
    latched: BTreeMap<String, Vec<u8>>,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
    is_whole: bool,
    times: Option<(u64, u64)>,
    /// Longest time by which a message lies before one that stands before it in the file, ns.
    pub(super) disorder_ns: u64,
    damaged: Vec<(u64, u64)>,
}

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedTopic {
    /// Its name.
    pub name: String,
    /// Layout of its samples.
    pub layout: TypeLayout,
    /// Number of its samples in the file.
    pub samples: u64,
    derived: Derived,
}

/// The pictures of a camera in a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedPictures {
    /// Name of their topic.
    pub topic: String,
    /// Name of their channel in the file, whose messages are `foxglove.RawImage`.
    pub channel: String,
    /// Number of the pictures in the file.
    pub count: u64,
}

/// The source of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    /// Index among the topics.
    Topic(usize),
    /// Index among the pictures.
    Pictures(usize),
}

impl RecordedTopic {
    /// The messages of its exact channel.
    pub fn derived(&self) -> &Derived {
        &self.derived
    }
}

fn told(error: &McapError) -> String {
    match error {
        McapError::BadMagic => "this is no recording, which is an MCAP file".to_owned(),
        McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}

/// The reason why a file of this many bytes, which ends before its first message, is refused.
pub(super) fn cut_off(bytes: usize) -> String {
    format!("it is cut off after {bytes} bytes, before anything was recorded")
}

/// The error of reading a recording. Its words hold those of its reason, which is therefore not its source as well.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read.
    #[error("{path}: {reason}", path = .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        reason: std::io::Error,
    },
    /// The file is no MCAP file, or damaged.
    #[error("{path}: {}", told(.reason), path = .path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The error of the format.
        reason: Box<McapError>,
    },
    /// A message that cannot be read.
    #[error("{path}: topic `{topic}`: {reason}", path = .path.display())]
    Message {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// The error.
        reason: Box<DerivedError>,
    },
    /// The recording does not hold what was asked for.
    #[error("{path}: {reason}", path = .path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The part that is missing, and what there is.
        reason: String,
    },
    /// The file is no recording of motorium.
    #[error("{path} is no recording of this version of motorium: {reason}", path = .path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The part that is missing or different.
        reason: String,
    },
}

impl Recording {
    /// Opens a recording, torn or whole, and reads what it holds but the samples.
    ///
    /// # Errors
    /// The file cannot be read, or is no recording.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let io = |reason| ReadError::Io { path: path.to_path_buf(), reason };
        let file = File::open(path).map_err(io)?;
        let metadata = file.metadata().map_err(io)?;
        if !metadata.is_file() {
            let what = if metadata.is_dir() { "it is a folder" } else { "it is a device or a pipe" };
            return Err(io(std::io::Error::other(format!("{what}, expected the file of a recording"))));
        }
        if metadata.len() == 0 {
            let reason = "it is empty".to_string();
            return Err(ReadError::Foreign { path: path.to_path_buf(), reason });
        }
        // SAFETY: recordings are written once. One that is cut while it is mapped ends the program, and damages nothing else.
        let map = unsafe { Mmap::map(&file) }.map_err(io)?;
        let mut this = Self {
            path: path.to_path_buf(),
            map,
            topics: Vec::new(),
            pictures: Vec::new(),
            of_channel: BTreeMap::new(),
            attachments: Vec::new(),
            latched: BTreeMap::new(),
            metadata: BTreeMap::new(),
            is_whole: false,
            times: None,
            disorder_ns: 0,
            damaged: Vec::new(),
        };
        this.scan()?;
        this.damaged = this.damaged_chunks();
        Ok(this)
    }

    fn format(&self, source: McapError) -> ReadError {
        ReadError::Format { path: self.path.clone(), reason: Box::new(source) }
    }

    pub(super) fn records(&self) -> Result<ChunkFlattener<'_>, ReadError> {
        ChunkFlattener::new_with_options(&self.map, Options::IgnoreEndMagic.into())
            .map_err(|source| self.format(source))
    }

    fn scan(&mut self) -> Result<(), ReadError> {
        let (mut topics, mut of_channel) = (Vec::<RecordedTopic>::new(), BTreeMap::new());
        let (mut pictures, mut of_pictures) = (Vec::<RecordedPictures>::new(), None);
        let (mut attachments, mut metadata, mut is_whole) = (Vec::new(), BTreeMap::new(), false);
        let (mut began, mut times) = (false, None::<(u64, u64)>);
        let mut disorder_ns = 0;
        let (mut of_no_topic, mut latched) = (BTreeMap::new(), BTreeMap::new());
        for record in self.records()? {
            let record = match record {
                Ok(record) => record,
                Err(error) if !began => return Err(self.format(error)),
                // The end of a torn file.
                Err(_) => break,
            };
            began = true;
            match record {
                Record::Schema { header, .. } if header.name == PICTURES => of_pictures = Some(header.id),
                Record::Channel(channel) if !of_channel.contains_key(&channel.id) => {
                    let topic = channel.metadata.get(TOPIC);
                    if let (true, Some(topic)) = (of_pictures == Some(channel.schema_id), topic) {
                        of_channel.insert(channel.id, Source::Pictures(pictures.len()));
                        let (topic, channel) = (topic.clone(), channel.topic);
                        pictures.push(RecordedPictures { topic, channel, count: 0 });
                        continue;
                    }
                    if topic.is_none() {
                        of_no_topic.insert(channel.id, channel.topic.clone());
                    }
                    let Some(layout) = channel.metadata.get(LAYOUT) else { continue };
                    let foreign = |reason: String| ReadError::Foreign { path: self.path.clone(), reason };
                    let layout: TypeLayout =
                        serde_json::from_str(layout).map_err(|error| foreign(error.to_string()))?;
                    let derived = Derived::new(&layout).map_err(|error| foreign(error.to_string()))?;
                    of_channel.insert(channel.id, Source::Topic(topics.len()));
                    let name = topic.unwrap_or(&channel.topic).clone();
                    topics.push(RecordedTopic { name, layout, samples: 0, derived });
                }
                Record::Message { header, data } => {
                    if let Some(name) = of_no_topic.get(&header.channel_id) {
                        latched.insert(name.clone(), data.into_owned());
                    }
                    if let Some(source) = of_channel.get(&header.channel_id) {
                        match *source {
                            Source::Topic(topic) => topics[topic].samples += 1,
                            Source::Pictures(of_camera) => pictures[of_camera].count += 1,
                        }
                        let (first, last) = times.unwrap_or((header.log_time, header.log_time));
                        times = Some((first.min(header.log_time), last.max(header.log_time)));
                        disorder_ns = disorder_ns.max(last.saturating_sub(header.log_time));
                    }
                }
                Record::Attachment { header, data, .. } => {
                    attachments.push((header.name, data.into_owned()));
                }
                Record::Metadata(found) => {
                    metadata.insert(found.name, found.metadata);
                }
                Record::Footer(_) => is_whole = true,
                _ => {}
            }
        }
        (self.topics, self.pictures, self.of_channel) = (topics, pictures, of_channel);
        (self.attachments, self.metadata, self.latched) = (attachments, metadata, latched);
        (self.is_whole, self.times, self.disorder_ns) = (is_whole, times, disorder_ns);
        Ok(())
    }

    /// The times of the first and the last message of each chunk whose bytes are not those that were written.
    fn damaged_chunks(&self) -> Vec<(u64, u64)> {
        let records = LinearReader::new_with_options(&self.map, Options::IgnoreEndMagic.into());
        let chunks = records.into_iter().flatten().map_while(Result::ok).filter_map(|record| match record {
            Record::Chunk { header, data } => Some((header, data)),
            _ => None,
        });
        let is_damaged = |(header, data): &(ChunkHeader, Cow<'_, [u8]>)| {
            let is_checked = header.uncompressed_crc != 0 && header.compression.is_empty();
            is_checked && crc32fast::hash(data) != header.uncompressed_crc
        };
        let times = |(header, _): (ChunkHeader, _)| (header.message_start_time, header.message_end_time);
        chunks.filter(is_damaged).map(times).collect()
    }

    /// True if the file has its end: its writer was not interrupted.
    pub fn is_whole(&self) -> bool {
        self.is_whole
    }

    /// Faults of the file in spite of which it can be read: its end is missing, or bytes of it are not those that were written.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if !self.is_whole {
            faults.push(
                "has no end: what there is of it is read (`motorium recover` gives it one)".to_string(),
            );
        }
        if let (Some((from, _)), Some((_, to))) = (self.damaged.first(), self.damaged.last()) {
            let begin = self.times.map_or(0, |(first, _)| first);
            let since = |time: &u64| time.saturating_sub(begin) as f64 * 1e-9;
            let count = self.damaged.len();
            let chunks = if count == 1 { "chunk" } else { "chunks" };
            faults.push(format!(
                "is damaged: {count} {chunks} of it, between {:.3} s and {:.3} s, differ from what was written",
                since(from),
                since(to)
            ));
        }
        faults
    }

    /// Times of the first and the last sample, as [`RecordedSample::time_ns`](super::RecordedSample::time_ns); `None` if there is no sample.
    pub fn times(&self) -> Option<(u64, u64)> {
        self.times
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The topics that were recorded, and `motorium/events`.
    pub fn topics(&self) -> &[RecordedTopic] {
        &self.topics
    }

    /// The pictures of cameras that were recorded. They have no place among the [topics](Self::topics): their channels hold
    /// messages for viewers alone.
    pub fn pictures(&self) -> &[RecordedPictures] {
        &self.pictures
    }

    /// The topic of a name.
    pub fn topic(&self, name: &str) -> Option<usize> {
        self.topics.iter().position(|topic| topic.name == name)
    }

    /// The content of an attachment.
    pub fn attachment(&self, name: &str) -> Option<&[u8]> {
        self.attachments.iter().find(|(known, _)| known == name).map(|(_, content)| content.as_slice())
    }

    /// The last message of a channel that belongs to no topic, such as [`WORLD_SCENE`](crate::foxglove::WORLD_SCENE).
    pub fn latched(&self, channel: &str) -> Option<&[u8]> {
        self.latched.get(channel).map(Vec::as_slice)
    }

    /// Names of the attachments.
    pub fn attachments(&self) -> impl Iterator<Item = &str> {
        self.attachments.iter().map(|(name, _)| name.as_str())
    }

    /// A fact of the run, such as `version` or `seed`.
    pub fn fact(&self, name: &str) -> Option<&str> {
        self.metadata.get(RUN)?.get(name).map(String::as_str)
    }

    /// The samples of a topic that were lost, where the recording has its end.
    pub fn lost(&self, topic: &str) -> Option<u64> {
        self.metadata.get(super::COUNTS)?.get(&format!("lost {topic}"))?.parse().ok()
    }

    /// The plan of the run.
    ///
    /// # Errors
    /// The file holds none that this version reads.
    pub fn plan(&self) -> Result<Plan, ReadError> {
        let foreign = |reason: String| ReadError::Foreign { path: self.path.clone(), reason };
        let missing = || match (self.is_whole, self.fact("version")) {
            (false, None) => ReadError::Missing { path: self.path.clone(), reason: cut_off(self.map.len()) },
            _ => foreign(format!("it has no attachment `{PLAN}`")),
        };
        let text = self.attachment(PLAN).ok_or_else(missing)?;
        serde_json::from_slice(text).map_err(|error| foreign(error.to_string()))
    }
}
