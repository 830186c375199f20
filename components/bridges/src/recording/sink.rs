//! Output file of a recorder, or its buffer for the end of the run.

use std::collections::BTreeMap;
use std::path::PathBuf;

use mcap::McapError;

use super::batch::{Batch, Ring};
use super::file::Writer;
use super::settings::RecordError;
use super::{COUNTS, KEPT};

/// Output file of a recorder. If only the end of the run is kept, it is written last.
pub(super) struct Sink {
    path: PathBuf,
    writer: Writer,
    /// Buffer for the end of the run, if nothing else is kept.
    ring: Option<Ring>,
    /// The run has reported an error, so it fails.
    has_failed: bool,
}

impl Sink {
    /// Creates a sink for the file of `writer`. With `last_ns` \[ns\], the file only contains this period
    /// before a failure.
    pub(super) fn new(path: PathBuf, writer: Writer, last_ns: Option<u64>) -> Self {
        Self { path, writer, ring: last_ns.map(Ring::new), has_failed: false }
    }

    /// Writes a batch, and empties it.
    pub(super) fn write(&mut self, batch: &mut Batch) -> Result<(), RecordError> {
        self.has_failed |= std::mem::take(&mut batch.has_failed);
        let written = batch.write(&mut self.writer, self.ring.as_mut());
        written.and_then(|()| self.writer.flush_if_due()).map_err(|source| self.error(source))
    }

    /// Number of message bytes so far.
    pub(super) fn bytes(&self) -> u64 {
        self.writer.bytes()
    }

    /// Ends the file with a summary, and returns the number of message bytes. If only failures are recorded,
    /// the file of a successful run is removed.
    pub(super) fn finish(mut self, mut summary: BTreeMap<String, String>) -> Result<u64, RecordError> {
        let failed = |path: PathBuf| move |source| RecordError::File { path, source };
        if let Some(ring) = self.ring.take() {
            if !self.has_failed {
                let Self { path, writer, .. } = self;
                let bytes = writer.bytes();
                drop(writer);
                let removed = std::fs::remove_file(&path).map_err(McapError::from);
                return removed.map(|()| bytes).map_err(failed(path));
            }
            summary.insert(KEPT.to_string(), ring.span_ns.to_string());
            for (message, data) in &ring.messages {
                message.write(data, &mut self.writer).map_err(|source| self.error(source))?;
            }
        }
        let Self { path, mut writer, .. } = self;
        let bytes = writer.bytes();
        let ended = writer.metadata(COUNTS, summary).and_then(|()| writer.finish());
        ended.map(|()| bytes).map_err(failed(path))
    }

    fn error(&self, source: McapError) -> RecordError {
        RecordError::File { path: self.path.clone(), source }
    }
}
