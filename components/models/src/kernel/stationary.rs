//! Stationary kernels: their parameters, and rows of covariances, computed by loops over contiguous memory.

use motorium_algebra::Simd;
use serde::{Deserialize, Serialize};

use super::Points;

/// Variance and length scales of a stationary kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stationary {
    /// Variance.
    pub variance: f64,
    /// Length scales in units of the input: one for all dimensions, or one for each dimension (automatic
    /// relevance determination).
    pub lengths: Vec<f64>,
}

impl Stationary {
    /// Creates the parameters of a stationary kernel.
    pub fn new(variance: f64, lengths: &[f64]) -> Self {
        Self { variance, lengths: lengths.to_vec() }
    }

    pub(super) fn length(&self, dimension: usize) -> f64 {
        if self.lengths.len() == 1 { self.lengths[0] } else { self.lengths[dimension] }
    }
}

/// The function of the squared distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Profile {
    Rbf,
    Matern32,
    Matern52,
}

const SQRT_3: f64 = 1.732_050_807_568_877_2;
const SQRT_5: f64 = 2.236_067_977_499_79;

/// `exp(x)` for `x <= 0`, to one unit in the last place, in a form that compiles to vector instructions.
/// Every operation rounds once, so the bits do not depend on the width of the instructions.
#[inline(always)]
fn exp(x: f64) -> f64 {
    // below, the result is subnormal
    let x = if x < -708.0 { -708.0 } else { x };
    // adding this leaves an integer in the lowest bits of the mantissa
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let shifted = x.mul_add(std::f64::consts::LOG2_E, ROUND);
    let k = shifted - ROUND;
    let r = k.mul_add(-1.908_214_929_270_587_7e-10, k.mul_add(-6.931_471_803_691_238e-1, x));
    let mut sum: f64 = 1.0 / 6_227_020_800.0;
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
        sum = sum.mul_add(r, factor);
    }
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    sum * power
}

