//! Samples made readable by their layout alone: the program need not know their types.

use motorium::state::TypeLayout;
use serde::ser::{Serialize, SerializeMap as _, Serializer};

/// Types of which only the first `count` entries of every array mean anything.
const COUNTED: [&str; 2] = ["motorium.JointState", "motorium.JointCommand"];
/// Padding that these types name.
const PADDING: &str = "reserved";

/// A layout or a sample that cannot be read.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum DecodeError {
    /// A field has a type that this program does not know.
    #[error(
        "field `{field}` of `{type_name}` has the type `{kind}`, which this version of motorium cannot read"
    )]
    Kind { type_name: String, field: String, kind: String },
    /// A field lies outside of its sample.
    #[error("field `{field}` of `{type_name}` ends at byte {end}, but a sample has only {size}")]
    Outside { type_name: String, field: String, end: usize, size: usize },
    /// A sample is cut short.
    #[error("a sample of {found} bytes, expected {expected}")]
    Short { found: usize, expected: usize },
    /// A sample counts more entries than it holds.
    #[error("`count` is {found}, but the sample holds at most {capacity} entries")]
    Count { found: u64, capacity: usize },
}

macro_rules! scalars {
    ($($variant:ident $type:ident $as:ty),*) => {
        /// A primitive number in a sample.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        enum Scalar { $( $variant ),* }

        impl Scalar {
            fn parse(kind: &str) -> Option<Self> {
                match kind { $( stringify!($type) => Some(Self::$variant), )* _ => None }
            }

            fn size(self) -> usize {
                match self { $( Self::$variant => size_of::<$type>() ),* }
            }

            /// Reads the number at the start of `bytes`, which the caller has checked to be long enough.
            fn read(self, bytes: &[u8]) -> Number {
                match self {
                    $( Self::$variant => {
                        let mut raw = [0; size_of::<$type>()];
                        let length = raw.len();
                        raw.copy_from_slice(&bytes[..length]);
                        Number::from($type::from_ne_bytes(raw) as $as)
                    } )*
                }
            }
        }
    };
}
scalars!(
    F64 f64 f64, F32 f32 f32,
    U8 u8 u64, U16 u16 u64, U32 u32 u64, U64 u64 u64,
    I8 i8 i64, I16 i16 i64, I32 i32 i64, I64 i64 i64
);

/// A number of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Number {
    Double(f64),
    Single(f32),
    Natural(u64),
    Integer(i64),
}

macro_rules! numbers {
    ($($type:ty => $variant:ident),*) => { $(
        impl From<$type> for Number {
            fn from(value: $type) -> Self {
                Self::$variant(value)
            }
        }
    )* };
}
numbers!(f64 => Double, f32 => Single, u64 => Natural, i64 => Integer);

impl core::fmt::Display for Number {
    /// Floats with six decimals, so that columns stand still while the values change; tiny and huge ones with an
    /// exponent.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let value = match *self {
            Self::Natural(value) => return write!(f, "{value}"),
            Self::Integer(value) => return write!(f, "{value}"),
            Self::Double(value) => value,
            Self::Single(value) => f64::from(value),
        };
        let size = value.abs();
        if size != 0.0 && !(1e-5..1e7).contains(&size) {
            write!(f, "{value:.3e}")
        } else {
            write!(f, "{value:.6}")
        }
    }
}

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Self::Double(value) => serializer.serialize_f64(value),
            Self::Single(value) => serializer.serialize_f32(value),
            Self::Natural(value) => serializer.serialize_u64(value),
            Self::Integer(value) => serializer.serialize_i64(value),
        }
    }
}

/// A field's value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    One(Number),
    Many(Vec<Number>),
}

impl Value {
    pub(super) fn numbers(&self) -> &[Number] {
        match self {
            Self::One(number) => core::slice::from_ref(number),
            Self::Many(numbers) => numbers,
        }
    }
}

/// A sample as names and values, in the order of its layout. As JSON it is an object.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Decoded<'a>(pub(super) Vec<(&'a str, Value)>);

impl Serialize for Decoded<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, value) in &self.0 {
            match value {
                Value::One(number) => map.serialize_entry(name, number)?,
                Value::Many(numbers) => map.serialize_entry(name, numbers)?,
            }
        }
        map.end()
    }
}

/// Reads the samples of one layout.
#[derive(Debug)]
pub(super) struct Decoder {
    size: usize,
    fields: Vec<Field>,
    /// Index of the field that counts the entries of all arrays.
    count: Option<usize>,
}

