//! Sine and cosine of many angles at once.
//!
//! Straight-line code without branches or table look-ups, so that the compiler computes several angles side by side.
//! Reduction by three parts of pi/2 (Cody and Waite 1980), then Taylor polynomials on [-pi/4, pi/4] whose remainder is
//! below half a unit in the last place.

/// pi/2 in three parts; the first two have 33 bits, so that whole multiples up to 2^20 are exact.
const PI_2: [f64; 3] = [1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21];

/// Adding this leaves a number rounded to an integer, which stands in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Beyond this angle the reduction is no longer exact.
const FAR: f64 = 1.0e6;

/// Angles computed side by side; lengths must be multiples of this.
pub(crate) const LANES: usize = 4;

/// Sines and cosines of `angles`. The three slices have the same length, a multiple of [`LANES`].
#[inline(always)]
pub(crate) fn sin_cos(angles: &[f64], sines: &mut [f64], cosines: &mut [f64]) {
    let (angles, _) = angles.as_chunks::<LANES>();
    let (sines, _) = sines.as_chunks_mut::<LANES>();
    let (cosines, _) = cosines.as_chunks_mut::<LANES>();
    for ((x, sin), cos) in angles.iter().zip(sines).zip(cosines) {
        if x.iter().all(|x| x.abs() <= FAR) {
            lanes(x, sin, cos);
        } else {
            // Also where an angle is not a number.
            for i in 0..LANES {
                (sin[i], cos[i]) = x[i].sin_cos();
            }
        }
    }
}

#[inline(always)]
fn lanes(x: &[f64; LANES], sin: &mut [f64; LANES], cos: &mut [f64; LANES]) {
    for i in 0..LANES {
        let rounded = x[i] * std::f64::consts::FRAC_2_PI + ROUND;
        let quadrant = rounded.to_bits();
        let turns = rounded - ROUND;
        let r = ((x[i] - turns * PI_2[0]) - turns * PI_2[1]) - turns * PI_2[2];
        let z = r * r;
        let s = r + r * z * sine_tail(z);
        let c = 1.0 - 0.5 * z + z * z * cosine_tail(z);
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
fn sine_tail(z: f64) -> f64 {
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
    polynomial(&C, z)
}

/// (cos r - 1 + z/2) / z^2 for z = r^2.
#[inline(always)]
fn cosine_tail(z: f64) -> f64 {
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
    polynomial(&C, z)
}

/// Estrin's scheme: half the depth of Horner's.
#[inline(always)]
fn polynomial(c: &[f64; 8], z: f64) -> f64 {
    let z2 = z * z;
    let z4 = z2 * z2;
    ((c[0] + c[1] * z) + (c[2] + c[3] * z) * z2) + ((c[4] + c[5] * z) + (c[6] + c[7] * z) * z2) * z4
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both(x: f64) -> (f64, f64) {
        let (mut sin, mut cos) = ([0.0; LANES], [0.0; LANES]);
        sin_cos(&[x; LANES], &mut sin, &mut cos);
        (sin[0], cos[0])
    }

    #[test]
    fn sine_and_cosine_agree_with_the_standard_library_to_two_units_in_the_last_place_of_one() {
        for step in 0..2_000_000 {
            let x = f64::from(step - 1_000_000) * 1e-4 * std::f64::consts::PI;
            for x in [x, x * 1e-3, x * 1e-9, x * 1e2] {
                let (sin, cos) = both(x);
                assert!((sin - x.sin()).abs() <= 2.3e-16, "sin {x:e}: {sin:e}");
                assert!((cos - x.cos()).abs() <= 2.3e-16, "cos {x:e}: {cos:e}");
            }
        }
    }

    #[test]
    fn small_angles_keep_their_relative_accuracy() {
        for exponent in 1..300 {
            let x = 10_f64.powi(-exponent);
            assert!((both(x).0 / x.sin() - 1.0).abs() < 3e-16, "{x:e}");
        }
    }

    #[test]
    fn far_angles_and_faults_go_to_the_standard_library() {
        for x in [1e7, -3.3e12] {
            assert_eq!(both(x), x.sin_cos());
        }
        assert!(both(f64::NAN).0.is_nan() && both(f64::INFINITY).1.is_nan());
    }
}
