//! Packets of serial servo buses, in two protocols: one of Feetech servos (STS and SCS) and Dynamixel 1.0,
//! and one of Dynamixel 2.0.
//!
//! A servo is a table of registers. One packet can read or write the registers of one servo or of many. All
//! servos share one line and answer when queried. Packets of both protocols may share a line; [`Reader`]
//! supports both.

mod fast;
mod packet;

use crate::frame::DecodeError;
pub use fast::{FAST_AROUND, FAST_HEAD, FastReader, FastTurn, fast_sum, write_fast_status};
pub use packet::Packet;

/// Servo number that addresses all servos.
pub const EVERYBODY: u8 = 0xfe;
/// Length of the longest supported packet, bytes.
pub const LONGEST: usize = 256;

/// Protocol of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// Feetech, and Dynamixel 1.0: an 8-bit checksum, registers 0 to 255.
    One,
    /// Dynamixel 2.0: a 16-bit checksum, registers 0 to 65535.
    Two,
}

/// Request to servos.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instruction<'a> {
    /// Request an answer without data.
    Ping,
    /// Read `count` bytes starting at this register.
    Read {
        /// First register.
        register: u16,
        /// Number of bytes.
        count: u8,
    },
    /// Write these bytes starting at this register.
    Write {
        /// First register.
        register: u16,
        /// Bytes.
        data: &'a [u8],
    },
    /// Write to many servos simultaneously, without answers: each servo stores its bytes starting at this
    /// register.
    WriteMany {
        /// First register.
        register: u16,
        /// Number of bytes per servo.
        each: u8,
        /// Number of each servo, followed by its bytes.
        data: &'a [u8],
    },
    /// Read `count` bytes from many servos, which answer one after the other.
    ReadMany {
        /// First register.
        register: u16,
        /// Number of bytes.
        count: u8,
        /// Numbers of the servos.
        servos: &'a [u8],
    },
    /// Read from many servos, which answer together in one packet: [`FastReader`]. Protocol 2.0 only, if the
    /// firmware supports it.
    FastReadMany {
        /// First register.
        register: u16,
        /// Number of bytes.
        count: u8,
        /// Numbers of the servos.
        servos: &'a [u8],
    },
}

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const STATUS: u8 = 0x55;
const READ_MANY: u8 = 0x82;
const WRITE_MANY: u8 = 0x83;
const FAST_READ_MANY: u8 = 0x8a;

/// Packet under construction.
struct Writer<'a> {
    bytes: &'a mut [u8; LONGEST],
    length: usize,
}

impl Writer<'_> {
    fn put(&mut self, bytes: &[u8]) -> Option<()> {
        let end = self.length + bytes.len();
        self.bytes.get_mut(self.length..end)?.copy_from_slice(bytes);
        self.length = end;
        Some(())
    }

    fn word(&mut self, protocol: Protocol, number: u16) -> Option<()> {
        match protocol {
            Protocol::One => self.put(&[u8::try_from(number).ok()?]),
            Protocol::Two => self.put(&number.to_le_bytes()),
        }
    }
}

/// Writes an instruction packet for a servo. Returns the length of the packet; `None` if the data do not fit.
///
/// ```
/// use motorium_can::servo::{Instruction, LONGEST, Protocol, write};
///
/// let mut packet = [0; LONGEST];
/// let length = write(Protocol::One, 1, &Instruction::Ping, &mut packet).ok_or("too long")?;
/// assert_eq!(packet[..length], [0xff, 0xff, 1, 2, 1, 0xfb]);
/// # Ok::<(), &str>(())
/// ```
pub fn write(
    protocol: Protocol,
    servo: u8,
    instruction: &Instruction<'_>,
    packet: &mut [u8; LONGEST],
) -> Option<usize> {
    let (code, many) = match instruction {
        Instruction::Ping => (PING, false),
        Instruction::Read { .. } => (READ, false),
        Instruction::Write { .. } => (WRITE, false),
        Instruction::ReadMany { .. } => (READ_MANY, true),
        Instruction::WriteMany { .. } => (WRITE_MANY, true),
        Instruction::FastReadMany { .. } if protocol == Protocol::Two => (FAST_READ_MANY, true),
        Instruction::FastReadMany { .. } => return None,
    };
    let servo = if many { EVERYBODY } else { servo };
    if servo > EVERYBODY {
        return None;
    }
    let mut out = begin(protocol, servo, packet);
    out.put(&[code])?;
    match *instruction {
        Instruction::Ping => {}
        Instruction::Read { register, count } => {
            out.word(protocol, register)?;
            out.word(protocol, count.into())?;
        }
        Instruction::Write { register, data } => {
            out.word(protocol, register)?;
            out.put(data)?;
        }
        Instruction::ReadMany { register, count, servos }
        | Instruction::FastReadMany { register, count, servos } => {
            out.word(protocol, register)?;
            out.word(protocol, count.into())?;
            out.put(servos)?;
        }
        Instruction::WriteMany { register, each, data } => {
            if data.is_empty() || data.len() % (usize::from(each) + 1) != 0 {
                return None;
            }
            out.word(protocol, register)?;
            out.word(protocol, each.into())?;
            out.put(data)?;
        }
    }
    end(protocol, out)
}

