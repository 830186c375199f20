//! The file of a benchmark run: the machine, every raw histogram, and the table of targets.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Measurement, Target};
use crate::host::Machine;

/// Version of the file's format; incremented when the meaning of a field changes or a field is removed.
pub const VERSION: u32 = 2;

/// Content of a benchmark file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Written {
    /// Version of the file format.
    pub version: u32,
    /// Version of motorium.
    pub motorium: String,
    /// Arguments of the program, without its own name.
    pub arguments: Vec<String>,
    /// Start time of the measurements, s since 1970.
    pub began_unix_s: u64,
    /// The machine on which the measurements were made.
    pub machine: Machine,
    /// Load generator of measurements whose names end in `.loaded`, with its options.
    pub load: String,
    /// Total duration, s.
    pub seconds: f64,
    /// Descriptions of denied privileges; empty if everything ran at real-time priority on its own core.
    pub denied: Vec<String>,
    /// Every measurement with its raw histogram.
    pub measurements: Vec<Measurement>,
    /// Failed measurements with reasons.
    pub skipped: Vec<Skipped>,
    /// The table of targets.
    pub targets: Vec<Target>,
}

/// A measurement that failed or was skipped.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Skipped {
    /// Name of the measurement.
    pub name: String,
    /// Reason why the measurement failed or was skipped.
    pub reason: String,
}

/// Error of reading a benchmark file.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file could not be read.
    #[error("{file} could not be read: {error}")]
    File {
        /// The file.
        file: String,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// The version of the format is missing or not supported.
    #[error("{file} has version {found} of the format, expected {VERSION}: measure again")]
    Version {
        /// The file.
        file: String,
        /// Version found, `unknown` if missing.
        found: String,
    },
    /// The file was not written by `motorium bench latency --json`.
    #[error("{file} was not written by `motorium bench latency --json`: {error}")]
    Content {
        /// The file.
        file: String,
        /// Error of the JSON parser, with its position.
        error: serde_json::Error,
    },
}

impl Written {
    /// Reads a benchmark file.
    ///
    /// # Errors
    /// The file is missing or is not a benchmark file.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let file = || path.display().to_string();
        let refused = |error| ReadError::File { file: file(), error };
        // A pipe or a device may never end.
        if !std::fs::metadata(path).map_err(refused)?.is_file() {
            return Err(refused(std::io::Error::other("it is not a regular file")));
        }
        let text = std::fs::read(path).map_err(refused)?;
        let content = |error| ReadError::Content { file: file(), error };
        // The version is checked first, since other versions may lack other fields.
        let any: serde_json::Value = serde_json::from_slice(&text).map_err(content)?;
        let version = any.get("version").and_then(serde_json::Value::as_u64);
        if any.get("measurements").is_some() && version != Some(u64::from(VERSION)) {
            let found = version.map_or("unknown".to_string(), |version| version.to_string());
            return Err(ReadError::Version { file: file(), found });
        }
        serde_json::from_value(any).map_err(content)
    }

    /// Returns the measurement named `name`; `None` if it is missing.
    pub fn get(&self, name: &str) -> Option<&Measurement> {
        self.measurements.iter().find(|measurement| measurement.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_files_are_rejected() {
        let path = std::env::temp_dir().join(format!("motorium-bench-json-{}", std::process::id()));
        let refusal = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Written::read(&path).unwrap_err().to_string()
        };
        assert!(refusal(r#"{"version": 1, "measurements": []}"#).contains("has version 1 of the format"));
        assert!(refusal(r#"{"components": []}"#).contains("was not written by"));
        assert!(refusal("name,p50").contains("line 1 column 2"));
        std::fs::remove_file(&path).unwrap();
        assert!(Written::read(&path).unwrap_err().to_string().contains("could not be read"));
    }
}
