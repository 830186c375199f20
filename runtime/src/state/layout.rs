//! The layout of a state buffer, which must be the same in all processes that share it.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::Digest;

/// One field of a state buffer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FieldLayout {
    /// Dotted path of the field.
    pub name: String,
    /// Offset from the start of the buffer, bytes.
    pub offset: usize,
    /// Type: a primitive such as `f64`, or an array such as `[f64; 64]`.
    pub kind: String,
    /// Size of the field, bytes.
    pub size: usize,
    /// For an array, the name of the `u32` field with the number of entries in use; `None` if all entries are
    /// always in use.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<String>,
}

impl FieldLayout {
    pub(super) fn new(name: &str, offset: usize, kind: &str, size: usize) -> Self {
        Self { name: name.to_string(), offset, kind: kind.to_string(), size, count: None }
    }
}

/// Layout of a state buffer. Tools use it to read values of types that they do not know.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct TypeLayout {
    /// Permanent name of the type.
    pub type_name: String,
    /// Size of the whole buffer, bytes.
    pub size: usize,
    /// Alignment, bytes.
    pub alignment: usize,
    /// Fields in order of their offsets.
    pub fields: Vec<FieldLayout>,
}

impl TypeLayout {
    /// Returns a placeholder layout for an input that accepts topics of any type; see
    /// [`is_any`](Self::is_any).
    pub fn any() -> Self {
        Self { type_name: "any type".to_string(), size: 0, alignment: 1, fields: Vec::new() }
    }

    /// Returns `true` if this is the placeholder returned by [`any`](Self::any). The layout declared by the
    /// topic's writer then applies.
    pub fn is_any(&self) -> bool {
        self.size == 0 && self.fields.is_empty()
    }

    /// Returns a hash of the type's name and of the names, offsets and types of all fields, as 16 hexadecimal
    /// digits. Equal layouts have equal hashes.
    pub fn hash(&self) -> String {
        let mut digest = Digest::default();
        digest.write(self.to_string().as_bytes());
        format!("{:016x}", digest.finish())
    }

    /// Formats two layouts side by side for an error message, with differing lines marked `!`. `mine` and
    /// `theirs` are the column titles.
    pub fn difference(&self, mine: &str, other: &Self, theirs: &str) -> String {
        let (left, right) = (self.to_string(), other.to_string());
        let width = left.lines().map(str::len).max().unwrap_or(0).max(mine.len());
        let mut text = format!("    {mine:width$}   {theirs}\n");
        let (mut left, mut right) = (left.lines(), right.lines());
        loop {
            let (a, b) = (left.next(), right.next());
            if a.is_none() && b.is_none() {
                return text;
            }
            let mark = if a == b { ' ' } else { '!' };
            let line = format!("  {mark} {:width$}   {}", a.unwrap_or(""), b.unwrap_or(""));
            let _ = writeln!(text, "{}", line.trim_end());
        }
    }
}

impl core::fmt::Display for TypeLayout {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        writeln!(f, "{}: {} bytes, aligned to {}", self.type_name, self.size, self.alignment)?;
        for field in &self.fields {
            writeln!(f, "{:>6}  {}: {}", field.offset, field.name, field.kind)?;
        }
        Ok(())
    }
}
