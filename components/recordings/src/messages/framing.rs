//! Top-level records of an MCAP file, found despite damaged lengths.
//!
//! A damaged length would otherwise hide everything after it. The framing continues at the next chunk listed
//! in the index at the end of the file. Without an index, it continues at the next bytes whose lengths are
//! consistent with a chunk.

use mcap::MAGIC;
use mcap::records::{ChunkIndex, Record, op};

use super::lengths;

/// Number of bytes before the content of a record: its kind and its length.
const HEAD: usize = 9;
/// Size of a chunk header without the compression name, bytes.
const CHUNK_HEADER: usize = 40;

/// A top-level record: its kind and its content.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame<'a> {
    pub(crate) kind: u8,
    pub(crate) body: &'a [u8],
    /// Start of the record in the file.
    pub(crate) start: usize,
    /// End of the record in the file.
    pub(crate) end: usize,
    /// `true` if the file ends with the record.
    pub(crate) is_last: bool,
    /// `true` if the length of the record is damaged or was never written. The content then ends at the
    /// position given by the index, at the next record or at the end of the file.
    pub(crate) is_cut: bool,
    /// Index entry of the chunk, if the index lists it.
    pub(crate) listed: Option<&'a ChunkIndex>,
}

/// An iterator over the top-level records.
#[derive(Debug, Clone)]
pub(crate) struct Frames<'a> {
    file: &'a [u8],
    position: usize,
    /// Chunks listed by the index, ascending.
    chunks: &'a [ListedChunk],
    /// Number of bytes that are not part of any record.
    pub(crate) skipped: u64,
    /// `true` once the footer has been reached.
    pub(crate) has_footer: bool,
}

impl<'a> Frames<'a> {
    /// Creates an iterator over the records of `file`. `chunks` are the chunks listed by its index, if
    /// present.
    pub(crate) fn new(file: &'a [u8], chunks: &'a [ListedChunk]) -> Self {
        Self { file, position: MAGIC.len().min(file.len()), chunks, skipped: 0, has_footer: false }
    }

    /// Returns the end of a record that starts at `start` if its kind and length are plausible.
    fn framed(&self, start: usize) -> Option<usize> {
        let (kind, length) = head(self.file, start)?;
        let end = (start + HEAD).checked_add(length).filter(|end| *end <= self.file.len())?;
        let is_plausible = match kind {
            op::CHUNK => chunk_length(&self.file[start + HEAD..]) == Some(length),
            op::FOOTER => length == 20,
            op::DATA_END => length == 4,
            _ => true,
        };
        if !is_plausible || (kind != op::CHUNK && self.listed(start).is_some()) {
            return None;
        }
        // A record that extends past the start of a chunk has a damaged length.
        self.next_chunk(start).is_none_or(|chunk| end <= chunk).then_some(end)
    }

    fn frame(&self, kind: u8, start: usize, end: usize, is_cut: bool) -> Frame<'a> {
        let body = self.file.get(start + HEAD..end).unwrap_or_default();
        Frame { kind, body, start, end, is_last: end == self.file.len(), is_cut, listed: None }
    }

    /// Returns the chunk that starts here if the index lists it.
    fn listed(&self, start: usize) -> Option<&'a ListedChunk> {
        let place = self.chunks.binary_search_by_key(&start, |chunk| chunk.start).ok()?;
        Some(&self.chunks[place])
    }

    /// Returns the start of the next listed chunk after a position.
    fn next_chunk(&self, start: usize) -> Option<usize> {
        let next = self.chunks.partition_point(|chunk| chunk.start <= start);
        self.chunks.get(next).map(|chunk| chunk.start)
    }

    /// Returns the start of the next record after damage at `start`.
    fn resume(&self, start: usize) -> Option<usize> {
        if let Some(chunk) = self.next_chunk(start) {
            return Some(chunk);
        }
        // Two consecutive records, or the end of the file; bytes of a message rarely match this.
        let is_next = |start: &usize| {
            if is_open_chunk(self.file, *start) {
                return true;
            }
            let is_landmark = matches!(self.file[*start], op::CHUNK | op::DATA_END);
            let end = is_landmark.then(|| self.framed(*start)).flatten();
            end.is_some_and(|end| {
                end == self.file.len() || self.framed(end).is_some() || is_open_chunk(self.file, end)
            })
        };
        (start + 1..self.file.len()).find(is_next)
    }
}

impl<'a> Iterator for Frames<'a> {
    type Item = Frame<'a>;

    fn next(&mut self) -> Option<Frame<'a>> {
        while !self.has_footer && self.position < self.file.len() {
            let start = self.position;
            if let Some(chunk) = self.listed(start) {
                self.position = chunk.end;
                // Its kind, its length or its header may be damaged.
                let is_cut = self.framed(start) != Some(chunk.end);
                let frame = self.frame(op::CHUNK, start, chunk.end, is_cut);
                return Some(Frame { listed: Some(&chunk.index), ..frame });
            }
            if let Some(end) = self.framed(start) {
                self.position = end;
                let kind = self.file[start];
                self.has_footer = kind == op::FOOTER;
                return Some(self.frame(kind, start, end, false));
            }
            // A chunk contains its length twice: in its record and in its header.
            let body = self.file.get(start + HEAD..).unwrap_or_default();
            let is_chunk = self.file[start] == op::CHUNK;
            let stated = chunk_length(body).filter(|length| is_chunk && *length <= body.len());
            let stated = stated.map(|length| start + HEAD + length);
            let resumed = match stated.filter(|end| *end == self.file.len() || self.framed(*end).is_some()) {
                Some(end) => Some(end),
                None => self.resume(start),
            };
            let end = resumed.unwrap_or(self.file.len());
            self.position = end;
            if is_chunk && chunk_length(body).is_some() {
                return Some(self.frame(op::CHUNK, start, end, true));
            }
            self.skipped += (end - start) as u64;
        }
        None
    }
}