#[derive(Debug)]
struct Field {
    name: String,
    offset: usize,
    scalar: Scalar,
    /// Entries of an array; `None` for a single number.
    length: Option<usize>,
}

impl Decoder {
    /// Prepares to read a layout.
    ///
    /// # Errors
    /// It has a field of an unknown type, or one outside of the sample.
    pub(super) fn new(layout: &TypeLayout) -> Result<Self, DecodeError> {
        let counted = COUNTED.contains(&layout.type_name.as_str());
        let mut fields = Vec::new();
        for field in &layout.fields {
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
            if !(counted && field.name == PADDING) {
                fields.push(Field { name: field.name.clone(), offset: field.offset, scalar, length });
            }
        }
        let count = fields.iter().position(|field| counted && field.name == "count");
        Ok(Self { size: layout.size, fields, count })
    }

    /// Reads a sample.
    ///
    /// # Errors
    /// It is cut short, or counts more entries than it holds; no number is read then.
    pub(super) fn decode(&self, bytes: &[u8]) -> Result<Decoded<'_>, DecodeError> {
        if bytes.len() < self.size {
            return Err(DecodeError::Short { found: bytes.len(), expected: self.size });
        }
        let used = self.used(bytes)?;
        let value = |field: &Field| {
            let at = |i: usize| field.scalar.read(&bytes[field.offset + i * field.scalar.size()..]);
            match field.length {
                None => Value::One(at(0)),
                Some(length) => Value::Many((0..length.min(used)).map(at).collect()),
            }
        };
        Ok(Decoded(self.fields.iter().map(|field| (field.name.as_str(), value(field))).collect()))
    }

    /// How many entries of each array mean anything.
    fn used(&self, bytes: &[u8]) -> Result<usize, DecodeError> {
        let Some(field) = self.count.map(|index| &self.fields[index]) else { return Ok(usize::MAX) };
        let Number::Natural(found) = field.scalar.read(&bytes[field.offset..]) else { return Ok(usize::MAX) };
        let capacity = self.fields.iter().filter_map(|field| field.length).min().unwrap_or(0);
        match usize::try_from(found) {
            Ok(used) if used <= capacity => Ok(used),
            _ => Err(DecodeError::Count { found, capacity }),
        }
    }
}

/// Reads a kind such as `f64` or `[f64; 64]`.
fn parse(kind: &str) -> Option<(Scalar, Option<usize>)> {
    match kind.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
        None => Some((Scalar::parse(kind)?, None)),
        Some(array) => {
            let (scalar, length) = array.split_once(';')?;
            Some((Scalar::parse(scalar.trim())?, Some(length.trim().parse().ok()?)))
        }
    }
}

#[cfg(test)]
mod tests {
    use motorium::state::{FieldLayout, JointCommand, JointState, PoseTarget, StateBuffer};

    use super::*;

    motorium::state_buffer! {
        /// Every primitive once, with padding between.
        struct Everything as "test.Everything" {
            small: u8,
            wide: u64,
            signed: i16,
            single: f32,
            bytes: [u8; 3],
            pairs: [f32; 2],
            negative: i64,
            target: Target,
            legs: [Target; 2],
        }
    }

    motorium::state_buffer! {
        /// A part of another buffer.
        struct Target as "test.Target" {
            place: [f64; 2],
            index: i32,
        }
    }

    /// A sample whose named fields hold these bytes, all others zero.
    fn sample(layout: &TypeLayout, content: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let mut sample = vec![0; layout.size];
        for (name, bytes) in content {
            let field = layout.fields.iter().find(|field| field.name == *name).expect(name);
            sample[field.offset..][..bytes.len()].copy_from_slice(bytes);
        }
        sample
    }

    fn doubles(values: &[f64]) -> Vec<u8> {
        values.iter().flat_map(|value| value.to_ne_bytes()).collect()
    }

    fn json<T: StateBuffer>(content: &[(&str, Vec<u8>)]) -> String {
        let layout = T::layout();
        let decoder = Decoder::new(&layout).unwrap();
        serde_json::to_string(&decoder.decode(&sample(&layout, content)).unwrap()).unwrap()
    }

