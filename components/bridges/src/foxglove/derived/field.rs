//! Fields of a layout, and their encoding in a message.

use motorium::state::TypeLayout;

use super::error::DerivedError;
use motorium_recordings::messages::wire::{self, Read};

/// Number of the layout's first field; further fields are numbered consecutively.
const FIRST: u32 = 2;
/// Padding declared by a type; it is skipped.
const PADDING: &str = "reserved";

/// One field of a layout and of the message.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) number: u32,
    pub(super) offset: usize,
    pub(super) scalar: Scalar,
    /// Entries of an array; `None` for a single number.
    pub(super) length: Option<usize>,
    /// Byte offset of the number of used entries.
    pub(super) count: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scalar {
    F64,
    F32,
    Unsigned(usize),
    Signed(usize),
    /// Bytes that hold text.
    Text,
}

impl Scalar {
    fn from_kind(kind: &str) -> Option<Self> {
        Some(match kind {
            "f64" => Self::F64,
            "f32" => Self::F32,
            "u8" => Self::Unsigned(1),
            "u16" => Self::Unsigned(2),
            "u32" => Self::Unsigned(4),
            "u64" => Self::Unsigned(8),
            "i8" => Self::Signed(1),
            "i16" => Self::Signed(2),
            "i32" => Self::Signed(4),
            "i64" => Self::Signed(8),
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::F64 => 8,
            Self::F32 => 4,
            Self::Unsigned(bytes) | Self::Signed(bytes) => bytes,
            Self::Text => 1,
        }
    }

    /// Number of the type in `google.protobuf.FieldDescriptorProto.Type`.
    fn descriptor_type(self, is_array: bool) -> u64 {
        match self {
            Self::F64 => 1,
            Self::F32 => 2,
            Self::Unsigned(8) => 4,
            Self::Text => 9,
            Self::Unsigned(1) if is_array => 12,
            Self::Unsigned(_) => 13,
            Self::Signed(8) => 18,
            Self::Signed(_) => 17,
        }
    }

    /// Returns the varint of an integer at the start of `bytes`.
    fn integer(self, bytes: &[u8]) -> u64 {
        let mut raw = [0; 8];
        let size = self.size().min(bytes.len());
        raw[..size].copy_from_slice(&bytes[..size]);
        let number = u64::from_le_bytes(raw);
        match self {
            Self::Signed(size) => {
                let unused = 64 - 8 * size as u32;
                wire::zigzag((number << unused) as i64 >> unused)
            }
            _ => number,
        }
    }

    /// Writes an integer from a varint to `place`; `false` if it does not fit.
    fn put(self, form: u64, place: &mut [u8]) -> bool {
        let size = self.size();
        let raw = match self {
            Self::Signed(_) => wire::unzigzag(form).to_le_bytes(),
            _ => form.to_le_bytes(),
        };
        place.copy_from_slice(&raw[..size]);
        self.integer(place) == form
    }
}

/// Returns the fields of a layout, numbered in order.
pub(super) fn fields(layout: &TypeLayout) -> Result<Vec<Field>, DerivedError> {
    let mut fields = Vec::new();
    for (number, field) in (FIRST..).zip(&layout.fields).filter(|(_, field)| field.name != PADDING) {
        let refused = || DerivedError::Field {
            type_name: layout.type_name.clone(),
            field: field.name.clone(),
            kind: field.kind.clone(),
            offset: field.offset,
        };
        let array = field.kind.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        let (kind, length) = match array.map(|array| array.split_once(';').ok_or_else(refused)).transpose()? {
            Some((kind, length)) => (kind.trim(), Some(length.trim().parse().map_err(|_| refused())?)),
            None => (field.kind.as_str(), None),
        };
        let mut scalar = Scalar::from_kind(kind).ok_or_else(refused)?;
        if length.is_some() && scalar == Scalar::Unsigned(1) && field.name.rsplit('.').next() == Some("text")
        {
            scalar = Scalar::Text;
        }
        let end = length.unwrap_or(1usize).checked_mul(scalar.size());
        let end = end.and_then(|bytes| bytes.checked_add(field.offset));
        if end.is_none_or(|end| end > layout.size) {
            return Err(refused());
        }
        let counter = |name: &String| {
            let found = layout.fields.iter().find(|other| other.name == *name && other.kind == "u32");
            let found =
                found.filter(|other| other.offset.checked_add(4).is_some_and(|end| end <= layout.size));
            found.map(|other| other.offset).ok_or_else(refused)
        };
        let count = field.count.as_ref().map(counter).transpose()?;
        let name = field.name.replace('.', "__").replace('[', "_").replace(']', "");
        fields.push(Field { name, number, offset: field.offset, scalar, length, count });
    }
    Ok(fields)
}

impl Field {
    /// Its `google.protobuf.FieldDescriptorProto`.
    pub(super) fn descriptor(&self) -> Vec<u8> {
        let is_array = self.length.is_some();
        let kind = self.scalar.descriptor_type(is_array);
        // Bytes and texts are single values; other arrays are repeated.
        let label = if is_array && !matches!(kind, 9 | 12) { 3 } else { 1 };
        let mut out = Vec::new();
        wire::bytes(1, self.name.as_bytes(), &mut out);
        for (field, value) in [(3, u64::from(self.number)), (4, label), (5, kind)] {
            wire::key(field, wire::VARINT, &mut out);
            wire::varint(value, &mut out);
        }
        out
    }

