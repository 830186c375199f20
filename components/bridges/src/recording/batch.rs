//! Batches of messages to be written to the file.

use std::collections::VecDeque;

use mcap::McapError;
use motorium::state::Stamp;

use super::file::Writer;

/// Messages that have been read but not written.
#[derive(Default)]
pub(super) struct Batch {
    bytes: Vec<u8>,
    messages: Vec<Message>,
    /// `true` if the run has reported an error in the meantime.
    pub(super) has_failed: bool,
}

/// A message, stored as a byte range of its batch.
pub(super) struct Message {
    pub(super) time_ns: u64,
    publish_ns: u64,
    sequence: u64,
    channel: u16,
    start: usize,
    end: usize,
}

impl Message {
    pub(super) fn write(&self, data: &[u8], writer: &mut Writer) -> Result<(), McapError> {
        writer.message(self.channel, self.sequence, (self.time_ns, self.publish_ns), data)
    }
}

impl Batch {
    pub(super) fn push(
        &mut self,
        channel: u16,
        stamp: &Stamp,
        time_ns: u64,
        encode: impl FnOnce(&mut Vec<u8>),
    ) {
        let start = self.bytes.len();
        encode(&mut self.bytes);
        let end = self.bytes.len();
        if end > start {
            let (publish_ns, sequence) = (time_ns, stamp.sequence);
            self.messages.push(Message { time_ns, publish_ns, sequence, channel, start, end });
        }
    }
}

impl Batch {
    /// Returns `true` if there is nothing to write.
    pub(super) fn is_empty(&self) -> bool {
        self.messages.is_empty() && !self.has_failed
    }

    /// Size of its messages, bytes.
    pub(super) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Writes the messages in time order to the file, or to a ring if there is one, and empties the batch.
    pub(super) fn write(
        &mut self,
        writer: &mut Writer,
        mut ring: Option<&mut Ring>,
    ) -> Result<(), McapError> {
        self.messages.sort_by_key(|message| message.time_ns);
        for message in self.messages.drain(..) {
            let data = &self.bytes[message.start..message.end];
            match &mut ring {
                Some(ring) => ring.push(message, data),
                None => message.write(data, writer)?,
            }
        }
        self.bytes.clear();
        Ok(())
    }
}

/// The most recent messages, oldest first.
pub(super) struct Ring {
    pub(super) span_ns: u64,
    pub(super) messages: VecDeque<(Message, Box<[u8]>)>,
}

impl Ring {
    /// Creates a ring that keeps the messages of a time span \[ns\].
    pub(super) fn new(span_ns: u64) -> Self {
        Self { span_ns, messages: VecDeque::new() }
    }

    pub(super) fn push(&mut self, message: Message, data: &[u8]) {
        let oldest_ns = message.time_ns.saturating_sub(self.span_ns);
        while self.messages.front().is_some_and(|(first, _)| first.time_ns < oldest_ns) {
            self.messages.pop_front();
        }
        self.messages.push_back((message, data.into()));
    }
}
