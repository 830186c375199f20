//! A primitive in a file.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::dmp::{DmpModel, RhythmicModel};
use crate::promp::ProMp;

/// What a file of a primitive says: JSON, one object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrimitiveFile {
    /// Version of this layout: [`PrimitiveFile::VERSION`].
    pub version: u32,
    /// Name of every dimension.
    pub names: Vec<String>,
    /// Seconds that the demonstration took; of a rhythm, its period.
    pub duration: f64,
    /// Where the demonstration began.
    pub start: Vec<f64>,
    /// How fast it was there, per second.
    pub start_velocity: Vec<f64>,
    /// Where it ended; of a rhythm, the middle.
    pub goal: Vec<f64>,
    /// How fast it was there, per second.
    pub final_velocity: Vec<f64>,
    /// The primitive.
    pub primitive: Primitive,
}

/// The kinds that files hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Primitive {
    /// A discrete dynamic movement primitive.
    Discrete(DmpModel),
    /// A rhythmic dynamic movement primitive.
    Rhythmic(RhythmicModel),
    /// A probabilistic movement primitive.
    Probabilistic(ProMp),
}

impl Primitive {
    /// Its kind, in a word.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Discrete(_) => "discrete",
            Self::Rhythmic(_) => "rhythmic",
            Self::Probabilistic(_) => "probabilistic",
        }
    }

    /// Number of dimensions.
    pub fn dimensions(&self) -> usize {
        match self {
            Self::Discrete(model) => model.dimensions(),
            Self::Rhythmic(model) => model.dimensions(),
            Self::Probabilistic(promp) => promp.dimensions(),
        }
    }
}

/// Why a file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum PrimitiveFileError {
    /// The system refused.
    #[error("{}: {source}", path.display())]
    System {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The text is no primitive.
    #[error("{}: {source}", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and where.
        source: serde_json::Error,
    },
    /// Another version.
    #[error("{}: version {found}, but this program reads version {}: fit it again", path.display(), PrimitiveFile::VERSION)]
    Version {
        /// The file.
        path: PathBuf,
        /// The version found.
        found: u32,
    },
    /// Lists of different lengths, or numbers that cannot be.
    #[error("{}: {message}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        message: String,
    },
}

impl PrimitiveFile {
    /// The version of the layout that this program writes and reads.
    pub const VERSION: u32 = 1;

    /// Reads a file and checks that it is whole.
    ///
    /// # Errors
    /// The file cannot be read, is cut short or malformed, of another version, or contradicts itself.
    pub fn read(path: &Path) -> Result<Self, PrimitiveFileError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| PrimitiveFileError::System { path: path.into(), source })?;
        let file: Self = serde_json::from_str(&text)
            .map_err(|source| PrimitiveFileError::Text { path: path.into(), source })?;
        if file.version != Self::VERSION {
            return Err(PrimitiveFileError::Version { path: path.into(), found: file.version });
        }
        let content = |message| PrimitiveFileError::Content { path: path.into(), message };
        let expected = file.primitive.dimensions();
        for (name, values) in [
            ("start", &file.start),
            ("start_velocity", &file.start_velocity),
            ("goal", &file.goal),
            ("final_velocity", &file.final_velocity),
        ] {
            if values.len() != expected {
                let found = values.len();
                return Err(content(format!(
                    "`{name}` has {found} entries, the primitive {expected} dimensions"
                )));
            }
        }
        if file.names.len() != expected {
            let found = file.names.len();
            return Err(content(format!("{found} names for {expected} dimensions")));
        }
        if !(file.duration > 0.0 && file.duration.is_finite()) {
            return Err(content(format!("a duration of {} s, expected a positive time", file.duration)));
        }
        Ok(file)
    }

    /// Writes a file: whole or not at all.
    ///
    /// # Errors
    /// The system refused.
    pub fn write(&self, path: &Path) -> Result<(), PrimitiveFileError> {
        let text = serde_json::to_string(self)
            .map_err(|source| PrimitiveFileError::Text { path: path.into(), source })?;
        let refused = |source| PrimitiveFileError::System { path: path.into(), source };
        let mut unfinished = path.as_os_str().to_owned();
        unfinished.push(format!(".{}.part", std::process::id()));
        std::fs::write(&unfinished, text + "\n").map_err(refused)?;
        std::fs::rename(&unfinished, path).map_err(refused)
    }
}
