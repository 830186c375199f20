//! The types that a state buffer may consist of.

#![allow(unsafe_code)] // `Field` promises facts about bytes in shared memory; only plain numbers get it here.

use twox_hash::xxhash3_64::{DEFAULT_SECRET_LENGTH, RawHasher, SecretBuffer};

use super::FieldLayout;

/// A value that may be part of a state buffer.
///
/// # Safety
/// The type must be valid for every bit pattern, hold no pointer or reference, need no `Drop`, and `describe` must
/// report every field at its true offset.
pub unsafe trait Field: Copy + core::fmt::Debug + 'static {
    /// The value whose bytes are all zero.
    const ZERO: Self;

    /// Appends the layout of this field (or of its parts) under the name `prefix`, at `offset` bytes.
    fn describe(prefix: &str, offset: usize, out: &mut Vec<FieldLayout>);

    /// Finds what must never reach a reader: a number that is not finite, a count beyond its capacity.
    fn check(&self) -> Result<(), Defect>;

    /// As [`check`](Self::check), of many values one after the other.
    fn check_all(values: &[Self]) -> Result<(), Defect> {
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

    /// Feeds the meaningful content (not the unused part of a buffer) to a digest.
    fn digest(&self, digest: &mut Digest);

    /// As [`digest`](Self::digest), of many values one after the other.
    fn digest_all(values: &[Self], digest: &mut Digest) {
        values.iter().for_each(|value| value.digest(digest));
    }
}

/// A running 64-bit digest (XXH3) of published content, equal for equal runs.
pub struct Digest(RawHasher<&'static [u8; DEFAULT_SECRET_LENGTH]>);

impl Default for Digest {
    fn default() -> Self {
        // Without heap memory: an output begins a new one in a step.
        Self(RawHasher::new(SecretBuffer::default()))
    }
}

impl Digest {
    /// Adds bytes.
    pub fn write(&mut self, bytes: &[u8]) {
        core::hash::Hasher::write(&mut self.0, bytes);
    }

    /// Adds an integer.
    pub fn write_u64(&mut self, value: u64) {
        self.write(&value.to_le_bytes());
    }

    /// The digest of everything written so far.
    pub fn finish(&self) -> u64 {
        core::hash::Hasher::finish(&self.0)
    }
}

impl core::fmt::Debug for Digest {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Digest({:016x})", self.finish())
    }
}

/// A defect in the content of a state buffer. It holds no heap memory: it is made on the hot path.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Defect {
    /// A number is NaN or infinite.
    #[error("`{field}`[{index}] is {value}, not a finite number")]
    NotFinite {
        /// The field's name.
        field: &'static str,
        /// Its index when it is an array, else 0.
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

/// The gathered bits of all numbers times zero: 0 but for the sign if all of them are finite.
///
/// One pass without branches: this runs at every publication. A finite number times zero is a zero of either sign, and the
/// bits of zeros, unlike their sum, may be gathered in any order: several numbers at a time.
#[inline(always)]
fn gathered_portably(values: &[f64]) -> u64 {
    values.iter().fold(0, |bits, value| bits | (value * 0.0).to_bits())
}

#[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
#[target_feature(enable = "avx2")]
fn gathered_by_four(values: &[f64]) -> u64 {
    gathered_portably(values)
}

#[inline]
fn gathered(values: &[f64]) -> u64 {
    #[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
    if values.len() >= 32 && std::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the instructions.
        return unsafe { gathered_by_four(values) };
    }
    gathered_portably(values)
}

/// Checks that all numbers of a slice are finite.
pub(super) fn all_finite(field: &'static str, values: &[f64]) -> Result<(), Defect> {
    if gathered(values) << 1 == 0 {
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

            fn describe(prefix: &str, offset: usize, out: &mut Vec<FieldLayout>) {
                out.push(FieldLayout::new(prefix, offset, stringify!($type), size_of::<$type>()));
            }

            fn check(&self) -> Result<(), Defect> {
                number!(@check $type, self)
            }

            fn check_all(values: &[Self]) -> Result<(), Defect> {
                number!(@check_all $type, values)
            }

            fn digest(&self, digest: &mut Digest) {
                digest.write(&self.to_le_bytes());
            }

            fn digest_all(values: &[Self], digest: &mut Digest) {
                if cfg!(target_endian = "little") {
                    // SAFETY: numbers without padding: every byte is initialised, and bytes have no alignment.
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
    (@check_all f64, $values:ident) => { all_finite("", $values) };
    (@check_all f32, $values:ident) => {{
        let bits = $values.iter().fold(0, |bits, value| bits | (value * 0.0).to_bits());
        if bits << 1 == 0 {
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

    fn digest(&self, digest: &mut Digest) {
        T::digest_all(self, digest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_arrays_are_checked_alike_by_wide_instructions_and_portably() {
        let mut values: Vec<f64> = (0..1_003).map(|i| f64::from(i - 500) * 1e300).collect();
        assert_eq!((gathered(&values) << 1, gathered_portably(&values) << 1), (0, 0));
        for (index, wrong) in [(0, f64::NAN), (499, f64::INFINITY), (1_002, f64::NEG_INFINITY)] {
            let right = core::mem::replace(&mut values[index], wrong);
            assert!(gathered(&values) << 1 != 0 && gathered_portably(&values) << 1 != 0, "{index}");
            values[index] = right;
        }
    }
}
