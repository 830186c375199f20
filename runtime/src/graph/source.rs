//! Source texts of a graph: its files, and the `--set` overrides of the command line.
//!
//! All texts share one range of byte offsets, one after the other, so that a plain `Range<usize>` identifies
//! a position in any of them. TOML values keep such a range through parsing and serde.

use core::ops::Range;
use std::path::{Path, PathBuf};

/// A position in one of the texts: bytes in the shared range of offsets.
pub(super) type Span = Range<usize>;

/// A text.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct Source {
    /// Name of the text in messages: the path of the file, or `--set`.
    pub name: String,
    /// Content of the text.
    pub text: String,
    /// Position of the text's first byte. The texts of a graph are numbered one after another, so a position
    /// identifies both the text and the byte.
    pub start: usize,
    /// Folder that relative paths in the text refer to.
    pub folder: PathBuf,
}

impl core::fmt::Debug for Source {
    /// Omits the text, because every diagnostic refers to its sources.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} ({} bytes from {})", self.name, self.text.len(), self.start)
    }
}

impl Source {
    /// Returns the part of a span in this text, in bytes of this text, on character boundaries.
    pub(super) fn local(&self, span: &Span) -> Range<usize> {
        let clamp = |offset: usize| {
            let mut local = offset.saturating_sub(self.start).min(self.text.len());
            while !self.text.is_char_boundary(local) {
                local -= 1;
            }
            local
        };
        let (start, end) = (clamp(span.start), clamp(span.end));
        start..end.max(start)
    }

    /// Returns the line and column (in characters) of a span's start, both from 1.
    pub(super) fn position(&self, span: &Span) -> (usize, usize) {
        let before = &self.text[..self.local(span).start];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    /// Returns the text from byte `from` (at least 2) as the value of a key, padded with blanks so that
    /// parser offsets are in the shared range.
    pub(super) fn padded(&self, from: usize) -> String {
        let mut padded = " ".repeat(self.start + from - 2);
        padded.push_str("v=");
        padded.push_str(&self.text[from..]);
        padded
    }
}

/// All texts of one graph: its files in order, then the overrides.
// With `Eq`, two `Arc`s of the same texts are compared by address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Sources {
    texts: Vec<Source>,
    /// Number of files, which come first.
    files: usize,
    /// Index of the graph file.
    named: usize,
}

impl Sources {
    /// Creates an empty list, to which the graph file is added at index `named`.
    pub(super) fn new(named: usize) -> Self {
        Self { texts: Vec::new(), files: 0, named }
    }

    /// Creates the sources of a graph with one file.
    pub(super) fn of_file(name: String, text: String) -> Self {
        let mut sources = Self::new(0);
        sources.add_file(name, text, PathBuf::new());
        sources
    }

    /// Adds a file; all files precede all overrides.
    pub(super) fn add_file(&mut self, name: String, text: String, folder: PathBuf) {
        self.add(name, text, folder);
        self.files += 1;
    }

    /// Adds an override; paths in it are relative to the graph file.
    pub(super) fn add_override(&mut self, text: String) {
        let folder = self.file().folder.clone();
        self.add("--set".to_string(), text, folder);
    }

    fn add(&mut self, name: String, text: String, folder: PathBuf) {
        let start = self.texts.last().map_or(0, |last| last.start + last.text.len() + 1);
        self.texts.push(Source { name, text, start, folder });
    }

    /// Returns the graph file.
    pub(super) fn file(&self) -> &Source {
        &self.texts[self.named]
    }

    /// Returns the beginning of the graph file.
    pub(super) fn top(&self) -> Span {
        self.file().start..self.file().start
    }

    /// Returns all files, the lowest first.
    pub(super) fn files(&self) -> &[Source] {
        &self.texts[..self.files]
    }

    /// Returns all texts after the files.
    pub(super) fn overrides(&self) -> &[Source] {
        &self.texts[self.files..]
    }

    /// Returns the text that contains a span.
    pub(super) fn source_of(&self, span: &Span) -> &Source {
        let after = self.texts.partition_point(|source| source.start <= span.start);
        &self.texts[after.saturating_sub(1)]
    }

    /// Returns the folder of the file that contains a span.
    pub(super) fn folder(&self, span: &Span) -> &Path {
        &self.source_of(span).folder
    }
}
