//! Schemas derived from the layouts of state buffers.

mod error;
mod field;
mod stamp;
#[cfg(test)]
mod tests;

use motorium::state::{Stamp, StateBuffer as _, TypeLayout};

use super::Schema;
pub use error::DerivedError;
use field::Field;
use motorium_recordings::messages::wire::{self, Read};
use stamp::{STAMP, stamp_bytes, stamp_field, stamp_of};

/// Version of the rule for deriving schemas; the last part of their package.
const PACKAGE_VERSION: &str = "v1";

/// Encoder and decoder for the samples of one type. The schema is derived from the layout of the type.
///
/// The schema of `motorium.JointState` is `motorium.v1.JointState`, where `v1` is the version of the
/// derivation rule. Field 1 is the stamp. The fields of the layout follow in order from 2, so a field keeps
/// its number while its position in the type is unchanged. Arrays of numbers are packed, arrays of bytes are
/// `bytes`, and UTF-8 bytes named `text` are a `string`. Only the used entries of a counted array are
/// written. In field names `.` becomes `__`, and `[3]` becomes `_3`.
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

impl Derived {
    /// Derives the schema from a layout.
    ///
    /// # Errors
    /// Returns an error if a field is neither a number nor an array of numbers, or extends beyond the type.
    pub fn new(layout: &TypeLayout) -> Result<Self, DerivedError> {
        let (fields, stamp) = (field::fields(layout)?, field::fields(&Stamp::layout())?);
        let (package, name) = layout.type_name.rsplit_once('.').unwrap_or(("user", &layout.type_name));
        let package = format!("{package}.{PACKAGE_VERSION}");
        let mut file = Vec::new();
        wire::bytes(1, format!("{package}.{name}.proto").as_bytes(), &mut file);
        wire::bytes(2, package.as_bytes(), &mut file);
        // The stamp is a nested message, so files with several types define each name once.
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

    /// Returns the schema.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Returns the size of a sample, bytes.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Encodes a sample of [`size`](Self::size) bytes as a message and appends it to `out`. Missing bytes are
    /// treated as zeros.
    pub fn encode(&self, stamp: &Stamp, bytes: &[u8], out: &mut Vec<u8>) {
        let raw = stamp_bytes(stamp);
        let start = out.len();
        // The length of the stamp fits in one byte: its fields have at most 70 bytes.
        out.extend([(STAMP << 3 | wire::BYTES) as u8, 0]);
        self.stamp.iter().for_each(|field| field.encode(&raw, out));
        out[start + 1] = (out.len() - start - 2) as u8;
        self.fields.iter().for_each(|field| field.encode(bytes, out));
    }

    /// Decodes a message into the stamp and the bytes of its sample, in the layout of the type. Array entries
    /// beyond the count are zero.
    ///
    /// # Errors
    /// Returns an error if the message is damaged, or is not a message of this type.
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
