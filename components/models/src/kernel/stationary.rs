//! Rows of stationary kernels, computed as loops over contiguous points.

use motorium_algebra::Simd;

use super::{Points, Stationary};

/// The function of the squared distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Profile {
    Rbf,
    Matern32,
    Matern52,
}

const SQRT_3: f64 = 1.732_050_807_568_877_2;
const SQRT_5: f64 = 2.236_067_977_499_79;

/// `exp(x)` for `x <= 0`, to two units in the last place, in a form that compiles to vector instructions.
#[inline(always)]
fn exp(x: f64) -> f64 {
    // below, the result is subnormal
    let x = if x < -708.0 { -708.0 } else { x };
    // adding this leaves an integer in the lowest bits of the mantissa
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (x - k * 6.931_471_803_691_238e-1) - k * 1.908_214_929_270_587_7e-10;
    let mut sum = 1.0 / 6_227_020_800.0;
    for factor in [
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
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
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    sum * power
}

#[inline(always)]
fn distances(s: &Stationary, query: &[f64], points: &Points, first: usize, out: &mut [f64]) {
    out.fill(0.0);
    for (d, x) in query.iter().enumerate() {
        let inverse = 1.0 / s.length(d);
        for (out, z) in out.iter_mut().zip(&points.coordinate(d)[first..]) {
            let distance = (x - z) * inverse;
            *out += distance * distance;
        }
    }
}

/// Writes the covariances of a query with the points starting at `first`.
pub(super) fn row(
    profile: Profile,
    s: &Stationary,
    query: &[f64],
    points: &Points,
    first: usize,
    out: &mut [f64],
) {
    Simd::new().run(
        #[inline(always)]
        || {
            distances(s, query, points, first, out);
            match profile {
                Profile::Rbf => out.iter_mut().for_each(|out| *out = s.variance * exp(-0.5 * *out)),
                Profile::Matern32 => out.iter_mut().for_each(|out| {
                    let r = SQRT_3 * out.sqrt();
                    *out = s.variance * (1.0 + r) * exp(-r);
                }),
                Profile::Matern52 => out.iter_mut().for_each(|out| {
                    let r = SQRT_5 * out.sqrt();
                    *out = s.variance * (1.0 + r + r * r / 3.0) * exp(-r);
                }),
            }
        },
    );
}

/// Converts the values of a row to derivatives with respect to `r^2 / 2`.
#[inline(always)]
fn derivatives(
    profile: Profile,
    s: &Stationary,
    query: &[f64],
    points: &Points,
    first: usize,
    row: &mut [f64],
) {
    distances(s, query, points, first, row);
    match profile {
        Profile::Rbf => row.iter_mut().for_each(|out| *out = -s.variance * exp(-0.5 * *out)),
        Profile::Matern32 => {
            row.iter_mut().for_each(|out| *out = -3.0 * s.variance * exp(-SQRT_3 * out.sqrt()));
        }
        Profile::Matern52 => row.iter_mut().for_each(|out| {
            let r = SQRT_5 * out.sqrt();
            *out = -5.0 / 3.0 * s.variance * (1.0 + r) * exp(-r);
        }),
    }
}

/// Adds the gradients of `sum_b weights[b] k(query, points[first + b])`: by the logarithms of the parameters
/// to `parameters`, by the points to `by_points` (dimension by dimension, `points.len()` each), where the
/// query is point `first`.
#[expect(clippy::too_many_arguments, reason = "the pieces of one loop")]
pub(super) fn gradient(
    profile: Profile,
    s: &Stationary,
    query: &[f64],
    points: &Points,
    first: usize,
    values: &[f64],
    weights: &[f64],
    parameters: &mut [f64],
    by_points: Option<&mut [f64]>,
    scratch: &mut [f64],
) {
    let simd = Simd::new();
    parameters[0] += simd.dot(values, weights);
    let count = points.len();
    simd.run(
        #[inline(always)]
        || {
            if profile == Profile::Rbf {
                scratch.iter_mut().zip(values).for_each(|(out, value)| *out = -value);
            } else {
                derivatives(profile, s, query, points, first, scratch);
            }
            scratch.iter_mut().zip(weights).for_each(|(out, weight)| *out *= weight);
            let mut by_points = by_points;
            for (d, x) in query.iter().enumerate() {
                let inverse = 1.0 / s.length(d);
                let inverse = inverse * inverse;
                let z = &points.coordinate(d)[first..];
                let mut sums = [0.0; 8];
                let mut by_length = [0.0; 8];
                if let Some(by_points) = by_points.as_deref_mut() {
                    let out = &mut by_points[d * count + first..(d + 1) * count];
                    let n = scratch.len() / 8 * 8;
                    for ((out, z), h) in
                        out.chunks_exact_mut(8).zip(z.chunks_exact(8)).zip(scratch.chunks_exact(8))
                    {
                        for i in 0..8 {
                            let difference = x - z[i];
                            let pull = h[i] * difference * inverse;
                            out[i] -= pull;
                            sums[i] += pull;
                            by_length[i] += pull * difference;
                        }
                    }
                    for i in n..scratch.len() {
                        let difference = x - z[i];
                        let pull = scratch[i] * difference * inverse;
                        out[i] -= pull;
                        sums[0] += pull;
                        by_length[0] += pull * difference;
                    }
                    out[0] += sums.iter().sum::<f64>();
                } else {
                    let n = scratch.len() / 8 * 8;
                    for (z, h) in z.chunks_exact(8).zip(scratch.chunks_exact(8)) {
                        for i in 0..8 {
                            let difference = x - z[i];
                            by_length[i] += h[i] * difference * difference * inverse;
                        }
                    }
                    for i in n..scratch.len() {
                        let difference = x - z[i];
                        by_length[0] += scratch[i] * difference * difference * inverse;
                    }
                }
                let index = if s.lengths.len() == 1 { 0 } else { d };
                parameters[1 + index] -= by_length.iter().sum::<f64>();
            }
        },
    );
}

#[cfg(test)]
mod tests {
    #[test]
    fn exponentials_equal_those_of_the_standard_library() {
        for i in 0..200_000 {
            let x = -0.003_54 * f64::from(i);
            let (found, expected) = (super::exp(x), x.exp());
            assert!((found - expected).abs() <= 6e-16 * expected, "{x}: {found:e} {expected:e}");
        }
        assert_eq!(super::exp(0.0), 1.0);
        assert!(super::exp(-1e9) < 1e-300);
    }
}
