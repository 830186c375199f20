//! Schemas derived from the layouts of state buffers.

use motorium::state::{Stamp, StateBuffer as _, TypeLayout};

use super::Schema;
use super::wire::{self, Read};

/// Version of the rule by which schemas are derived; the last part of their package.
const PACKAGE_VERSION: &str = "v1";
/// Number of the field that holds the stamp.
const STAMP: u32 = 1;
/// Number of the field that holds the first field of the layout; the others follow in its order.
const FIRST: u32 = 2;
/// Padding that a type declares; it is left out.
const PADDING: &str = "reserved";

/// The messages of one type of samples, in a schema derived from its layout.
///
/// The schema of `motorium.JointState` is `motorium.v1.JointState`: `v1` is the rule of derivation. Field 1 is the stamp, and
/// the fields of the layout follow in its order from 2, so that a field keeps its number for as long as its type has it in its
/// place. Numbers of an array are packed, those of bytes are `bytes`, bytes named `text` that are UTF-8 a `string`; of a
/// counted array only the entries in use are written. In the names of fields `.`
/// becomes `__`, and `[3]` becomes `_3`.
///
/// ```
/// use motorium::state::{Stamp, StateBuffer, Wrench};
/// use motorium_bridges::foxglove::Derived;
///
/// let derived = Derived::new(&Wrench::layout())?;
/// let mut message = Vec::new();
/// derived.encode(&Stamp::default(), &[0; size_of::<Wrench>()], &mut message);
/// assert!(derived.decode(&message[..9]).is_err(), "cut short");
/// # Ok::<(), motorium_bridges::foxglove::DerivedError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Derived {
    schema: Schema,
    size: usize,
    fields: Vec<Field>,
    stamp: Vec<Field>,
}

/// One field of a layout and of the message.
#[derive(Debug, Clone, PartialEq)]
struct Field {
    name: String,
    number: u32,
    offset: usize,
    scalar: Scalar,
    /// Entries of an array; `None` for a single number.
    length: Option<usize>,
    /// Place of the count of its entries in use.
    count: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Scalar {
    F64,
    F32,
    Unsigned(usize),
    Signed(usize),
    /// Bytes that hold text.
    Text,
}

/// A layout or a message that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DerivedError {
    /// A field has a type that no state buffer has, or lies outside of it.
    #[error(
        "field `{field}` of `{type_name}` is {kind} at byte {offset}, which cannot be written as protobuf"
    )]
    Field {
        /// The type.
        type_name: String,
        /// The field.
        field: String,
        /// Its type as the layout gives it.
        kind: String,
        /// Its place, bytes from the start.
        offset: usize,
    },
    /// A message that is damaged or cut short.
    #[error("a message of `{schema}` is damaged{}", .field.as_ref().map_or_else(String::new, |field| format!(" in field `{field}`")))]
    Message {
        /// Name of the schema.
        schema: String,
        /// The field at fault, where it is known.
        field: Option<String>,
    },
}

