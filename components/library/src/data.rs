//! Movements from recordings in files.

use std::path::Path;

use motorium_recordings::{Recording, RecordingError, Selection, read_all};

use crate::{Recordings, Trajectory};

/// Error returned when [`Recordings::read`] fails.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// A file cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// There are no files.
    #[error("found no file, expected at least one")]
    NoFile,
    /// The degrees of freedom of a recording differ from the first recording's.
    #[error(
        "recording `{id}` of {path} has the degrees of freedom {found}, expected {expected} as in the first recording: choose common degrees of freedom by name"
    )]
    Names {
        /// Path of the file or folder with the recording.
        path: String,
        /// Id of the recording.
        id: String,
        /// Names of the recording's degrees of freedom.
        found: String,
        /// Names of the degrees of freedom of the first recording.
        expected: String,
    },
}

impl From<&Recording> for Trajectory {
    /// Returns evenly spaced samples of a recording, with the recording's number of samples.
    fn from(recording: &Recording) -> Self {
        Self {
            id: recording.id().to_string(),
            label: recording.label().map(str::to_string),
            duration: recording.duration(),
            positions: recording.evenly_spaced(),
        }
    }
}

impl Recordings {
    /// Reads the recordings of files and folders, in the order of `paths`. See [`motorium_recordings`] for
    /// the file formats.
    ///
    /// # Errors
    /// [`DataError`] if a file cannot be read, or recordings have different degrees of freedom.
    pub fn read<P: AsRef<Path>>(
        paths: impl IntoIterator<Item = P>,
        selection: &Selection,
    ) -> Result<Self, DataError> {
        let mut all: Option<Self> = None;
        for path in paths {
            let path = path.as_ref();
            for recording in read_all(path, selection)? {
                let names = recording.names().to_vec();
                let all = all.get_or_insert_with(|| Self { names: names.clone(), trajectories: Vec::new() });
                if all.names != names {
                    return Err(DataError::Names {
                        path: path.display().to_string(),
                        id: recording.id().to_string(),
                        found: names.join(", "),
                        expected: all.names.join(", "),
                    });
                }
                all.trajectories.push(Trajectory::from(&recording));
            }
        }
        all.ok_or(DataError::NoFile)
    }
}
