//! Whole packets: answers as the adapter finds them on its line, instructions as a servo does.

use super::{Instruction, PING, READ, READ_MANY, Status, WRITE, WRITE_MANY, checksum, one};
use crate::frame::DecodeError;

/// The answer in a packet of protocol 1, head and checksum among its bytes.
///
/// ```
/// use motorium_can::servo::read_status;
///
/// let status = read_status(&[0xff, 0xff, 1, 3, 0, 0x20, 0xdb])?;
/// assert_eq!((status.servo, status.data), (1, &[0x20][..]));
/// # Ok::<(), motorium_can::DecodeError>(())
/// ```
///
/// # Errors
/// It is no such packet, another one follows it, or its checksum is wrong.
pub fn read_status(packet: &[u8]) -> Result<Status<'_>, DecodeError> {
    whole(packet)?;
    one(packet)
}

/// The servo's side: the number of the servo and the instruction in a packet of protocol 1.
///
/// ```
/// use motorium_can::servo::{Instruction, read_instruction};
///
/// let (servo, instruction) = read_instruction(&[0xff, 0xff, 1, 4, 2, 0x2b, 1, 0xcc])?;
/// assert_eq!((servo, instruction), (1, Instruction::Read { register: 0x2b, count: 1 }));
/// # Ok::<(), motorium_can::DecodeError>(())
/// ```
///
/// # Errors
/// It is no such packet, its checksum is wrong, or the instruction is not known here.
pub fn read_instruction(packet: &[u8]) -> Result<(u8, Instruction<'_>), DecodeError> {
    let sum = whole(packet)?;
    let body = &packet[2..packet.len() - 1];
    if checksum(body) != sum {
        return Err(DecodeError::Field { field: "the checksum", found: sum.into() });
    }
    let (servo, code, data) = (packet[2], packet[4], &packet[5..packet.len() - 1]);
    let instruction = match (code, data) {
        (PING, []) => Instruction::Ping,
        (READ, [register, count]) => Instruction::Read { register: (*register).into(), count: *count },
        (WRITE, [register, data @ ..]) => Instruction::Write { register: (*register).into(), data },
        (READ_MANY, [register, count, servos @ ..]) => {
            Instruction::ReadMany { register: (*register).into(), count: *count, servos }
        }
        (WRITE_MANY, [register, each, data @ ..])
            if !data.is_empty() && data.len().is_multiple_of(usize::from(*each) + 1) =>
        {
            Instruction::WriteMany { register: (*register).into(), each: *each, data }
        }
        (found, _) => return Err(DecodeError::Field { field: "the instruction", found: found.into() }),
    };
    Ok((servo, instruction))
}

/// The checksum of what must be one whole packet of protocol 1.
fn whole(packet: &[u8]) -> Result<u8, DecodeError> {
    match packet {
        [0xff, 0xff, servo, length, ..] if *servo != 0xff => {
            let (found, expected) = (packet.len(), 4 + usize::from(*length));
            if found != expected || expected < 6 {
                return Err(DecodeError::Length { found, expected: expected.max(6) });
            }
            Ok(packet[found - 1])
        }
        _ => Err(DecodeError::Length { found: packet.len(), expected: 6 }),
    }
}
