//! Records in a chunk of an MCAP file: checked against the chunk's checksum, and recovered if the chunk is
//! damaged.

use std::borrow::Cow;
use std::io::Read;

use mcap::records::{ChunkHeader, ChunkIndex, Record, op};

use super::framing::Frame;
use super::lengths;

/// Maximum size of a decompressed chunk \[bytes\]. Writers create chunks of a few megabytes; a few kilobytes
/// can expand to gigabytes.
const LONGEST: usize = 128 << 20;
/// Names of the compressions used by writers.
const COMPRESSIONS: [&str; 3] = ["", "lz4", "zstd"];
/// Number of bytes before the content of a record: its kind and its length.
const HEAD: usize = 9;

/// A decompressed and verified chunk.
#[derive(Debug, Clone)]
pub(crate) struct Chunk<'a> {
    /// Times of the first and last message according to the header, ns.
    pub(crate) times: (u64, u64),
    content: Cow<'a, [u8]>,
    position: usize,
    /// Offsets of the messages listed by the chunk's index, ascending.
    messages: Vec<usize>,
    /// `true` if bytes of the chunk are corrupted.
    pub(crate) is_damaged: bool,
    /// `true` if the end of the chunk is missing: its writer was interrupted, or the file was truncated.
    pub(crate) is_open: bool,
    /// Reason why the chunk cannot be read.
    pub(crate) unreadable: Option<String>,
    /// Number of bytes that are not part of any record.
    pub(crate) skipped: u64,
}

impl<'a> Chunk<'a> {
    /// Opens the chunk of a record; `indexes` are the records between it and the next chunk.
    pub(crate) fn open(frame: &Frame<'a>, indexes: &[u8]) -> Self {
        let mut chunk = Self {
            times: (0, 0),
            content: Cow::Borrowed(&[]),
            position: 0,
            messages: Vec::new(),
            is_damaged: false,
            is_open: false,
            unreadable: None,
            skipped: 0,
        };
        let parts = match frame.listed {
            Some(index) => repaired(frame.body, index),
            None => split(frame.body),
        };
        let Some((header, stored, is_consistent)) = parts else {
            (chunk.is_damaged, chunk.skipped) = (true, frame.body.len() as u64);
            return chunk;
        };
        chunk.times = (header.message_start_time, header.message_end_time);
        // The writer sets the sizes when it closes the chunk.
        let is_unfinished = header.compressed_size == u64::MAX && header.uncompressed_size == u64::MAX;
        let is_short = (stored.len() as u64) < header.compressed_size;
        chunk.is_open = is_unfinished || (frame.is_cut && frame.is_last && is_short);
        chunk.is_damaged = (frame.is_cut || !is_consistent) && !chunk.is_open;
        match decompress(&header, stored) {
            Ok((content, is_whole)) => {
                chunk.content = content;
                chunk.is_damaged |= !is_whole && !chunk.is_open;
            }
            Err(reason) => chunk.unreadable = Some(reason),
        }
        let is_summed = header.uncompressed_crc != 0 && !chunk.is_open && chunk.unreadable.is_none();
        chunk.is_damaged |= is_summed && crc32fast::hash(&chunk.content) != header.uncompressed_crc;
        if chunk.is_damaged || !is_summed {
            chunk.messages = listed(indexes, chunk.content.len());
        }
        chunk
    }

    /// Returns the end of the record at `start` if its kind and length are plausible.
    fn framed(&self, start: usize) -> Option<usize> {
        let kind = *self.content.get(start)?;
        let length = u64::from_le_bytes(*self.content.get(start + 1..)?.first_chunk()?);
        let end = usize::try_from(length).ok()?.checked_add(start + HEAD)?;
        let is_known = matches!(kind, op::SCHEMA | op::CHANNEL | op::MESSAGE) || kind >= 0x80;
        (is_known && end <= self.content.len()).then_some(end)
    }

    /// Returns the start of the first listed message after an offset.
    fn next_message(&self, start: usize) -> Option<usize> {
        self.messages.get(self.messages.partition_point(|message| *message <= start)).copied()
    }

    /// Returns the end of the record at `start` if all records from `start` fit before the next listed
    /// message.
    fn end(&self, start: usize) -> Option<usize> {
        let end = self.framed(start)?;
        let Some(next) = self.next_message(start) else { return Some(end) };
        let mut place = end;
        while place < next {
            // All messages are listed; definitions are between them.
            place = self.framed(place).filter(|_| self.content[place] != op::MESSAGE)?;
        }
        (place == next).then_some(end)
    }

    /// Returns the next record.
    pub(crate) fn next(&mut self) -> Option<Record<'a>> {
        while self.position < self.content.len() {
            let start = self.position;
            let end = self.end(start);
            let record = end.and_then(|end| self.parsed(start, end));
            match (end, record) {
                (Some(end), Some(record)) => {
                    self.position = end;
                    return Some(record);
                }
                (Some(end), None) => self.position = end,
                (None, _) => self.position = self.next_message(start).unwrap_or(self.content.len()),
            }
            self.is_damaged |= !self.is_open;
            self.skipped += (self.position - start) as u64;
        }
        None
    }

    fn parsed(&self, start: usize, end: usize) -> Option<Record<'a>> {
        let kind = self.content[start];
        match &self.content {
            Cow::Borrowed(content) => lengths::parsed(kind, &content[start + HEAD..end]),
            Cow::Owned(content) => lengths::parsed(kind, &content[start + HEAD..end]).map(Record::into_owned),
        }
    }
}

