//! The negative logarithm of the marginal likelihood and its gradient.

use motorium_algebra::{Cholesky, Simd};

use super::error::GpError;
use crate::kernel::{Kernel, Points};

/// Value added to the diagonal of every covariance matrix, as in the library GPy.
pub const NUGGET: f64 = 1e-8;

/// Jitters added to the diagonal when a factorisation fails, relative to its mean, as in GPy.
const JITTERS: [f64; 5] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2];

/// Covariance, factor and weights of one kernel at some points, in reused memory.
#[derive(Clone, Debug)]
pub(crate) struct Marginal {
    pub(crate) factor: Cholesky,
    /// `K^-1 y` of each output, one after the other.
    pub(crate) weights: Vec<f64>,
    /// Rows of the covariance, without noise, starting at the diagonal.
    values: Vec<f64>,
    /// Derivatives of the covariance, if the kernel has them.
    slopes: Vec<f64>,
    /// Rows of the inverse covariance, or of the gradient with respect to the covariance, starting at the
    /// diagonal.
    inverse: Vec<f64>,
}

/// Buffers to which gradients are added.
pub(crate) struct Gradient<'a> {
    /// Gradient with respect to the logarithms of the kernel's parameters, then the noise variance.
    pub(crate) parameters: &'a mut [f64],
    /// Gradient with respect to the points, dimension by dimension.
    pub(crate) by_points: Option<&'a mut [f64]>,
}

impl Marginal {
    pub(crate) fn new() -> Self {
        Self {
            factor: Cholesky::with_capacity(0),
            weights: vec![],
            values: vec![],
            slopes: vec![],
            inverse: vec![],
        }
    }

    /// Factorises the covariance and solves for the weights of all outputs.
    pub(crate) fn fit(
        &mut self,
        kernel: &Kernel,
        noise: f64,
        points: &Points,
        targets: &[f64],
    ) -> Result<(), GpError> {
        let n = points.len();
        let mut query = vec![0.0; points.dimensions()];
        let mut scratch = vec![0.0; kernel.scratch_rows() * n];
        self.values.resize(n * n, 0.0);
        self.slopes.resize(n * n, 0.0);
        for a in 0..n {
            points.copy_point(a, &mut query);
            let row = a * n + a..(a + 1) * n;
            let out = (&mut self.values[row.clone()], &mut self.slopes[row]);
            kernel.row_with_slopes((&query, Some(a)), (points, a), out, &mut scratch);
        }
        self.factorise(n, noise)?;
        self.weights.clear();
        self.weights.extend_from_slice(targets);
        self.factor.solve_all(&mut self.weights);
        Ok(())
    }

    fn factorise(&mut self, n: usize, noise: f64) -> Result<(), GpError> {
        let mean = (0..n).map(|a| self.values[a * n + a]).sum::<f64>() / n.max(1) as f64 + noise;
        let mut tried = vec![];
        for jitter in std::iter::once(0.0).chain(JITTERS.map(|part| part * mean)) {
            let values = &self.values;
            let result = self.factor.factorise(n, |a, out| {
                out.copy_from_slice(&values[a * n + a..(a + 1) * n]);
                out[0] += noise + NUGGET + jitter;
            });
            match result {
                Ok(()) => return Ok(()),
                Err(_) => tried.push(jitter),
            }
        }
        Err(GpError::Factorisation { points: n, tried })
    }

    /// Returns the mean squared error of each pose predicted from all others, relative to the mean square of
    /// the targets; uses the targets of [`fit`](Self::fit).
    pub(crate) fn leave_one_out(&mut self, targets: &[f64]) -> f64 {
        let (n, stride) = (self.factor.size(), self.factor.stride());
        self.inverse.resize(stride * stride, 0.0);
        self.factor.inverse(&mut self.inverse);
        let residuals = self.weights.iter().enumerate().map(|(i, w)| w / self.inverse[i % n * (stride + 1)]);
        let (errors, squares) =
            (residuals.map(|r| r * r).sum::<f64>(), targets.iter().map(|y| y * y).sum::<f64>());
        errors / squares.max(f64::MIN_POSITIVE)
    }

    /// Returns the negative log marginal likelihood of all outputs together, and adds its gradient.
    pub(crate) fn evaluate(
        &mut self,
        kernel: &Kernel,
        noise: f64,
        points: &Points,
        targets: &[f64],
        gradient: Option<Gradient<'_>>,
    ) -> Result<f64, GpError> {
        let n = points.len();
        let outputs = targets.len() / n.max(1);
        self.fit(kernel, noise, points, targets)?;
        let simd = Simd::new();
        let constant = targets.len() as f64 * (2.0 * std::f64::consts::PI).ln();
        let energy =
            constant + outputs as f64 * self.factor.log_determinant() + simd.dot(targets, &self.weights);
        if let Some(Gradient { parameters, mut by_points }) = gradient {
            let stride = self.factor.stride();
            self.inverse.resize(stride * stride, 0.0);
            // twice dE/dK
            self.factor.weighted_inverse(outputs as f64, &self.weights, &mut self.inverse);
            let (by_kernel, by_noise) = parameters.split_at_mut(kernel.parameter_count());
            for a in 0..n {
                // an off-diagonal entry counts twice
                let weights = &mut self.inverse[a * stride..][a..n];
                weights[0] *= 0.5;
                by_noise[0] += noise * weights[0];
                let row = a * n + a..(a + 1) * n;
                let row = (&self.values[row.clone()], &self.slopes[row]);
                kernel.add_gradient((a, points), row, weights, by_kernel, by_points.as_deref_mut());
            }
        }
        Ok(0.5 * energy)
    }
}
