//! Errors of reading and resampling recordings.

use std::fmt;

use crate::messages::LogError;

/// Position of an error in a recording file.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Path of the file.
    pub path: String,
    /// Line, counted from 1. `None` for JSON files that were parsed as a whole.
    pub line: Option<usize>,
    /// Sample or recording in a JSON file: a noun and a number counted from 1, such as `("sample", 3)`.
    pub item: Option<(&'static str, usize)>,
    /// Column, counted from 1, with its name, which may be empty.
    pub column: Option<(usize, String)>,
}

impl Place {
    pub(crate) fn file(path: &str) -> Self {
        Self { path: path.into(), line: None, item: None, column: None }
    }

    pub(crate) fn line(path: &str, line: usize) -> Self {
        Self { line: Some(line), ..Self::file(path) }
    }

    pub(crate) fn item(path: &str, word: &'static str, number: usize) -> Self {
        Self { item: Some((word, number)), ..Self::file(path) }
    }

    pub(crate) fn column(self, number: usize, name: &str) -> Self {
        Self { column: Some((number, name.into())), ..self }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path)?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if let Some((word, number)) = self.item {
            write!(f, ", {word} {number}")?;
        }
        match &self.column {
            Some((number, name)) if name.is_empty() => write!(f, ", column {number}")?,
            Some((number, name)) => write!(f, ", column {number} (`{name}`)")?,
            None => {}
        }
        Ok(())
    }
}

/// An error of [`read`](crate::read) and [`read_all`](crate::read_all), or of a
/// [`Recording`](crate::Recording).
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    System {
        /// Path of the file or folder.
        path: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file name has an unknown extension.
    #[error(
        "{path}: expected a name that ends in .csv, .tsv, .json, .jsonl or .ndjson, or a folder of such files"
    )]
    Format {
        /// Path of the file.
        path: String,
    },
    /// A line, sample or cell is invalid.
    #[error("{place}: found {found}, expected {expected}{}", advised(*.advice))]
    Malformed {
        /// Position of the error.
        place: Box<Place>,
        /// Content found.
        found: String,
        /// Content expected.
        expected: String,
        /// Suggested fix.
        advice: Option<&'static str>,
    },
    /// The recording has neither a time column nor a rate.
    #[error(
        "{path}: found no column named {} or {}, and no rate; set the samples per second by `--rate HZ` or the key `rate`",
        crate::names::TIME.join(", "),
        crate::names::STEP.join(", ")
    )]
    NoTime {
        /// Path of the file.
        path: String,
    },
    /// The field or channel is unknown.
    #[error("{path}: found no channel `{name}`; known: {known}")]
    NoChannel {
        /// Path of the file.
        path: String,
        /// The requested name.
        name: String,
        /// The names in the file.
        known: String,
    },
    /// The number of recordings in the file is wrong.
    #[error("{path}: found {found} recordings, expected {expected}")]
    Count {
        /// Path of the file or folder.
        path: String,
        /// Number of recordings found.
        found: usize,
        /// Description of the expected number.
        expected: &'static str,
    },
    /// The skeleton has no such joint.
    #[error("the skeleton has no joint `{name}`; known: {known}")]
    NoJoint {
        /// The requested name.
        name: String,
        /// Joint names of the skeleton.
        known: String,
    },
    /// The joints of a limb coincide.
    #[error("the limb `{name}` has no length, expected two joints at different positions")]
    NoLength {
        /// Name of the limb.
        name: String,
    },
    /// The MCAP file does not contain the selected movement, or cannot be decoded.
    #[error("{path}: {reason}")]
    Messages {
        /// Path of the file.
        path: String,
        /// The reason.
        reason: Box<LogError>,
    },
    /// There are too few samples.
    #[error("found {found} samples, expected at least {expected}")]
    TooShort {
        /// Number of samples found.
        found: usize,
        /// Minimum number of samples.
        expected: usize,
    },
    /// Times do not increase.
    #[error(
        "sample {sample} is at {time} s, not after the previous one: sort the recording, or cut it where the clock was reset"
    )]
    Backwards {
        /// Index of the sample, counted from 1.
        sample: usize,
        /// Its time, s.
        time: f64,
    },
    /// A value is NaN or infinite.
    #[error(
        "channel `{name}` is {value} at sample {sample}, expected a finite number: cut the recording or fill the gap"
    )]
    NotFinite {
        /// Index of the sample, counted from 1.
        sample: usize,
        /// Name of the channel.
        name: String,
        /// The value.
        value: f64,
    },
    /// A setting is out of range.
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange {
        /// Name of the setting.
        name: &'static str,
        /// Value of the setting.
        value: f64,
        /// Expected range.
        expected: &'static str,
    },
}

fn advised(advice: Option<&str>) -> String {
    advice.map_or_else(String::new, |advice| format!("; {advice}"))
}