/// Writes a servo's answer.
pub fn write_status(
    protocol: Protocol,
    servo: u8,
    error: u8,
    data: &[u8],
    packet: &mut [u8; LONGEST],
) -> Option<usize> {
    let mut out = begin(protocol, servo, packet);
    if protocol == Protocol::Two {
        out.put(&[STATUS])?;
    }
    out.put(&[error])?;
    out.put(data)?;
    end(protocol, out)
}

fn begin(protocol: Protocol, servo: u8, bytes: &mut [u8; LONGEST]) -> Writer<'_> {
    let head: &[u8] = match protocol {
        Protocol::One => &[0xff, 0xff, servo, 0],
        Protocol::Two => &[0xff, 0xff, 0xfd, 0, servo, 0, 0],
    };
    bytes[..head.len()].copy_from_slice(head);
    Writer { bytes, length: head.len() }
}

/// Adds length and checksum.
fn end(protocol: Protocol, mut out: Writer<'_>) -> Option<usize> {
    match protocol {
        Protocol::One => {
            out.bytes[3] = u8::try_from(out.length - 3).ok()?;
            let sum = checksum(&out.bytes[2..out.length]);
            out.put(&[sum])?;
        }
        Protocol::Two => {
            // a stuffing byte follows a sequence that looks like a packet header
            let mut at = 7;
            while at + 3 <= out.length {
                if out.bytes[at..at + 3] == [0xff, 0xff, 0xfd] {
                    out.put(&[0])?;
                    out.bytes.copy_within(at + 3..out.length - 1, at + 4);
                    out.bytes[at + 3] = 0xfd;
                }
                at += 1;
            }
            let length = u16::try_from(out.length - 5).ok()?;
            out.bytes[5..7].copy_from_slice(&length.to_le_bytes());
            let sum = crc(&out.bytes[..out.length]);
            out.put(&sum.to_le_bytes())?;
        }
    }
    Some(out.length)
}

/// Returns the inverted lowest eight bits of the sum of the bytes.
fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

/// Returns the 16-bit checksum with the polynomial 0x8005, highest bit first.
fn crc(bytes: &[u8]) -> u16 {
    crc_from(0, bytes)
}

/// Continues a checksum with more bytes.
fn crc_from(before: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(before, |crc, byte| {
        (0..8).fold(
            crc ^ u16::from(*byte) << 8,
            |crc, _| {
                if crc & 0x8000 != 0 { crc << 1 ^ 0x8005 } else { crc << 1 }
            },
        )
    })
}

/// Answer of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status<'a> {
    /// Protocol.
    pub protocol: Protocol,
    /// Number of the servo.
    pub servo: u8,
    /// Error flags; 0 for none.
    pub error: u8,
    /// Bytes read from the servo; empty for other answers.
    pub data: &'a [u8],
}

/// Reader of answers that processes one byte at a time. Bytes outside of packets are skipped.
#[derive(Clone, Debug)]
pub struct Reader {
    bytes: [u8; LONGEST],
    length: usize,
}

impl Default for Reader {
    fn default() -> Self {
        Self { bytes: [0; LONGEST], length: 0 }
    }
}

