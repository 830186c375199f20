//! Messages in the OMG common data representation (CDR, version 1), as used by ROS 2 and DDS.

use super::definition::{Scalar, Type};
use super::value::{Number, Value};

/// Decodes a message with its four-byte encapsulation header.
///
/// # Errors
/// The reason and the position in the message.
pub(crate) fn decoded(message: &[u8], kind: &Type) -> Result<Value, String> {
    let (header, body) = message
        .split_first_chunk::<4>()
        .ok_or_else(|| format!("{} bytes, expected a header of 4", message.len()))?;
    let is_little = match header[..2] {
        [0, 0] => false,
        [0, 1] => true,
        [first, second] => {
            return Err(format!(
                "representation {first:02x} {second:02x}, expected plain CDR (00 00 or 00 01)"
            ));
        }
        _ => unreachable!("two bytes"),
    };
    let mut reader = Reader { body, position: 0, is_little };
    let value = reader.value(kind)?;
    // The end is padded to a multiple of four bytes.
    let rest = body.len() - reader.position;
    if rest > 8 {
        return Err(format!("{rest} bytes follow the last field: the schema does not describe this message"));
    }
    Ok(value)
}

struct Reader<'m> {
    body: &'m [u8],
    position: usize,
    is_little: bool,
}

impl<'m> Reader<'m> {
    fn ended(&self) -> String {
        format!("it ends after {} bytes, within a field", self.body.len() + 4)
    }

    fn bytes(&mut self, length: usize) -> Result<&'m [u8], String> {
        let end = self.position.checked_add(length);
        let found = end.and_then(|end| self.body.get(self.position..end)).ok_or_else(|| self.ended())?;
        self.position += length;
        Ok(found)
    }

    /// Numbers are aligned to their size, counted from the end of the header.
    fn number<const N: usize>(&mut self) -> Result<[u8; N], String> {
        self.position = self.position.next_multiple_of(N);
        let mut bytes: [u8; N] = self.bytes(N)?.try_into().map_err(|_| self.ended())?;
        if !self.is_little {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn length(&mut self) -> Result<usize, String> {
        Ok(u32::from_le_bytes(self.number()?) as usize)
    }

    fn value(&mut self, kind: &Type) -> Result<Value, String> {
        Ok(match kind {
            Type::Scalar(scalar) => Value::Number(self.scalar(*scalar)?),
            Type::Text => {
                let length = self.length()?;
                let text = self.bytes(length)?;
                let text = text.strip_suffix(&[0]).unwrap_or(text);
                Value::Text(String::from_utf8_lossy(text).into_owned())
            }
            Type::Struct(fields) => {
                let values: Result<Vec<_>, String> =
                    fields.iter().map(|(name, kind)| Ok((name.clone(), self.value(kind)?))).collect();
                Value::Record(values?)
            }
            Type::Array(entry, length) => self.list(entry, *length)?,
            Type::Sequence(entry) => {
                let length = self.length()?;
                self.list(entry, length)?
            }
        })
    }

    fn list(&mut self, entry: &Type, length: usize) -> Result<Value, String> {
        if *entry == Type::Scalar(Scalar::Byte) {
            return Ok(Value::Bytes(self.bytes(length)?.to_vec()));
        }
        // Every entry has at least one byte.
        let rest = self.body.len() - self.position.min(self.body.len());
        if length > rest {
            return Err(format!("an array of {length} entries, with {rest} bytes left"));
        }
        Ok(Value::List((0..length).map(|_| self.value(entry)).collect::<Result<_, _>>()?))
    }

    fn scalar(&mut self, scalar: Scalar) -> Result<Number, String> {
        Ok(match scalar {
            Scalar::Bool => Number::Natural(u64::from(self.number::<1>()?[0] != 0)),
            Scalar::Byte => Number::Natural(self.number::<1>()?[0].into()),
            Scalar::Int8 => Number::Integer(i8::from_le_bytes(self.number()?).into()),
            Scalar::Int16 => Number::Integer(i16::from_le_bytes(self.number()?).into()),
            Scalar::Uint16 => Number::Natural(u16::from_le_bytes(self.number()?).into()),
            Scalar::Int32 => Number::Integer(i32::from_le_bytes(self.number()?).into()),
            Scalar::Uint32 => Number::Natural(u32::from_le_bytes(self.number()?).into()),
            Scalar::Int64 => Number::Integer(i64::from_le_bytes(self.number()?)),
            Scalar::Uint64 => Number::Natural(u64::from_le_bytes(self.number()?)),
            Scalar::Float32 => Number::Single(f32::from_le_bytes(self.number()?)),
            Scalar::Float64 => Number::Double(f64::from_le_bytes(self.number()?)),
        })
    }
}
