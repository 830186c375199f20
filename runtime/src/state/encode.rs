//! Encoding of values from text: `position=[0.4, 0.0, 0.3] goal=1`.

use super::decode::{PADDING, Scalar, parse};
use super::{ContentCheck, FieldLayout, TypeLayout};
use crate::nearest::suggest;

/// Error of [`encode`]: the text is not a value of the type. The message names the field and the expected
/// form.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EncodeError {
    /// A part of the text does not have the form `field=value`.
    #[error("`{0}` is not of the form field=value, such as position=[0.4, 0.0, 0.3]")]
    Form(String),
    /// The type has no field with this name.
    #[error("{type_name} has no field `{field}`; {advice}")]
    Field {
        /// Name of the type.
        type_name: String,
        /// Field name found in the text.
        field: String,
        /// Suggestion: the most similar field, or all fields.
        advice: String,
    },
    /// A field occurs twice.
    #[error("`{0}` is given twice")]
    Twice(String),
    /// The value is not a number of the field's type, or not finite.
    #[error("`{field}` is {found}, expected {}{kind}", if kind.starts_with('f') { "a finite " } else { "" })]
    Number {
        /// Name of the field.
        field: String,
        /// Text of the value.
        found: String,
        /// Type of the field, such as `f64`.
        kind: String,
    },
    /// A number was given for an array, or an array for a number.
    #[error("`{field}` has the type {kind}; write {form}")]
    Shape {
        /// Name of the field.
        field: String,
        /// Type of the field.
        kind: String,
        /// Expected form, with an example.
        form: &'static str,
    },
    /// The array has the wrong length.
    #[error("`{field}` has {found} entries, expected {expected}")]
    Length {
        /// Name of the field.
        field: String,
        /// Number of entries found.
        found: usize,
        /// Expected number of entries.
        expected: String,
    },
    /// The layout has a field that cannot be written as text.
    #[error("{0} has a field that cannot be written as text, expected only numbers and arrays of numbers")]
    Layout(String),
}

/// Encodes a value of `layout` from the fields in `text`: `name=number`, `name=[number, ...]`, or
/// `name="text"` for bytes. Fields that are missing in `text` are zero. Counts are derived from the number of
/// array entries.
///
/// ```
/// use motorium::state::{JointState, StateBuffer, encode};
///
/// let bytes = encode(&JointState::layout(), "position=[0.5, -1.0] velocity=[0.0, 0.1]").unwrap();
/// assert_eq!(bytes[..4], 2u32.to_ne_bytes(), "the count follows from the entries");
/// let error = encode(&JointState::layout(), "positoin=[0.5]").unwrap_err();
/// assert_eq!(error.to_string(), "motorium.JointState has no field `positoin`; did you mean `position`?");
/// ```
///
/// # Errors
/// Returns the first error, with the field and the expected form.
pub fn encode(layout: &TypeLayout, text: &str) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = vec![0; layout.size];
    let mut written: Vec<(&FieldLayout, usize)> = Vec::new();
    for (name, value) in parts(text)? {
        let field = find(layout, name)?;
        if written.iter().any(|(other, _)| other.name == field.name) {
            return Err(EncodeError::Twice(field.name.clone()));
        }
        written.push((field, write(field, value, &mut bytes, layout)?));
    }
    counts(layout, &written, &mut bytes)?;
    match ContentCheck::new(layout).map(|check| check.check(&bytes)) {
        Ok(Ok(())) => Ok(bytes),
        _ => Err(EncodeError::Layout(layout.type_name.clone())),
    }
}

fn find<'l>(layout: &'l TypeLayout, name: &str) -> Result<&'l FieldLayout, EncodeError> {
    let shown = || layout.fields.iter().filter(|field| field.name != PADDING);
    shown().find(|field| field.name == name).ok_or_else(|| {
        let advice = suggest(name, shown().map(|field| field.name.as_str()), "its fields are");
        EncodeError::Field { type_name: layout.type_name.clone(), field: name.to_string(), advice }
    })
}

