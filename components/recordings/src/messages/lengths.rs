//! Checks of the lengths inside a record before it is parsed.
//!
//! The MCAP parser allocates memory for a string of the stated length before reading it: four damaged bytes
//! could request 4 GB and end the program.

use mcap::read::parse_record;
use mcap::records::{Record, op};

/// A section of a record.
#[derive(Debug, Clone, Copy)]
enum Part {
    /// Fixed number of bytes.
    Fixed(usize),
    /// A four-byte length followed by that number of bytes.
    Block,
    /// A block that consists of blocks.
    Blocks,
    /// An eight-byte length followed by that number of bytes.
    Long,
}

use Part::{Block, Blocks, Fixed, Long};

/// Returns the sections of a record of this kind. More bytes may follow, except in an attachment, whose
/// parser relies on its end.
fn parts(kind: u8) -> &'static [Part] {
    match kind {
        op::HEADER => &[Block, Block],
        op::FOOTER => &[Fixed(20)],
        op::SCHEMA => &[Fixed(2), Block, Block, Block],
        op::CHANNEL => &[Fixed(4), Block, Block, Blocks],
        op::MESSAGE => &[Fixed(22)],
        op::CHUNK => &[Fixed(28), Block, Long],
        op::MESSAGE_INDEX => &[Fixed(2), Block],
        op::CHUNK_INDEX => &[Fixed(32), Block, Fixed(8), Block, Fixed(16)],
        op::ATTACHMENT => &[Fixed(16), Block, Block, Long, Fixed(4)],
        op::ATTACHMENT_INDEX => &[Fixed(40), Block, Block],
        op::STATISTICS => &[Fixed(42), Block],
        op::METADATA => &[Block, Blocks],
        op::METADATA_INDEX => &[Fixed(16), Block],
        op::SUMMARY_OFFSET => &[Fixed(17)],
        op::DATA_END => &[Fixed(4)],
        _ => &[],
    }
}

/// Splits off the bytes counted by a leading four-byte length.
fn block(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(u32::from_le_bytes(*length) as usize)
}

/// Splits off the bytes counted by a leading eight-byte length.
fn long(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<8>()?;
    rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)
}

/// Returns `true` if all lengths in a record stay within it.
pub(crate) fn fit(kind: u8, body: &[u8]) -> bool {
    let mut rest = body;
    for part in parts(kind) {
        let next = match part {
            Fixed(count) => rest.get(*count..),
            Block => block(rest).map(|(_, rest)| rest),
            Long => long(rest).map(|(_, rest)| rest),
            Blocks => block(rest).and_then(|(mut inside, rest)| {
                while !inside.is_empty() {
                    inside = block(inside)?.1;
                }
                Some(rest)
            }),
        };
        let Some(next) = next else { return false };
        rest = next;
    }
    kind != op::ATTACHMENT || rest.is_empty()
}

/// Parses a record; `None` if its lengths do not fit or its content is invalid.
pub(crate) fn parsed(kind: u8, body: &[u8]) -> Option<Record<'_>> {
    fit(kind, body).then(|| parse_record(kind, body).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// Returns a file with a record of each kind that writers create.
    fn file() -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let options = mcap::WriteOptions::new().compression(None).profile("profile").library("library");
        let mut writer = options.create(&mut bytes).unwrap();
        let schema = writer.add_schema("numbers", "protobuf", b"abc").unwrap();
        let facts = BTreeMap::from([("one".to_string(), "two".to_string())]);
        let channel_id = writer.add_channel(schema, "numbers", "protobuf", &facts).unwrap();
        let header = mcap::records::MessageHeader { channel_id, sequence: 1, log_time: 2, publish_time: 3 };
        writer.write_to_known_channel(&header, &[7; 40]).unwrap();
        let data = std::borrow::Cow::Borrowed(&b"content"[..]);
        let (name, media_type) = ("a".to_string(), "text".to_string());
        writer.attach(&mcap::Attachment { log_time: 1, create_time: 2, name, media_type, data }).unwrap();
        writer.write_metadata(&mcap::records::Metadata { name: "m".to_string(), metadata: facts }).unwrap();
        writer.finish().unwrap();
        drop(writer);
        bytes.into_inner()
    }

    /// Returns the kinds and contents of all records, at the top level and in chunks.
    fn records(bytes: &[u8]) -> Vec<(u8, Vec<u8>)> {
        let mut found = Vec::new();
        let mut rest = bytes;
        while let Some((&kind, behind)) = rest.split_first()
            && let Some((body, behind)) = long(behind)
        {
            if kind == op::CHUNK {
                found.extend(records(&body[40..]));
            }
            found.push((kind, body.to_vec()));
            rest = behind;
        }
        found
    }

    #[test]
    fn records_of_writers_fit() {
        let file = file();
        let found = records(&file[mcap::MAGIC.len()..]);
        let kinds: std::collections::BTreeSet<u8> = found.iter().map(|(kind, _)| *kind).collect();
        assert_eq!(kinds.len(), usize::from(op::DATA_END - op::HEADER + 1), "{kinds:?}");
        for (kind, body) in &found {
            assert!(fit(*kind, body) && parsed(*kind, body).is_some(), "kind {kind}");
            for end in 0..body.len() {
                // neither panics nor reads beyond the end
                drop(parsed(*kind, &body[..end]));
            }
        }
    }

    #[test]
    fn lengths_beyond_the_record_are_rejected() {
        for (kind, body) in records(&file()[mcap::MAGIC.len()..]) {
            for start in 0..body.len().saturating_sub(3) {
                let mut body = body.clone();
                body[start..start + 4].fill(0xff);
                // A text of 4 GB would be reserved before it is read.
                drop(parsed(kind, &body));
            }
        }
        let huge = [&u32::MAX.to_le_bytes()[..], b"abc"].concat();
        assert!(!fit(op::HEADER, &huge) && !fit(op::METADATA, &huge));
    }
}
