//! Repair of truncated or damaged recordings.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::rc::Rc;

use mcap::records::{Metadata, Record};
use mcap::{Attachment, McapError, WriteOptions};
use motorium_recordings::messages::{Records, Summary};

use super::reader::{check_content, map_file};
use super::scan::Scan;
use super::{RECOVERED, ReadError};

/// Counts of recovered, damaged and lost parts of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Recovered {
    /// Messages of all channels.
    pub messages: u64,
    /// Number of bytes outside of readable records, such as the unfinished end.
    pub lost_bytes: u64,
    /// `true` if the file was complete.
    pub was_whole: bool,
    /// Number of messages that are declared in the file but unreadable.
    pub missing_messages: u64,
    /// Number of corrupt chunks. Their messages are copied without a checksum.
    pub damaged_chunks: u64,
    /// Number of corrupt attachments. They are copied without a checksum.
    pub damaged_attachments: u64,
    /// Number of unreadable chunks, such as chunks with an unknown compression.
    pub unreadable_chunks: u64,
    /// `true` if bytes outside of chunks and attachments are corrupt.
    pub has_other_damage: bool,
}

impl Recovered {
    /// Returns `true` if nothing but the unfinished end of the file was lost or damaged.
    pub fn is_clean(&self) -> bool {
        let counts =
            [self.missing_messages, self.damaged_chunks, self.damaged_attachments, self.unreadable_chunks];
        let has_gap = self.was_whole && self.lost_bytes > 0;
        counts.iter().all(|count| *count == 0) && !self.has_other_damage && !has_gap
    }

    /// Returns the non-zero losses by name.
    pub fn losses(&self) -> BTreeMap<String, String> {
        let other = u64::from(self.has_other_damage);
        let all = [
            ("missing messages", self.missing_messages),
            ("damaged chunks", self.damaged_chunks),
            ("damaged attachments", self.damaged_attachments),
            ("unreadable chunks", self.unreadable_chunks),
            ("unreadable bytes", if self.is_clean() { 0 } else { self.lost_bytes }),
            ("damage outside of chunks", other),
        ];
        let lost = all.into_iter().filter(|(_, count)| *count > 0);
        lost.map(|(what, count)| (what.to_string(), count.to_string())).collect()
    }
}

/// Copies the readable content of an MCAP file from any writer to a new, complete file with an index.
///
/// Reading continues after damage at the next message or chunk. Damaged parts get no checksum in the new
/// file, and the metadata record `recovered` lists the losses, so readers of the new file still report them.
///
/// ```no_run
/// let recovered = motorium_bridges::recording::recover("torn.mcap".as_ref(), "whole.mcap".as_ref())?;
/// println!("{} messages", recovered.messages);
/// # Ok::<(), motorium_bridges::recording::ReadError>(())
/// ```
///
/// # Errors
/// Returns an error if one of the files cannot be read or written, or if the first is not an MCAP file or
/// ends before its first record.
pub fn recover(torn: &Path, whole: &Path) -> Result<Recovered, ReadError> {
    let io = |path: &Path| {
        let path = path.to_path_buf();
        move |reason| ReadError::Io { path, reason }
    };
    let source = map_file(torn)?;
    let summary = Summary::read(&source);
    check_content(torn, &source, &summary)?;
    let file = File::create(whole).map_err(io(whole))?;
    let recovered = Copy::new(&source, &summary).write(file).map_err(|error| {
        // A partial copy would look like a complete recording. Devices and other non-files are kept.
        if std::fs::symlink_metadata(whole).is_ok_and(|there| there.is_file()) {
            let _ = std::fs::remove_file(whole);
        }
        ReadError::Format { path: whole.to_path_buf(), reason: Box::new(error) }
    })?;
    Ok(recovered)
}

/// A copy of the readable records of a file.
struct Copy<'a> {
    source: &'a [u8],
    summary: &'a Summary,
    recovered: Recovered,
}

impl<'a> Copy<'a> {
    /// Finds the damage before anything is written.
    fn new(source: &'a [u8], summary: &'a Summary) -> Self {
        let mut records = Records::new(source, summary, true);
        let mut messages = 0;
        for record in records.by_ref() {
            messages += u64::from(matches!(record, Record::Message { .. }));
        }
        let stated = summary.statistics.as_ref().map_or(0, |statistics| statistics.message_count);
        let by_index = stated.saturating_sub(messages);
        // Layouts that this version cannot read are irrelevant here.
        let missing = Scan::of_file(source, summary).map_or(by_index, |scan| scan.missing);
        let damage = &records.damage;
        let recovered = Recovered {
            messages: 0,
            lost_bytes: damage.skipped,
            was_whole: records.is_whole,
            missing_messages: missing.max(by_index),
            damaged_chunks: damage.chunks.len() as u64,
            damaged_attachments: damage.attachments.len() as u64,
            unreadable_chunks: damage.unreadable.len() as u64,
            has_other_damage: damage.has_other,
        };
        Self { source, summary, recovered }
    }

