//! Arithmetic of networks: single precision for use, double precision for reference computations and
//! simulated actuators.
//!
//! The functions on `f32` use only additions, multiplications, divisions and fused multiply-adds, each
//! rounded once, so that they vectorise and give the same bits on every processor.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

use pulp::Simd;

/// A scalar type of a network: `f32`, or `f64` for reference computations.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// Converts `value` to this type, rounded to the nearest number.
    fn from_f64(value: f64) -> Self;
    /// Converts to `f64` without rounding.
    fn to_f64(self) -> f64;
    /// Converts `value` to this type without rounding.
    fn from_f32(value: f32) -> Self;
    /// Returns `self * a + b`, rounded once.
    #[must_use]
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// Returns `exp(self)`. For `f32`, a result above the largest finite power of two is limited to that
    /// power.
    #[must_use]
    fn exp(self) -> Self;
    /// Returns `exp(self) - 1`, accurate near 0.
    #[must_use]
    fn exp_m1(self) -> Self;
    /// Returns the hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self;
    /// Returns `ln(1 + self)`.
    #[must_use]
    fn ln_1p(self) -> Self;
    /// Returns the square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Returns `self` to the power of `exponent`.
    #[must_use]
    fn powf(self, exponent: Self) -> Self;
    /// Returns the larger number. If one number is NaN, returns the other.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// Returns `1 / (1 + exp(-self))`.
    #[must_use]
    #[inline(always)]
    fn sigmoid(self) -> Self {
        let one = Self::from_f64(1.0);
        one / (one + (-self).exp())
    }
    /// Returns the larger number. If `self` is NaN, returns `other`.
    #[must_use]
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    /// Returns `true` if this value is NaN.
    #[inline(always)]
    fn is_nan(self) -> bool {
        self.partial_cmp(&self).is_none()
    }
    /// Returns the absolute value.
    #[must_use]
    #[inline(always)]
    fn magnitude(self) -> Self {
        if self < Self::default() { -self } else { self }
    }
}

/// Returns `p`, the power of two closest to `exp(x)`, and `exp(x) / p - 1`.
#[inline(always)]
fn exp_parts(x: f32) -> (f32, f32) {
    /// Adding this constant to a number rounds the number to an integer, which is then in the lowest bits of
    /// the sum.
    const ROUND: f32 = 12_582_912.0;
    let x = x.clamp(-87.0, 88.3);
    let rounded = x.mul_add(core::f32::consts::LOG2_E, ROUND);
    let n = rounded - ROUND;
    let r = (-n).mul_add(0.693_359_4, x);
    let r = (-n).mul_add(-2.121_944_4e-4, r);
    let q = r.mul_add(1.0 / 5040.0, 1.0 / 720.0);
    let q = q.mul_add(r, 1.0 / 120.0);
    let q = q.mul_add(r, 1.0 / 24.0);
    let q = q.mul_add(r, 1.0 / 6.0);
    let q = q.mul_add(r, 0.5);
    let power = f32::from_bits(rounded.to_bits().wrapping_add(127) << 23);
    (power, (r * r).mul_add(q, r))
}

/// Implements methods of [`Real`] by the inherent functions of the same names.
macro_rules! inherent {
    ($($name:ident($($argument:ident),*)),*) => {$(
        #[inline(always)]
        fn $name(self $(, $argument: Self)*) -> Self {
            self.$name($($argument),*)
        }
    )*};
}

impl Real for f32 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as Self
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn from_f32(value: f32) -> Self {
        value
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let (power, rest) = exp_parts(self);
        power.mul_add(rest, power)
    }
    #[inline(always)]
    fn exp_m1(self) -> Self {
        let (power, rest) = exp_parts(self);
        power.mul_add(rest, power - 1.0)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        // beyond 10 the result is 1 to the last bit
        let e = Real::exp_m1(2.0 * self.abs().min(10.0));
        let value = (e / (e + 2.0)).copysign(self);
        if self.is_nan() { self } else { value }
    }
    inherent!(mul_add(a, b), ln_1p(), sqrt(), powf(exponent), max(other));
}

