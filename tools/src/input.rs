//! Input files: regular files of bounded size, never a pipe or a device that has no end.

use std::path::Path;
use std::string::FromUtf8Error;

use anyhow::Context as _;
use motorium_recordings::read_bounded;

/// Longest input file, bytes.
const LONGEST: u64 = 1 << 30;
/// Byte order mark, which editors on Windows write before the text.
const MARK: char = '\u{feff}';

/// Returns the bytes of an input file.
pub(crate) fn bytes(path: &Path) -> anyhow::Result<Vec<u8>> {
    read_bounded(path, LONGEST).with_context(|| format!("reading {}", path.display()))
}

/// Returns the text of an input file without its byte order mark.
pub(crate) fn text(path: &Path) -> anyhow::Result<String> {
    decoded(bytes(path)?).with_context(|| format!("reading {}", path.display()))
}

/// Returns the text of bytes in UTF-8 without its byte order mark.
pub(crate) fn decoded(bytes: Vec<u8>) -> Result<String, FromUtf8Error> {
    let mut text = String::from_utf8(bytes)?;
    if text.starts_with(MARK) {
        text.remove(0);
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn byte_order_mark_is_not_part_of_a_text() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        for (content, expected) in [("\u{feff}{}", "{}"), ("{}", "{}"), ("", ""), ("a\u{feff}", "a\u{feff}")]
        {
            std::fs::write(file.path(), content).expect("a file");
            assert_eq!(text(file.path()).expect("text"), expected);
        }
    }
}
