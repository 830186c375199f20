//! All records of an MCAP file, at the top level and in chunks, and their damage.

use mcap::MAGIC;
use mcap::records::{Record, op};

use super::chunks::Chunk;
use super::framing::{Frame, Frames, Summary};
use super::lengths;

/// Damage found while reading the records of a file.
#[derive(Debug, Clone, Default)]
pub struct Damage {
    /// Times of the first and last message of each corrupted chunk, ns.
    pub chunks: Vec<(u64, u64)>,
    /// Names of corrupted attachments.
    pub attachments: Vec<String>,
    /// For each unreadable chunk, the reason why it is unreadable.
    pub unreadable: Vec<String>,
    /// Number of bytes that are not part of any record.
    pub skipped: u64,
    /// `true` if bytes outside chunks and attachments are corrupted.
    pub has_other: bool,
}

impl Damage {
    /// Returns descriptions of the faults, each as a predicate such as "is incomplete". `is_whole` is `true`
    /// if the end of the file is present. `begin_ns` is the time at which the file starts \[ns\].
    pub fn faults(&self, is_whole: bool, begin_ns: u64) -> Vec<String> {
        let mut faults = Vec::new();
        if !is_whole {
            faults.push(
                "is incomplete: all existing records are read (`motorium recover` completes it)".to_string(),
            );
        }
        faults.extend(damaged(&self.chunks, begin_ns));
        for name in &self.attachments {
            faults.push(format!("is damaged: its attachment `{name}` changed after writing"));
        }
        if self.has_other {
            faults.push("is damaged: bytes outside its chunks changed after writing".to_string());
        }
        if is_whole && self.skipped > 0 {
            faults.push(format!("is damaged: {} bytes cannot be read", self.skipped));
        }
        if let Some(reason) = self.unreadable.first() {
            let count = self.unreadable.len();
            faults.push(format!("has {count} chunks that cannot be read: {reason}"));
        }
        faults
    }

    /// Returns `true` if the file has damage other than a missing end.
    pub fn is_any(&self) -> bool {
        let Self { chunks, attachments, unreadable, has_other, .. } = self;
        !chunks.is_empty() || !attachments.is_empty() || !unreadable.is_empty() || *has_other
    }
}

/// Returns the faults of chunks with these times, for a file that starts at `begin` \[ns\].
fn damaged(chunks: &[(u64, u64)], begin: u64) -> Option<String> {
    let (from, to) = (chunks.iter().map(|(from, _)| from).min()?, chunks.iter().map(|(_, to)| to).max()?);
    let since = |time: &u64| time.saturating_sub(begin) as f64 * 1e-9;
    let count = chunks.len();
    let noun = if count == 1 { "chunk" } else { "chunks" };
    Some(format!(
        "is damaged: {count} {noun}, between {:.3} s and {:.3} s, changed after writing",
        since(from),
        since(to)
    ))
}

/// An iterator over all records in file order, in and outside chunks. The iterator skips damaged bytes.
#[derive(Debug)]
pub struct Records<'a> {
    file: &'a [u8],
    frames: Frames<'a>,
    /// A record that was read ahead.
    next: Option<Frame<'a>>,
    chunk: Option<Chunk<'a>>,
    /// Number of chunks read.
    pub chunks: usize,
    /// Damage found in the records read.
    pub damage: Damage,
    /// `true` once the end of the data has been reached.
    pub is_whole: bool,
    /// `true` to compare the checksum of all data with the one in the file.
    checks_all: bool,
}

impl<'a> Records<'a> {
    /// Creates an iterator over the records of a file. If `checks_all` is `true`, the iterator also verifies
    /// the checksum of the whole data section.
    pub fn new(file: &'a [u8], summary: &'a Summary, checks_all: bool) -> Self {
        Self {
            file,
            frames: Frames::new(file, &summary.chunks),
            next: None,
            chunk: None,
            chunks: 0,
            damage: Damage { has_other: summary.is_damaged, ..Damage::default() },
            is_whole: summary.has_footer,
            checks_all,
        }
    }

