//! Checks for finite numbers, in memory and while they are written.

#![allow(unsafe_code)] // wide instructions where the processor has them

use core::ops::BitOr;

/// Minimum number of values for SIMD instructions, which are in a separate function on another page.
#[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
const WIDE: usize = 256;

/// A floating-point number.
pub(super) trait Float: Copy {
    /// Its bits.
    type Bits: Copy + Default + PartialEq + BitOr<Output = Self::Bits>;

    /// Returns the bits of the number minus itself: 0 for a finite number, otherwise the bits of a NaN.
    fn excess(self) -> Self::Bits;
}

macro_rules! floats {
    ($($float:ident => $bits:ident),*) => { $(
        impl Float for $float {
            type Bits = $bits;

            #[inline(always)]
            fn excess(self) -> $bits {
                (self - self).to_bits()
            }
        }
    )* };
}
floats!(f64 => u64, f32 => u32);

/// Returns the OR of the bits of `x - x` over all numbers: 0 if all of them are finite.
///
/// This runs at every publication, so it is one pass without branches. Unlike a floating-point sum, the OR
/// may be computed in any order, several numbers at a time.
#[inline(always)]
fn gathered_portably<F: Float>(values: &[F]) -> F::Bits {
    values.iter().fold(F::Bits::default(), |bits, value| bits | value.excess())
}

#[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
#[target_feature(enable = "avx2")]
fn gathered_by_four<F: Float>(values: &[F]) -> F::Bits {
    gathered_portably(values)
}

/// Returns `true` if all numbers are finite.
#[inline]
pub(super) fn are_finite<F: Float>(values: &[F]) -> bool {
    #[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
    if values.len() >= WIDE && std::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the instructions.
        return unsafe { gathered_by_four(values) } == F::Bits::default();
    }
    gathered_portably(values) == F::Bits::default()
}

/// Writes numbers to consecutive places and accumulates their bits like [`gathered_portably`], without
/// reading them again. Returns the number of written values.
#[inline(always)]
fn written_portably<F: Float>(places: &mut [F], values: impl Iterator<Item = F>) -> (usize, F::Bits) {
    places.iter_mut().zip(values).fold((0, F::Bits::default()), |(count, bits), (place, value)| {
        *place = value;
        (count + 1, bits | value.excess())
    })
}

#[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
#[target_feature(enable = "avx2")]
fn written_by_four<F: Float>(places: &mut [F], values: impl Iterator<Item = F>) -> (usize, F::Bits) {
    written_portably(places, values)
}

/// Writes numbers to consecutive places until either runs out. Returns the number of written values, and
/// `true` if all of them are finite.
#[inline]
pub(super) fn write<F: Float>(places: &mut [F], values: impl Iterator<Item = F>) -> (usize, bool) {
    #[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
    if places.len() >= WIDE && std::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the instructions.
        let (count, bits) = unsafe { written_by_four(places, values) };
        return (count, bits == F::Bits::default());
    }
    let (count, bits) = written_portably(places, values);
    (count, bits == F::Bits::default())
}

/// Type of all numbers in a value. Determines how fast the value can be checked for finite numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbers {
    /// `f64` only, without padding.
    Double,
    /// `f32` only, without padding.
    Single,
    /// Integers only: any content is valid.
    Whole,
    /// Several types of numbers, or arrays whose entries are only valid up to a count.
    Mixed,
}

impl Numbers {
    /// Combines the number types of the parts of a value: the common type if all are equal, otherwise
    /// [`Mixed`](Self::Mixed).
    ///
    /// ```
    /// use motorium::state::Numbers;
    ///
    /// assert_eq!(Numbers::concat(&[Numbers::Single, Numbers::Single]), Numbers::Single);
    /// assert_eq!(Numbers::concat(&[Numbers::Single, Numbers::Whole]), Numbers::Mixed);
    /// ```
    pub const fn concat(parts: &[Self]) -> Self {
        let mut index = 1;
        while index < parts.len() {
            if parts[index] as u8 != parts[0] as u8 {
                return Self::Mixed;
            }
            index += 1;
        }
        if parts.is_empty() { Self::Whole } else { parts[0] }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::state::{CloudPoint, Defect, Field};

    #[test]
    fn wide_and_portable_checks_agree() {
        let mut values: Vec<f64> = (0..1_003).map(|i| f64::from(i - 500) * 1e300).collect();
        assert!(are_finite(&values) && gathered_portably(&values) == 0);
        for (index, wrong) in [(0, f64::NAN), (499, f64::INFINITY), (1_002, f64::NEG_INFINITY)] {
            let right = core::mem::replace(&mut values[index], wrong);
            assert!(!are_finite(&values) && gathered_portably(&values) != 0, "{index}");
            values[index] = right;
        }
    }

    /// Generates any bits: finite and subnormal numbers, infinities, NaNs with any payload.
    fn any_f64() -> impl Strategy<Value = f64> {
        prop_oneof![
            20 => any::<u64>().prop_map(f64::from_bits),
            60 => -1e308..1e308,
            1 => Just(f64::NAN),
            1 => Just(f64::INFINITY),
        ]
    }

    proptest! {
        #[test]
        fn written_values_are_unchanged_and_checked(
            values in proptest::collection::vec(any_f64(), 0..600),
            places in 0..600usize,
        ) {
            let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            let mut wide = vec![7.0; places];
            let mut portable = wide.clone();
            let expected = places.min(values.len());
            let valid = values[..expected].iter().all(|value| value.is_finite());
            prop_assert_eq!(write(&mut wide, values.iter().copied()), (expected, valid));
            let (count, gathered) = written_portably(&mut portable, values.iter().copied());
            prop_assert_eq!((count, gathered == 0), (expected, valid));
            for written in [&wide, &portable] {
                prop_assert_eq!(bits(&written[..expected]), bits(&values[..expected]));
                prop_assert!(written[expected..].iter().all(|value| *value == 7.0), "beyond the end");
            }
        }

        #[test]
        fn numbers_in_bulk_are_checked_as_one_by_one(
            values in proptest::collection::vec(any::<u32>().prop_map(f32::from_bits), 0..600),
        ) {
            let mut places = vec![0.0; values.len()];
            let valid = values.iter().all(|value| value.is_finite());
            prop_assert_eq!(write(&mut places, values.iter().copied()), (values.len(), valid));
            prop_assert_eq!(are_finite(&values), valid);
        }

        #[test]
        fn points_in_bulk_are_checked_as_one_by_one(
            bits in proptest::collection::vec(any::<[u32; 4]>(), 0..150),
            finite: bool,
        ) {
            let number = |bits: u32| if finite { bits as f32 } else { f32::from_bits(bits) };
            let points: Vec<CloudPoint> = bits
                .iter()
                .map(|bits| bits.map(number))
                .map(|[x, y, z, intensity]| CloudPoint { x, y, z, intensity })
                .collect();
            let one_by_one: Result<Vec<()>, Defect> = points.iter().map(Field::check).collect();
            prop_assert_eq!(CloudPoint::check_all(&points).is_ok(), one_by_one.is_ok());
        }
    }
}
