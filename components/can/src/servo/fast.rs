//! Common packet with which protocol 2.0 servos jointly answer a fast read. The first servo starts the
//! packet, and each further servo appends its share.

use super::{EVERYBODY, LONGEST, Protocol, STATUS, Status, Writer, crc_from};
use crate::frame::DecodeError;

/// Length of the packet header, bytes.
pub const FAST_HEAD: usize = 8;
/// Overhead of a share, bytes: error, number and checksum.
pub const FAST_AROUND: usize = 4;

/// Position of a servo in the answer order of a common packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FastTurn {
    /// The servo starts the packet.
    First {
        /// Number of servos that answer.
        servos: usize,
    },
    /// The servo appends its share after the shares of previous servos.
    After {
        /// Checksum of all bytes of the previous servos, computed by [`fast_sum`].
        sum: u16,
    },
}

/// Returns the checksum of a common packet after adding `bytes`. `sum` is the checksum of the bytes before
/// them, 0 at the start of the packet.
pub fn fast_sum(sum: u16, bytes: &[u8]) -> u16 {
    crc_from(sum, bytes)
}

/// Writes a servo's share of the common packet. Returns the number of bytes; `None` if they do not fit.
///
/// ```
/// use motorium_can::servo::{FastTurn, LONGEST, fast_sum, write_fast_status};
///
/// let mut share = [0; LONGEST];
/// let length = write_fast_status(FastTurn::First { servos: 2 }, 3, 0, &[0xa6, 0], &mut share).ok_or("too long")?;
/// let sum = fast_sum(0, &share[..length]);
/// assert!(write_fast_status(FastTurn::After { sum }, 7, 0, &[0x1f, 8], &mut share).is_some());
/// # Ok::<(), &str>(())
/// ```
pub fn write_fast_status(
    turn: FastTurn,
    servo: u8,
    error: u8,
    data: &[u8],
    share: &mut [u8; LONGEST],
) -> Option<usize> {
    let mut out = Writer { bytes: share, length: 0 };
    let mut sum = 0;
    match turn {
        FastTurn::First { servos } => {
            let length = u16::try_from(1 + servos * (data.len() + FAST_AROUND)).ok()?;
            let [low, high] = length.to_le_bytes();
            out.put(&[0xff, 0xff, 0xfd, 0, EVERYBODY, low, high, STATUS])?;
        }
        FastTurn::After { sum: before } => sum = before,
    }
    out.put(&[error, servo])?;
    out.put(data)?;
    let sum = crc_from(sum, &out.bytes[..out.length]);
    out.put(&sum.to_le_bytes())?;
    Some(out.length)
}

/// Reader of common packets. It returns each servo's share as soon as it is complete, including the shares
/// before a missing or damaged one.
///
/// ```
/// use motorium_can::servo::FastReader;
///
/// let mut reader = FastReader::default();
/// reader.expect(4);
/// reader.push(&[0xff, 0xff, 0xfd, 0, 0xfe, 9, 0, 0x55, 0, 3, 0xa6, 0, 0, 0]);
/// assert!(reader.next().is_none(), "its checksum has not come yet");
/// ```
#[derive(Clone, Debug)]
pub struct FastReader {
    bytes: [u8; LONGEST],
    length: usize,
    /// Offset of the next share; 0 before the header, beyond all bytes once the packet is complete.
    next: usize,
    /// End of the last share.
    end: usize,
    sum: u16,
    /// Data bytes per servo.
    count: usize,
}

const OVER: usize = usize::MAX;

impl Default for FastReader {
    fn default() -> Self {
        Self { bytes: [0; LONGEST], length: 0, next: OVER, end: 0, sum: 0, count: 0 }
    }
}

impl FastReader {
    /// Prepares for a common packet with `count` data bytes per servo.
    pub fn expect(&mut self, count: u8) {
        (self.length, self.next, self.count) = (0, 0, count.into());
    }

    /// Appends bytes of the packet, which may be split at any position.
    pub fn push(&mut self, bytes: &[u8]) {
        let end = self.length + bytes.len();
        match self.bytes.get_mut(self.length..end) {
            Some(place) => {
                place.copy_from_slice(bytes);
                self.length = end;
            }
            None => self.next = OVER,
        }
    }

    /// Returns the next servo's complete share; `None` if more bytes are needed.
    ///
    /// # Errors
    /// Returns an error if the packet is not a common packet with `count` data bytes per servo, or if the
    /// checksum is wrong. The remaining bytes of the packet are discarded.
    #[allow(clippy::should_implement_trait)] // a share borrows the reader
    pub fn next(&mut self) -> Option<Result<Status<'_>, DecodeError>> {
        if self.next == 0 {
            let head = self.bytes[..self.length].first_chunk::<FAST_HEAD>()?;
            let length = usize::from(u16::from_le_bytes([head[5], head[6]]));
            let is_head = head[..5] == [0xff, 0xff, 0xfd, 0, EVERYBODY] && head[7] == STATUS;
            if !is_head || length < 1 || !(length - 1).is_multiple_of(self.count + FAST_AROUND) {
                self.next = OVER;
                return Some(Err(DecodeError::Field { field: "the instruction", found: head[7].into() }));
            }
            self.sum = crc_from(0, head);
            (self.next, self.end) = (FAST_HEAD, FAST_HEAD - 1 + length);
        }
        let begin = self.next;
        if begin == OVER || begin >= self.end {
            return None;
        }
        let sum_at = begin + 2 + self.count;
        let share = self.bytes[..self.length].get(begin..sum_at + 2)?;
        let sum = crc_from(self.sum, &share[..2 + self.count]);
        let sent = u16::from_le_bytes([share[2 + self.count], share[3 + self.count]]);
        if sum != sent {
            self.next = OVER;
            return Some(Err(DecodeError::Field { field: "the checksum", found: sent.into() }));
        }
        self.sum = crc_from(sum, &sent.to_le_bytes());
        self.next = sum_at + 2;
        Some(Ok(Status {
            protocol: Protocol::Two,
            servo: share[1],
            error: share[0],
            data: &self.bytes[begin + 2..sum_at],
        }))
    }
}
