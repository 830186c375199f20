//! Decoders of messages, selected by the encodings of a channel.

use super::definition::{SEPARATOR, Type, linked};
use super::protobuf::Descriptors;
use super::value::{Number, Value};
use super::{cdr, idl, msg};

/// The schema of a channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// Name of the type, such as `sensor_msgs/msg/JointState`.
    pub name: String,
    /// Encoding of the schema, such as `ros2msg`.
    pub encoding: String,
    /// Content of the schema.
    pub data: Vec<u8>,
}

impl Schema {
    /// Returns the name of the type without its packages: `JointState` for `sensor_msgs/msg/JointState`.
    pub fn short_name(&self) -> &str {
        self.name.rsplit(['.', '/', ':']).next().unwrap_or_default()
    }
}

/// Reason why the messages of a channel cannot be decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unsupported {
    /// The encoding of the messages is unknown.
    #[error("messages are encoded as `{0}`, expected `cdr`, `json` or `protobuf`")]
    Encoding(String),
    /// The channel has no schema, which its encoding requires.
    #[error("messages encoded as `{0}` have no schema, but this encoding requires one")]
    NoSchema(String),
    /// The encoding of the schema is unknown.
    #[error("messages encoded as `{messages}` have a schema encoded as `{schema}`, expected {expected}")]
    SchemaEncoding {
        /// Encoding of the messages.
        messages: String,
        /// Encoding of the schema.
        schema: String,
        /// The supported encodings of schemas.
        expected: &'static str,
    },
    /// The schema does not parse.
    #[error("the schema cannot be read: {0}")]
    Schema(String),
}

/// A message that does not match its schema.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Damaged(String);

/// A decoder of the messages of a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoder(Kind);

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Json,
    Cdr(Type),
    Protobuf(Descriptors),
}

impl Decoder {
    /// Creates a decoder for messages with an encoding and a schema.
    ///
    /// # Errors
    /// The encodings are unknown, or the schema does not parse.
    pub fn new(encoding: &str, schema: Option<&Schema>) -> Result<Self, Unsupported> {
        let required = || schema.ok_or_else(|| Unsupported::NoSchema(encoding.to_string()));
        let unknown = |schema: &Schema, expected| Unsupported::SchemaEncoding {
            messages: encoding.to_string(),
            schema: schema.encoding.clone(),
            expected,
        };
        match encoding {
            "json" => Ok(Self(Kind::Json)),
            "cdr" => {
                let schema = required()?;
                let text = std::str::from_utf8(&schema.data)
                    .map_err(|error| Unsupported::Schema(format!("it is not UTF-8: {error}")))?;
                let (items, root) = match schema.encoding.as_str() {
                    "ros2msg" => (msg::items(&schema.name, text), msg::full_name(&schema.name)),
                    "ros2idl" => (idl::items(text), msg::full_name(&schema.name)),
                    "omgidl" => (idl::items(text), schema.name.replace('/', SEPARATOR)),
                    _ => return Err(unknown(schema, "`ros2msg`, `ros2idl` or `omgidl`")),
                };
                let items = items.map_err(Unsupported::Schema)?;
                Ok(Self(Kind::Cdr(linked(&items, &root).map_err(Unsupported::Schema)?)))
            }
            "protobuf" => {
                let schema = required()?;
                if schema.encoding != "protobuf" {
                    return Err(unknown(schema, "`protobuf`"));
                }
                let descriptors =
                    Descriptors::new(&schema.data, &schema.name).map_err(Unsupported::Schema)?;
                Ok(Self(Kind::Protobuf(descriptors)))
            }
            other => Err(Unsupported::Encoding(other.to_string())),
        }
    }

    /// Decodes a message.
    ///
    /// # Errors
    /// The message is damaged, or its type differs from the schema.
    pub fn decode(&self, message: &[u8]) -> Result<Value, Damaged> {
        match &self.0 {
            Kind::Json => {
                let json = serde_json::from_slice(message).map_err(|error| Damaged(error.to_string()))?;
                Ok(of_json(json).unwrap_or_else(|| Value::Record(Vec::new())))
            }
            Kind::Cdr(kind) => cdr::decoded(message, kind).map_err(Damaged),
            Kind::Protobuf(descriptors) => descriptors.decode(message).map_err(Damaged),
        }
    }
}

/// Converts a JSON document. Returns `None` for `null`, which is omitted from fields and lists.
fn of_json(json: serde_json::Value) -> Option<Value> {
    Some(match json {
        serde_json::Value::Null => return None,
        serde_json::Value::Bool(is_true) => Value::Number(Number::Natural(is_true.into())),
        serde_json::Value::Number(number) => Value::Number(match (number.as_u64(), number.as_i64()) {
            (Some(natural), _) => Number::Natural(natural),
            (None, Some(integer)) => Number::Integer(integer),
            (None, None) => Number::Double(number.as_f64()?),
        }),
        serde_json::Value::String(text) => Value::Text(text),
        serde_json::Value::Array(entries) => Value::List(entries.into_iter().filter_map(of_json).collect()),
        serde_json::Value::Object(fields) => Value::Record(
            fields.into_iter().filter_map(|(name, value)| Some((name.into(), of_json(value)?))).collect(),
        ),
    })
}
