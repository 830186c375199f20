//! Types of the fields of a state buffer.

#![allow(unsafe_code)] // `Field` promises facts about bytes in shared memory; only plain numbers get it here.

use super::finite::{self, Checked, Numbers, are_finite, are_plainly_finite};
use super::{Digest, FieldLayout};

/// Number of bytes written before they are checked, small enough for the nearest cache.
const PART: usize = 8 * 1024;

/// A value that may be part of a state buffer.
///
/// # Safety
/// The type must be valid for every bit pattern, contain no pointer or reference, need no `Drop`, and
/// `describe` must report every field at its true offset. A type whose `NUMBERS` are not
/// [`Mixed`](Numbers::Mixed) consists of such numbers alone, without padding.
pub unsafe trait Field: Copy + core::fmt::Debug + 'static {
    /// The value whose bytes are all zero.
    const ZERO: Self;

    /// Kind of the numbers of which it consists.
    const NUMBERS: Numbers = Numbers::Mixed;

    /// Appends the layout of this field (or of its parts) under the name `prefix`, at `offset` bytes.
    fn describe(prefix: &str, offset: usize, out: &mut Vec<FieldLayout>);

    /// Checks for content that must never reach a reader: a number that is not finite, or a count beyond its
    /// capacity.
    fn check(&self) -> Result<(), Defect>;

    /// Like [`check`](Self::check), without the part that was checked while it was written.
    #[inline]
    fn check_rest(&self, checked: &Checked) -> Result<(), Defect> {
        let _ = checked;
        self.check()
    }

    /// Like [`check`](Self::check), for many consecutive values.
    fn check_all(values: &[Self]) -> Result<(), Defect> {
        if are_plainly_finite(values) {
            return Ok(());
        }
        for (i, value) in values.iter().enumerate() {
            value.check().map_err(|defect| match defect {
                Defect::NotFinite { field: "", value, .. } => {
                    Defect::NotFinite { field: "", index: i, value }
                }
                other => other,
            })?;
        }
        Ok(())
    }

    /// Writes values to their places, from the first one, until either end, and checks each while it is in
    /// registers. Returns the number of written values, and whether all of them may reach a reader.
    fn write_checked(places: &mut [Self], values: impl Iterator<Item = Self>) -> (usize, bool) {
        let (mut values, mut count) = (values, 0);
        for part in places.chunks_mut((PART / size_of::<Self>().max(1)).max(1)) {
            let room = part.len();
            let written = part.iter_mut().zip(values.by_ref()).map(|(place, value)| *place = value).count();
            count += written;
            if Self::check_all(&part[..written]).is_err() {
                // The check of the rest finds nothing.
                let rest = places[count..].iter_mut().zip(values).map(|(place, value)| *place = value);
                return (count + rest.count(), false);
            }
            if written < room {
                break;
            }
        }
        (count, true)
    }

    /// Feeds the meaningful content (not the unused part of a buffer) to a digest.
    fn digest(&self, digest: &mut Digest);

    /// Like [`digest`](Self::digest), for many consecutive values.
    fn digest_all(values: &[Self], digest: &mut Digest) {
        values.iter().for_each(|value| value.digest(digest));
    }
}

/// A defect of the content of a state buffer. Owns no heap memory, since it is created on the hot path.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Defect {
    /// A number is NaN or infinite.
    #[error("`{field}`[{index}] is {value}, not a finite number")]
    NotFinite {
        /// The field's name.
        field: &'static str,
        /// Index in an array, otherwise 0.
        index: usize,
        /// The value found.
        value: f64,
    },
    /// A count is larger than the buffer behind it.
    #[error("`{field}` counts {found} entries, but the buffer holds at most {capacity}")]
    Count {
        /// The field's name.
        field: &'static str,
        /// The count found.
        found: usize,
        /// The largest valid count.
        capacity: usize,
    },
}

impl Defect {
    /// Names the field in which the defect was found; the innermost name wins.
    #[must_use]
    pub fn inside(self, name: &'static str) -> Self {
        match self {
            Self::NotFinite { field: "", index, value } => Self::NotFinite { field: name, index, value },
            other => other,
        }
    }
}

