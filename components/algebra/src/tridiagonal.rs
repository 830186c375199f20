//! Tridiagonalisation of a symmetric matrix by reflections.

use nalgebra::DMatrix;

use super::Simd;

/// Decomposition `A = H T H^T`, with `H` a product of reflections and `T` tridiagonal.
pub(super) struct Tridiagonal {
    /// The diagonal of `T`.
    pub(super) diagonal: Vec<f64>,
    /// The off-diagonal entries of `T`.
    pub(super) beside: Vec<f64>,
    /// Below the diagonal, column k: the vector of reflection k.
    reflections: DMatrix<f64>,
    /// The factor of each reflection: `I - factor v v^T`.
    factors: Vec<f64>,
}

impl Tridiagonal {
    /// Reduces a symmetric matrix; only the lower triangle is read.
    pub(super) fn new(mut matrix: DMatrix<f64>, simd: Simd) -> Self {
        let n = matrix.nrows();
        let (mut diagonal, mut beside, mut factors) =
            (vec![0.0; n], vec![0.0; n.saturating_sub(1)], Vec::new());
        let (mut v, mut w) = (vec![0.0; n], vec![0.0; n]);
        let a = matrix.as_mut_slice();
        for k in 0..n.saturating_sub(1) {
            let m = n - k - 1;
            let (v, w) = (&mut v[..m], &mut w[..m]);
            let column = &mut a[k * n + k + 1..(k + 1) * n];
            v.copy_from_slice(column);
            let (factor, end) = reflection(v);
            column.copy_from_slice(v);
            factors.push(factor);
            beside[k] = end;
            if factor == 0.0 {
                continue;
            }
            // w = factor A v, from the lower triangle
            w.fill(0.0);
            for j in 0..m {
                let column = &a[(k + 1 + j) * n + k + 1 + j..(k + 2 + j) * n];
                let (head, rest) = w.split_at_mut(j + 1);
                head[j] += column[0] * v[j] + simd.add_scaled_and_dot(v[j], &column[1..], rest, &v[j + 1..]);
            }
            w.iter_mut().for_each(|w| *w *= factor);
            let half = -0.5 * factor * simd.dot(v, w);
            simd.add_scaled(half, v, w);
            for j in 0..m {
                let column = &mut a[(k + 1 + j) * n + k + 1 + j..(k + 2 + j) * n];
                simd.subtract_two(w[j], &v[j..], v[j], &w[j..], column);
            }
        }
        for (k, entry) in diagonal.iter_mut().enumerate() {
            *entry = a[k * n + k];
        }
        Self { diagonal, beside, reflections: matrix, factors }
    }

    /// Transforms the eigenvectors of `T`, one per column, into eigenvectors of `A`.
    pub(super) fn apply(&self, vectors: &mut DMatrix<f64>, simd: Simd) {
        let n = self.reflections.nrows();
        let a = self.reflections.as_slice();
        for column in vectors.as_mut_slice().chunks_exact_mut(n.max(1)) {
            for (k, &factor) in self.factors.iter().enumerate().rev() {
                if factor != 0.0 {
                    let v = &a[k * n + k + 1..(k + 1) * n];
                    let rows = &mut column[k + 1..];
                    let along = simd.dot(v, rows);
                    simd.add_scaled(-factor * along, v, rows);
                }
            }
        }
    }
}

/// Computes the reflection that maps `x` to a multiple of the first unit vector. Overwrites `x` with the
/// reflection's vector; returns its factor and the remaining entry.
fn reflection(x: &mut [f64]) -> (f64, f64) {
    let scale = x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let rest = x[1..].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if rest == 0.0 {
        return (0.0, x[0]);
    }
    let norm = scale * x.iter().map(|x| (x / scale).powi(2)).sum::<f64>().sqrt();
    let end = -norm.copysign(x[0]);
    let first = x[0] - end;
    x[0] = 1.0;
    x[1..].iter_mut().for_each(|x| *x /= first);
    (-first / end, end)
}
