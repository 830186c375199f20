//! Input files: regular files of bounded size, never a pipe or a device that has no end.

use std::path::Path;

use anyhow::Context as _;
use motorium_recordings::read_bounded;

/// Longest input file, bytes.
const LONGEST: u64 = 1 << 30;

/// Returns the bytes of an input file.
pub(crate) fn bytes(path: &Path) -> anyhow::Result<Vec<u8>> {
    read_bounded(path, LONGEST).with_context(|| format!("reading {}", path.display()))
}

/// Returns the text of an input file.
pub(crate) fn text(path: &Path) -> anyhow::Result<String> {
    String::from_utf8(bytes(path)?).with_context(|| format!("reading {}", path.display()))
}