/// Splits the text into names and values. Values end at a space outside brackets and quotes.
fn parts(text: &str) -> Result<Vec<(&str, &str)>, EncodeError> {
    let mut parts = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        let Some((name, after)) = rest.split_once('=') else {
            return Err(EncodeError::Form(rest.to_string()));
        };
        let (name, after) = (name.trim(), after.trim_start());
        if name.is_empty() || name.contains(char::is_whitespace) {
            return Err(EncodeError::Form(rest.to_string()));
        }
        let end = match after.chars().next() {
            Some('[') => after.find(']').map(|end| end + 1),
            Some('"') => after[1..].find('"').map(|end| end + 2),
            Some(_) => Some(after.find(char::is_whitespace).unwrap_or(after.len())),
            None => None,
        };
        let Some(end) = end else { return Err(EncodeError::Form(rest.to_string())) };
        parts.push((name, &after[..end]));
        rest = after[end..].trim_start();
    }
    Ok(parts)
}

/// Writes one field and returns the number of its entries.
fn write(
    field: &FieldLayout,
    value: &str,
    bytes: &mut [u8],
    layout: &TypeLayout,
) -> Result<usize, EncodeError> {
    let unknown = || EncodeError::Layout(layout.type_name.clone());
    let (scalar, length) = parse(&field.kind).ok_or_else(unknown)?;
    let place = bytes.get_mut(field.offset..field.offset + field.size).ok_or_else(unknown)?;
    let shape = |form| EncodeError::Shape { field: field.name.clone(), kind: field.kind.clone(), form };
    let number = |text: &str, into: &mut [u8]| {
        let kind = field.kind.trim_start_matches('[').split(';').next().unwrap_or_default().to_string();
        let found = if text.is_empty() { "nothing".to_string() } else { text.to_string() };
        scalar.write(text, into).then_some(()).ok_or(EncodeError::Number {
            field: field.name.clone(),
            found,
            kind,
        })
    };
    let Some(capacity) = length else {
        if value.starts_with(['[', '"']) {
            return Err(shape("one number, such as 1"));
        }
        return number(value, place).map(|()| 1);
    };
    let too_many = |found| {
        let expected = match field.count {
            Some(_) => format!("at most {capacity}"),
            None => capacity.to_string(),
        };
        EncodeError::Length { field: field.name.clone(), found, expected }
    };
    if let Some(text) = value.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')) {
        if scalar != Scalar::U8 {
            return Err(shape("a list of numbers, such as [0.0, 1.0]"));
        }
        if text.len() > capacity {
            return Err(too_many(text.len()));
        }
        place[..text.len()].copy_from_slice(text.as_bytes());
        return Ok(text.len());
    }
    let Some(list) = value.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) else {
        return Err(shape("a list of numbers, such as [0.0, 1.0]"));
    };
    let entries: Vec<&str> = match list.trim() {
        "" => Vec::new(),
        list => list.trim_end_matches(',').split(',').map(str::trim).collect(),
    };
    if entries.len() > capacity || (field.count.is_none() && entries.len() != capacity) {
        return Err(too_many(entries.len()));
    }
    for (entry, into) in entries.iter().zip(place.chunks_exact_mut(scalar.size())) {
        number(entry, into)?;
    }
    Ok(entries.len())
}

