//! Lines and columns of positions in a text.

use std::fmt;
use std::path::PathBuf;

/// A position in a text file; line and column are counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// Line number.
    pub line: u32,
    /// Column number, in characters.
    pub column: u32,
}

/// A position in a file, written as `FILE:LINE:COLUMN`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FilePosition {
    /// Path of the file; `None` if the text is not from a file.
    pub file: Option<PathBuf>,
    /// Line and column.
    pub at: Position,
}

impl fmt::Display for FilePosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Position { line, column } = self.at;
        match &self.file {
            Some(file) => write!(f, "{}:{line}:{column}", file.display()),
            None => write!(f, "line {line}, column {column}"),
        }
    }
}

/// Start offsets of the lines of a text, so that positions are found by bisection.
pub(crate) struct Lines<'a> {
    text: &'a str,
    starts: Vec<usize>,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1));
        Self { text, starts: starts.collect() }
    }

    /// Returns line and column of the byte at `offset`, both from 1; columns count characters.
    pub(crate) fn position(&self, offset: usize) -> Position {
        let line = self.starts.partition_point(|start| *start <= offset);
        let column = self.text[self.starts[line - 1]..offset].chars().count() + 1;
        Position { line: line as u32, column: column as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_match_the_xml_reader() {
        let text = "<a>\n  <b x=\"ä€\"/>\r\n\n<c/></a>\n";
        let document = roxmltree::Document::parse(text).unwrap();
        let lines = Lines::new(text);
        for (offset, _) in text.char_indices() {
            let theirs = document.text_pos_at(offset);
            assert_eq!(lines.position(offset), Position { line: theirs.row, column: theirs.col }, "{offset}");
        }
    }
}
