//! The content of a sample: a value, or the elements of a slice.

use std::fmt::Write as _;

use motorium::declare::TopicPattern;
use motorium::plan::TopicPlan;
use motorium::state::{Decoded, Decoder, FieldValue, TypeLayout};
use serde::ser::{Error as _, Serialize, SerializeSeq as _, Serializer};

/// Number of slice elements printed as text.
const SHOWN: usize = 8;
/// Number of slice numbers printed as text.
const NUMBERS_SHOWN: usize = 32;
/// Numbers per line.
const NUMBERS_IN_LINE: usize = 8;

/// Content of a sample. In JSON, a value is an object; a slice is an array of objects or of numbers.
#[derive(Debug, Clone)]
pub(super) enum Content<'a> {
    /// A single value.
    Value(Decoded<'a>),
    /// The elements of a slice, decoded one by one as they are printed.
    Slice(Slice<'a>),
}

/// The elements of a slice, where they are in shared memory.
#[derive(Debug, Clone)]
pub(super) struct Slice<'a> {
    decoder: &'a Decoder,
    layout: &'a TypeLayout,
    bytes: &'a [u8],
}

impl<'a> Content<'a> {
    /// Returns the content of a sample of a topic.
    ///
    /// # Errors
    /// If a single value is malformed.
    pub(super) fn read(topic: &'a TopicPlan, decoder: &'a Decoder, bytes: &'a [u8]) -> anyhow::Result<Self> {
        Ok(match topic.pattern {
            TopicPattern::Slices { .. } => Self::Slice(Slice { decoder, layout: &topic.layout, bytes }),
            TopicPattern::State | TopicPattern::Stream { .. } => Self::Value(decoder.decode(bytes)?),
        })
    }
}

impl Serialize for Content<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Value(value) => value.serialize(serializer),
            Self::Slice(slice) => slice.serialize(serializer),
        }
    }
}

impl Slice<'_> {
    /// Returns the elements, each in the layout.
    fn elements(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        self.bytes.chunks_exact(self.layout.size.max(1))
    }

    /// Returns `true` if the elements are plain numbers.
    fn is_of_numbers(&self) -> bool {
        matches!(self.layout.fields.as_slice(), [field] if field.name.is_empty())
    }

    /// Returns the first elements as readable lines, and the total number of elements.
    pub(super) fn lines(&self) -> String {
        let count = self.elements().len();
        let mut text = format!("  {count} elements of {}\n", self.layout.type_name);
        let shown = if self.is_of_numbers() { NUMBERS_SHOWN } else { SHOWN };
        for (index, element) in self.elements().take(shown).enumerate() {
            let Ok(value) = self.decoder.decode(element) else {
                let _ = writeln!(text, "  [{index}] is malformed");
                continue;
            };
            if !self.is_of_numbers() {
                let _ = writeln!(text, "  [{index}]{}", fields(&value));
                continue;
            }
            let numbers = value.0.iter().flat_map(|(_, value)| value.numbers());
            let number = numbers.map(ToString::to_string).collect::<String>();
            let begin = if index % NUMBERS_IN_LINE == 0 { " " } else { "" };
            let is_last = index % NUMBERS_IN_LINE + 1 == NUMBERS_IN_LINE || index + 1 == count.min(shown);
            let _ = write!(text, "{begin} {number:>8}{}", if is_last { "\n" } else { "" });
        }
        if count > shown {
            let _ = writeln!(text, "  and {} more; --json prints all", count - shown);
        }
        text
    }
}

impl Serialize for Slice<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut elements = serializer.serialize_seq(Some(self.elements().len()))?;
        for element in self.elements() {
            let value = self.decoder.decode(element).map_err(S::Error::custom)?;
            match value.0.as_slice() {
                [("", FieldValue::One(number))] => elements.serialize_element(number)?,
                _ => elements.serialize_element(&value)?,
            }
        }
        elements.end()
    }
}

/// Returns the fields of an element in one line.
fn fields(value: &Decoded<'_>) -> String {
    let mut text = String::new();
    for (name, value) in &value.0 {
        let _ = write!(text, " {name}");
        if let FieldValue::Text(content) = value {
            let _ = write!(text, " {content:?}");
        }
        for number in value.numbers() {
            let _ = write!(text, " {number}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use motorium::state::{CloudPoint, StateBuffer as _};

    use super::*;

    fn topic(layout: TypeLayout) -> TopicPlan {
        TopicPlan {
            name: "topic".to_string(),
            pattern: TopicPattern::Slices { capacity: 1, longest: 100 },
            layout,
            writer: 0,
            triggers: Vec::new(),
            readers: Vec::new(),
            history: 0,
        }
    }

    /// A sample as JSON and as text.
    fn shown(layout: TypeLayout, bytes: &[u8]) -> (String, String) {
        let (topic, decoder) = (topic(layout.clone()), Decoder::new(&layout).unwrap());
        let content = Content::read(&topic, &decoder, bytes).unwrap();
        let Content::Slice(slice) = &content else { panic!("a slice") };
        (serde_json::to_string(&content).unwrap(), slice.lines())
    }

    #[test]
    fn slices_of_numbers_are_arrays() {
        let (json, text) = shown(u8::layout(), &[1, 2, 255]);
        assert_eq!(json, "[1,2,255]");
        assert_eq!(text, "  3 elements of u8\n         1        2      255\n");
        let (json, text) = shown(u8::layout(), &[7; 100]);
        assert_eq!(json.matches('7').count(), 100);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 1 + 4 + 1, "{text}");
        assert_eq!(lines[5], "  and 68 more; --json prints all");
        assert_eq!(shown(u8::layout(), &[]), ("[]".to_string(), "  0 elements of u8\n".to_string()));
    }

    #[test]
    fn slices_of_structures_are_arrays_of_objects() {
        let bytes: Vec<u8> = (0..40).flat_map(|number| (number as f32).to_ne_bytes()).collect();
        let (json, text) = shown(CloudPoint::layout(), &bytes);
        assert!(json.starts_with("[{\"x\":0.0,\"y\":1.0,\"z\":2.0,\"intensity\":3.0},"), "{json}");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!((lines.len(), lines[0]), (10, "  10 elements of motorium.CloudPoint"));
        assert!(lines[2].starts_with("  [1] x 4") && lines[2].contains(" intensity 7"), "{text}");
    }
}