    #[test]
    fn every_primitive_every_array_and_every_part_comes_back_as_it_was_written() {
        let singles = |values: [f32; 2]| values.iter().flat_map(|value| value.to_ne_bytes()).collect();
        let content = [
            ("small", vec![200]),
            ("wide", u64::MAX.to_ne_bytes().to_vec()),
            ("signed", (-5i16).to_ne_bytes().to_vec()),
            ("single", 0.1f32.to_ne_bytes().to_vec()),
            ("bytes", vec![1, 2, 3]),
            ("pairs", singles([1.5, -2.5])),
            ("negative", i64::MIN.to_ne_bytes().to_vec()),
            ("target.place", doubles(&[0.25, -1e-9])),
            ("target.index", (-7i32).to_ne_bytes().to_vec()),
            ("legs[0].place", doubles(&[1.0, 2.0])),
            ("legs[1].place", doubles(&[4.0, 5.0])),
            ("legs[1].index", 6i32.to_ne_bytes().to_vec()),
        ];
        assert_eq!(
            json::<Everything>(&content),
            concat!(
                r#"{"small":200,"wide":18446744073709551615,"signed":-5,"single":0.1,"bytes":[1,2,3],"#,
                r#""pairs":[1.5,-2.5],"negative":-9223372036854775808,"#,
                r#""target.place":[0.25,-1e-9],"target.index":-7,"#,
                r#""legs[0].place":[1.0,2.0],"legs[0].index":0,"legs[1].place":[4.0,5.0],"legs[1].index":6}"#
            )
        );
    }

    #[test]
    fn of_joints_only_the_counted_ones_are_shown() {
        let content = [
            ("count", 2u32.to_ne_bytes().to_vec()),
            ("reserved", vec![9; 4]),
            ("position", doubles(&[1.0, 2.0, 3.0])),
            ("effort", doubles(&[0.0, -0.5])),
        ];
        assert_eq!(
            json::<JointState>(&content),
            r#"{"count":2,"position":[1.0,2.0],"velocity":[0.0,0.0],"effort":[0.0,-0.5]}"#
        );
        assert!(json::<JointCommand>(&[]).ends_with(r#""stiffness":[],"damping":[]}"#));
    }

    #[test]
    fn the_arrays_of_other_types_are_shown_whole() {
        let content =
            [("orientation", doubles(&[0.0, 0.0, 0.0, 1.0])), ("goal", 2u64.to_ne_bytes().to_vec())];
        let text = json::<PoseTarget>(&content);
        assert!(
            text.contains(r#""orientation":[0.0,0.0,0.0,1.0]"#) && text.contains(r#""goal":2"#),
            "{text}"
        );
    }

    #[test]
    fn a_count_beyond_the_arrays_is_refused_before_any_number_is_read() {
        let layout = JointState::layout();
        let sample = sample(&layout, &[("count", 65u32.to_ne_bytes().to_vec())]);
        let error = Decoder::new(&layout).unwrap().decode(&sample).unwrap_err();
        assert_eq!(error, DecodeError::Count { found: 65, capacity: 64 });
    }

    #[test]
    fn a_sample_cut_short_is_refused() {
        let decoder = Decoder::new(&PoseTarget::layout()).unwrap();
        let expected = size_of::<PoseTarget>();
        assert_eq!(decoder.decode(&[0; 8]).unwrap_err(), DecodeError::Short { found: 8, expected });
    }

    fn layout(kind: &str, offset: usize) -> TypeLayout {
        let field = FieldLayout { name: "x".into(), offset, kind: kind.into(), size: 8 };
        TypeLayout { type_name: "test.Made".into(), size: 16, alignment: 8, fields: vec![field] }
    }

    #[test]
    fn an_unknown_kind_of_field_is_named() {
        for kind in ["f128", "[f64; many]", "[f64 3]", "", "[[f64; 2]; 2]"] {
            let error = Decoder::new(&layout(kind, 0)).unwrap_err();
            assert!(matches!(&error, DecodeError::Kind { kind: found, .. } if found == kind), "{error}");
        }
    }

    #[test]
    fn a_field_outside_of_the_sample_is_refused() {
        for (kind, offset) in [("f64", 9), ("[f64; 3]", 0), ("[u8; 18446744073709551615]", 8)] {
            let error = Decoder::new(&layout(kind, offset)).unwrap_err();
            assert!(matches!(error, DecodeError::Outside { size: 16, .. }), "{kind}: {error}");
        }
        assert!(Decoder::new(&layout("[f64; 2]", 0)).is_ok());
    }

    #[test]
    fn numbers_keep_their_width_and_extremes_get_an_exponent() {
        let texts = [0.0, -1.5, 1234.5678901, 1e-7, 2.5e9, f64::NAN].map(|x| Number::Double(x).to_string());
        assert_eq!(texts, ["0.000000", "-1.500000", "1234.567890", "1.000e-7", "2.500e9", "NaN"]);
    }
}
