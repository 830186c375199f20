//! Errors of datasets.

use std::io;
use std::path::PathBuf;

use super::super::SignalsError;

/// The dataset cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The recording cannot be read, or lacks a signal.
    #[error(transparent)]
    Signals(#[from] SignalsError),
    /// A file cannot be written.
    #[error("{path}: {source}", path = .path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// System error.
        source: io::Error,
    },
    /// The number of entries of a signal changes during the recording.
    #[error(
        "the {what} has {found} numbers at {time_s:.3} s, expected {expected} as before, because all frames of a dataset have the same width; \
         select entries, such as TOPIC.FIELD[0..{least}]"
    )]
    Width {
        /// `state` or `action`.
        what: &'static str,
        /// Number of entries found.
        found: usize,
        /// Number of entries of earlier samples.
        expected: usize,
        /// Smaller of the two numbers.
        least: usize,
        /// Time since the beginning of the recording, s.
        time_s: f64,
    },
    /// The recording has no images on this topic.
    #[error("the recording has no images on `{topic}`; {advice}")]
    NoPictures {
        /// Name of the topic.
        topic: String,
        /// Similar topic, or all topics.
        advice: String,
    },
    /// The image has a format that a dataset cannot store.
    #[error("the image on `{topic}` at {time_s:.3} s {found}")]
    Picture {
        /// Name of the topic.
        topic: String,
        /// Time since the beginning of the recording, s.
        time_s: f64,
        /// Reason, as a phrase that follows the name of the image.
        found: String,
    },
    /// The signals and images were never all available at the same time.
    #[error(
        "the dataset has no frame: at no time were the signals of the state, the signals of the action and an image of each camera all available"
    )]
    Empty,
}
