//! The texts a graph comes from: its file, and the `--set` overrides of the command line.
//!
//! All texts share one range of byte offsets, one text after the other, so that a plain `Range<usize>` names a place
//! in any of them. TOML values keep such a range through parsing and through serde.

use core::ops::Range;

/// A place in one of the texts: bytes in the shared range of offsets.
pub(super) type Span = Range<usize>;

/// One text.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct Source {
    /// Its name in messages: the path of the file, or `--set`.
    pub name: String,
    /// Its content.
    pub text: String,
    /// Offset of its first byte in the shared range.
    pub start: usize,
}

impl core::fmt::Debug for Source {
    /// Without the text: every diagnostic refers to its sources.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} ({} bytes from {})", self.name, self.text.len(), self.start)
    }
}

impl Source {
    /// The part of a span that lies in this text, in bytes of this text, on character boundaries.
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

    /// Line and column (in characters) of a span's start, both from 1.
    pub(super) fn position(&self, span: &Span) -> (usize, usize) {
        let before = &self.text[..self.local(span).start];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    /// The text from byte `from` (at least 2) on as the value of a key, with blanks before it, so that a parser counts
    /// its offsets in the shared range.
    pub(super) fn padded(&self, from: usize) -> String {
        let mut padded = " ".repeat(self.start + from - 2);
        padded.push_str("v=");
        padded.push_str(&self.text[from..]);
        padded
    }
}

/// All texts of one graph; the file is the first.
// `Eq`, so that two `Arc`s of the same texts are compared by their addresses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Sources(Vec<Source>);

impl Sources {
    /// Starts with the graph file.
    pub(super) fn new(name: String, text: String) -> Self {
        Self(vec![Source { name, text, start: 0 }])
    }

    /// Adds a text.
    pub(super) fn add(&mut self, name: String, text: String) {
        let start = self.0.last().map_or(0, |last| last.start + last.text.len() + 1);
        self.0.push(Source { name, text, start });
    }

    /// The graph file.
    pub(super) fn file(&self) -> &Source {
        &self.0[0]
    }

    /// All texts after the file.
    pub(super) fn overrides(&self) -> &[Source] {
        &self.0[1..]
    }

    /// The text in which a span lies.
    pub(super) fn of(&self, span: &Span) -> &Source {
        let after = self.0.partition_point(|source| source.start <= span.start);
        &self.0[after.saturating_sub(1)]
    }
}