    /// Returns `true` if the latest record is from a damaged chunk.
    pub fn is_damaged(&self) -> bool {
        self.chunk.as_ref().is_some_and(|chunk| chunk.is_damaged)
    }

    fn close_chunk(&mut self) {
        let Some(chunk) = self.chunk.take() else { return };
        self.damage.skipped += chunk.skipped;
        if chunk.is_damaged {
            self.damage.chunks.push(chunk.times);
        }
        self.damage.unreadable.extend(chunk.unreadable);
    }

    fn open_chunk(&mut self, frame: &Frame<'a>) {
        let mut end = frame.end;
        // The index of a chunk follows it.
        for next in self.frames.by_ref() {
            if next.kind != op::MESSAGE_INDEX {
                self.next = Some(next);
                break;
            }
            end = next.end;
        }
        self.chunk = Some(Chunk::open(frame, &self.file[frame.end..end]));
        self.chunks += 1;
    }

    fn end(&mut self, body: &[u8], start: usize) {
        self.is_whole = true;
        let stated = body.first_chunk().map_or(0, |sum| u32::from_le_bytes(*sum));
        let is_clean = !self.damage.is_any() && self.damage.skipped == 0 && self.frames.skipped == 0;
        if !self.checks_all || stated == 0 || !is_clean {
            return;
        }
        // Writers differ in whether the checksum covers the first bytes of the file.
        let mut with_magic = crc32fast::Hasher::new();
        with_magic.update(MAGIC);
        let mut data = crc32fast::Hasher::new();
        data.update(&self.file[MAGIC.len()..start]);
        with_magic.combine(&data);
        self.damage.has_other = with_magic.finalize() != stated && data.finalize() != stated;
    }
}

impl<'a> Iterator for Records<'a> {
    type Item = Record<'a>;

    fn next(&mut self) -> Option<Record<'a>> {
        loop {
            if let Some(chunk) = &mut self.chunk {
                if let Some(record) = chunk.next() {
                    return Some(record);
                }
                self.close_chunk();
            }
            let Some(frame) = self.next.take().or_else(|| self.frames.next()) else {
                self.is_whole |= self.frames.has_footer;
                self.damage.skipped += std::mem::take(&mut self.frames.skipped);
                return None;
            };
            match frame.kind {
                op::CHUNK => self.open_chunk(&frame),
                op::ATTACHMENT => {
                    let (record, is_damaged) = attachment(frame.body);
                    if let Some(record) = record {
                        if let (Record::Attachment { header, .. }, true) = (&record, is_damaged) {
                            self.damage.attachments.push(header.name.clone());
                        }
                        return Some(record);
                    }
                    self.damage.has_other = true;
                    self.damage.skipped += (frame.end - frame.start) as u64;
                }
                kind => {
                    if kind == op::DATA_END {
                        self.end(frame.body, frame.start);
                    }
                    if let Some(record) = lengths::parsed(kind, frame.body) {
                        return Some(record);
                    }
                    self.damage.has_other = true;
                    self.damage.skipped += (frame.end - frame.start) as u64;
                }
            }
        }
    }
}

