//! Errors of datasets.

use std::io;
use std::path::PathBuf;

use super::super::SignalsError;

/// Error of writing a dataset.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The recording cannot be read, or has no such signal.
    #[error(transparent)]
    Signals(#[from] SignalsError),
    /// A file cannot be written.
    #[error("{path}: {source}", path = .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// System error.
        source: io::Error,
    },
    /// The length of a signal changed.
    #[error(
        "the {what} has {found} numbers at {time_s:.3} s, expected {expected} as before: all frames of a dataset have the same width; \
         choose entries, such as TOPIC.FIELD[0..{least}]"
    )]
    Width {
        /// `state` or `action`.
        what: &'static str,
        /// Numbers found.
        found: usize,
        /// Numbers expected.
        expected: usize,
        /// Smaller of both lengths.
        least: usize,
        /// Time since the beginning of the recording, s.
        time_s: f64,
    },
    /// The recording has no images on this topic.
    #[error("the recording has no pictures of `{topic}`; {advice}")]
    NoPictures {
        /// The topic.
        topic: String,
        /// Suggested topic, or all topics.
        advice: String,
    },
    /// A dataset cannot store the image.
    #[error("the picture of `{topic}` at {time_s:.3} s {found}")]
    Picture {
        /// The topic.
        topic: String,
        /// Time since the beginning of the recording, s.
        time_s: f64,
        /// Reason.
        found: String,
    },
    /// The signals and images were never all available at the same time.
    #[error(
        "the dataset has no frame, because all signals of the state and the action, and pictures of all cameras, were never available together"
    )]
    Empty,
}
