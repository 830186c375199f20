//! An exponential that the compiler can vectorise.

use std::f64::consts::LOG2_E;

/// Smallest exponent that is evaluated; smaller ones return the value at this exponent, which is negligible
/// compared with 1.
const LEAST: f64 = -690.0;

/// `exp(x)` for `x <= 0` to within two units in the last place, without branches or calls.
///
/// `x = n ln 2 + r`, `|r| <= ln(2) / 2`; `exp(r)` by its Taylor series to the twelfth power (remainder
/// 2e-16), times `2^n` put into the exponent bits.
#[inline(always)]
pub(super) fn exp_of_negative(x: f64) -> f64 {
    // adding it rounds to an integer, which ends up in the lowest bits
    const ROUNDER: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let x = if x > LEAST { x } else { LEAST };
    let rounded = x * LOG2_E + ROUNDER;
    let n = rounded - ROUNDER;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    let mut sum = 1.0 / 479_001_600.0;
    for factor in [
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ] {
        sum = sum * r + factor;
    }
    sum * f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_std_exp_within_two_ulps() {
        for k in 0..200_000 {
            let x = -f64::from(k) * 3.4e-3;
            let (found, expected) = (exp_of_negative(x), x.exp());
            assert!((found - expected).abs() <= 2.0 * f64::EPSILON * expected, "at {x}: {found} {expected}");
        }
    }

    #[test]
    fn very_negative_exponents_give_normal_numbers_near_zero() {
        for x in [-700.0, -1e9, f64::NEG_INFINITY] {
            let value = exp_of_negative(x);
            assert!(value.is_normal() && value < 1e-299, "{value}");
        }
    }
}