    /// Returns the used bytes of the field in a sample.
    pub(super) fn content<'a>(&self, bytes: &'a [u8]) -> &'a [u8] {
        let entries = match (self.length, self.count) {
            (None, _) => 1,
            (Some(length), None) => length,
            (Some(length), Some(place)) => {
                let count = bytes.get(place..).and_then(|rest| rest.first_chunk());
                count.map_or(0, |count| u32::from_le_bytes(*count) as usize).min(length)
            }
        };
        bytes.get(self.offset..self.offset + entries * self.scalar.size()).unwrap_or_default()
    }

    pub(super) fn encode(&self, bytes: &[u8], out: &mut Vec<u8>) {
        let content = self.content(bytes);
        let is_array = self.length.is_some();
        match self.scalar {
            Scalar::Text => match core::str::from_utf8(content) {
                Ok(_) => wire::bytes(self.number, content, out),
                Err(_) => wire::bytes(self.number, String::from_utf8_lossy(content).as_bytes(), out),
            },
            Scalar::F64 | Scalar::F32 | Scalar::Unsigned(1) if is_array => {
                wire::bytes(self.number, content, out)
            }
            Scalar::F64 | Scalar::F32 => {
                let wire = if self.scalar == Scalar::F64 { wire::FIXED_64 } else { wire::FIXED_32 };
                wire::key(self.number, wire, out);
                out.extend_from_slice(content);
            }
            scalar if is_array => {
                let mut packed = Vec::with_capacity(content.len());
                for entry in content.chunks_exact(scalar.size()) {
                    wire::varint(scalar.integer(entry), &mut packed);
                }
                wire::bytes(self.number, &packed, out);
            }
            scalar => {
                wire::key(self.number, wire::VARINT, out);
                wire::varint(scalar.integer(content), out);
            }
        }
    }

    /// Writes a decoded value to its position in a sample; `None` if it does not fit.
    pub(super) fn decode(&self, content: Read<'_>, bytes: &mut [u8]) -> Option<()> {
        let (size, capacity) = (self.scalar.size(), self.length.unwrap_or(1) * self.scalar.size());
        let place = bytes.get_mut(self.offset..self.offset + capacity)?;
        match (self.scalar, content) {
            (Scalar::F64 | Scalar::F32, Read::Fixed(number))
                if self.length.is_none() && number.len() == size =>
            {
                place.copy_from_slice(number);
            }
            // Replacing invalid UTF-8 may have made the text longer.
            (Scalar::Text, Read::Bytes(content)) if self.length.is_some() => {
                let length = content.len().min(capacity);
                place[..length].copy_from_slice(&content[..length]);
            }
            (Scalar::F64 | Scalar::F32 | Scalar::Unsigned(1), Read::Bytes(content))
                if self.length.is_some()
                    && content.len() <= capacity
                    && content.len().is_multiple_of(size) =>
            {
                place[..content.len()].copy_from_slice(content);
            }
            (scalar @ (Scalar::Unsigned(_) | Scalar::Signed(_)), Read::Varint(form))
                if self.length.is_none() =>
            {
                return scalar.put(form, place).then_some(());
            }
            (scalar @ (Scalar::Unsigned(_) | Scalar::Signed(_)), Read::Bytes(mut packed)) => {
                for entry in place.chunks_exact_mut(size) {
                    if packed.is_empty() {
                        break;
                    }
                    let form = wire::take_varint(&mut packed)?;
                    if !scalar.put(form, entry) {
                        return None;
                    }
                }
                return packed.is_empty().then_some(());
            }
            _ => return None,
        }
        Some(())
    }
}