/// Returns kind and length of the record at a position.
fn head(file: &[u8], start: usize) -> Option<(u8, usize)> {
    let kind = *file.get(start)?;
    let length = u64::from_le_bytes(*file.get(start + 1..)?.first_chunk()?);
    let is_known = (op::HEADER..=op::DATA_END).contains(&kind) || kind >= 0x80;
    is_known.then(|| (kind, usize::try_from(length).unwrap_or(usize::MAX)))
}

/// Returns the length of a chunk as stated by its header; `usize::MAX` if it was never written, `None` if the
/// header is not a chunk's.
fn chunk_length(body: &[u8]) -> Option<usize> {
    let name = u32::from_le_bytes(*body.get(28..)?.first_chunk()?) as usize;
    if name > 16 {
        return None;
    }
    let stored = u64::from_le_bytes(*body.get(32 + name..)?.first_chunk()?);
    let name_is_text = body[32..32 + name].iter().all(u8::is_ascii_alphanumeric);
    name_is_text.then(|| usize::try_from(stored).unwrap_or(usize::MAX).saturating_add(CHUNK_HEADER + name))
}

/// Returns `true` for an unfinished chunk, whose lengths are placeholders.
fn is_open_chunk(file: &[u8], start: usize) -> bool {
    head(file, start).is_some_and(|(kind, length)| kind == op::CHUNK && length == usize::MAX)
}

/// A chunk listed by the index at the end of the file.
#[derive(Debug, Clone)]
pub(crate) struct ListedChunk {
    /// Start of the chunk's record in the file.
    pub(crate) start: usize,
    /// End of the chunk's record.
    pub(crate) end: usize,
    index: ChunkIndex,
}

impl ListedChunk {
    /// Returns a chunk whose lengths are consistent and within a file of `size` bytes.
    fn new(index: ChunkIndex, size: usize) -> Option<Self> {
        let start = usize::try_from(index.chunk_start_offset).ok()?;
        let length = usize::try_from(index.chunk_length).ok()?;
        let stored = usize::try_from(index.compressed_size).ok()?;
        let header = HEAD + CHUNK_HEADER + index.compression.len();
        let end = start.checked_add(length).filter(|end| *end <= size)?;
        (stored.checked_add(header) == Some(length)).then_some(Self { start, end, index })
    }
}

/// The summary section at the end of a file: definitions, counts and index, as far as they are present and
/// undamaged.
#[derive(Debug, Default)]
pub struct Summary {
    /// Records of the schemas and channels.
    pub definitions: Vec<Record<'static>>,
    /// Message counts; `None` if the file does not contain them.
    pub statistics: Option<mcap::records::Statistics>,
    /// Chunks, ascending.
    pub(crate) chunks: Vec<ListedChunk>,
    /// `true` if the footer is present.
    pub has_footer: bool,
    /// `true` if bytes of the summary are corrupted.
    pub is_damaged: bool,
}

impl Summary {
    /// Reads the summary from the end of a file.
    pub fn read(file: &[u8]) -> Self {
        const FOOTER: usize = HEAD + 20;
        let mut summary = Self::default();
        let footer = file
            .len()
            .checked_sub(FOOTER + MAGIC.len())
            .filter(|start| file.ends_with(MAGIC) && head(file, *start) == Some((op::FOOTER, FOOTER - HEAD)));
        let Some(footer) = footer else { return summary };
        let Some(Record::Footer(facts)) = lengths::parsed(op::FOOTER, &file[footer + HEAD..footer + FOOTER])
        else {
            return summary;
        };
        summary.has_footer = true;
        let start = usize::try_from(facts.summary_start).unwrap_or(usize::MAX);
        if start == 0 {
            return summary;
        }
        if start > footer || start < MAGIC.len() {
            summary.is_damaged = true;
            return summary;
        }
        // The checksum covers the summary and the footer up to the checksum.
        let covered = &file[start..footer + FOOTER - 4];
        if facts.summary_crc != 0 && crc32fast::hash(covered) != facts.summary_crc {
            summary.is_damaged = true;
            return summary;
        }
        let mut place = start;
        while place < footer
            && let Some((kind, length)) = head(file, place)
            && let Some(end) = (place + HEAD).checked_add(length).filter(|end| *end <= footer)
        {
            if matches!(kind, op::SCHEMA | op::CHANNEL | op::STATISTICS | op::CHUNK_INDEX)
                && let Some(record) = lengths::parsed(kind, &file[place + HEAD..end])
            {
                match record {
                    Record::Statistics(statistics) => summary.statistics = Some(statistics),
                    Record::ChunkIndex(index) => summary.chunks.extend(ListedChunk::new(index, start)),
                    other => summary.definitions.push(other.into_owned()),
                }
            }
            place = end;
        }
        summary.chunks.sort_unstable_by_key(|chunk| chunk.start);
        // Writers do not create overlapping chunks.
        let mut end = MAGIC.len();
        summary.chunks.retain(|chunk| {
            let is_behind = chunk.start >= end;
            end = if is_behind { chunk.end } else { end };
            is_behind
        });
        summary
    }
}