/// Returns the header of a chunk, its stored bytes, and whether the lengths in the header match the length of
/// the record. If they do not, the compression is derived from the lengths that would match.
fn split(body: &[u8]) -> Option<(ChunkHeader, &[u8], bool)> {
    let number = |start: usize| Some(u64::from_le_bytes(*body.get(start..)?.first_chunk()?));
    let short = |start: usize| Some(u32::from_le_bytes(*body.get(start..)?.first_chunk()?));
    let fits = |name: usize| {
        number(32 + name).is_some_and(|size| size.checked_add(40 + name as u64) == Some(body.len() as u64))
    };
    let length = short(28)? as usize;
    let stated = body.get(32..32_usize.checked_add(length)?);
    let is_consistent = stated.is_some() && fits(length);
    let likely = || COMPRESSIONS.into_iter().find(|name| fits(name.len()));
    let compression = match stated {
        Some(name) if is_consistent => String::from_utf8_lossy(name).into_owned(),
        _ => likely().map(str::to_owned).or_else(|| Some(String::from_utf8_lossy(stated?).into_owned()))?,
    };
    let name = compression.len();
    let header = ChunkHeader {
        message_start_time: number(0)?,
        message_end_time: number(8)?,
        uncompressed_size: number(16)?,
        uncompressed_crc: short(24)?,
        compression,
        compressed_size: number(32 + name)?,
    };
    Some((header, body.get(40 + name..)?, is_consistent))
}

/// Returns the chunk header according to the file's index, the stored bytes, and whether the chunk has the
/// same header. The index contains everything except the checksum of the content.
fn repaired<'a>(body: &'a [u8], index: &ChunkIndex) -> Option<(ChunkHeader, &'a [u8], bool)> {
    let header = ChunkHeader {
        message_start_time: index.message_start_time,
        message_end_time: index.message_end_time,
        uncompressed_size: index.uncompressed_size,
        uncompressed_crc: u32::from_le_bytes(*body.get(24..)?.first_chunk()?),
        compression: index.compression.clone(),
        compressed_size: index.compressed_size,
    };
    let times = [header.message_start_time, header.message_end_time, header.uncompressed_size];
    let expected = [
        times.map(u64::to_le_bytes).as_flattened(),
        &header.uncompressed_crc.to_le_bytes(),
        &(header.compression.len() as u32).to_le_bytes(),
        header.compression.as_bytes(),
        &header.compressed_size.to_le_bytes(),
    ]
    .concat();
    let (found, stored) = body.split_at_checked(expected.len())?;
    let is_same = found == expected;
    Some((header, stored, is_same))
}

/// Returns the content of a chunk and whether it has the stated size.
fn decompress<'a>(header: &ChunkHeader, stored: &'a [u8]) -> Result<(Cow<'a, [u8]>, bool), String> {
    let size = usize::try_from(header.uncompressed_size).unwrap_or(usize::MAX);
    if header.compression.is_empty() {
        return Ok((Cow::Borrowed(stored), stored.len() == size));
    }
    let is_open = size == usize::MAX;
    if size > LONGEST && !is_open {
        return Err(format!("a compressed chunk of {size} bytes, expected at most {LONGEST}"));
    }
    let mut content = Vec::new();
    // One extra byte detects a chunk longer than stated.
    let limit = size.min(LONGEST) as u64 + 1;
    let read = match header.compression.as_str() {
        "zstd" => match ruzstd::decoding::StreamingDecoder::new(stored) {
            Ok(decoder) => decoder.take(limit).read_to_end(&mut content),
            Err(_) => return Ok((Cow::Owned(content), false)),
        },
        "lz4" => lz4_flex::frame::FrameDecoder::new(stored).take(limit).read_to_end(&mut content),
        other => return Err(format!("a chunk compressed by `{other}`, expected `zstd`, `lz4` or none")),
    };
    let is_whole = read.is_ok() && content.len() == size;
    content.truncate(size.min(LONGEST));
    Ok((Cow::Owned(content), is_whole))
}

/// Returns the start offsets of the messages listed by a chunk's indexes, up to the length of the chunk.
fn listed(mut records: &[u8], length: usize) -> Vec<usize> {
    let mut starts = Vec::new();
    while let Some((&kind, rest)) = records.split_first()
        && let Some((bytes, rest)) = rest.split_first_chunk::<8>()
        && let Ok(size) = usize::try_from(u64::from_le_bytes(*bytes))
        && let Some((body, rest)) = rest.split_at_checked(size)
    {
        if kind == op::MESSAGE_INDEX && body.len() >= 6 {
            let entries = body[6..].chunks_exact(16).filter_map(|entry| entry.last_chunk::<8>());
            starts.extend(entries.filter_map(|start| usize::try_from(u64::from_le_bytes(*start)).ok()));
        }
        records = rest;
    }
    starts.retain(|start| *start < length);
    starts.sort_unstable();
    starts.dedup();
    starts
}
