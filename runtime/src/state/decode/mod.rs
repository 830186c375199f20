//! Decoding of values by their layout, without knowledge of their types.

mod number;

use serde::ser::{Serialize, SerializeMap as _, Serializer};

use super::{FieldLayout, TypeLayout};
pub use number::Number;
pub(super) use number::Scalar;

/// Name of padding that a type declares.
pub(super) const PADDING: &str = "reserved";

/// Name of a byte array that contains text.
const TEXT: &str = "text";

/// Error of a [`Decoder`]: a layout or a sample cannot be decoded.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// The layout has a field whose type this program does not know.
    #[error(
        "field `{field}` of `{type_name}` has the type `{kind}`, which this version of motorium cannot read"
    )]
    Kind {
        /// Name of the layout's type.
        type_name: String,
        /// Name of the field.
        field: String,
        /// Type of the field in the layout.
        kind: String,
    },
    /// A field of the layout is outside the sample.
    #[error("field `{field}` of `{type_name}` ends at byte {end}, expected at most {size} (the sample size)")]
    Outside {
        /// Name of the layout's type.
        type_name: String,
        /// Name of the field.
        field: String,
        /// End of the field, bytes from the start of the sample.
        end: usize,
        /// Size of a sample, bytes.
        size: usize,
    },
    /// A sample is shorter or longer than its type.
    #[error("the sample has {found} bytes, expected {expected}")]
    Short {
        /// Size of the sample, bytes.
        found: usize,
        /// Size of the type, bytes.
        expected: usize,
    },
    /// The count of an array exceeds its capacity.
    #[error("`{count}` is {found}, expected at most {capacity}, the capacity of `{field}`")]
    Count {
        /// Name of the field that counts the entries.
        count: String,
        /// Value of the field `count`.
        found: u64,
        /// Name of the counted array.
        field: String,
        /// Number of entries that fit in the array.
        capacity: usize,
    },
}

/// The decoded value of a field.
#[derive(Debug, Clone, PartialEq)]
pub enum FieldValue {
    /// A single number.
    One(Number),
    /// The array entries that are in use.
    Many(Vec<Number>),
    /// The bytes in use of an array named `text`; invalid UTF-8 is replaced.
    Text(String),
}

impl FieldValue {
    /// Returns the numbers of the value: one, or the array entries in use. Empty for a text.
    pub fn numbers(&self) -> &[Number] {
        match self {
            Self::One(number) => core::slice::from_ref(number),
            Self::Many(numbers) => numbers,
            Self::Text(_) => &[],
        }
    }
}

/// A decoded sample: names and values of its fields, in layout order. Serialises as a JSON object.
#[derive(Debug, Clone, PartialEq)]
pub struct Decoded<'a>(pub Vec<(&'a str, FieldValue)>);

impl Serialize for Decoded<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, value) in &self.0 {
            match value {
                FieldValue::One(number) => map.serialize_entry(name, number)?,
                FieldValue::Many(numbers) => map.serialize_entry(name, numbers)?,
                FieldValue::Text(text) => map.serialize_entry(name, text)?,
            }
        }
        map.end()
    }
}

/// Converts the bytes of samples to named values, according to the layout of their type.
///
/// ```
/// use motorium::state::{Decoder, StateBuffer, Wrench};
///
/// let decoder = Decoder::new(&Wrench::layout())?;
/// let value = decoder.decode(&[0; size_of::<Wrench>()])?;
/// assert_eq!(serde_json::to_string(&value).unwrap(), r#"{"force":[0.0,0.0,0.0],"torque":[0.0,0.0,0.0]}"#);
/// # Ok::<(), motorium::state::DecodeError>(())
/// ```
#[derive(Debug)]
pub struct Decoder {
    size: usize,
    fields: Vec<Field>,
}

#[derive(Debug)]
struct Field {
    name: String,
    offset: usize,
    scalar: Scalar,
    /// Length of an array; `None` for a single number.
    length: Option<usize>,
    /// Index of the field that counts the entries of this array in use.
    count: Option<usize>,
}

impl Decoder {
    /// Creates a decoder for samples with this layout.
    ///
    /// # Errors
    /// A field of the layout has an unknown type or is outside the sample.
    pub fn new(layout: &TypeLayout) -> Result<Self, DecodeError> {
        let mut fields = Vec::new();
        let shown: Vec<_> = layout.fields.iter().filter(|field| field.name != PADDING).collect();
        for field in &shown {
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
            let counter = |other: &&FieldLayout| Some(&other.name) == field.count.as_ref();
            let count = shown.iter().position(counter);
            fields.push(Field { name: field.name.clone(), offset: field.offset, scalar, length, count });
        }
        Ok(Self { size: layout.size, fields })
    }

    /// Decodes the bytes of one sample.
    ///
    /// # Errors
    /// The sample has the wrong size, or a count exceeds the capacity of its array.
    pub fn decode(&self, bytes: &[u8]) -> Result<Decoded<'_>, DecodeError> {
        if bytes.len() < self.size {
            return Err(DecodeError::Short { found: bytes.len(), expected: self.size });
        }
        let used: Vec<Option<usize>> =
            self.fields.iter().map(|field| self.used(field, bytes)).collect::<Result<_, _>>()?;
        let value = |field: &Field, used| {
            let entry = |i: usize| field.scalar.read(&bytes[field.offset + i * field.scalar.size()..]);
            match used {
                None => FieldValue::One(entry(0)),
                Some(used) if field.scalar == Scalar::U8 && field.name.rsplit('.').next() == Some(TEXT) => {
                    let bytes = &bytes[field.offset..field.offset + used];
                    FieldValue::Text(String::from_utf8_lossy(bytes).into_owned())
                }
                Some(used) => FieldValue::Many((0..used).map(entry).collect()),
            }
        };
        let fields = self.fields.iter().zip(used);
        Ok(Decoded(fields.map(|(field, used)| (field.name.as_str(), value(field, used))).collect()))
    }

    /// Returns the number of array entries in use; `None` for a single number.
    fn used(&self, field: &Field, bytes: &[u8]) -> Result<Option<usize>, DecodeError> {
        let (Some(capacity), Some(index)) = (field.length, field.count) else { return Ok(field.length) };
        let counter = &self.fields[index];
        let Number::Natural(found) = counter.scalar.read(&bytes[counter.offset..]) else {
            return Ok(Some(capacity));
        };
        match usize::try_from(found) {
            Ok(used) if used <= capacity => Ok(Some(used)),
            _ => {
                let (count, field) = (counter.name.clone(), field.name.clone());
                Err(DecodeError::Count { count, found, field, capacity })
            }
        }
    }
}

/// Parses a kind such as `f64` or `[f64; 64]`.
pub(super) fn parse(kind: &str) -> Option<(Scalar, Option<usize>)> {
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
