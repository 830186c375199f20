//! Errors of derived schemas.

/// Error of a layout or a message that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DerivedError {
    /// A field has a type that no state buffer contains, or exceeds the buffer.
    #[error(
        "field `{field}` of `{type_name}` is {kind} at byte {offset}, which cannot be written as protobuf"
    )]
    Field {
        /// The type.
        type_name: String,
        /// The field.
        field: String,
        /// Type of the field in the layout.
        kind: String,
        /// Byte offset of the field.
        offset: usize,
    },
    /// The message is damaged or truncated.
    #[error("a message of `{schema}` is damaged{}", .field.as_ref().map_or_else(String::new, |field| format!(" in field `{field}`")))]
    Message {
        /// Name of the schema.
        schema: String,
        /// The faulty field, if known.
        field: Option<String>,
    },
}
