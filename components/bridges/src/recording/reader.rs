//! Reader of recordings.

#![allow(unsafe_code)] // a file is mapped rather than read: recordings are larger than memory

use std::fs::File;
use std::path::{Path, PathBuf};

use mcap::records::Record;
use mcap::{MAGIC, McapError};
use memmap2::Mmap;
use motorium::plan::Plan;
use motorium_recordings::messages::{LogError, MessageLog, Records, Summary};

use super::recorded::{RecordedPictures, RecordedTopic, Source};
use super::scan::Scan;
use super::{COUNTS, PLAN, PROFILE, RECOVERED, RUN};
use crate::foxglove::DerivedError;

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
    summary: Summary,
    scan: Scan,
}

fn describe(error: &McapError) -> String {
    match error {
        McapError::BadMagic => "the file is not a recording (MCAP)".to_owned(),
        McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}

/// Returns the reason for rejecting a file that ends after `bytes`, before its first message.
fn cut_off(bytes: usize) -> String {
    format!("the file is cut off after {bytes} bytes, before the first message")
}

/// Refuses a file without a record between its header and its end.
pub(super) fn check_content(path: &Path, source: &[u8], summary: &Summary) -> Result<(), ReadError> {
    let mut records = Records::new(source, summary, true);
    if records.any(|record| !matches!(record, Record::Header(_) | Record::Footer(_))) {
        return Ok(());
    }
    let reason = cut_off(source.len()) + "; nothing can be recovered, so record it again";
    Err(ReadError::Missing { path: path.to_path_buf(), reason })
}

/// A recording cannot be read. The message includes the cause, which is therefore not exposed as `source`.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read.
    #[error("{path}: {reason}", path = .path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// System error.
        reason: std::io::Error,
    },
    /// The file is damaged or is not an MCAP file.
    #[error("{path}: {}", describe(.reason), path = .path.display())]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Format error.
        reason: Box<McapError>,
    },
    /// A message cannot be read.
    #[error("{path}: topic `{topic}`: {reason}", path = .path.display())]
    Message {
        /// Path of the file.
        path: PathBuf,
        /// Name of the topic.
        topic: String,
        /// Error of the message.
        reason: Box<DerivedError>,
    },
    /// The recording lacks a requested part.
    #[error("{path}: {reason}", path = .path.display())]
    Missing {
        /// Path of the file.
        path: PathBuf,
        /// Missing part, and the available parts.
        reason: String,
    },
    /// A file of another program, or a message in it, cannot be read.
    #[error("{path}: {reason}", path = .path.display())]
    Log {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the failure.
        reason: LogError,
    },
    /// The file is not a motorium recording.
    #[error("{path} is not a recording of this version of motorium: {reason}", path = .path.display())]
    Foreign {
        /// Path of the file.
        path: PathBuf,
        /// Part that is missing, or that differs from a motorium recording.
        reason: String,
    },
}

