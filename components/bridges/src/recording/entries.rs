//! Samples and images of a recording, in order.

use std::borrow::Cow;
use std::collections::BTreeMap;

use foxglove::Decode as _;
use foxglove::messages::RawImage;
use mcap::records::Record;
use motorium::state::Stamp;
use motorium_recordings::messages::Records;

use super::reader::{ReadError, Recording};
use super::recorded::Source;
use crate::foxglove::DerivedError;

/// A sample of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedSample {
    /// Index of the sample's topic in [`Recording::topics`].
    pub topic: usize,
    /// Time of the sample in the file, ns: since 1970, or since the start of a lockstep run.
    pub time_ns: u64,
    /// Stamp of the sample.
    pub stamp: Stamp,
    /// Bytes of the sample, in the layout of the topic.
    pub bytes: Vec<u8>,
}

/// An image of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedPicture {
    /// Index of the camera in [`Recording::pictures`].
    pub pictures: usize,
    /// Time of the image in the file, ns, on the same clock as samples.
    pub time_ns: u64,
    /// Stored message, a `foxglove.RawImage`.
    pub message: Vec<u8>,
}

impl RecordedPicture {
    /// Decodes the image: size, encoding and pixels. Returns `None` if the message is damaged.
    ///
    /// ```no_run
    /// use motorium_bridges::recording::{Entry, Recording};
    ///
    /// let recording = Recording::open("out/run.mcap".as_ref())?;
    /// for entry in recording.entries() {
    ///     if let Entry::Picture(picture) = entry?
    ///         && let Some(image) = picture.image()
    ///     {
    ///         let camera = &recording.pictures()[picture.pictures].topic;
    ///         println!("{camera}: {} x {} pixels, {}", image.width, image.height, image.encoding);
    ///     }
    /// }
    /// # Ok::<(), motorium_bridges::recording::ReadError>(())
    /// ```
    pub fn image(&self) -> Option<RawImage> {
        RawImage::decode(&self.message[..]).ok()
    }
}

/// A sample or an image of a recording.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// A sample of a topic.
    Sample(RecordedSample),
    /// An image of a camera.
    Picture(RecordedPicture),
}

impl Entry {
    /// Returns the time in the file, ns.
    pub fn time_ns(&self) -> u64 {
        match self {
            Self::Sample(sample) => sample.time_ns,
            Self::Picture(picture) => picture.time_ns,
        }
    }
}

impl Recording {
    /// Returns an iterator over all samples in file order, which is nearly time order. In a damaged file it
    /// ends at the damage.
    pub fn samples(&self) -> Samples<'_> {
        Samples::new(self)
    }

    /// Returns an iterator over all images in file order. Samples are skipped without decoding.
    pub fn images(&self) -> Images<'_> {
        Images::new(self)
    }

    /// Returns an iterator over all samples and images in file order.
    pub fn entries(&self) -> Entries<'_> {
        Entries::new(self)
    }

    /// Returns the latest sample of each topic and the latest image of each camera at `time_ns`, and an
    /// iterator over the following entries in file order. Earlier entries are skipped without decoding.
    ///
    /// # Errors
    /// Returns an error if a message is damaged.
    pub fn newest_at(&self, time_ns: u64) -> Result<(Vec<Entry>, Entries<'_>), ReadError> {
        let mut entries = self.entries();
        let newest = entries.pass(time_ns)?;
        Ok((newest, entries))
    }
}

/// A stored message of the file.
struct Message<'r> {
    source: Source,
    time_ns: u64,
    data: Cow<'r, [u8]>,
}

/// Messages of a recording, in order.
struct Messages<'r> {
    recording: &'r Recording,
    records: Records<'r>,
}

impl<'r> Messages<'r> {
    fn new(recording: &'r Recording) -> Self {
        Self { recording, records: recording.records() }
    }

    fn next(&mut self) -> Option<Message<'r>> {
        loop {
            let Record::Message { header, data } = self.records.next()? else { continue };
            let Some(source) = self.recording.source(header.channel_id) else { continue };
            return Some(Message { source, time_ns: header.log_time, data });
        }
    }

    fn sample(&self, topic: usize, time_ns: u64, data: &[u8]) -> Result<RecordedSample, ReadError> {
        let of_topic = &self.recording.topics()[topic];
        match of_topic.derived().decode(data) {
            Ok((stamp, bytes)) => Ok(RecordedSample { topic, time_ns, stamp, bytes }),
            Err(source) => Err(self.damaged(&of_topic.name, source)),
        }
    }

    fn entry(&self, Message { source, time_ns, data }: Message<'_>) -> Result<Entry, ReadError> {
        Ok(match source {
            Source::Topic(topic) => Entry::Sample(self.sample(topic, time_ns, &data)?),
            Source::Pictures(pictures) => {
                Entry::Picture(RecordedPicture { pictures, time_ns, message: data.into_owned() })
            }
        })
    }

    fn damaged(&self, topic: &str, source: DerivedError) -> ReadError {
        let path = self.recording.path().to_path_buf();
        ReadError::Message { path, topic: topic.to_string(), reason: Box::new(source) }
    }
}

/// Iterator over the samples of a recording, in file order.
pub struct Samples<'r>(Messages<'r>);

impl<'r> Samples<'r> {
    pub(super) fn new(recording: &'r Recording) -> Self {
        Self(Messages::new(recording))
    }
}

impl Iterator for Samples<'_> {
    type Item = Result<RecordedSample, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let Message { source, time_ns, data } = self.0.next()?;
            if let Source::Topic(topic) = source {
                return Some(self.0.sample(topic, time_ns, &data));
            }
        }
    }
}

/// Iterator over the images of a recording, in file order.
pub struct Images<'r>(Messages<'r>);

impl<'r> Images<'r> {
    pub(super) fn new(recording: &'r Recording) -> Self {
        Self(Messages::new(recording))
    }
}

impl Iterator for Images<'_> {
    type Item = RecordedPicture;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let Message { source, time_ns, data } = self.0.next()?;
            if let Source::Pictures(pictures) = source {
                return Some(RecordedPicture { pictures, time_ns, message: data.into_owned() });
            }
        }
    }
}

/// Iterator over the samples and images of a recording, in file order.
pub struct Entries<'r> {
    messages: Messages<'r>,
    /// Message that has been read ahead.
    next: Option<Message<'r>>,
}

impl<'r> Entries<'r> {
    pub(super) fn new(recording: &'r Recording) -> Self {
        Self { messages: Messages::new(recording), next: None }
    }

    /// Skips the entries before `time_ns`, and returns the newest skipped entry of each topic and camera.
    pub(super) fn pass(&mut self, time_ns: u64) -> Result<Vec<Entry>, ReadError> {
        let mut newest: BTreeMap<Source, Message<'r>> = BTreeMap::new();
        while let Some(message) = self.next.take().or_else(|| self.messages.next()) {
            if message.time_ns > time_ns {
                self.next = Some(message);
                break;
            }
            newest.insert(message.source, message);
        }
        newest.into_values().map(|message| self.messages.entry(message)).collect()
    }
}

impl Iterator for Entries<'_> {
    type Item = Result<Entry, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        let message = self.next.take().or_else(|| self.messages.next())?;
        Some(self.messages.entry(message))
    }
}
