//! Inner loops with the widest vector instructions of the machine, selected at run time.

use pulp::{Arch, Simd as Instructions, WithSimd};

/// Vector instructions of this machine. Cheap to copy; detect them once with [`new`](Self::new).
#[derive(Clone, Copy, Debug)]
pub struct Simd(Arch);

impl Default for Simd {
    fn default() -> Self {
        Self::new()
    }
}

impl Simd {
    /// Detects the instructions of the machine.
    pub fn new() -> Self {
        Self(Arch::new())
    }

    pub(super) fn from_arch(arch: Arch) -> Self {
        Self(arch)
    }

    /// Runs `operation` compiled for the widest instructions of the machine, so that its loops over slices
    /// are vectorised. `operation` and the functions that it calls must be marked `#[inline(always)]`.
    pub fn run<R>(self, operation: impl FnOnce() -> R) -> R {
        self.0.dispatch(operation)
    }

    /// Computes `out = A^T x`; `matrix` contains the columns of A one after the other, each as long as `x`.
    ///
    /// # Panics
    /// If the length of `matrix` is not `x.len() * out.len()`.
    pub fn project(self, matrix: &[f64], x: &[f64], out: &mut [f64]) {
        assert_eq!(matrix.len(), x.len() * out.len(), "columns of {} for {} outputs", x.len(), out.len());
        if !x.is_empty() {
            self.0.dispatch(Project { matrix, x, out });
        } else {
            out.fill(0.0);
        }
    }

    /// Computes `out += A x`; `matrix` contains the columns of A one after the other, each as long as `out`.
    ///
    /// # Panics
    /// If the length of `matrix` is not `x.len() * out.len()`.
    pub fn superpose(self, matrix: &[f64], x: &[f64], out: &mut [f64]) {
        assert_eq!(matrix.len(), x.len() * out.len(), "columns of {} for {} inputs", out.len(), x.len());
        let rows = out.len().max(1);
        for (column, &factor) in matrix.chunks_exact(rows).zip(x) {
            self.add_scaled(factor, column, out);
        }
    }

    /// Returns the dot product of two vectors of the same length.
    pub fn dot(self, a: &[f64], b: &[f64]) -> f64 {
        let mut out = [0.0];
        self.project(a, b, &mut out);
        out[0]
    }

    /// Computes `y += factor * x`.
    pub fn add_scaled(self, factor: f64, x: &[f64], y: &mut [f64]) {
        self.0.dispatch(AddScaled { factor, x, y });
    }

    /// Processes one column of a symmetric product in one pass: adds `factor * x` to `y` and returns the dot
    /// product of `x` and `z`.
    pub(super) fn add_scaled_and_dot(self, factor: f64, x: &[f64], y: &mut [f64], z: &[f64]) -> f64 {
        self.0.dispatch(AddScaledAndDot { factor, x, y, z })
    }

    /// Computes `y -= a * x1 + b * x2`.
    pub(super) fn subtract_two(self, a: f64, x1: &[f64], b: f64, x2: &[f64], y: &mut [f64]) {
        self.0.dispatch(SubtractTwo { a, x1, b, x2, y });
    }
}

struct Project<'a> {
    matrix: &'a [f64],
    x: &'a [f64],
    out: &'a mut [f64],
}

impl WithSimd for Project<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Instructions>(self, simd: S) {
        let n = self.x.len();
        let (head, tail) = S::as_simd_f64s(self.x);
        let mut columns = self.matrix.chunks_exact(2 * n);
        let mut outs = self.out.chunks_exact_mut(2);
        let zero = simd.splat_f64s(0.0);
        for (pair, out) in columns.by_ref().zip(outs.by_ref()) {
            let (a, b) = pair.split_at(n);
            let ((a, a_tail), (b, b_tail)) = (S::as_simd_f64s(a), S::as_simd_f64s(b));
            let (mut a0, mut a1, mut b0, mut b1) = (zero, zero, zero, zero);
            let (xs, x_rest) = pulp::as_arrays::<2, _>(head);
            let ((a, a_rest), (b, b_rest)) = (pulp::as_arrays::<2, _>(a), pulp::as_arrays::<2, _>(b));
            for ((x, a), b) in xs.iter().zip(a).zip(b) {
                a0 = simd.mul_add_f64s(x[0], a[0], a0);
                a1 = simd.mul_add_f64s(x[1], a[1], a1);
                b0 = simd.mul_add_f64s(x[0], b[0], b0);
                b1 = simd.mul_add_f64s(x[1], b[1], b1);
            }
            for ((x, a), b) in x_rest.iter().zip(a_rest).zip(b_rest) {
                a0 = simd.mul_add_f64s(*x, *a, a0);
                b0 = simd.mul_add_f64s(*x, *b, b0);
            }
            let mut sums =
                [simd.reduce_sum_f64s(simd.add_f64s(a0, a1)), simd.reduce_sum_f64s(simd.add_f64s(b0, b1))];
            for ((x, a), b) in tail.iter().zip(a_tail).zip(b_tail) {
                sums[0] += x * a;
                sums[1] += x * b;
            }
            out.copy_from_slice(&sums);
        }
        if let ([out], column) = (outs.into_remainder(), columns.remainder()) {
            let (a, a_tail) = S::as_simd_f64s(column);
            let mut sum = zero;
            for (x, a) in head.iter().zip(a) {
                sum = simd.mul_add_f64s(*x, *a, sum);
            }
            *out = simd.reduce_sum_f64s(sum) + tail.iter().zip(a_tail).map(|(x, a)| x * a).sum::<f64>();
        }
    }
}

