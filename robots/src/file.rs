//! Reading of regular files with bounded size.

use std::fs::File;
use std::io::{Error, Read as _, Result};
use std::path::Path;

/// Reads a regular file of at most `longest` bytes.
///
/// # Errors
/// The file cannot be read or is longer than `longest`, or the path refers to a folder, a device or a pipe.
/// Devices and pipes are rejected because they may be endless.
pub fn read_bounded(path: &Path, longest: u64) -> Result<Vec<u8>> {
    // Checked before opening: opening a pipe would block until its other end is open.
    let metadata = std::fs::metadata(path)?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(Error::other(format!("it is {found}, expected a regular file")));
    }
    let refuse = |found: u64| Error::other(format!("it has {found} bytes, expected at most {longest}"));
    if metadata.len() > longest {
        return Err(refuse(metadata.len()));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(longest + 1).read_to_end(&mut bytes)?;
    // The file may have grown since the check.
    if bytes.len() as u64 > longest { Err(refuse(bytes.len() as u64)) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_of_bounded_size_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "four").unwrap();
        assert_eq!(read_bounded(&file, 4).unwrap(), b"four");
        let error = |path: &Path| read_bounded(path, 3).unwrap_err().to_string();
        assert_eq!(error(&file), "it has 4 bytes, expected at most 3");
        assert_eq!(error(folder.path()), "it is a folder, expected a regular file");
        assert_eq!(error(Path::new("/dev/zero")), "it is a device or a pipe, expected a regular file");
    }
}