/// Sets the counts of arrays to the number of their entries. Arrays that share a count must have equal
/// lengths.
fn counts(
    layout: &TypeLayout,
    written: &[(&FieldLayout, usize)],
    bytes: &mut [u8],
) -> Result<(), EncodeError> {
    for counter in &layout.fields {
        let mut of_counter = written.iter().filter(|(field, _)| field.count.as_ref() == Some(&counter.name));
        let Some((_, entries)) = of_counter.next() else { continue };
        if let Some((other, found)) = of_counter.find(|(_, found)| found != entries) {
            let (field, found) = (other.name.clone(), *found);
            return Err(EncodeError::Length { field, found, expected: format!("{entries}, as the others") });
        }
        let text = entries.to_string();
        let place = &mut bytes[counter.offset..counter.offset + counter.size];
        if written.iter().any(|(field, _)| field.name == counter.name) {
            let mut same = place.to_vec();
            let (scalar, _) =
                parse(&counter.kind).ok_or_else(|| EncodeError::Layout(layout.type_name.clone()))?;
            scalar.write(&text, &mut same);
            if same != *place {
                let field = counter.name.clone();
                let expected = "the number of entries of its arrays".to_string();
                return Err(EncodeError::Length { field, found: *entries, expected });
            }
        } else if let Some((scalar, _)) = parse(&counter.kind) {
            scalar.write(&text, place);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::{Decoder, JointCommand, JointState, PoseTarget, StateBuffer};

    fn round<T: StateBuffer>(text: &str) -> String {
        let bytes = encode(&T::layout(), text).unwrap();
        let decoder = Decoder::new(&T::layout()).unwrap();
        serde_json::to_string(&decoder.decode(&bytes).unwrap()).unwrap()
    }

    fn refused<T: StateBuffer>(text: &str) -> String {
        encode(&T::layout(), text).unwrap_err().to_string()
    }

    #[test]
    fn encoded_values_decode_unchanged() {
        let target =
            round::<PoseTarget>("position=[0.4, -1e-3, 3] orientation=[0,0,0,1]  goal=18446744073709551615");
        assert!(
            target.starts_with(r#"{"position":[0.4,-0.001,3.0],"orientation":[0.0,0.0,0.0,1.0],"#),
            "{target}"
        );
        assert!(target.contains(r#""goal":18446744073709551615,"at_goal":0"#), "{target}");
        let state = round::<JointState>("count=2 effort=[1, 2]");
        assert_eq!(state, r#"{"count":2,"position":[0.0,0.0],"velocity":[0.0,0.0],"effort":[1.0,2.0]}"#);
        assert!(round::<JointState>("").starts_with(r#"{"count":0,"position":[]"#));
    }

    #[test]
    fn errors_name_the_field_and_the_expected_form() {
        for (text, answer) in [
            ("position", "`position` is not of the form field=value, such as position=[0.4, 0.0, 0.3]"),
            (
                "position=[1, 2",
                "`position=[1, 2` is not of the form field=value, such as position=[0.4, 0.0, 0.3]",
            ),
            ("positon=[1]", "motorium.PoseTarget has no field `positon`; did you mean `position`?"),
            ("position=[1, 2]", "`position` has 2 entries, expected 3"),
            ("position=[1, x, 3]", "`position` is x, expected a finite f64"),
            ("position=[1, nan, 3]", "`position` is nan, expected a finite f64"),
            ("position=1", "`position` has the type [f64; 3]; write a list of numbers, such as [0.0, 1.0]"),
            ("goal=[1]", "`goal` has the type u64; write one number, such as 1"),
            ("goal=-1", "`goal` is -1, expected u64"),
            ("goal=1.5", "`goal` is 1.5, expected u64"),
            ("goal=1 goal=2", "`goal` is given twice"),
        ] {
            assert_eq!(refused::<PoseTarget>(text), answer);
        }
        let many = format!("position=[{}]", ["0"; 65].join(","));
        assert_eq!(refused::<JointState>(&many), "`position` has 65 entries, expected at most 64");
        assert_eq!(
            refused::<JointCommand>("position=[1, 2] kp=[1]"),
            "`kp` has 1 entries, expected 2, as the others"
        );
        assert!(
            refused::<JointState>("count=3 position=[1]").starts_with("`count` has 1 entries, expected the")
        );
        assert!(refused::<JointState>("reserved=1").contains("has no field `reserved`"));
    }
}