/// Returns an attachment, and `true` if its bytes are corrupted. `None` if its lengths are inconsistent.
fn attachment(body: &[u8]) -> (Option<Record<'_>>, bool) {
    if !lengths::fit(op::ATTACHMENT, body) {
        return (None, true);
    }
    if let Some(record) = lengths::parsed(op::ATTACHMENT, body) {
        return (Some(record), false);
    }
    // Without a checksum, the parser accepts the bytes.
    let mut unsummed = body.to_vec();
    let end = unsummed.len() - 4;
    unsummed[end..].fill(0);
    (lengths::parsed(op::ATTACHMENT, &unsummed).map(Record::into_owned), true)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use mcap::records::MessageHeader;
    use mcap::{Compression, WriteOptions};

    use super::*;

    /// Returns a file with 300 messages in several chunks, and the start offsets of its chunks.
    fn file(compression: Option<Compression>) -> (Vec<u8>, Vec<usize>) {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let options = WriteOptions::new().compression(compression).chunk_size(Some(2000));
        let mut writer = options.create(&mut bytes).unwrap();
        let schema = writer.add_schema("numbers", "protobuf", b"").unwrap();
        let channel = writer.add_channel(schema, "numbers", "protobuf", &BTreeMap::new()).unwrap();
        for sequence in 0..300_u32 {
            let time = u64::from(sequence);
            let header = MessageHeader { channel_id: channel, sequence, log_time: time, publish_time: time };
            writer.write_to_known_channel(&header, &[sequence as u8; 40]).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        let bytes = bytes.into_inner();
        let chunks: Vec<usize> = Summary::read(&bytes).chunks.iter().map(|chunk| chunk.start).collect();
        assert!(chunks.len() > 5);
        (bytes, chunks)
    }

    fn messages(bytes: &[u8]) -> (Vec<u32>, Damage) {
        let summary = Summary::read(bytes);
        let mut records = Records::new(bytes, &summary, true);
        let mut found = Vec::new();
        for record in records.by_ref() {
            if let Record::Message { header, .. } = record {
                found.push(header.sequence);
            }
        }
        (found, records.damage)
    }

    /// Flips bits of lengths and contents of records in chunks, with and without the index.
    #[test]
    fn one_flipped_bit_loses_at_most_one_message() {
        let (whole, chunks) = file(None);
        assert_eq!(messages(&whole).0.len(), 300);
        for at in chunks[1]..chunks[2] {
            for bit in (0..8).map(|bit| 1 << bit) {
                let mut bytes = whole.clone();
                bytes[at] ^= bit;
                let (found, damage) = messages(&bytes);
                assert!(found.len() >= 299, "{} messages, bit {bit} of byte {at}", found.len());
                assert!(damage.is_any() || damage.skipped > 0, "bit {bit} of byte {at} is not detected");
            }
        }
    }

    #[test]
    fn bit_flips_anywhere_are_detected() {
        let (whole, _) = file(None);
        let clean = messages(&whole);
        assert!(!clean.1.is_any() && clean.1.skipped == 0);
        for at in MAGIC.len()..whole.len() - MAGIC.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x04;
            let summary = Summary::read(&bytes);
            let mut records = Records::new(&bytes, &summary, true);
            records.by_ref().for_each(drop);
            let damage = &records.damage;
            let has_end = records.is_whole && summary.has_footer;
            assert!(damage.is_any() || damage.skipped > 0 || !has_end, "byte {at} of {}", whole.len());
        }
    }

    #[test]
    fn reading_without_index_continues_at_the_next_chunk() {
        let (whole, chunks) = file(None);
        let per_chunk = 300 / chunks.len();
        // The footer is cut off, and the length of a chunk is damaged in both places.
        let mut bytes = whole[..whole.len() - 20].to_vec();
        bytes[chunks[1] + 1 + 3] ^= 0x20;
        bytes[chunks[1] + 9 + 32 + 3] ^= 0x20;
        let (found, _) = messages(&bytes);
        assert!(found.len() + 2 * per_chunk >= 300, "{} messages", found.len());
        assert_eq!(found.last(), Some(&299));
    }

    #[test]
    fn unfinished_chunk_is_read_to_its_end() {
        let (whole, chunks) = file(None);
        let last = *chunks.last().unwrap();
        let all = messages(&whole[..last]).0.len();
        let mut bytes = whole.clone();
        bytes[last + 1..last + 9].fill(0xff);
        bytes[last + 9 + 16..last + 9 + 28].fill(0xff);
        bytes[last + 9 + 32..last + 9 + 40].fill(0xff);
        bytes.truncate(last + 9 + 40 + 3 * 71 + 30);
        let (found, damage) = messages(&bytes);
        assert_eq!(found.len(), all + 3);
        assert!(!damage.is_any() && damage.skipped == 30, "{damage:?}");
    }
}
