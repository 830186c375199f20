//! Errors of derived schemas.

/// The layout of a type cannot be converted to a schema, or a message cannot be decoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DerivedError {
    /// A field has a type that state buffers do not support, or extends beyond the buffer.
    #[error(
        "field `{field}` of `{type_name}` has type {kind} at byte {offset}, which cannot be encoded as protobuf"
    )]
    Field {
        /// Name of the type.
        type_name: String,
        /// Name of the field.
        field: String,
        /// Type of the field in the layout.
        kind: String,
        /// Byte offset of the field.
        offset: usize,
    },
    /// The message is damaged or truncated.
    #[error("a message of `{schema}` is damaged{}", .field.as_ref().map_or_else(String::new, |field| format!(" in field `{field}`")))]
    Message {
        /// Name of the message's schema.
        schema: String,
        /// Damaged field, if known.
        field: Option<String>,
    },
}