impl Recording {
    /// Opens a complete or truncated recording and reads everything except its samples.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or is not a recording.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        opened(path)?.map_err(|map| {
            let path = path.to_path_buf();
            match MessageLog::new(map) {
                Ok(log) => ReadError::Foreign { path, reason: other_writer(&log) },
                Err(reason) => ReadError::Log { path, reason },
            }
        })
    }

    pub(super) fn records(&self) -> Records<'_> {
        Records::new(&self.map, &self.summary, false)
    }

    pub(super) fn source(&self, channel: u16) -> Option<Source> {
        self.scan.of_channel.get(&channel).copied()
    }

    /// Maximum time by which a message in the file is earlier than a preceding one, ns.
    pub(super) fn disorder_ns(&self) -> u64 {
        self.scan.disorder_ns
    }

    /// Returns `true` if the file is complete, which means that its writer was not interrupted.
    pub fn is_whole(&self) -> bool {
        self.scan.is_whole
    }

    /// Returns the number of messages that the file declares but does not contain.
    pub fn missing(&self) -> u64 {
        self.scan.missing
    }

    /// Returns descriptions of the faults of a readable file: a missing end, missing messages, or corrupt
    /// bytes.
    pub fn faults(&self) -> Vec<String> {
        let Scan { is_whole, damage, missing, times, metadata, .. } = &self.scan;
        let mut faults = damage.faults(*is_whole, times.map_or(0, |(first, _)| first));
        if *missing > 0 {
            faults.push(format!("declares {missing} messages that it does not contain"));
        }
        if let Some(losses) = metadata.get(RECOVERED) {
            let losses: Vec<String> = losses.iter().map(|(what, count)| format!("{what}: {count}")).collect();
            faults.push(format!("was recovered from a damaged file, with losses ({})", losses.join(", ")));
        }
        faults
    }

    /// Returns the times of the first and the last sample, on the clock of
    /// [`RecordedSample::time_ns`](super::RecordedSample::time_ns); `None` without samples.
    pub fn times(&self) -> Option<(u64, u64)> {
        self.scan.times
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the recorded topics, including `motorium/events`.
    pub fn topics(&self) -> &[RecordedTopic] {
        &self.scan.topics
    }

    /// Returns the cameras with recorded images. They are not among the [topics](Self::topics), because their
    /// channels contain only viewer messages.
    pub fn pictures(&self) -> &[RecordedPictures] {
        &self.scan.pictures
    }

    /// Returns the index of the topic with this name in [`topics`](Self::topics).
    pub fn topic(&self, name: &str) -> Option<usize> {
        self.scan.topics.iter().position(|topic| topic.name == name)
    }

    /// Returns the content of the attachment with this name.
    pub fn attachment(&self, name: &str) -> Option<&[u8]> {
        self.scan.attachments.iter().find(|(known, _)| known == name).map(|(_, content)| content.as_slice())
    }

    /// Returns the latched message of `channel`: the last message of a channel without a topic, such as
    /// [`WORLD_SCENE`](crate::foxglove::WORLD_SCENE). Returns `None` if the file has no latched message of
    /// this channel.
    pub fn latched(&self, channel: &str) -> Option<&[u8]> {
        self.scan.latched.get(channel).map(Vec::as_slice)
    }

    /// Returns the names of the attachments.
    pub fn attachments(&self) -> impl Iterator<Item = &str> {
        self.scan.attachments.iter().map(|(name, _)| name.as_str())
    }

    /// Returns a fact of the run by name, such as `version` or `seed`.
    pub fn fact(&self, name: &str) -> Option<&str> {
        self.scan.metadata.get(RUN)?.get(name).map(String::as_str)
    }

    /// Returns the number of lost samples of a topic; `None` if the recording is incomplete.
    pub fn lost(&self, topic: &str) -> Option<u64> {
        self.scan.metadata.get(COUNTS)?.get(&format!("lost {topic}"))?.parse().ok()
    }

    /// Returns the plan of the run.
    ///
    /// # Errors
    /// Returns an error if the plan is missing or is not readable by this version.
    pub fn plan(&self) -> Result<Plan, ReadError> {
        let foreign = |reason: String| ReadError::Foreign { path: self.path.clone(), reason };
        let missing = || match (self.scan.is_whole, self.fact("version")) {
            (false, None) => ReadError::Missing { path: self.path.clone(), reason: cut_off(self.map.len()) },
            _ => foreign(format!("the attachment `{PLAN}` is missing")),
        };
        let text = self.attachment(PLAN).ok_or_else(missing)?;
        serde_json::from_slice(text).map_err(|error| foreign(error.to_string()))
    }
}

/// Opens a recording, or returns the bytes of a file of another program.
pub(super) fn opened(path: &Path) -> Result<Result<Recording, Mmap>, ReadError> {
    let map = map_file(path)?;
    let summary = Summary::read(&map);
    let scan = Scan::of_file(&map, &summary)
        .map_err(|reason| ReadError::Foreign { path: path.to_path_buf(), reason })?;
    if !scan.is_whole {
        check_content(path, &map, &summary)?;
    }
    let is_own = scan.profile == PROFILE || !scan.topics.is_empty() || scan.metadata.contains_key(RUN);
    // A motorium file that was cut off early has no channels.
    let is_other = !is_own && (scan.has_channels() || !scan.damage.unreadable.is_empty());
    if is_other {
        return Ok(Err(map));
    }
    Ok(Ok(Recording { path: path.to_path_buf(), map, summary, scan }))
}

/// Maps an MCAP file into memory.
pub(super) fn map_file(path: &Path) -> Result<Mmap, ReadError> {
    let io = |reason| ReadError::Io { path: path.to_path_buf(), reason };
    // Check the metadata before opening: opening a pipe would block until its other end is open.
    let metadata = std::fs::metadata(path).map_err(io)?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(io(std::io::Error::other(format!("it is {found}, expected the file of a recording"))));
    }
    if metadata.len() == 0 {
        return Err(ReadError::Missing { path: path.to_path_buf(), reason: "the file is empty".to_string() });
    }
    let file = File::open(path).map_err(io)?;
    // SAFETY: recordings are written once. Truncating a mapped file terminates the program, with no other
    // damage.
    let map = unsafe { Mmap::map(&file) }.map_err(io)?;
    if !map.starts_with(MAGIC) {
        let reason = Box::new(McapError::BadMagic);
        return Err(ReadError::Format { path: path.to_path_buf(), reason });
    }
    Ok(map)
}

/// Explains why a file written by another program is not a recording.
fn other_writer(log: &MessageLog<Mmap>) -> String {
    let by = match log.writer() {
        "" => "another program".to_string(),
        writer => format!("`{writer}`"),
    };
    format!(
        "the file was written by {by} and contains {}, expected channels written by `motorium run --record`",
        log.described()
    )
}
