//! Messages in the protobuf encoding, decoded with the descriptors in their schema.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::value::{Number, Value};
use super::wire::{Read, take, take_varint, unzigzag};

/// Maximum nesting depth of messages.
const DEEPEST: usize = 64;

/// The types of a schema.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Descriptors {
    messages: BTreeMap<String, Vec<Field>>,
    root: String,
}

#[derive(Clone, Debug, Default, PartialEq)]
struct Field {
    name: Arc<str>,
    number: u32,
    /// Number of the type in `google.protobuf.FieldDescriptorProto.Type`.
    kind: u64,
    /// Full name of a message type.
    message: String,
    is_repeated: bool,
    /// `true` if an absent field is zero or empty.
    is_implicit: bool,
}

/// Type numbers in `google.protobuf.FieldDescriptorProto.Type`.
mod kind {
    pub(super) const DOUBLE: u64 = 1;
    pub(super) const FLOAT: u64 = 2;
    pub(super) const INT64: u64 = 3;
    pub(super) const INT32: u64 = 5;
    pub(super) const FIXED64: u64 = 6;
    pub(super) const FIXED32: u64 = 7;
    pub(super) const BOOL: u64 = 8;
    pub(super) const STRING: u64 = 9;
    pub(super) const MESSAGE: u64 = 11;
    pub(super) const BYTES: u64 = 12;
    pub(super) const ENUM: u64 = 14;
    pub(super) const SFIXED32: u64 = 15;
    pub(super) const SFIXED64: u64 = 16;
    pub(super) const SINT32: u64 = 17;
    pub(super) const SINT64: u64 = 18;
}

const REPEATED: u64 = 3;