/// Checks that all numbers of a slice are finite.
pub(super) fn all_finite(field: &'static str, values: &[f64]) -> Result<(), Defect> {
    if are_finite(values) {
        return Ok(());
    }
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(Defect::NotFinite { field, index, value: values[index] }),
        None => Ok(()),
    }
}

macro_rules! number {
    ($($type:ident),*) => { $(
        // SAFETY: a primitive number is valid for every bit pattern and holds no pointer.
        unsafe impl Field for $type {
            const ZERO: Self = 0 as $type;
            const NUMBERS: Numbers = number!(@numbers $type);

            fn describe(prefix: &str, offset: usize, out: &mut Vec<FieldLayout>) {
                out.push(FieldLayout::new(prefix, offset, stringify!($type), size_of::<$type>()));
            }

            fn check(&self) -> Result<(), Defect> {
                number!(@check $type, self)
            }

            fn check_all(values: &[Self]) -> Result<(), Defect> {
                number!(@check_all $type, values)
            }

            #[inline]
            fn write_checked(places: &mut [Self], values: impl Iterator<Item = Self>) -> (usize, bool) {
                number!(@write $type, places, values)
            }

            fn digest(&self, digest: &mut Digest) {
                digest.write(&self.to_le_bytes());
            }

            fn digest_all(values: &[Self], digest: &mut Digest) {
                if cfg!(target_endian = "little") {
                    // SAFETY: numbers without padding: every byte is initialised, and bytes have no
                    // alignment.
                    digest.write(unsafe {
                        core::slice::from_raw_parts(values.as_ptr().cast::<u8>(), size_of_val(values))
                    });
                } else {
                    values.iter().for_each(|value| value.digest(digest));
                }
            }
        }

        impl super::StateBuffer for $type {
            const NAME: &'static str = stringify!($type);

            fn layout() -> super::TypeLayout {
                super::TypeLayout::of::<$type>()
            }
        }
    )* };
    (@numbers f64) => { Numbers::Double };
    (@numbers f32) => { Numbers::Single };
    (@numbers $type:ident) => { Numbers::Whole };
    (@write f64, $places:ident, $values:ident) => { finite::write($places, $values) };
    (@write f32, $places:ident, $values:ident) => { finite::write($places, $values) };
    (@write $type:ident, $places:ident, $values:ident) => {
        ($places.iter_mut().zip($values).map(|(place, value)| *place = value).count(), true)
    };
    (@check_all f64, $values:ident) => { all_finite("", $values) };
    (@check_all f32, $values:ident) => {{
        if are_finite($values) {
            return Ok(());
        }
        match $values.iter().position(|value| !value.is_finite()) {
            Some(index) => Err(Defect::NotFinite { field: "", index, value: f64::from($values[index]) }),
            None => Ok(()),
        }
    }};
    (@check_all $type:ident, $values:ident) => {{ let _ = $values; Ok(()) }};
    (@check f64, $value:ident) => { all_finite("", core::slice::from_ref($value)) };
    (@check f32, $value:ident) => { all_finite("", &[f64::from(*$value)]) };
    (@check $type:ident, $value:ident) => {{ let _ = $value; Ok(()) }};
}

number!(f64, f32, u8, u16, u32, u64, i8, i16, i32, i64);

// SAFETY: an array of values that are valid for every bit pattern is too.
unsafe impl<T: Field, const N: usize> Field for [T; N] {
    const ZERO: Self = [T::ZERO; N];
    const NUMBERS: Numbers = T::NUMBERS;

    fn describe(prefix: &str, offset: usize, out: &mut Vec<FieldLayout>) {
        let mut element = Vec::new();
        T::describe("", 0, &mut element);
        match element.as_slice() {
            [single] if single.name.is_empty() => out.push(FieldLayout::new(
                prefix,
                offset,
                &format!("[{}; {N}]", single.kind),
                size_of::<Self>(),
            )),
            _ => {
                (0..N).for_each(|i| T::describe(&format!("{prefix}[{i}]"), offset + i * size_of::<T>(), out))
            }
        }
    }

    fn check(&self) -> Result<(), Defect> {
        T::check_all(self)
    }

    fn check_rest(&self, checked: &Checked) -> Result<(), Defect> {
        if checked.covers(self) { Ok(()) } else { T::check_all(self) }
    }

    fn digest(&self, digest: &mut Digest) {
        T::digest_all(self, digest);
    }
}
