//! Recorded movements, as they come from files.
//!
//! | format | by its ending | what it is |
//! |---|---|---|
//! | CSV | `.csv` | a header of names, then a line a sample; one column is the time |
//! | JSON | `.json` | a list of samples, each a list of numbers or an object |
//! | JSON lines | `.jsonl`, `.ndjson` | an object a line; what `motorium topic echo --json` prints is read as it is |
//!
//! The time is a column or field named `time_s`, `time`, `t` or `timestamp`, in seconds; without one, samples are evenly
//! spaced at a rate that is given. A [`Recording`] keeps the samples as they were taken; [`Recording::evenly`] resamples
//! and filters them for a demonstration.

mod even;
mod read;

pub use read::{Selection, read, read_text};

use nalgebra::DMatrix;

/// Samples of several channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    names: Vec<String>,
    times: Vec<f64>,
    /// Samples x channels.
    values: DMatrix<f64>,
}

/// Why a file is no recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The system refused.
    #[error("{path}: {source}")]
    System {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// An ending that says nothing.
    #[error("{path}: expected a name that ends in .csv, .json, .jsonl or .ndjson")]
    Format {
        /// The file.
        path: String,
    },
    /// A line (or sample) that cannot be read.
    #[error("{place}: {message}")]
    Malformed {
        /// The file and the line or sample in it, counted from 1.
        place: String,
        /// What was found and expected.
        message: String,
    },
    /// No time and no rate.
    #[error(
        "{path}: no column named time_s, time, t or timestamp, and no rate is given: say how many samples a second there are"
    )]
    NoTime {
        /// The file.
        path: String,
    },
    /// A field or channel that is not there.
    #[error("{path}: no channel `{name}`; there are {known}")]
    NoChannel {
        /// The file.
        path: String,
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// Too little of it.
    #[error("{found} samples, expected at least {expected}")]
    TooShort {
        /// What was found.
        found: usize,
        /// What was expected.
        expected: usize,
    },
    /// Time that does not pass.
    #[error(
        "sample {sample} is at {time} s, not after the one before: sort the recording, or cut it where the clock was reset"
    )]
    Backwards {
        /// Which one, counted from 1.
        sample: usize,
        /// Its time.
        time: f64,
    },
    /// A number that is none.
    #[error("sample {sample}, channel `{name}` is {value}: cut the recording or fill the gap")]
    NotFinite {
        /// Which one, counted from 1.
        sample: usize,
        /// The channel.
        name: String,
        /// What was found.
        value: f64,
    },
    /// A setting that cannot be.
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange {
        /// The setting.
        name: &'static str,
        /// What was found.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
}

impl Recording {
    /// From names, times (s, ascending) and values (samples x channels).
    ///
    /// # Errors
    /// Fewer than two samples, no channel, lengths that differ, time that does not pass, numbers that are not finite.
    pub fn new(names: Vec<String>, times: Vec<f64>, values: DMatrix<f64>) -> Result<Self, RecordingError> {
        if times.len() < 2 || values.nrows() != times.len() {
            let found = times.len().min(values.nrows());
            return Err(RecordingError::TooShort { found, expected: 2.max(times.len()) });
        }
        if names.is_empty() || names.len() != values.ncols() {
            let (name, value) = ("the number of channels", values.ncols() as f64);
            return Err(RecordingError::OutOfRange {
                name,
                value,
                expected: "one for each name, at least one",
            });
        }
        for (sample, time) in times.iter().enumerate() {
            if !time.is_finite() || (sample > 0 && *time <= times[sample - 1]) {
                return Err(RecordingError::Backwards { sample: sample + 1, time: *time });
            }
        }
        for (channel, name) in names.iter().enumerate() {
            for sample in 0..times.len() {
                let value = values[(sample, channel)];
                if !value.is_finite() {
                    return Err(RecordingError::NotFinite { sample: sample + 1, name: name.clone(), value });
                }
            }
        }
        Ok(Self { names, times, values })
    }

    /// Names of the channels.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.times.len()
    }

    /// Times of the samples, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The values, samples x channels.
    pub fn values(&self) -> &DMatrix<f64> {
        &self.values
    }

    /// From the first sample to the last, s.
    pub fn duration(&self) -> f64 {
        self.times[self.times.len() - 1] - self.times[0]
    }
}