/// Calls `each` with the number and content of every field.
fn fields<'m>(
    mut message: &'m [u8],
    mut each: impl FnMut(u32, Read<'m>) -> Result<(), String>,
) -> Result<(), String> {
    while !message.is_empty() {
        let (number, content) = take(&mut message).ok_or("it ends within a field")?;
        each(number, content)?;
    }
    Ok(())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

impl Descriptors {
    /// Reads the types of a `google.protobuf.FileDescriptorSet`.
    pub(crate) fn new(set: &[u8], root: &str) -> Result<Self, String> {
        let mut this = Self { messages: BTreeMap::new(), root: root.to_string() };
        fields(set, |number, content| match (number, content) {
            (1, Read::Bytes(file)) => this.file(file),
            _ => Ok(()),
        })?;
        if this.messages.contains_key(root) {
            return Ok(this);
        }
        let known: Vec<&str> = this.messages.keys().map(String::as_str).collect();
        Err(format!("it does not define `{root}`, only {}", known.join(", ")))
    }

    fn file(&mut self, file: &[u8]) -> Result<(), String> {
        let (mut package, mut is_implicit, mut messages) = (String::new(), false, Vec::new());
        fields(file, |number, content| {
            match (number, content) {
                (2, Read::Bytes(name)) => package = text(name),
                (4, Read::Bytes(message)) => messages.push(message),
                (12, Read::Bytes(syntax)) => is_implicit = syntax == b"proto3",
                _ => {}
            }
            Ok(())
        })?;
        messages.into_iter().try_for_each(|message| self.message(message, &package, is_implicit, 0))
    }

    fn message(
        &mut self,
        message: &[u8],
        scope: &str,
        is_implicit: bool,
        depth: usize,
    ) -> Result<(), String> {
        if depth > DEEPEST {
            return Err(format!("it nests more than {DEEPEST} types"));
        }
        let (mut name, mut found, mut nested) = (String::new(), Vec::new(), Vec::new());
        fields(message, |number, content| {
            match (number, content) {
                (1, Read::Bytes(bytes)) => name = text(bytes),
                (2, Read::Bytes(field)) => found.push(of_field(field, is_implicit)?),
                (3, Read::Bytes(inner)) => nested.push(inner),
                _ => {}
            }
            Ok(())
        })?;
        let full = if scope.is_empty() { name } else { format!("{scope}.{name}") };
        for inner in nested {
            self.message(inner, &full, is_implicit, depth + 1)?;
        }
        self.messages.insert(full, found);
        Ok(())
    }

    /// Decodes a message of the root type.
    pub(crate) fn decode(&self, message: &[u8]) -> Result<Value, String> {
        self.decode_as(&self.root, message, 0)
    }

    fn decode_as(&self, name: &str, message: &[u8], depth: usize) -> Result<Value, String> {
        let known = self.messages.get(name).ok_or_else(|| format!("its schema does not define `{name}`"))?;
        if depth > DEEPEST {
            return Err(format!("it nests more than {DEEPEST} messages"));
        }
        let mut values: Vec<Vec<Value>> = vec![Vec::new(); known.len()];
        fields(message, |number, content| {
            let Some(index) = known.iter().position(|field| field.number == number) else { return Ok(()) };
            let field = &known[index];
            match content {
                Read::Bytes(mut packed) if field.is_repeated && field.is_scalar() => {
                    while !packed.is_empty() {
                        let content = field.take(&mut packed).ok_or_else(|| field.damaged())?;
                        values[index].push(field.scalar(content).ok_or_else(|| field.damaged())?);
                    }
                }
                Read::Bytes(bytes) if !field.is_scalar() => values[index].push(match field.kind {
                    kind::STRING => Value::Text(text(bytes)),
                    kind::BYTES => Value::Bytes(bytes.to_vec()),
                    kind::MESSAGE => self.decode_as(&field.message, bytes, depth + 1)?,
                    _ => return Err(format!("field `{}` has a type that is not supported", field.name)),
                }),
                content => values[index].push(field.scalar(content).ok_or_else(|| field.damaged())?),
            }
            Ok(())
        })?;
        let record = known.iter().zip(values).filter_map(|(field, mut found)| {
            let value = match found.pop() {
                last if field.is_repeated => {
                    found.extend(last);
                    Value::List(found)
                }
                Some(last) => last,
                None => field.absent()?,
            };
            Some((field.name.clone(), value))
        });
        Ok(Value::Record(record.collect()))
    }
}

fn of_field(descriptor: &[u8], is_proto3: bool) -> Result<Field, String> {
    let mut field = Field { is_implicit: is_proto3, ..Field::default() };
    fields(descriptor, |number, content| {
        match (number, content) {
            (1, Read::Bytes(name)) => field.name = text(name).into(),
            (3, Read::Varint(number)) => field.number = u32::try_from(number).unwrap_or(0),
            (4, Read::Varint(label)) => field.is_repeated = label == REPEATED,
            (5, Read::Varint(kind)) => field.kind = kind,
            (6, Read::Bytes(name)) => field.message = text(name).trim_start_matches('.').to_string(),
            // The field is one of several alternatives, or optional.
            (9 | 17, _) => field.is_implicit = false,
            _ => {}
        }
        Ok(())
    })?;
    Ok(field)
}

impl Field {
    fn is_scalar(&self) -> bool {
        !matches!(self.kind, kind::STRING | kind::BYTES | kind::MESSAGE)
    }

    fn damaged(&self) -> String {
        format!("field `{}` does not match the schema", self.name)
    }

    /// Reads an entry of a packed array.
    fn take<'m>(&self, packed: &mut &'m [u8]) -> Option<Read<'m>> {
        let length = match self.kind {
            kind::DOUBLE | kind::FIXED64 | kind::SFIXED64 => 8,
            kind::FLOAT | kind::FIXED32 | kind::SFIXED32 => 4,
            _ => return take_varint(packed).map(Read::Varint),
        };
        let (entry, rest) = packed.split_at_checked(length)?;
        *packed = rest;
        Some(Read::Fixed(entry))
    }

    fn scalar(&self, content: Read<'_>) -> Option<Value> {
        let number = match (self.kind, content) {
            (kind::DOUBLE, Read::Fixed(bytes)) => Number::Double(f64::from_le_bytes(bytes.try_into().ok()?)),
            (kind::FLOAT, Read::Fixed(bytes)) => Number::Single(f32::from_le_bytes(bytes.try_into().ok()?)),
            (kind::FIXED64, Read::Fixed(bytes)) => {
                Number::Natural(u64::from_le_bytes(bytes.try_into().ok()?))
            }
            (kind::FIXED32, Read::Fixed(bytes)) => {
                Number::Natural(u32::from_le_bytes(bytes.try_into().ok()?).into())
            }
            (kind::SFIXED64, Read::Fixed(bytes)) => {
                Number::Integer(i64::from_le_bytes(bytes.try_into().ok()?))
            }
            (kind::SFIXED32, Read::Fixed(bytes)) => {
                Number::Integer(i32::from_le_bytes(bytes.try_into().ok()?).into())
            }
            (kind::INT64 | kind::INT32 | kind::ENUM, Read::Varint(bits)) => Number::Integer(bits as i64),
            (kind::SINT64 | kind::SINT32, Read::Varint(bits)) => Number::Integer(unzigzag(bits)),
            (kind::BOOL, Read::Varint(bits)) => Number::Natural((bits != 0).into()),
            (_, Read::Varint(bits)) => Number::Natural(bits),
            _ => return None,
        };
        Some(Value::Number(number))
    }

    /// Returns the default value of a field that is absent from a message; `None` if the field has no
    /// default.
    fn absent(&self) -> Option<Value> {
        if !self.is_implicit {
            return None;
        }
        Some(match self.kind {
            kind::STRING => Value::Text(String::new()),
            kind::BYTES => Value::Bytes(Vec::new()),
            kind::MESSAGE => return None,
            kind::DOUBLE => Value::Number(Number::Double(0.0)),
            kind::FLOAT => Value::Number(Number::Single(0.0)),
            kind::INT64 | kind::INT32 | kind::ENUM | kind::SFIXED32 | kind::SFIXED64 => {
                Value::Number(Number::Integer(0))
            }
            kind::SINT32 | kind::SINT64 => Value::Number(Number::Integer(0)),
            _ => Value::Number(Number::Natural(0)),
        })
    }
}