/// Writes the squared distances of a query from the points starting at `first`, scaled by the lengths.
#[inline(always)]
fn distances(s: &Stationary, query: &[f64], points: &Points, first: usize, out: &mut [f64]) {
    out.fill(0.0);
    let z = |d: usize| &points.coordinate(d)[first..];
    let mut d = 0;
    while d + 1 < query.len() {
        let (x, y, by_x, by_y) = (query[d], query[d + 1], 1.0 / s.length(d), 1.0 / s.length(d + 1));
        for ((out, z), w) in out.iter_mut().zip(z(d)).zip(z(d + 1)) {
            let (a, b) = ((x - z) * by_x, (y - w) * by_y);
            *out = b.mul_add(b, a.mul_add(a, *out));
        }
        d += 2;
    }
    if d < query.len() {
        let (x, inverse) = (query[d], 1.0 / s.length(d));
        for (out, z) in out.iter_mut().zip(z(d)) {
            let a = (x - z) * inverse;
            *out = a.mul_add(a, *out);
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

/// Writes the covariances of a query with the points starting at `first`, and their derivatives with respect
/// to `r^2 / 2`.
pub(super) fn row_with_slopes(
    profile: Profile,
    s: &Stationary,
    query: &[f64],
    points: &Points,
    first: usize,
    (out, slopes): (&mut [f64], &mut [f64]),
) {
    Simd::new().run(
        #[inline(always)]
        || {
            distances(s, query, points, first, out);
            let both = out.iter_mut().zip(slopes);
            match profile {
                Profile::Rbf => both.for_each(|(out, slope)| {
                    *out = s.variance * exp(-0.5 * *out);
                    *slope = -*out;
                }),
                Profile::Matern32 => both.for_each(|(out, slope)| {
                    let r = SQRT_3 * out.sqrt();
                    let decay = s.variance * exp(-r);
                    *out = (1.0 + r) * decay;
                    *slope = -3.0 * decay;
                }),
                Profile::Matern52 => both.for_each(|(out, slope)| {
                    let r = SQRT_5 * out.sqrt();
                    let decay = s.variance * exp(-r);
                    *out = (1.0 + r + r * r / 3.0) * decay;
                    *slope = -5.0 / 3.0 * (1.0 + r) * decay;
                }),
            }
        },
    );
}

/// Number of points whose slopes are weighted in one pass.
const CHUNK: usize = 256;

/// Adds the gradients of `sum_b weights[b] k(query, points[first + b])`: with respect to the logarithms of
/// the parameters to `parameters`, and with respect to the points to `by_points` (dimension by dimension,
/// `points.len()` each). The query is point `first`. `slopes` are the derivatives with respect to `r^2 / 2`.
pub(super) fn gradient(
    s: &Stationary,
    query: &[f64],
    points: &Points,
    first: usize,
    values: &[f64],
    slopes: &[f64],
    weights: &[f64],
    parameters: &mut [f64],
    by_points: Option<&mut [f64]>,
) {
    let simd = Simd::new();
    parameters[0] += simd.dot(values, weights);
    let count = points.len();
    simd.run(
        #[inline(always)]
        || {
            let mut by_points = by_points;
            let mut products = [0.0; CHUNK];
            for (c, (slopes, weights)) in slopes.chunks(CHUNK).zip(weights.chunks(CHUNK)).enumerate() {
                let products = &mut products[..weights.len()];
                for ((product, slope), weight) in products.iter_mut().zip(slopes).zip(weights) {
                    *product = slope * weight;
                }
                let start = first + c * CHUNK;
                for (d, x) in query.iter().enumerate() {
                    let inverse = 1.0 / s.length(d);
                    let inverse = inverse * inverse;
                    let z = &points.coordinate(d)[start..][..products.len()];
                    let index = if s.lengths.len() == 1 { 0 } else { d };
                    let by_length = if let Some(by_points) = by_points.as_deref_mut() {
                        let out = &mut by_points[d * count..(d + 1) * count];
                        let (by_length, own) = pulls(*x, z, products, inverse, &mut out[start..][..z.len()]);
                        out[first] += own;
                        by_length
                    } else {
                        squares(*x, z, products) * inverse
                    };
                    parameters[1 + index] -= by_length;
                }
            }
        },
    );
}

/// `sum_b products[b] (x - z_b)^2`.
#[inline(always)]
fn squares(x: f64, z: &[f64], products: &[f64]) -> f64 {
    let mut sums = [0.0_f64; 16];
    let (z, z_rest) = z.as_chunks::<16>();
    let (products, products_rest) = products.as_chunks::<16>();
    for (z, product) in z.iter().zip(products) {
        for i in 0..16 {
            let difference = x - z[i];
            sums[i] = (product[i] * difference).mul_add(difference, sums[i]);
        }
    }
    for ((z, product), sum) in z_rest.iter().zip(products_rest).zip(&mut sums) {
        let difference = x - z;
        *sum = (product * difference).mul_add(difference, *sum);
    }
    sums.iter().sum()
}

/// Subtracts `products[b] (x - z_b) inverse` from `out`. Returns the sum of these terms times `x - z_b`, and
/// the sum of these terms.
#[inline(always)]
fn pulls(x: f64, z: &[f64], products: &[f64], inverse: f64, out: &mut [f64]) -> (f64, f64) {
    let (mut sums, mut by_length) = ([0.0_f64; 8], [0.0_f64; 8]);
    let (z, z_rest) = z.as_chunks::<8>();
    let (products, products_rest) = products.as_chunks::<8>();
    let (out, out_rest) = out.as_chunks_mut::<8>();
    for ((z, product), out) in z.iter().zip(products).zip(out) {
        for i in 0..8 {
            let difference = x - z[i];
            let pull = product[i] * difference * inverse;
            out[i] -= pull;
            sums[i] += pull;
            by_length[i] = pull.mul_add(difference, by_length[i]);
        }
    }
    for (i, ((z, product), out)) in z_rest.iter().zip(products_rest).zip(out_rest).enumerate() {
        let difference = x - z;
        let pull = product * difference * inverse;
        *out -= pull;
        sums[i] += pull;
        by_length[i] = pull.mul_add(difference, by_length[i]);
    }
    (by_length.iter().sum(), sums.iter().sum())
}

#[cfg(test)]
mod tests {
    #[test]
    fn exponentials_match_the_standard_library() {
        for i in 0..200_000 {
            let x = -0.003_54 * f64::from(i);
            let (found, expected) = (super::exp(x), x.exp());
            assert!((found - expected).abs() <= 6e-16 * expected, "{x}: {found:e} {expected:e}");
        }
        assert_eq!(super::exp(0.0), 1.0);
        assert!(super::exp(-1e9) < 1e-300);
    }
}