impl Scalar {
    fn of(kind: &str) -> Option<Self> {
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

    /// Its number in `google.protobuf.FieldDescriptorProto.Type`.
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

    /// The varint of an integer at the start of `bytes`.
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

    /// Writes the integer of a varint to `place`; false if it does not fit.
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

fn fields(layout: &TypeLayout) -> Result<Vec<Field>, DerivedError> {
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
        let mut scalar = Scalar::of(kind).ok_or_else(refused)?;
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

impl Derived {
    /// Derives the schema of a layout.
    ///
    /// # Errors
    /// A field is neither a number nor an array of numbers, or lies outside of the type.
    pub fn new(layout: &TypeLayout) -> Result<Self, DerivedError> {
        let (fields, stamp) = (self::fields(layout)?, self::fields(&Stamp::layout())?);
        let (package, name) = layout.type_name.rsplit_once('.').unwrap_or(("user", &layout.type_name));
        let package = format!("{package}.{PACKAGE_VERSION}");
        let mut file = Vec::new();
        wire::bytes(1, format!("{package}.{name}.proto").as_bytes(), &mut file);
        wire::bytes(2, package.as_bytes(), &mut file);
        // The stamp is a message within the message, so that files of several types define each name once.
        let mut message = Vec::new();
        wire::bytes(1, name.as_bytes(), &mut message);
        let stamp_type = format!(".{package}.{name}.Stamp");
        wire::bytes(2, &stamp_field(&stamp_type), &mut message);
        fields.iter().for_each(|field| wire::bytes(2, &field.descriptor(), &mut message));
        let mut nested = Vec::new();
        wire::bytes(1, b"Stamp", &mut nested);
        stamp.iter().for_each(|field| wire::bytes(2, &field.descriptor(), &mut nested));
        wire::bytes(3, &nested, &mut message);
        wire::bytes(4, &message, &mut file);
        wire::bytes(12, b"proto3", &mut file);
        let mut data = Vec::new();
        wire::bytes(1, &file, &mut data);
        let schema = Schema { name: format!("{package}.{name}"), encoding: "protobuf", data };
        Ok(Self { schema, size: layout.size, fields, stamp })
    }

    /// The schema.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Bytes of a sample.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Appends the message of a sample of [`size`](Self::size) bytes. Missing bytes count as zeros.
    pub fn encode(&self, stamp: &Stamp, bytes: &[u8], out: &mut Vec<u8>) {
        let raw = stamp_bytes(stamp);
        let start = out.len();
        // The length of the stamp is one byte: its fields take at most 70.
        out.extend([(STAMP << 3 | wire::BYTES) as u8, 0]);
        self.stamp.iter().for_each(|field| field.encode(&raw, out));
        out[start + 1] = (out.len() - start - 2) as u8;
        self.fields.iter().for_each(|field| field.encode(bytes, out));
    }

    /// The sample of a message: its stamp, and its bytes in the layout of the type. Entries beyond a count are zero.
    ///
    /// # Errors
    /// The message is damaged, or of another type.
    pub fn decode(&self, mut message: &[u8]) -> Result<(Stamp, Vec<u8>), DerivedError> {
        let damaged = |field: Option<&str>| DerivedError::Message {
            schema: self.schema.name.clone(),
            field: field.map(str::to_string),
        };
        let (mut raw, mut bytes) = (vec![0; size_of::<Stamp>()], vec![0; self.size]);
        while !message.is_empty() {
            let (number, content) = wire::take(&mut message).ok_or_else(|| damaged(None))?;
            if number == STAMP {
                let Read::Bytes(mut inner) = content else { return Err(damaged(Some("stamp"))) };
                while !inner.is_empty() {
                    let (number, content) = wire::take(&mut inner).ok_or_else(|| damaged(Some("stamp")))?;
                    let field = self.stamp.iter().find(|field| field.number == number);
                    if field.is_some_and(|field| field.decode(content, &mut raw).is_none()) {
                        return Err(damaged(Some("stamp")));
                    }
                }
            } else if let Some(field) = self.fields.iter().find(|field| field.number == number)
                && field.decode(content, &mut bytes).is_none()
            {
                return Err(damaged(Some(&field.name)));
            }
        }
        Ok((stamp_of(&raw), bytes))
    }
}

/// The bytes of a stamp.
fn stamp_bytes(stamp: &Stamp) -> [u8; size_of::<Stamp>()] {
    let Stamp { sequence, source_time, publish_time, state_time, episode, publisher, restart_count } = *stamp;
    let mut raw = [0; size_of::<Stamp>()];
    let longs = [sequence, source_time, publish_time, state_time, episode];
    for (place, number) in raw.chunks_exact_mut(8).zip(longs) {
        place.copy_from_slice(&number.to_le_bytes());
    }
    raw[40..44].copy_from_slice(&publisher.to_le_bytes());
    raw[44..].copy_from_slice(&restart_count.to_le_bytes());
    raw
}

/// The stamp of these bytes.
fn stamp_of(raw: &[u8]) -> Stamp {
    let long = |index: usize| {
        raw.get(8 * index..).and_then(|rest| rest.first_chunk()).map_or(0, |bytes| u64::from_le_bytes(*bytes))
    };
    let last = long(5);
    Stamp {
        sequence: long(0),
        source_time: long(1),
        publish_time: long(2),
        state_time: long(3),
        episode: long(4),
        publisher: last as u32,
        restart_count: (last >> 32) as u32,
    }
}

/// The descriptor of the field that holds the stamp.
fn stamp_field(type_name: &str) -> Vec<u8> {
    let mut out = Vec::new();
    wire::bytes(1, b"stamp", &mut out);
    for (field, value) in [(3, u64::from(STAMP)), (4, 1), (5, 11)] {
        wire::key(field, wire::VARINT, &mut out);
        wire::varint(value, &mut out);
    }
    wire::bytes(6, type_name.as_bytes(), &mut out);
    out
}

impl Field {
    /// Its `google.protobuf.FieldDescriptorProto`.
    fn descriptor(&self) -> Vec<u8> {
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

    /// Its bytes in use in a sample.
    fn content<'a>(&self, bytes: &'a [u8]) -> &'a [u8] {
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

    fn encode(&self, bytes: &[u8], out: &mut Vec<u8>) {
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

    /// Writes what was read to its place in a sample; `None` if it does not fit.
    fn decode(&self, content: Read<'_>, bytes: &mut [u8]) -> Option<()> {
        let (size, capacity) = (self.scalar.size(), self.length.unwrap_or(1) * self.scalar.size());
        let place = bytes.get_mut(self.offset..self.offset + capacity)?;
        match (self.scalar, content) {
            (Scalar::F64 | Scalar::F32, Read::Fixed(number))
                if self.length.is_none() && number.len() == size =>
            {
                place.copy_from_slice(number);
            }
            // A text that was not UTF-8 may have become longer.
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

#[cfg(test)]
mod tests;
