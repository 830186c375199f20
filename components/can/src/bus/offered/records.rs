//! Frames and reports as 80-byte records for a unix socket, with many records per message.

use crate::bus::Received;
use crate::bus::report::Report;
use crate::frame::{Form, Frame, Id};

/// Bytes of a record: identifier and flags, form, length, number of unsent frames, time, data.
pub(super) const RECORD: usize = 80;
/// Records per message.
pub(super) const BATCH: usize = 64;

const EXTENDED: u32 = 1 << 31;
const REPORT: u32 = 1 << 29;
const DATA: usize = 16;

/// A record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Record {
    /// Frame with its send or receive time.
    Frame(Received),
    /// Report of a controller, with the number of frames that did not fit into its queue.
    Report(Report, u8),
    /// The interface is down.
    Down,
}

impl Record {
    pub(super) fn encode(&self, bytes: &mut [u8; RECORD]) {
        *bytes = [0; RECORD];
        let mut id = REPORT;
        match self {
            Self::Frame(Received { frame, time_ns }) => {
                id = match frame.id {
                    Id::Standard(id) => id.into(),
                    Id::Extended(id) => id | EXTENDED,
                };
                bytes[4] = match frame.form {
                    Form::Classic => 0,
                    Form::Fd => 1,
                    Form::FdFast => 2,
                    Form::Packet => 3,
                };
                let data = frame.data();
                bytes[5] = data.len() as u8;
                bytes[8..16].copy_from_slice(&time_ns.to_le_bytes());
                bytes[DATA..DATA + data.len()].copy_from_slice(data);
            }
            Self::Report(report, unsent) => {
                let (classes, data) = report.encode();
                id |= classes;
                (bytes[5], bytes[6]) = (8, *unsent);
                bytes[DATA..DATA + 8].copy_from_slice(&data);
            }
            Self::Down => {}
        }
        bytes[..4].copy_from_slice(&id.to_le_bytes());
    }

    /// Decodes a record. Returns `None` for invalid bytes.
    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; RECORD] = bytes.try_into().ok()?;
        let id = u32::from_le_bytes(*bytes.first_chunk()?);
        let data = bytes.get(DATA..DATA + usize::from(bytes[5]))?;
        if id & REPORT != 0 {
            return match data.len() {
                0 => Some(Self::Down),
                _ => Some(Self::Report(Report::decode(id & !REPORT, data.first_chunk()?), bytes[6])),
            };
        }
        let form = [Form::Classic, Form::Fd, Form::FdFast, Form::Packet].get(usize::from(bytes[4]))?;
        let id = match id & EXTENDED {
            0 => Id::standard(u16::try_from(id).ok()?)?,
            _ => Id::extended(id & !EXTENDED)?,
        };
        let time_ns = u64::from_le_bytes(*bytes[8..].first_chunk()?);
        Some(Self::Frame(Received { frame: Frame::new(id, *form, data)?, time_ns }))
    }
}

/// Records waiting to be sent.
#[derive(Debug)]
pub(super) struct Batch {
    bytes: Box<[u8; RECORD * BATCH]>,
    pub(super) count: usize,
}

impl Batch {
    pub(super) fn new() -> Self {
        Self { bytes: Box::new([0; RECORD * BATCH]), count: 0 }
    }

    pub(super) fn is_full(&self) -> bool {
        self.count == BATCH
    }

    pub(super) fn push(&mut self, record: &Record) {
        if let Some(place) = self.bytes.as_chunks_mut().0.get_mut(self.count) {
            record.encode(place);
            self.count += 1;
        }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes[..RECORD * self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorState;

    #[test]
    fn records_round_trip_and_invalid_bytes_are_rejected() {
        let frame = |id, form, data: &[u8]| {
            Record::Frame(Received {
                frame: Frame::new(id, form, data).unwrap(),
                time_ns: 0x0123_4567_89ab_cdef,
            })
        };
        let report = Report { state: Some(ErrorState::Off), is_overflow: true, ..Report::default() };
        let mut bytes = [0; RECORD];
        for record in [
            frame(Id::Standard(0x7ff), Form::Classic, &[7; 8]),
            frame(Id::Extended(0x1fff_ffff), Form::FdFast, &[9; 64]),
            frame(Id::Extended(0), Form::Fd, &[]),
            frame(Id::Standard(3), Form::Packet, &[1; 33]),
            Record::Report(report, 12),
            Record::Down,
        ] {
            record.encode(&mut bytes);
            assert_eq!(Record::decode(&bytes), Some(record));
        }
        assert_eq!(Record::decode(&bytes[1..]), None);
        bytes[..6].copy_from_slice(&[0, 8, 0, 0, 0, 8]);
        assert_eq!(Record::decode(&bytes), None, "no such identifier");
        bytes[..6].copy_from_slice(&[0, 0, 0, 0, 0, 9]);
        assert_eq!(Record::decode(&bytes), None, "a classic frame of nine bytes");
        bytes[..6].copy_from_slice(&[0, 0, 0, 0, 4, 0]);
        assert_eq!(Record::decode(&bytes), None, "no such form");
    }
}