struct AddScaled<'a> {
    factor: f64,
    x: &'a [f64],
    y: &'a mut [f64],
}

impl WithSimd for AddScaled<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Instructions>(self, simd: S) {
        let factor = simd.splat_f64s(self.factor);
        let (x, x_tail) = S::as_simd_f64s(self.x);
        let (y, y_tail) = S::as_mut_simd_f64s(self.y);
        for (y, x) in y.iter_mut().zip(x) {
            *y = simd.mul_add_f64s(factor, *x, *y);
        }
        for (y, x) in y_tail.iter_mut().zip(x_tail) {
            *y += self.factor * x;
        }
    }
}

struct AddScaledAndDot<'a> {
    factor: f64,
    x: &'a [f64],
    y: &'a mut [f64],
    z: &'a [f64],
}

impl WithSimd for AddScaledAndDot<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Instructions>(self, simd: S) -> f64 {
        let factor = simd.splat_f64s(self.factor);
        let mut sum = simd.splat_f64s(0.0);
        let (x, x_tail) = S::as_simd_f64s(self.x);
        let (z, z_tail) = S::as_simd_f64s(self.z);
        let (y, y_tail) = S::as_mut_simd_f64s(self.y);
        for ((y, x), z) in y.iter_mut().zip(x).zip(z) {
            *y = simd.mul_add_f64s(factor, *x, *y);
            sum = simd.mul_add_f64s(*x, *z, sum);
        }
        let mut rest = 0.0;
        for ((y, x), z) in y_tail.iter_mut().zip(x_tail).zip(z_tail) {
            *y += self.factor * x;
            rest += x * z;
        }
        simd.reduce_sum_f64s(sum) + rest
    }
}

struct SubtractTwo<'a> {
    a: f64,
    x1: &'a [f64],
    b: f64,
    x2: &'a [f64],
    y: &'a mut [f64],
}

impl WithSimd for SubtractTwo<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Instructions>(self, simd: S) {
        let (a, b) = (simd.splat_f64s(-self.a), simd.splat_f64s(-self.b));
        let (x1, x1_tail) = S::as_simd_f64s(self.x1);
        let (x2, x2_tail) = S::as_simd_f64s(self.x2);
        let (y, y_tail) = S::as_mut_simd_f64s(self.y);
        for ((y, x1), x2) in y.iter_mut().zip(x1).zip(x2) {
            *y = simd.mul_add_f64s(b, *x2, simd.mul_add_f64s(a, *x1, *y));
        }
        for ((y, x1), x2) in y_tail.iter_mut().zip(x1_tail).zip(x2_tail) {
            *y -= self.a * x1 + self.b * x2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projection_of_any_size_matches_the_sum_of_products() {
        for (n, outputs) in [(1, 1), (7, 3), (16, 2), (33, 5), (398, 50)] {
            let matrix: Vec<f64> = (0..n * outputs).map(|i| (0.3 * i as f64).sin()).collect();
            let x: Vec<f64> = (0..n).map(|i| (0.7 * i as f64).cos()).collect();
            let mut out = vec![0.0; outputs];
            Simd::new().project(&matrix, &x, &mut out);
            for (column, out) in matrix.chunks(n).zip(&out) {
                let plain: f64 = column.iter().zip(&x).map(|(a, x)| a * x).sum();
                assert!((plain - out).abs() < 1e-12, "{n} x {outputs}: {plain} {out}");
            }
        }
    }
}
