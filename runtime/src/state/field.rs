//! Types of the fields of a state buffer.

#![allow(unsafe_code)] // `Field` promises facts about bytes in shared memory; values are seen as their numbers

use super::finite::{self, Numbers, are_finite};
use super::{Digest, FieldLayout};

/// Number of bytes written before they are checked; fits the L1 cache.
const PART: usize = 8 * 1024;

/// A type that can be a field of a state buffer: a number, an array, or another state buffer.
///
/// # Safety
/// The type must be valid for every bit pattern, contain no pointer or reference, and not need `Drop`.
/// `describe` must report every field at its true offset. A type whose `NUMBERS` are not
/// [`Mixed`](Numbers::Mixed) must consist of these numbers only, without padding.
pub unsafe trait Field: Copy + core::fmt::Debug + 'static {
    /// Value with all bytes zero.
    const ZERO: Self;

    /// Type of the numbers that the value consists of.
    const NUMBERS: Numbers = Numbers::Mixed;

    /// Appends the layout of this field to `out`; if the field is a state buffer, appends the layouts of the
    /// buffer's fields. `prefix` is the name of the field, and `offset` is its offset, bytes.
    fn describe(prefix: &str, offset: usize, out: &mut Vec<FieldLayout>);

    /// Checks that all numbers are finite and that counts do not exceed their arrays.
    fn check(&self) -> Result<(), Defect>;

    /// Checks the value like [`check`](Self::check), but skips numbers that `checked` covers because they
    /// were checked while they were written.
    #[inline]
    fn check_rest(&self, checked: &Checked) -> Result<(), Defect> {
        let _ = checked;
        self.check()
    }

    /// Checks consecutive values like [`check`](Self::check).
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

    /// Writes `values` to the consecutive `places` until values or places run out, and checks each value
    /// while it is in registers. Returns the number of values written, and `true` if all written values are
    /// valid.
    fn write_checked(places: &mut [Self], values: impl Iterator<Item = Self>) -> (usize, bool) {
        let (mut values, mut count) = (values, 0);
        for part in places.chunks_mut((PART / size_of::<Self>().max(1)).max(1)) {
            let room = part.len();
            let written = part.iter_mut().zip(values.by_ref()).map(|(place, value)| *place = value).count();
            count += written;
            if Self::check_all(&part[..written]).is_err() {
                // The rest needs no check.
                let rest = places[count..].iter_mut().zip(values).map(|(place, value)| *place = value);
                return (count + rest.count(), false);
            }
            if written < room {
                break;
            }
        }
        (count, true)
    }

    /// Adds the content of the value to a digest, except for entries of arrays that are not in use.
    fn digest(&self, digest: &mut Digest);

    /// Adds consecutive values to a digest, like [`digest`](Self::digest).
    fn digest_all(values: &[Self], digest: &mut Digest) {
        values.iter().for_each(|value| value.digest(digest));
    }
}

/// Returns `true` if all values are known to be finite; `false` if a value is not finite or the values must
/// be checked one by one.
#[inline]
fn are_plainly_finite<T: Field>(values: &[T]) -> bool {
    let bytes = size_of_val(values);
    let first = values.as_ptr();
    match T::NUMBERS {
        Numbers::Whole => true,
        Numbers::Mixed => false,
        // SAFETY: by the contract of `Field` the values are consecutive numbers of this type without padding,
        // with the same alignment.
        Numbers::Double => are_finite(unsafe { core::slice::from_raw_parts(first.cast::<f64>(), bytes / 8) }),
        // SAFETY: as above.
        Numbers::Single => are_finite(unsafe { core::slice::from_raw_parts(first.cast::<f32>(), bytes / 4) }),
    }
}

/// Address range of numbers that were found to be finite while they were written, so that they need not be
/// checked again.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Checked {
    /// Addresses of the first byte and one past the last; empty if equal.
    from: usize,
    to: usize,
    /// True if the numbers are `f32`.
    single: bool,
}

impl Checked {
    /// Returns the address range of these values; empty unless they consist only of `f64` or only of `f32`.
    pub(crate) fn from_values<T: Field>(values: &[T]) -> Self {
        let from = values.as_ptr().addr();
        match T::NUMBERS {
            Numbers::Double | Numbers::Single => {
                Self { from, to: from + size_of_val(values), single: T::NUMBERS == Numbers::Single }
            }
            Numbers::Whole | Numbers::Mixed => Self::default(),
        }
    }

    /// Returns `true` if the range is empty.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.from == self.to
    }

    /// Returns `true` if the range contains all of these values.
    #[inline]
    pub fn covers<T: Field>(&self, values: &[T]) -> bool {
        let asked = Self::from_values(values);
        self.from <= asked.from && asked.to <= self.to && !asked.is_empty() && self.single == asked.single
    }
}

/// A defect in the content of a state buffer. Owns no heap memory, so it can be created on the hot path.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Defect {
    /// A number is NaN or infinite.
    #[error("`{field}`[{index}] is {value}, not a finite number")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// Index in an array, otherwise 0.
        index: usize,
        /// The value found.
        value: f64,
    },
    /// A count exceeds the capacity of its array.
    #[error("`{field}` counts {found} entries, but the buffer holds at most {capacity}")]
    Count {
        /// Name of the field.
        field: &'static str,
        /// Value of the count.
        found: usize,
        /// The largest valid count.
        capacity: usize,
    },
}

impl Defect {
    /// Sets the name of the field that has the defect, unless a nested field has already set a name.
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
        // SAFETY: a primitive number is valid for every bit pattern and contains no pointer.
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
                    // SAFETY: numbers without padding: every byte is initialised, and bytes need no
                    // alignment.
                    digest.write(unsafe {
                        core::slice::from_raw_parts(values.as_ptr().cast::<u8>(), size_of_val(values))
                    });
                } else {
                    values.iter().for_each(|value| value.digest(digest));
                }
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

// SAFETY: an array of values that are valid for every bit pattern is itself valid for every bit pattern.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn part_covers_only_its_own_numbers() {
        let values = [0.0_f64; 8];
        let part = Checked::from_values(&values[2..6]);
        assert!(part.covers(&values[2..6]) && part.covers(&values[3..4]));
        for range in [1..6, 2..7, 0..2, 6..8] {
            assert!(!part.covers(&values[range.clone()]), "{range:?}");
        }
        assert!(!part.covers(&[0.0_f64]) && !Checked::default().covers(&values));
        let bits: [u64; 8] = values.map(f64::to_bits);
        assert!(Checked::from_values(&bits).is_empty());
    }
}
