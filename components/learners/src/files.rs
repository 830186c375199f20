//! Atomic file operations: a file is written completely or not at all.

use std::io;
use std::path::{Path, PathBuf};

/// Error of a file operation.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", file.display())]
pub struct FileError {
    /// Path of the file.
    pub file: PathBuf,
    /// Error of the operating system.
    pub source: io::Error,
}

impl FileError {
    fn new(file: &Path, source: io::Error) -> Self {
        Self { file: file.to_path_buf(), source }
    }
}

/// Reads a file.
pub(crate) fn read(file: &Path) -> Result<Vec<u8>, FileError> {
    std::fs::read(file).map_err(|source| FileError::new(file, source))
}

/// Reads a text file.
pub(crate) fn read_text(file: &Path) -> Result<String, FileError> {
    std::fs::read_to_string(file).map_err(|source| FileError::new(file, source))
}

/// Creates a folder and its parents.
pub(crate) fn create_folder(folder: &Path) -> Result<(), FileError> {
    std::fs::create_dir_all(folder).map_err(|source| FileError::new(folder, source))
}

/// Writes a file under a temporary name and renames it: readers see either the old or the new content.
pub(crate) fn write(file: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let mut beside = file.as_os_str().to_owned();
    beside.push(".part");
    let beside = PathBuf::from(beside);
    std::fs::write(&beside, bytes).map_err(|source| FileError::new(&beside, source))?;
    std::fs::rename(&beside, file).map_err(|source| FileError::new(file, source))
}
