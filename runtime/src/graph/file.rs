//! Reading of graph files: regular files of bounded size.

use std::fs::File;
use std::io::{Error, Read as _};
use std::path::{Path, PathBuf};

/// Maximum size of a graph file, and of all files of a graph together, bytes.
pub(super) const LONGEST: u64 = 16 * 1024 * 1024;

/// Reads a regular file of at most [`LONGEST`] bytes.
///
/// # Errors
/// The file cannot be read or is too long, or the path names a folder, a device or a pipe.
pub(super) fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    // Checked before opening, because opening a pipe would block until its other end is open.
    let metadata = std::fs::metadata(path)?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(Error::other(format!("it is {found}, expected a regular file")));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(LONGEST + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LONGEST {
        let found = metadata.len().max(bytes.len() as u64);
        return Err(Error::other(format!("it has {found} bytes, expected at most {LONGEST} (16 MiB)")));
    }
    Ok(bytes)
}

/// Returns the graph file in the folder of `path` with the most similar name.
pub(super) fn near(path: &Path) -> Option<String> {
    let graphs: Vec<String> = std::fs::read_dir(folder_of(path))
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.ends_with(".toml"))
        .collect();
    let wanted = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    crate::nearest::nearest(wanted, graphs.iter().map(String::as_str)).map(str::to_owned)
}

/// Returns the folder of a file, absolute if it can be determined.
pub(super) fn folder_of(path: &Path) -> PathBuf {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_regular_file_of_bounded_size_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("graph.toml");
        std::fs::write(&file, "name").unwrap();
        assert_eq!(read(&file).unwrap(), b"name");
        let pipe = folder.path().join("pipe");
        rustix::fs::mknodat(
            rustix::fs::CWD,
            &pipe,
            rustix::fs::FileType::Fifo,
            rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR,
            0,
        )
        .unwrap();
        for (path, words) in [
            (folder.path(), "a folder"),
            (&*pipe, "a device or a pipe"),
            (Path::new("/dev/zero"), "a device"),
        ] {
            let text = read(path).unwrap_err().to_string();
            assert!(text.contains(words) && text.contains("expected a regular file"), "{text}");
        }
        File::create(&file).unwrap().set_len(LONGEST).unwrap();
        assert_eq!(read(&file).unwrap().len() as u64, LONGEST);
        File::create(&file).unwrap().set_len(1 << 40).unwrap();
        let text = read(&file).unwrap_err().to_string();
        assert!(text.contains("1099511627776 bytes, expected at most 16777216"), "{text}");
    }
}
