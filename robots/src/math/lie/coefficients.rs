//! The scalar functions of the angle `t` in exponentials and Jacobians. Below [`SEAM`], each function is
//! computed by its power series.

/// Angle \[rad\] below which the series are used. There, a closed form loses up to two digits, and twelve
/// terms of the series lose none.
const SEAM: f64 = 1.5;

const TERMS: usize = 12;

/// `sum (-1)^k z^k / (2k + first)!`, each term multiplied by `k + 1` if `weighted`.
const fn series(first: u32, weighted: bool) -> [f64; TERMS] {
    let mut coefficients = [0.0; TERMS];
    let (mut k, mut sign) = (0, 1.0);
    while k < TERMS {
        let mut factorial = 1.0;
        let mut factor = 2;
        while factor <= 2 * k as u32 + first {
            factorial *= factor as f64;
            factor += 1;
        }
        let weight = if weighted { (k + 1) as f64 } else { 1.0 };
        coefficients[k] = sign * weight / factorial;
        sign = -sign;
        k += 1;
    }
    coefficients
}

const A: [f64; TERMS] = series(2, false);
const B: [f64; TERMS] = series(3, false);
const C: [f64; TERMS] = series(4, false);
const D: [f64; TERMS] = series(5, true);
const A_SLOPE: [f64; TERMS] = series(4, true);

/// `|B_2k| / (2k)!` for k = 1, 2 ..., with the Bernoulli numbers `B_2k`.
const COTANGENT: [f64; 11] = [
    1.0 / 12.0,
    1.0 / 720.0,
    1.0 / 30_240.0,
    1.0 / 1_209_600.0,
    1.0 / 47_900_160.0,
    691.0 / 1_307_674_368_000.0,
    1.0 / 74_724_249_600.0,
    3_617.0 / 10_670_622_842_880_000.0,
    43_867.0 / 5_109_094_217_170_944_000.0,
    174_611.0 / 802_857_662_698_291_200_000.0,
    77_683.0 / 14_101_100_039_391_805_440_000.0,
];

fn polynomial(coefficients: &[f64], z: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * z + coefficient)
}

/// `(1 - cos t) / t^2` and `(t - sin t) / t^3`.
pub(super) fn left(t: f64) -> (f64, f64) {
    let z = t * t;
    if t < SEAM {
        (polynomial(&A, z), polynomial(&B, z))
    } else {
        let half = (0.5 * t).sin() / t;
        (2.0 * half * half, (t - t.sin()) / (z * t))
    }
}

/// `(1 - (t/2) cot(t/2)) / t^2`. Finite at pi, infinite at 2 pi.
pub(super) fn left_inverse(t: f64) -> f64 {
    let z = t * t;
    if t < 1.0 { polynomial(&COTANGENT, z) } else { z.recip() - 0.5 / (t * (0.5 * t).tan()) }
}

/// `(t - sin t) / t^3`, `(t^2 + 2 cos t - 2) / (2 t^4)`, `(2 t - 3 sin t + t cos t) / (2 t^5)`.
pub(super) fn coupling(t: f64) -> (f64, f64, f64) {
    let z = t * t;
    if t < SEAM {
        (polynomial(&B, z), polynomial(&C, z), polynomial(&D, z))
    } else {
        let (sin, cos) = t.sin_cos();
        (
            (t - sin) / (z * t),
            (z + 2.0 * cos - 2.0) / (2.0 * z * z),
            (2.0 * t - 3.0 * sin + t * cos) / (2.0 * z * z * t),
        )
    }
}

/// Derivatives of both results of [`left`] with respect to `t`, divided by `t`.
pub(super) fn left_slopes(t: f64) -> (f64, f64) {
    let z = t * t;
    if t < SEAM {
        (-2.0 * polynomial(&A_SLOPE, z), -2.0 * polynomial(&D, z))
    } else {
        let (a, b) = left(t);
        ((t.sin() / t - 2.0 * a) / z, (a - 3.0 * b) / z)
    }
}
