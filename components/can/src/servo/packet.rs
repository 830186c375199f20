//! Complete packets: answers received by the adapter, and instructions received by a servo.

use super::{
    FAST_READ_MANY, Instruction, LONGEST, PING, Protocol, READ, READ_MANY, Status, WRITE, WRITE_MANY,
    checked, checksum, one, two, unstuff,
};
use crate::frame::DecodeError;

/// Buffer for one complete packet, decoded in place.
///
/// ```
/// use motorium_can::servo::Packet;
///
/// let mut packet = Packet::default();
/// let status = packet.status(&[0xff, 0xff, 1, 3, 0, 0x20, 0xdb])?;
/// assert_eq!((status.servo, status.data), (1, &[0x20][..]));
/// # Ok::<(), motorium_can::DecodeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Packet {
    bytes: [u8; LONGEST],
}

impl Default for Packet {
    fn default() -> Self {
        Self { bytes: [0; LONGEST] }
    }
}

impl Packet {
    /// Copies a packet of either protocol, with header and checksum.
    fn take(&mut self, packet: &[u8]) -> Result<(Protocol, &mut [u8]), DecodeError> {
        let found = packet.len();
        let (protocol, expected) = match packet {
            [0xff, 0xff, 0xfd, 0, _, low, high, ..] => {
                (Protocol::Two, (7 + usize::from(u16::from_le_bytes([*low, *high]))).max(10))
            }
            [0xff, 0xff, servo, length, ..] if *servo != 0xff => {
                (Protocol::One, (4 + usize::from(*length)).max(6))
            }
            _ => return Err(DecodeError::Length { found, expected: 6 }),
        };
        if found != expected || found > LONGEST {
            return Err(DecodeError::Length { found, expected });
        }
        let bytes = &mut self.bytes[..found];
        bytes.copy_from_slice(packet);
        Ok((protocol, bytes))
    }

    /// Decodes the answer in a packet.
    ///
    /// # Errors
    /// Returns an error if the bytes are not exactly one answer packet, or if the checksum is wrong.
    pub fn status(&mut self, packet: &[u8]) -> Result<Status<'_>, DecodeError> {
        match self.take(packet)? {
            (Protocol::One, bytes) => one(bytes),
            (Protocol::Two, bytes) => two(bytes),
        }
    }

    /// Decodes the protocol, servo number and instruction of a packet that a servo has received.
    ///
    /// ```
    /// use motorium_can::servo::{Instruction, Packet, Protocol};
    ///
    /// let mut packet = Packet::default();
    /// let (protocol, servo, instruction) = packet.instruction(&[0xff, 0xff, 1, 4, 2, 0x2b, 1, 0xcc])?;
    /// assert_eq!((protocol, servo), (Protocol::One, 1));
    /// assert_eq!(instruction, Instruction::Read { register: 0x2b, count: 1 });
    /// # Ok::<(), motorium_can::DecodeError>(())
    /// ```
    ///
    /// # Errors
    /// Returns an error if the bytes are not an instruction packet, if the checksum is wrong, or if the
    /// instruction is not supported.
    pub fn instruction(&mut self, packet: &[u8]) -> Result<(Protocol, u8, Instruction<'_>), DecodeError> {
        let (protocol, bytes) = self.take(packet)?;
        let (servo, code, data) = match protocol {
            Protocol::One => {
                let end = bytes.len() - 1;
                if checksum(&bytes[2..end]) != bytes[end] {
                    return Err(DecodeError::Field { field: "the checksum", found: bytes[end].into() });
                }
                (bytes[2], bytes[4], &bytes[5..end])
            }
            Protocol::Two => {
                let end = checked(bytes)?;
                let end = unstuff(bytes, end);
                (bytes[4], bytes[7], &bytes[8..end])
            }
        };
        let unknown = DecodeError::Field { field: "the instruction", found: code.into() };
        // registers and counts have one or two bytes
        let word = |at: usize| match protocol {
            Protocol::One => data.get(at).map(|byte| u16::from(*byte)),
            Protocol::Two => Some(u16::from_le_bytes([*data.get(2 * at)?, *data.get(2 * at + 1)?])),
        };
        let rest = |words: usize| data.get(if protocol == Protocol::One { words } else { 2 * words }..);
        let count = || word(1).and_then(|count| u8::try_from(count).ok());
        let read = || match (code, word(0)) {
            (PING, _) if data.is_empty() => Some(Instruction::Ping),
            (READ, Some(register)) if rest(2)?.is_empty() => {
                Some(Instruction::Read { register, count: count()? })
            }
            (WRITE, Some(register)) => Some(Instruction::Write { register, data: rest(1)? }),
            (READ_MANY, Some(register)) => {
                Some(Instruction::ReadMany { register, count: count()?, servos: rest(2)? })
            }
            (FAST_READ_MANY, Some(register)) if protocol == Protocol::Two => {
                Some(Instruction::FastReadMany { register, count: count()?, servos: rest(2)? })
            }
            (WRITE_MANY, Some(register)) => {
                let (each, data) = (count()?, rest(2)?);
                let is_whole = !data.is_empty() && data.len().is_multiple_of(usize::from(each) + 1);
                is_whole.then_some(Instruction::WriteMany { register, each, data })
            }
            _ => None,
        };
        read().map(|instruction| (protocol, servo, instruction)).ok_or(unknown)
    }
}
