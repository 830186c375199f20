//! Repairing a recording whose writer was interrupted.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::read::{ChunkFlattener, Options};
use mcap::records::Record;
use mcap::{Attachment, McapError, WriteOptions};

use super::ReadError;
use super::reader::cut_off;

/// Counts of what was recovered of a torn file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Recovered {
    /// Messages of all channels.
    pub messages: u64,
    /// Bytes of the torn file that could not be read: its unfinished end.
    pub lost_bytes: u64,
    /// True if the file had its end: there was nothing to repair.
    pub was_whole: bool,
}

/// Writes what can be read of an MCAP file, of whichever writer, into a new one with its index and its end.
///
/// ```no_run
/// let recovered = motorium_bridges::recording::recover("torn.mcap".as_ref(), "whole.mcap".as_ref())?;
/// println!("{} messages", recovered.messages);
/// # Ok::<(), motorium_bridges::recording::ReadError>(())
/// ```
///
/// # Errors
/// One of the files cannot be read or written, or the first is no MCAP file or ends before it holds anything.
pub fn recover(torn: &Path, whole: &Path) -> Result<Recovered, ReadError> {
    let format = |path: &Path| {
        let path = path.to_path_buf();
        move |reason| ReadError::Format { path, reason: Box::new(reason) }
    };
    let io = |path: &Path| {
        let path = path.to_path_buf();
        move |reason| ReadError::Io { path, reason }
    };
    let source = std::fs::read(torn).map_err(io(torn))?;
    let mut records = ChunkFlattener::new_with_options(&source, Options::IgnoreEndMagic.into())
        .map_err(format(torn))?
        .peekable();
    // A file that is none is found out before another is made.
    if let Some(Err(_)) = records.peek()
        && let Some(Err(error)) = records.next()
    {
        return Err(format(torn)(error));
    }
    let again = ChunkFlattener::new_with_options(&source, Options::IgnoreEndMagic.into());
    let mut readable = again.map_err(format(torn))?.map_while(Result::ok);
    if !readable.any(|record| !matches!(record, Record::Header(_))) {
        let reason = if source.is_empty() { "it is empty".to_string() } else { cut_off(source.len()) };
        return Err(ReadError::Missing { path: torn.to_path_buf(), reason });
    }
    let file = File::create(whole).map_err(io(whole))?;
    let recovered = copy(records, file).map_err(|error| {
        // Part of a recording with an end would look like all of it. What is no file, such as a device, stays.
        if std::fs::symlink_metadata(whole).is_ok_and(|there| there.is_file()) {
            let _ = std::fs::remove_file(whole);
        }
        format(whole)(error)
    })?;
    let lost_bytes = if recovered.was_whole { 0 } else { unread(&source) };
    Ok(Recovered { lost_bytes, ..recovered })
}

/// Bytes behind the last record at the top level that is complete.
fn unread(source: &[u8]) -> u64 {
    const MAGIC: usize = 8;
    let mut place = MAGIC;
    while let Some(length) = source.get(place + 1..).and_then(|rest| rest.first_chunk()) {
        let end = usize::try_from(u64::from_le_bytes(*length))
            .ok()
            .and_then(|length| length.checked_add(place + 9));
        match end {
            Some(end) if end <= source.len() => place = end,
            _ => break,
        }
    }
    source.len().saturating_sub(place) as u64
}

fn copy<'a>(
    records: impl Iterator<Item = Result<Record<'a>, McapError>>,
    file: File,
) -> Result<Recovered, McapError> {
    let mut recovered = Recovered::default();
    let mut writer: Option<mcap::Writer<BufWriter<File>>> = None;
    let mut output = Some(file);
    let (mut schemas, mut channels) = (BTreeMap::from([(0, 0)]), BTreeMap::new());
    // The first record that cannot be read is the unfinished one.
    for record in records.map_while(Result::ok) {
        if let (None, Some(file)) = (&writer, output.take()) {
            let header = match &record {
                Record::Header(header) => header.clone(),
                _ => mcap::records::Header { profile: String::new(), library: String::new() },
            };
            let options =
                WriteOptions::new().compression(None).profile(header.profile).library(header.library);
            writer = Some(options.create(BufWriter::new(file))?);
        }
        let Some(writer) = &mut writer else { break };
        match record {
            Record::Schema { header, data } => {
                let id = writer.add_schema(&header.name, &header.encoding, &data)?;
                schemas.insert(header.id, id);
            }
            Record::Channel(channel) => {
                let Some(schema) = schemas.get(&channel.schema_id) else { continue };
                let (topic, encoding) = (&channel.topic, &channel.message_encoding);
                channels.insert(channel.id, writer.add_channel(*schema, topic, encoding, &channel.metadata)?);
            }
            Record::Message { mut header, data } => {
                let Some(channel) = channels.get(&header.channel_id) else { continue };
                header.channel_id = *channel;
                writer.write_to_known_channel(&header, &data)?;
                recovered.messages += 1;
            }
            Record::Attachment { header, data, .. } => writer.attach(&Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data,
            })?,
            Record::Metadata(metadata) => writer.write_metadata(&metadata)?,
            // What follows repeats what was before.
            Record::DataEnd(_) => {
                recovered.was_whole = true;
                break;
            }
            _ => {}
        }
    }
    if let Some(mut writer) = writer {
        writer.finish()?;
        let file = writer.into_inner().into_inner().map_err(std::io::IntoInnerError::into_error)?;
        file.sync_all()?;
    }
    Ok(recovered)
}
