//! Structures in Thrift's compact protocol, which Parquet uses for all metadata.

const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// Structure under construction. Fields are appended in ascending order of their numbers.
#[derive(Debug, Clone, Default)]
pub(super) struct Struct {
    bytes: Vec<u8>,
    last: u8,
}

/// Appends a number in groups of seven bits, lowest first.
pub(super) fn varint(mut value: u64, out: &mut Vec<u8>) {
    while value > 0x7f {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Zigzag encoding: small integers of either sign are short.
fn zigzag(value: i64, out: &mut Vec<u8>) {
    varint((value << 1 ^ value >> 63) as u64, out);
}

fn text(value: &str, out: &mut Vec<u8>) {
    varint(value.len() as u64, out);
    out.extend(value.as_bytes());
}

impl Struct {
    pub(super) fn new() -> Self {
        Self::default()
    }

    /// Appends the header of a field: its type, and the difference between its number and the last field's,
    /// at most 15.
    fn field(&mut self, number: u8, kind: u8) {
        self.bytes.push((number - self.last) << 4 | kind);
        self.last = number;
    }

    fn list(&mut self, number: u8, kind: u8, length: usize) {
        self.field(number, LIST);
        if length < 15 {
            self.bytes.push((length as u8) << 4 | kind);
        } else {
            self.bytes.push(0xf0 | kind);
            varint(length as u64, &mut self.bytes);
        }
    }

    pub(super) fn i32(mut self, number: u8, value: i64) -> Self {
        self.field(number, I32);
        zigzag(value, &mut self.bytes);
        self
    }

    pub(super) fn i64(mut self, number: u8, value: i64) -> Self {
        self.field(number, I64);
        zigzag(value, &mut self.bytes);
        self
    }

    pub(super) fn text(mut self, number: u8, value: &str) -> Self {
        self.field(number, BINARY);
        text(value, &mut self.bytes);
        self
    }

    pub(super) fn structure(mut self, number: u8, value: &Self) -> Self {
        self.field(number, STRUCT);
        self.bytes.extend(value.clone().finish());
        self
    }

    pub(super) fn i32s(mut self, number: u8, values: &[i64]) -> Self {
        self.list(number, I32, values.len());
        values.iter().for_each(|value| zigzag(*value, &mut self.bytes));
        self
    }

    pub(super) fn texts(mut self, number: u8, values: &[&str]) -> Self {
        self.list(number, BINARY, values.len());
        values.iter().for_each(|value| text(value, &mut self.bytes));
        self
    }

    pub(super) fn structs(mut self, number: u8, values: &[Self]) -> Self {
        self.list(number, STRUCT, values.len());
        values.iter().for_each(|value| self.bytes.extend(value.clone().finish()));
        self
    }

    /// Returns the bytes, with the stop marker.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}
