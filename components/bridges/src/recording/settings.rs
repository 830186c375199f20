//! Settings, counts and errors of a recorder.

use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

use mcap::McapError;
use motorium::declare::Taps;
use motorium::transport::PortError;

use crate::foxglove::DerivedError;

/// The error of a recorder.
#[derive(Debug, thiserror::Error)]
pub(super) enum RecordError {
    /// The file cannot be written.
    #[error("{}: {}", .path.display(), super::file::reason(.source))]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the MCAP writer.
        source: McapError,
    },
    /// A topic cannot be opened.
    #[error(transparent)]
    Topic(#[from] PortError),
    /// The type of a topic cannot be encoded.
    #[error(transparent)]
    Type(#[from] DerivedError),
}

/// The settings of a recorder.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    pub(super) output: PathBuf,
    pub(super) taps: Taps,
    /// Minimum time between two messages of a drawn channel, ns.
    pub(super) drawn_every_ns: u64,
    /// Length of the period kept before a failure, ns; `None` keeps the whole run.
    pub(super) last_ns: Option<u64>,
    /// Files to attach, by name.
    pub(super) attachments: Vec<(String, Vec<u8>)>,
}

/// The counts of a recording.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) samples: u64,
    pub(super) lost: u64,
    pub(super) bytes: u64,
}

/// Current time, ns since 1970.
pub(super) fn unix_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}
