//! Model files.
//!
//! A file has two lines of text: `motorium-latent VERSION CHECKSUM`, where the checksum is the XXH3 of the
//! second line as 16 hexadecimal digits, and a JSON object:
//!
//! | key | value |
//! |---|---|
//! | `latents` | number of latent dimensions |
//! | `x` | latent points, row by row |
//! | `spaces` | per space: name, columns, mean, scale, kernel, noise, `targets` (standardised, by column) |
//! | `back` | the back constraint, or null |
//! | `source` | folder of the poses, if known |
//!
//! Reading restores numbers bit for bit.

use std::path::Path;

use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

use super::back::Back;
use super::{LatentError, LatentModel, Space};
use crate::kernel::Points;

/// Version of the file format.
pub const VERSION: u32 = 1;

const MAGIC: &str = "motorium-latent";

/// Error of reading or writing a model file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file cannot be read or written.
    #[error("{path}: {error}")]
    Io {
        /// Path of the file.
        path: String,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// The first line is not a header.
    #[error("line 1 is not a header, found {found:?}, expected `motorium-latent VERSION CHECKSUM`")]
    Header {
        /// Start of the line.
        found: String,
    },
    /// The version is not supported.
    #[error("format version {found}, expected {VERSION}\nhelp: train the model again with this program")]
    Version {
        /// Version found.
        found: String,
    },
    /// The checksum does not match.
    #[error(
        "checksum of line 2 is {found:016x}, expected {expected}\nhelp: the file is damaged, copy it again"
    )]
    Checksum {
        /// Checksum computed from the content.
        found: u64,
        /// Checksum in the header.
        expected: String,
    },
    /// The content is not a model.
    #[error("line 2, column {column}: {error}")]
    Json {
        /// Column, from 1.
        column: usize,
        /// Syntax error.
        error: serde_json::Error,
    },
    /// The sizes of arrays in the file are inconsistent.
    #[error("{what} does not match {points} points in {latents} dimensions")]
    Sizes {
        /// Name of the inconsistent quantity.
        what: String,
        /// Number of latent points.
        points: usize,
        /// Number of latent dimensions.
        latents: usize,
    },
    /// The content does not form a valid model.
    #[error(transparent)]
    Model(#[from] LatentError),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    latents: usize,
    x: Vec<f64>,
    spaces: Vec<Space>,
    back: Option<Back>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    source: Option<String>,
}

impl LatentModel {
    /// Returns the text of a model file.
    pub fn to_text(&self) -> String {
        let content = Content {
            latents: self.latents(),
            x: self.latent(),
            spaces: self.spaces.clone(),
            back: self.back.clone(),
            source: self.source.clone(),
        };
        let json = serde_json::to_string(&content).expect("numbers and text");
        format!("{MAGIC} {VERSION} {:016x}\n{json}\n", XxHash3_64::oneshot(json.as_bytes()))
    }

    /// Parses the text of a model file.
    ///
    /// # Errors
    /// [`FileError`] if the text is not a model of this version, is damaged, or contains inconsistent sizes.
    pub fn from_text(text: &str) -> Result<Self, FileError> {
        let (header, json) = text.split_once('\n').unwrap_or((text, ""));
        let json = json.strip_suffix('\n').unwrap_or(json);
        let fields: Vec<&str> = header.split(' ').collect();
        let [MAGIC, version, checksum] = fields[..] else {
            return Err(FileError::Header { found: header.chars().take(60).collect() });
        };
        if version != VERSION.to_string() {
            return Err(FileError::Version { found: version.to_string() });
        }
        let found = XxHash3_64::oneshot(json.as_bytes());
        if checksum != format!("{found:016x}") {
            return Err(FileError::Checksum { found, expected: checksum.to_string() });
        }
        let content: Content =
            serde_json::from_str(json).map_err(|error| FileError::Json { column: error.column(), error })?;
        let latents = content.latents;
        let points = content.x.len().checked_div(latents).unwrap_or(0);
        let wrong = |what: &str| FileError::Sizes { what: what.to_string(), points, latents };
        if points == 0 || content.x.len() != points * latents || content.x.iter().any(|x| !x.is_finite()) {
            return Err(wrong("x"));
        }
        for space in &content.spaces {
            let d = space.mean.len();
            let fits = d > 0
                && [space.columns.len(), space.scale.len()] == [d, d]
                && space.targets.len() == d * points
                && space.kernel.lengths.len() == latents
                && space.rbf().is_valid(latents)
                && space.noise > 0.0
                && [&space.mean, &space.scale, &space.targets]
                    .iter()
                    .all(|v| v.iter().all(|v| v.is_finite()));
            if !fits || content.spaces.iter().filter(|other| other.name == space.name).count() > 1 {
                return Err(wrong(&format!("the space {}", space.name)));
            }
        }
        if content.back.as_ref().is_some_and(|back| !back.is_valid(&content.spaces, latents, points)) {
            return Err(wrong("the back constraint"));
        }
        let points = Points::from_rows(&content.x, latents);
        Ok(Self { source: content.source, ..Self::assemble(points, content.spaces, content.back)? })
    }

    /// Writes the model to a file.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        std::fs::write(path, self.to_text()).map_err(|error| io(path, error))
    }

    /// Reads a model from a file.
    ///
    /// # Errors
    /// Same as [`from_text`](Self::from_text). Also if the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        Self::from_text(&std::fs::read_to_string(path).map_err(|error| io(path, error))?)
    }
}

fn io(path: &Path, error: std::io::Error) -> FileError {
    FileError::Io { path: path.display().to_string(), error }
}
