//! The primitive numbers of samples.

use serde::ser::{Serialize, Serializer};

macro_rules! scalars {
    ($($variant:ident $type:ident $as:ty),*) => {
        /// A primitive number in a sample.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(in crate::state) enum Scalar { $( $variant ),* }

        impl Scalar {
            pub(in crate::state) fn parse(kind: &str) -> Option<Self> {
                match kind { $( stringify!($type) => Some(Self::$variant), )* _ => None }
            }

            pub(in crate::state) fn size(self) -> usize {
                match self { $( Self::$variant => size_of::<$type>() ),* }
            }

            /// Reads the number at the start of `bytes`, which the caller has checked to be long enough.
            pub(in crate::state) fn read(self, bytes: &[u8]) -> Number {
                match self {
                    $( Self::$variant => {
                        let mut raw = [0; size_of::<$type>()];
                        let length = raw.len();
                        raw.copy_from_slice(&bytes[..length]);
                        Number::from($type::from_ne_bytes(raw) as $as)
                    } )*
                }
            }

            /// Parses a number and writes it to the start of `bytes`. Returns `false` if it is not a number
            /// of this type or not finite.
            pub(in crate::state) fn write(self, text: &str, bytes: &mut [u8]) -> bool {
                match self {
                    $( Self::$variant => match text.parse::<$type>() {
                        Ok(number) if (number as f64).is_finite() => {
                            bytes[..size_of::<$type>()].copy_from_slice(&number.to_ne_bytes());
                            true
                        }
                        _ => false,
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

/// A number of a sample, converted to the widest type of its kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// A number stored as an `f64`.
    Double(f64),
    /// A number stored as an `f32`.
    Single(f32),
    /// A number stored as an unsigned integer of any size.
    Natural(u64),
    /// A number stored as a signed integer of any size.
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
    /// Formats floats with six decimals, which keeps columns aligned while values change. Floats below 1e-5
    /// or from 1e7 up are formatted with an exponent.
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