impl Real for f64 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
    #[inline(always)]
    fn from_f32(value: f32) -> Self {
        f64::from(value)
    }
    inherent!(mul_add(a, b), exp(), exp_m1(), tanh(), ln_1p(), sqrt(), powf(exponent), max(other));
}

/// A scalar type with SIMD vectors.
pub trait Lanes: Real + Send + Sync + 'static {
    /// A vector of the instruction set `S`.
    type Vector<S: Simd>: Copy;
    /// Count of numbers that fit in a cache line of 64 bytes.
    const LINE: usize = 64 / size_of::<Self>();
    /// Returns the numbers as vectors; a remainder shorter than a vector is omitted.
    fn vectors<S: Simd>(numbers: &[Self]) -> &[Self::Vector<S>];
    /// Returns the numbers as writable vectors; a remainder shorter than a vector is omitted.
    fn vectors_mut<S: Simd>(numbers: &mut [Self]) -> &mut [Self::Vector<S>];
    /// Returns the number of lanes of a vector.
    fn lanes<S: Simd>() -> usize;
    /// Returns a vector with `self` in every lane.
    fn splat<S: Simd>(self, simd: S) -> Self::Vector<S>;
    /// Returns `a * b + c` in every lane, rounded once.
    fn mul_add_vectors<S: Simd>(
        simd: S,
        a: Self::Vector<S>,
        b: Self::Vector<S>,
        c: Self::Vector<S>,
    ) -> Self::Vector<S>;
}

/// Implements [`Lanes`] by the functions of `pulp` for a type.
macro_rules! lanes {
    ($scalar:ty, $vector:ident, $lanes:ident, $as:ident, $as_mut:ident, $splat:ident, $mul_add:ident) => {
        impl Lanes for $scalar {
            type Vector<S: Simd> = S::$vector;
            #[inline(always)]
            fn vectors<S: Simd>(numbers: &[Self]) -> &[S::$vector] {
                S::$as(numbers).0
            }
            #[inline(always)]
            fn vectors_mut<S: Simd>(numbers: &mut [Self]) -> &mut [S::$vector] {
                S::$as_mut(numbers).0
            }
            #[inline(always)]
            fn lanes<S: Simd>() -> usize {
                S::$lanes
            }
            #[inline(always)]
            fn splat<S: Simd>(self, simd: S) -> S::$vector {
                simd.$splat(self)
            }
            #[inline(always)]
            fn mul_add_vectors<S: Simd>(simd: S, a: S::$vector, b: S::$vector, c: S::$vector) -> S::$vector {
                simd.$mul_add(a, b, c)
            }
        }
    };
}

lanes!(f32, f32s, F32_LANES, as_simd_f32s, as_mut_simd_f32s, splat_f32s, mul_add_f32s);
lanes!(f64, f64s, F64_LANES, as_simd_f64s, as_mut_simd_f64s, splat_f64s, mul_add_f64s);

#[cfg(test)]
mod tests {
    use super::Real;

    #[test]
    fn single_precision_functions_match_double_precision() {
        for k in -4000..=4000 {
            let x = k as f32 * 0.01;
            let wide = f64::from(x);
            let close = |found: f32, expected: f64| {
                let error = (f64::from(found) - expected).abs();
                assert!(error <= 4e-7 * expected.abs() + 1e-37, "{x}: {found} {expected}");
            };
            close(Real::exp(x), wide.exp());
            close(Real::exp_m1(x), wide.exp_m1());
            close(Real::tanh(x), wide.tanh());
            close(Real::sigmoid(x), 1.0 / (1.0 + (-wide).exp()));
        }
        assert_eq!(Real::tanh(50.0_f32), 1.0);
        assert_eq!(Real::tanh(-0.0_f32).to_bits(), (-0.0_f32).to_bits());
        assert!(Real::tanh(f32::NAN).is_nan() && Real::exp(f32::NAN).is_nan());
        assert!(Real::exp(1000.0_f32).is_finite());
    }
}
