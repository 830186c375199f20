//! Sine and cosine of many angles simultaneously.
//!
//! Straight-line code without branches or tables, which the compiler vectorises. The angle is reduced by
//! three parts of pi/2 (Cody and Waite 1980). On [-pi/4, pi/4], Taylor polynomials are used; their remainder
//! is below half a unit in the last place.

use super::fused;

/// pi/2 in three parts; the first two have 33 bits, so that integer multiples up to 2^20 are exact.
const PI_2: [f64; 3] = [1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21];

/// Adding this rounds a number to an integer in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Angle beyond which the reduction is no longer exact.
const FAR: f64 = 1.0e6;

/// Number of angles computed side by side; lengths must be multiples of it.
pub(crate) const LANES: usize = 4;

/// Sines and cosines of `angles`. The three slices have the same length, a multiple of [`LANES`].
#[inline(always)]
pub(crate) fn sin_cos(angles: &[f64], sines: &mut [f64], cosines: &mut [f64]) {
    let (angles, _) = angles.as_chunks::<LANES>();
    let (sines, _) = sines.as_chunks_mut::<LANES>();
    let (cosines, _) = cosines.as_chunks_mut::<LANES>();
    for ((x, sin), cos) in angles.iter().zip(sines).zip(cosines) {
        sin_cos_abreast::<false>(x, sin, cos);
    }
}

/// Sines and cosines of a few angles.
#[inline(always)]
pub(crate) fn sin_cos_abreast<const FUSED: bool>(
    x: &[f64; LANES],
    sin: &mut [f64; LANES],
    cos: &mut [f64; LANES],
) {
    if x.iter().all(|x| x.abs() <= FAR) {
        lanes::<FUSED>(x, sin, cos);
    } else {
        // Includes NaN angles.
        for i in 0..LANES {
            (sin[i], cos[i]) = x[i].sin_cos();
        }
    }
}

#[inline(always)]
fn lanes<const FUSED: bool>(x: &[f64; LANES], sin: &mut [f64; LANES], cos: &mut [f64; LANES]) {
    for i in 0..LANES {
        let rounded = fused::<FUSED>(x[i], std::f64::consts::FRAC_2_PI, ROUND);
        let quadrant = rounded.to_bits();
        let turns = ROUND - rounded;
        let r = PI_2.iter().fold(x[i], |rest, part| fused::<FUSED>(turns, *part, rest));
        let z = r * r;
        let s = fused::<FUSED>(r * z, sine_tail::<FUSED>(z), r);
        let c = fused::<FUSED>(z * z, cosine_tail::<FUSED>(z), fused::<FUSED>(-0.5, z, 1.0));
        // Odd quadrants swap; quadrants 2 and 3 negate the sine, 1 and 2 the cosine.
        let swap = (quadrant & 1).wrapping_neg();
        let (s, c) = (s.to_bits(), c.to_bits());
        let exchange = (s ^ c) & swap;
        sin[i] = f64::from_bits((s ^ exchange) ^ ((quadrant & 2) << 62));
        cos[i] = f64::from_bits((c ^ exchange) ^ ((quadrant.wrapping_add(1) & 2) << 62));
    }
}

/// (sin r / r - 1) / z for z = r^2.
#[inline(always)]
fn sine_tail<const FUSED: bool>(z: f64) -> f64 {
    const C: [f64; 8] = [
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5_040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 1_307_674_368_000.0,
        1.0 / 355_687_428_096_000.0,
    ];
    polynomial::<FUSED>(&C, z)
}

/// (cos r - 1 + z/2) / z^2 for z = r^2.
#[inline(always)]
fn cosine_tail<const FUSED: bool>(z: f64) -> f64 {
    const C: [f64; 8] = [
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 20_922_789_888_000.0,
        -1.0 / 6_402_373_705_728_000.0,
    ];
    polynomial::<FUSED>(&C, z)
}

/// Estrin's scheme: half the depth of Horner's.
#[inline(always)]
fn polynomial<const FUSED: bool>(c: &[f64; 8], z: f64) -> f64 {
    let z2 = z * z;
    let z4 = z2 * z2;
    let pair = |low: usize| fused::<FUSED>(c[low + 1], z, c[low]);
    let low = fused::<FUSED>(pair(2), z2, pair(0));
    fused::<FUSED>(fused::<FUSED>(pair(6), z2, pair(4)), z4, low)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both(x: f64) -> (f64, f64) {
        let (mut sin, mut cos) = ([0.0; LANES], [0.0; LANES]);
        sin_cos(&[x; LANES], &mut sin, &mut cos);
        (sin[0], cos[0])
    }

    /// As on processors with fused multiply-add.
    fn fusing(x: f64) -> (f64, f64) {
        let (mut sin, mut cos) = ([0.0; LANES], [0.0; LANES]);
        sin_cos_abreast::<true>(&[x; LANES], &mut sin, &mut cos);
        (sin[0], cos[0])
    }

    #[test]
    fn sine_and_cosine_match_std_within_two_ulps() {
        for step in 0..2_000_000 {
            let x = f64::from(step - 1_000_000) * 1e-4 * std::f64::consts::PI;
            for x in [x, x * 1e-3, x * 1e-9, x * 1e2] {
                for (sin, cos) in [both(x), fusing(x)] {
                    assert!((sin - x.sin()).abs() <= 2.3e-16, "sin {x:e}: {sin:e}");
                    assert!((cos - x.cos()).abs() <= 2.3e-16, "cos {x:e}: {cos:e}");
                }
            }
        }
    }

    #[test]
    fn small_angles_keep_their_relative_accuracy() {
        for exponent in 1..300 {
            let x = 10_f64.powi(-exponent);
            for (sin, _) in [both(x), fusing(x)] {
                assert!((sin / x.sin() - 1.0).abs() < 3e-16, "{x:e}");
            }
        }
    }

    #[test]
    fn large_angles_and_nan_use_the_standard_library() {
        for x in [1e7, -3.3e12] {
            assert_eq!(both(x), x.sin_cos());
        }
        assert!(both(f64::NAN).0.is_nan() && both(f64::INFINITY).1.is_nan());
    }
}
