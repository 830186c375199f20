//! Writer of MCAP files that survive a power cut.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;
use std::time::{Duration, Instant};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapError, WriteOptions};

use super::PROFILE;
use crate::foxglove::Schema;

/// Maximum time until a message is passed to the operating system.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// Size at which a chunk is written, bytes.
const CHUNK: u64 = 1 << 20;

/// An open recording. Chunks contain one megabyte, or half a second of data if they fill more slowly.
pub(super) struct Writer {
    mcap: mcap::Writer<BufWriter<File>>,
    flushed: Instant,
    bytes: u64,
}

/// Returns the system error that caused a writer's error, or the writer's own message.
pub(super) fn reason(error: &McapError) -> String {
    match error {
        McapError::Io(error) => error.to_string(),
        error => error.to_string(),
    }
}

impl Writer {
    /// Creates a file; an existing one is replaced.
    pub(super) fn create(path: &Path) -> Result<(Self, File), McapError> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let file = File::create(path)?;
        let twin = file.try_clone()?;
        Ok((Self::begin(file)?, twin))
    }

    fn begin(file: File) -> Result<Self, McapError> {
        let options = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK))
            .profile(PROFILE)
            .library(concat!("motorium ", env!("CARGO_PKG_VERSION")));
        let mcap = options.create(BufWriter::with_capacity(1 << 16, file))?;
        Ok(Self { mcap, flushed: Instant::now(), bytes: 0 })
    }

    /// Adds a channel and returns its number.
    pub(super) fn channel(
        &mut self,
        name: &str,
        schema: &Schema,
        metadata: &BTreeMap<String, String>,
    ) -> Result<u16, McapError> {
        let schema = self.mcap.add_schema(&schema.name, schema.encoding, &schema.data)?;
        self.mcap.add_channel(schema, name, "protobuf", metadata)
    }

    /// Adds a message.
    pub(super) fn message(
        &mut self,
        channel: u16,
        sequence: u64,
        times: (u64, u64),
        data: &[u8],
    ) -> Result<(), McapError> {
        let (log_time, publish_time) = times;
        let header = MessageHeader { channel_id: channel, sequence: sequence as u32, log_time, publish_time };
        self.bytes += data.len() as u64;
        self.mcap.write_to_known_channel(&header, data)
    }

    /// Attaches a file.
    pub(super) fn attach(
        &mut self,
        name: &str,
        media_type: &str,
        data: &[u8],
        time_ns: u64,
    ) -> Result<(), McapError> {
        self.mcap.attach(&Attachment {
            log_time: time_ns,
            create_time: time_ns,
            name: name.to_string(),
            media_type: media_type.to_string(),
            data: Cow::Borrowed(data),
        })
    }

    /// Adds a metadata record.
    pub(super) fn metadata(&mut self, name: &str, values: BTreeMap<String, String>) -> Result<(), McapError> {
        self.mcap.write_metadata(&Metadata { name: name.to_string(), metadata: values })
    }

    /// Flushes to the system if the last flush was at least half a second ago.
    pub(super) fn flush_if_due(&mut self) -> Result<(), McapError> {
        if self.flushed.elapsed() < FLUSH_EVERY {
            return Ok(());
        }
        self.flush()
    }

    /// Flushes to the operating system.
    pub(super) fn flush(&mut self) -> Result<(), McapError> {
        self.flushed = Instant::now();
        self.mcap.flush()
    }

    /// Completes the file with its summary and index.
    pub(super) fn finish(mut self) -> Result<(), McapError> {
        self.mcap.finish()?;
        let file = self.mcap.into_inner().into_inner().map_err(io::IntoInnerError::into_error)?;
        file.sync_all()?;
        Ok(())
    }

    /// Number of message bytes so far.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }
}
