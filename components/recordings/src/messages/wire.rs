//! The protobuf wire format: keys, varints, and length-delimited fields.

/// Wire type of a varint.
pub const VARINT: u32 = 0;
/// Wire type of eight bytes.
pub const FIXED_64: u32 = 1;
/// Wire type of length-delimited data.
pub const BYTES: u32 = 2;
/// Wire type of four bytes.
pub const FIXED_32: u32 = 5;

/// Appends a number as a varint: groups of seven bits, lowest first.
pub fn varint(mut number: u64, out: &mut Vec<u8>) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

/// Appends a field's key: its number and wire type.
pub fn key(field: u32, wire: u32, out: &mut Vec<u8>) {
    varint(u64::from(field) << 3 | u64::from(wire), out);
}

/// Appends a field of bytes: a string, a message or packed numbers.
pub fn bytes(field: u32, content: &[u8], out: &mut Vec<u8>) {
    key(field, BYTES, out);
    varint(content.len() as u64, out);
    out.extend_from_slice(content);
}

/// Returns the zigzag encoding of a signed number, in which numbers of small magnitude are short.
pub fn zigzag(number: i64) -> u64 {
    (number << 1 ^ number >> 63) as u64
}

/// Decodes a zigzag-encoded number.
pub fn unzigzag(form: u64) -> i64 {
    (form >> 1) as i64 ^ -((form & 1) as i64)
}

/// A decoded field of a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Read<'a> {
    /// A varint.
    Varint(u64),
    /// Four or eight bytes.
    Fixed(&'a [u8]),
    /// Length-delimited bytes.
    Bytes(&'a [u8]),
}

/// Reads a varint from the start of a message; `None` if it is truncated or longer than ten bytes.
pub fn take_varint(message: &mut &[u8]) -> Option<u64> {
    let mut number = 0;
    for shift in (0..70).step_by(7) {
        let (first, rest) = message.split_first()?;
        *message = rest;
        number |= u64::from(first & 0x7f).checked_shl(shift)?;
        if first & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}

/// Reads a field from the start of a message and returns its number and content; `None` if it is damaged.
pub fn take<'a>(message: &mut &'a [u8]) -> Option<(u32, Read<'a>)> {
    let key = take_varint(message)?;
    let field = u32::try_from(key >> 3).ok()?;
    let mut part = |length: usize| {
        let (part, rest) = message.split_at_checked(length)?;
        *message = rest;
        Some(part)
    };
    let content = match (key & 7) as u32 {
        VARINT => Read::Varint(take_varint(message)?),
        FIXED_64 => Read::Fixed(part(8)?),
        FIXED_32 => Read::Fixed(part(4)?),
        BYTES => {
            let length = usize::try_from(take_varint(message)?).ok()?;
            let (part, rest) = message.split_at_checked(length)?;
            *message = rest;
            Read::Bytes(part)
        }
        _ => return None,
    };
    Some((field, content))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_survive_encoding() {
        for number in [0, 1, 127, 128, 300, u64::from(u32::MAX), u64::MAX] {
            let mut out = Vec::new();
            varint(number, &mut out);
            assert_eq!(take_varint(&mut &out[..]), Some(number));
            assert_eq!(take_varint(&mut &out[..out.len() - 1]), None, "cut short");
        }
        // examples from the protobuf documentation
        for (number, form) in
            [(0, 0), (-1, 1), (1, 2), (-2, 3), (i64::MAX, u64::MAX - 1), (i64::MIN, u64::MAX)]
        {
            assert_eq!((zigzag(number), unzigzag(form)), (form, number));
        }
        let mut out = Vec::new();
        varint(150, &mut out);
        assert_eq!(out, [0x96, 0x01]);
    }
}