impl Reader {
    /// Appends a byte. Returns the answer completed by this byte; `None` if no answer is complete.
    ///
    /// # Errors
    /// Returns an error if the byte completes a packet that has a wrong checksum or is not an answer.
    pub fn push(&mut self, byte: u8) -> Option<Result<Status<'_>, DecodeError>> {
        let (protocol, whole) = self.end(byte)?;
        Some(match protocol {
            Protocol::One => one(&self.bytes[..whole]),
            Protocol::Two => two(&mut self.bytes[..whole]),
        })
    }

    /// Appends a byte. Returns the servo number and the bytes of the packet that it completes, if any,
    /// regardless of its content.
    pub(crate) fn push_raw(&mut self, byte: u8) -> Option<(u8, &[u8])> {
        let (protocol, whole) = self.end(byte)?;
        let servo = self.bytes[if protocol == Protocol::One { 2 } else { 4 }];
        Some((servo, &self.bytes[..whole]))
    }

    /// Discards an incomplete common answer: its end is missing if a servo is silent.
    pub(crate) fn drop_common(&mut self) {
        if matches!(self.bytes[..self.length], [0xff, 0xff, 0xfd, 0, EVERYBODY, _, _, STATUS, ..]) {
            self.length = 0;
        }
    }

    /// Appends a byte. Returns the protocol and length of the packet that it completes.
    fn end(&mut self, byte: u8) -> Option<(Protocol, usize)> {
        self.bytes[self.length] = byte;
        self.length += 1;
        // a header may begin at any byte
        while !self.may_begin() {
            self.bytes.copy_within(1..self.length, 0);
            self.length -= 1;
        }
        let (protocol, whole) = self.whole()?;
        if self.length < whole {
            return None;
        }
        self.length = 0;
        Some((protocol, whole))
    }

    /// Returns `true` if the bytes so far may begin a packet.
    fn may_begin(&self) -> bool {
        match &self.bytes[..self.length] {
            [] | [0xff] | [0xff, 0xff] => true,
            // a third 0xFF is not a servo number: the header starts one byte later
            [0xff, 0xff, servo] => *servo != 0xff,
            [0xff, 0xff, 0xfd, 0, ..] => {
                self.length < 7 || self.whole().is_some_and(|(_, whole)| whole <= LONGEST)
            }
            [0xff, 0xff, _, length, ..] => (2..=250).contains(length),
            _ => false,
        }
    }

    /// Returns the protocol and total length of the current packet, once they are known.
    fn whole(&self) -> Option<(Protocol, usize)> {
        match &self.bytes[..self.length] {
            [0xff, 0xff, 0xfd, 0, _, low, high, ..] => {
                let length = usize::from(u16::from_le_bytes([*low, *high]));
                Some((Protocol::Two, if length < 3 { LONGEST + 1 } else { 7 + length }))
            }
            [0xff, 0xff, 0xfd, 0, ..] => None,
            [0xff, 0xff, _, length, ..] => Some((Protocol::One, 4 + usize::from(*length))),
            _ => None,
        }
    }
}

fn one(packet: &[u8]) -> Result<Status<'_>, DecodeError> {
    let (sum, rest) = packet.split_last().unwrap_or((&0, &[]));
    if checksum(&rest[2..]) != *sum {
        return Err(DecodeError::Field { field: "the checksum", found: (*sum).into() });
    }
    Ok(Status { protocol: Protocol::One, servo: rest[2], error: rest[4], data: &rest[5..] })
}

fn two(packet: &mut [u8]) -> Result<Status<'_>, DecodeError> {
    let (end, expected) = (checked(packet)?, 11);
    if packet.len() < expected {
        return Err(DecodeError::Length { found: packet.len(), expected });
    }
    if packet[7] != STATUS {
        return Err(DecodeError::Field { field: "the instruction", found: packet[7].into() });
    }
    let length = unstuff(packet, end);
    Ok(Status { protocol: Protocol::Two, servo: packet[4], error: packet[8], data: &packet[9..length] })
}

/// Verifies the checksum of a protocol 2.0 packet. Returns the end of its data.
fn checked(packet: &[u8]) -> Result<usize, DecodeError> {
    let end = packet.len() - 2;
    let sum = u16::from_le_bytes([packet[end], packet[end + 1]]);
    if crc(&packet[..end]) != sum {
        return Err(DecodeError::Field { field: "the checksum", found: sum.into() });
    }
    Ok(end)
}

/// Removes stuffing bytes. Returns the new end of the data.
fn unstuff(packet: &mut [u8], end: usize) -> usize {
    let (mut length, mut at) = (end, 7);
    while at + 4 <= length {
        if packet[at..at + 4] == [0xff, 0xff, 0xfd, 0xfd] {
            packet.copy_within(at + 4..length, at + 3);
            length -= 1;
        }
        at += 1;
    }
    length
}