    fn write(mut self, file: File) -> Result<Recovered, McapError> {
        let has_damage = !self.recovered.is_clean();
        let position = Rc::new(Cell::new(0));
        let output = Tracked { file: BufWriter::new(file), position: position.clone() };
        let mut records = Records::new(self.source, self.summary, false);
        let mut first = records.next();
        let (profile, library) = match &first {
            Some(Record::Header(header)) => (header.profile.clone(), header.library.clone()),
            _ => (String::new(), String::new()),
        };
        // A checksum over all data would conceal the damage.
        let options = WriteOptions::new()
            .compression(None)
            .profile(profile)
            .library(library)
            .calculate_data_section_crc(!has_damage)
            .calculate_attachment_crcs(self.recovered.damaged_attachments == 0);
        let mut writer = options.create(output)?;
        let mut channels = Channels::new(self.summary);
        let mut unsummed: Vec<Range<u64>> = Vec::new();
        let mut damaged_since = None;
        while let Some(record) = first.take().or_else(|| records.next()) {
            // Messages of damaged chunks get chunks without a checksum.
            if records.is_damaged() != damaged_since.is_some() {
                writer.flush()?;
                match damaged_since.take() {
                    Some(start) => unsummed.push(start..position.get()),
                    None => damaged_since = Some(position.get()),
                }
            }
            match record {
                Record::Schema { .. } | Record::Channel(_) => channels.define(&record, &mut writer)?,
                Record::Message { mut header, data } => {
                    let Some(channel) = channels.find(header.channel_id, &mut writer)? else { continue };
                    header.channel_id = channel;
                    writer.write_to_known_channel(&header, &data)?;
                    self.recovered.messages += 1;
                }
                Record::Attachment { header, data, .. } => writer.attach(&Attachment {
                    log_time: header.log_time,
                    create_time: header.create_time,
                    name: header.name,
                    media_type: header.media_type,
                    data,
                })?,
                Record::Metadata(metadata) => writer.write_metadata(&metadata)?,
                _ => {}
            }
        }
        if has_damage {
            writer.write_metadata(&Metadata {
                name: RECOVERED.to_string(),
                metadata: self.recovered.losses(),
            })?;
        }
        let indexes = writer.finish()?.chunk_indexes;
        if let Some(start) = damaged_since {
            unsummed.push(start..u64::MAX);
        }
        let file = writer.into_inner().file.into_inner().map_err(std::io::IntoInnerError::into_error)?;
        for chunk in indexes.iter().map(|index| index.chunk_start_offset) {
            if unsummed.iter().any(|range| range.contains(&chunk)) {
                // The checksum is stored after the kind, length, times and size of the record; 0 means no
                // checksum.
                file.write_all_at(&[0; 4], chunk + 9 + 24)?;
            }
        }
        file.sync_all()?;
        Ok(self.recovered)
    }
}

/// Maps the channel numbers of a file to the numbers in its copy.
struct Channels<'a> {
    summary: &'a Summary,
    schemas: BTreeMap<u16, u16>,
    channels: BTreeMap<u16, u16>,
}

impl<'a> Channels<'a> {
    fn new(summary: &'a Summary) -> Self {
        Self { summary, schemas: BTreeMap::from([(0, 0)]), channels: BTreeMap::new() }
    }

    fn define<W: Write + Seek>(
        &mut self,
        record: &Record<'_>,
        writer: &mut mcap::Writer<W>,
    ) -> Result<(), McapError> {
        match record {
            Record::Schema { header, data } => {
                let id = writer.add_schema(&header.name, &header.encoding, data)?;
                self.schemas.insert(header.id, id);
            }
            Record::Channel(channel) => {
                let Some(schema) = self.schemas.get(&channel.schema_id) else { return Ok(()) };
                let (topic, encoding) = (&channel.topic, &channel.message_encoding);
                let id = writer.add_channel(*schema, topic, encoding, &channel.metadata)?;
                self.channels.insert(channel.id, id);
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the number of a channel. If the chunk with its definition is damaged, the end of the file
    /// defines it.
    fn find<W: Write + Seek>(
        &mut self,
        channel: u16,
        writer: &mut mcap::Writer<W>,
    ) -> Result<Option<u16>, McapError> {
        if !self.channels.contains_key(&channel) {
            let summary = self.summary;
            let is_other = |record: &&Record<'_>| !matches!(record, Record::Channel(it) if it.id != channel);
            for record in summary.definitions.iter().filter(is_other) {
                self.define(record, writer)?;
            }
        }
        Ok(self.channels.get(&channel).copied())
    }
}

/// A file whose write position can be read from outside its writer.
struct Tracked {
    file: BufWriter<File>,
    position: Rc<Cell<u64>>,
}

impl Write for Tracked {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.position.set(self.position.get() + written as u64);
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Tracked {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        let position = self.file.seek(to)?;
        self.position.set(position);
        Ok(position)
    }
}
