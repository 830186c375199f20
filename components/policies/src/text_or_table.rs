//! Configuration entries that are either a text or a table.

use core::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

/// Deserialises a text or a table. An error within the table is reported with its key, which an untagged enum
/// would hide.
pub(crate) fn text_or_table<'de, D: Deserializer<'de>, T: Deserialize<'de>, E>(
    deserializer: D,
    expected: &'static str,
    text: fn(String) -> E,
    table: fn(T) -> E,
) -> Result<E, D::Error> {
    deserializer.deserialize_any(TextOrTable { expected, text, table })
}

struct TextOrTable<T, E> {
    expected: &'static str,
    text: fn(String) -> E,
    table: fn(T) -> E,
}

impl<'de, T: Deserialize<'de>, E> Visitor<'de> for TextOrTable<T, E> {
    type Value = E;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }

    fn visit_str<F: Error>(self, text: &str) -> Result<E, F> {
        Ok((self.text)(text.to_owned()))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<E, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(self.table)
    }
}
