//! Samples made readable by their layout alone: the program need not know their types.

mod number;

use motorium::state::TypeLayout;
use serde::ser::{Serialize, SerializeMap as _, Serializer};

use number::{Number, Scalar};

/// Types of which only the first `count` entries of every array mean anything.
const COUNTED: [&str; 2] = ["motorium.JointState", "motorium.JointCommand"];
/// Padding that these types name.
const PADDING: &str = "reserved";

/// A layout or a sample that cannot be read.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum DecodeError {
    /// A field has a type that this program does not know.
    #[error(
        "field `{field}` of `{type_name}` has the type `{kind}`, which this version of motorium cannot read"
    )]
    Kind { type_name: String, field: String, kind: String },
    /// A field lies outside of its sample.
    #[error("field `{field}` of `{type_name}` ends at byte {end}, but a sample has only {size}")]
    Outside { type_name: String, field: String, end: usize, size: usize },
    /// A sample is cut short.
    #[error("a sample of {found} bytes, expected {expected}")]
    Short { found: usize, expected: usize },
    /// A sample counts more entries than it holds.
    #[error("`count` is {found}, but the sample holds at most {capacity} entries")]
    Count { found: u64, capacity: usize },
}

/// A field's value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    One(Number),
    Many(Vec<Number>),
}

impl Value {
    pub(super) fn numbers(&self) -> &[Number] {
        match self {
            Self::One(number) => core::slice::from_ref(number),
            Self::Many(numbers) => numbers,
        }
    }
}

/// A sample as names and values, in the order of its layout. As JSON it is an object.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Decoded<'a>(pub(super) Vec<(&'a str, Value)>);

impl Serialize for Decoded<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, value) in &self.0 {
            match value {
                Value::One(number) => map.serialize_entry(name, number)?,
                Value::Many(numbers) => map.serialize_entry(name, numbers)?,
            }
        }
        map.end()
    }
}

/// Reads the samples of one layout.
#[derive(Debug)]
pub(super) struct Decoder {
    size: usize,
    fields: Vec<Field>,
    /// Index of the field that counts the entries of all arrays.
    count: Option<usize>,
}

#[derive(Debug)]
struct Field {
    name: String,
    offset: usize,
    scalar: Scalar,
    /// Entries of an array; `None` for a single number.
    length: Option<usize>,
}

impl Decoder {
    /// Prepares to read a layout.
    ///
    /// # Errors
    /// It has a field of an unknown type, or one outside of the sample.
    pub(super) fn new(layout: &TypeLayout) -> Result<Self, DecodeError> {
        let counted = COUNTED.contains(&layout.type_name.as_str());
        let mut fields = Vec::new();
        for field in &layout.fields {
            let (scalar, length) = parse(&field.kind).ok_or_else(|| DecodeError::Kind {
                type_name: layout.type_name.clone(),
                field: field.name.clone(),
                kind: field.kind.clone(),
            })?;
            let end = length
                .unwrap_or(1)
                .checked_mul(scalar.size())
                .and_then(|bytes| bytes.checked_add(field.offset))
                .unwrap_or(usize::MAX);
            if end > layout.size {
                let (type_name, field) = (layout.type_name.clone(), field.name.clone());
                return Err(DecodeError::Outside { type_name, field, end, size: layout.size });
            }
            if !(counted && field.name == PADDING) {
                fields.push(Field { name: field.name.clone(), offset: field.offset, scalar, length });
            }
        }
        let count = fields.iter().position(|field| counted && field.name == "count");
        Ok(Self { size: layout.size, fields, count })
    }

    /// Reads a sample.
    ///
    /// # Errors
    /// It is cut short, or counts more entries than it holds; no number is read then.
    pub(super) fn decode(&self, bytes: &[u8]) -> Result<Decoded<'_>, DecodeError> {
        if bytes.len() < self.size {
            return Err(DecodeError::Short { found: bytes.len(), expected: self.size });
        }
        let used = self.used(bytes)?;
        let value = |field: &Field| {
            let at = |i: usize| field.scalar.read(&bytes[field.offset + i * field.scalar.size()..]);
            match field.length {
                None => Value::One(at(0)),
                Some(length) => Value::Many((0..length.min(used)).map(at).collect()),
            }
        };
        Ok(Decoded(self.fields.iter().map(|field| (field.name.as_str(), value(field))).collect()))
    }

    /// Number of valid entries of each array.
    fn used(&self, bytes: &[u8]) -> Result<usize, DecodeError> {
        let Some(field) = self.count.map(|index| &self.fields[index]) else { return Ok(usize::MAX) };
        let Number::Natural(found) = field.scalar.read(&bytes[field.offset..]) else { return Ok(usize::MAX) };
        let capacity = self.fields.iter().filter_map(|field| field.length).min().unwrap_or(0);
        match usize::try_from(found) {
            Ok(used) if used <= capacity => Ok(used),
            _ => Err(DecodeError::Count { found, capacity }),
        }
    }
}

/// Reads a kind such as `f64` or `[f64; 64]`.
fn parse(kind: &str) -> Option<(Scalar, Option<usize>)> {
    match kind.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
        None => Some((Scalar::parse(kind)?, None)),
        Some(array) => {
            let (scalar, length) = array.split_once(';')?;
            Some((Scalar::parse(scalar.trim())?, Some(length.trim().parse().ok()?)))
        }
    }
}

#[cfg(test)]
mod tests;
