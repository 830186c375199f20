//! Gaussian process regression.
//!
//! `y = f(x) + e`, `f ~ GP(0, k)`, `e ~ N(0, s_n)`. The hyperparameters minimise `E = (D N ln 2 pi + D ln
//! |K| + tr K^-1 Y Y^T) / 2` (type-II maximum likelihood) by L-BFGS with analytic gradients; all `D` outputs
//! share the kernel. A prediction is `m = k^T K^-1 y`, `s = k(x, x) + s_n - k^T K^-1 k`. Adding or removing a
//! point costs `O(N^2)`. Beyond about 500 points, use [`SparseGaussianProcess`], which costs `O(N M^2)` with
//! `M` inducing points. Reference: Rasmussen, Williams, *Gaussian Processes for Machine Learning*, algorithm
//! 2.1.
//!
//! ```
//! use motorium_models::gp::GaussianProcess;
//! use motorium_models::kernel::Kernel;
//!
//! let x: Vec<f64> = (0..20).map(|i| 0.3 * f64::from(i)).collect();
//! let y: Vec<f64> = x.iter().map(|x| x.sin()).collect();
//! let mut gp = GaussianProcess::new(Kernel::rbf(1, 1.0), 0.01, &x, 1, &y, 1)?;
//! gp.optimise(&Default::default())?;
//! let mut scratch = gp.scratch();
//! let mut mean = [0.0];
//! let variance = gp.predict(&[1.0], &mut mean, &mut scratch);
//! assert!((mean[0] - 1.0_f64.sin()).abs() < 1e-3 && variance < 1e-3);
//! # Ok::<(), motorium_models::gp::GpError>(())
//! ```

mod error;
mod marginal;
mod sparse;

pub use error::GpError;
pub(crate) use error::check_finite;
pub use marginal::NUGGET;
pub(crate) use marginal::{Gradient, Marginal};
use motorium_algebra::Simd;
pub use sparse::{Approximation, SparseGaussianProcess, SparseScratch};

use crate::kernel::{Kernel, Points};
use crate::optimise::{Minimum, Options, minimise};

/// Bound of the logarithms of hyperparameters during optimisation, in both directions.
pub(crate) const LOG_RANGE: f64 = 12.0;

/// Clamps logarithms to the range; [`release`] drops gradients that point out of it.
pub(crate) fn clamp(logarithms: &mut [f64]) {
    logarithms.iter_mut().for_each(|value| *value = value.clamp(-LOG_RANGE, LOG_RANGE));
}

/// Drops the gradient of values at the end of their range.
pub(crate) fn release(logarithms: &[f64], gradient: &mut [f64]) {
    for (value, gradient) in logarithms.iter().zip(gradient) {
        if value.abs() > LOG_RANGE {
            *gradient = 0.0;
        }
    }
}

/// A Gaussian process regression of one or several outputs that share a kernel.
#[derive(Clone, Debug)]
pub struct GaussianProcess {
    kernel: Kernel,
    noise: f64,
    points: Points,
    /// Targets, output by output.
    targets: Vec<Vec<f64>>,
    weights: Vec<Vec<f64>>,
    marginal: Marginal,
}

/// Workspace of [`GaussianProcess::predict`].
#[derive(Clone, Debug)]
pub struct Scratch {
    row: Vec<f64>,
    kernel: Vec<f64>,
}

impl GaussianProcess {
    /// Creates a process from a kernel, a noise variance and data. Each row of `x` is a point with
    /// `dimensions` coordinates. The same row of `y` contains the `outputs` values at this point.
    ///
    /// # Errors
    /// [`GpError`] if the sizes do not match, a value is not finite, or the covariance is not positive
    /// definite.
    pub fn new(
        kernel: Kernel,
        noise: f64,
        x: &[f64],
        dimensions: usize,
        y: &[f64],
        outputs: usize,
    ) -> Result<Self, GpError> {
        if dimensions == 0 || outputs == 0 || !x.len().is_multiple_of(dimensions) {
            return Err(GpError::Shape { what: "inputs", found: x.len(), expected: dimensions });
        }
        let count = x.len() / dimensions;
        if y.len() != count * outputs {
            return Err(GpError::Shape { what: "outputs", found: y.len(), expected: count * outputs });
        }
        check_finite("input", x)?;
        check_finite("output", y)?;
        if !(kernel.is_valid(dimensions) && noise >= 0.0 && noise.is_finite()) {
            return Err(GpError::Kernel { dimensions });
        }
        let targets = (0..outputs).map(|d| y.iter().skip(d).step_by(outputs).copied().collect()).collect();
        let mut made = Self {
            kernel,
            noise,
            points: Points::from_rows(x, dimensions),
            targets,
            weights: vec![],
            marginal: Marginal::new(),
        };
        made.refit()?;
        Ok(made)
    }

    /// Returns the kernel.
    pub fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    /// Returns the noise variance.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Returns `true` if there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Returns a workspace for predictions with the current number of points.
    pub fn scratch(&self) -> Scratch {
        let n = self.points.len();
        Scratch { row: vec![0.0; n], kernel: vec![0.0; n * self.kernel.scratch_rows()] }
    }

    fn refit(&mut self) -> Result<(), GpError> {
        let targets = self.targets.concat();
        self.marginal.fit(&self.kernel, self.noise, &self.points, &targets)?;
        self.weights = self.marginal.weights.chunks(self.points.len().max(1)).map(<[f64]>::to_vec).collect();
        self.weights.resize(self.targets.len(), vec![]);
        Ok(())
    }

    /// Returns the logarithms of the kernel's parameters, then the logarithm of the noise variance.
    pub fn parameters(&self) -> Vec<f64> {
        let mut found = self.kernel.parameters();
        found.push(self.noise.ln());
        found
    }

    /// Replaces the logarithms of the hyperparameters, in the order of [`parameters`](Self::parameters).
    ///
    /// # Errors
    /// [`GpError`] if the number of logarithms is wrong, a logarithm is not finite, or the covariance is not
    /// positive definite. The process is then unchanged.
    pub fn set_parameters(&mut self, logarithms: &[f64]) -> Result<(), GpError> {
        let before = self.parameters();
        if logarithms.len() != before.len() {
            let (found, expected) = (logarithms.len(), before.len());
            return Err(GpError::Shape { what: "parameters", found, expected });
        }
        check_finite("parameter", logarithms)?;
        let mut assign = |values: &[f64]| {
            let (noise, kernel) = values.split_last().expect("the noise");
            self.kernel.set_parameters(kernel);
            self.noise = noise.exp();
            self.refit()
        };
        assign(logarithms).or_else(|error| assign(&before).and(Err(error)))
    }

    /// Returns the number of inputs.
    pub fn dimensions(&self) -> usize {
        self.points.dimensions()
    }

    /// Returns the number of outputs.
    pub fn output_count(&self) -> usize {
        self.targets.len()
    }

    /// Returns the negative log marginal likelihood for these parameters, and writes its gradient.
    ///
    /// # Errors
    /// [`GpError`] if the covariance is not positive definite.
    ///
    /// # Panics
    /// If there are too few parameters.
    pub fn energy(&self, parameters: &[f64], gradient: &mut [f64]) -> Result<f64, GpError> {
        let mut marginal = Marginal::new();
        self.energy_with(&mut marginal, &self.targets.concat(), parameters, gradient)
    }

    fn energy_with(
        &self,
        marginal: &mut Marginal,
        targets: &[f64],
        parameters: &[f64],
        gradient: &mut [f64],
    ) -> Result<f64, GpError> {
        let mut kernel = self.kernel.clone();
        kernel.set_parameters(parameters);
        let noise = parameters[kernel.parameter_count()].exp();
        gradient.fill(0.0);
        let gradient = Gradient { parameters: gradient, by_points: None };
        marginal.evaluate(&kernel, noise, &self.points, targets, Some(gradient))
    }

    /// Fits the hyperparameters, starting from the current values.
    ///
    /// # Errors
    /// [`GpError`] if the covariance is not positive definite.
    pub fn optimise(&mut self, options: &Options) -> Result<Minimum, GpError> {
        let mut parameters = self.parameters();
        clamp(&mut parameters);
        let targets = self.targets.concat();
        let mut marginal = Marginal::new();
        let found = minimise(&mut parameters, options, |parameters, gradient| {
            let mut inside = parameters.to_vec();
            clamp(&mut inside);
            let value = self.energy_with(&mut marginal, &targets, &inside, gradient);
            release(parameters, gradient);
            value.unwrap_or(f64::INFINITY)
        });
        clamp(&mut parameters);
        self.kernel.set_parameters(&parameters);
        self.noise = parameters[self.kernel.parameter_count()].exp();
        self.refit()?;
        Ok(found)
    }

    /// Adds a point in `O(N^2)`, without changing the hyperparameters.
    ///
    /// # Errors
    /// [`GpError`] if a length is wrong, a value is not finite, or the covariance is no longer positive
    /// definite. The process is then unchanged.
    pub fn push(&mut self, x: &[f64], y: &[f64]) -> Result<(), GpError> {
        if x.len() != self.points.dimensions() {
            return Err(GpError::Shape {
                what: "inputs",
                found: x.len(),
                expected: self.points.dimensions(),
            });
        }
        if y.len() != self.targets.len() {
            return Err(GpError::Shape { what: "outputs", found: y.len(), expected: self.targets.len() });
        }
        check_finite("input", x)?;
        check_finite("output", y)?;
        let n = self.points.len();
        let mut row = vec![0.0; n];
        let mut scratch = vec![0.0; n * self.kernel.scratch_rows()];
        self.kernel.row((x, None), (&self.points, 0), &mut row, &mut scratch);
        let diagonal = self.kernel.variance(x, true) + self.noise + NUGGET;
        let appended = self.marginal.factor.append(&row, diagonal);
        appended.map_err(|_| GpError::Factorisation { points: n + 1, tried: vec![0.0] })?;
        self.points.push(x);
        self.targets.iter_mut().zip(y).for_each(|(target, y)| target.push(*y));
        self.solve();
        Ok(())
    }

    /// Removes a point in `O(N^2)`.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn remove(&mut self, index: usize) {
        self.marginal.factor.remove(index);
        self.points.remove(index);
        for target in &mut self.targets {
            target.remove(index);
        }
        self.solve();
    }

    fn solve(&mut self) {
        for (weights, target) in self.weights.iter_mut().zip(&self.targets) {
            weights.clear();
            weights.extend_from_slice(target);
            self.marginal.factor.solve(weights);
        }
    }

    /// Writes the mean of each output at the point `x`, and returns the variance of an observation, which is
    /// the same for all outputs. Does not allocate.
    ///
    /// # Panics
    /// If `x`, `mean` or `scratch` has the wrong length. A [`scratch`](Self::scratch) remains valid until a
    /// point is added.
    pub fn predict(&self, x: &[f64], mean: &mut [f64], scratch: &mut Scratch) -> f64 {
        assert_eq!(x.len(), self.points.dimensions(), "dimensions of the point");
        assert_eq!(mean.len(), self.targets.len(), "number of outputs");
        let n = self.points.len();
        let row = &mut scratch.row[..n];
        self.kernel.row((x, None), (&self.points, 0), row, &mut scratch.kernel);
        let simd = Simd::new();
        for (mean, weights) in mean.iter_mut().zip(&self.weights) {
            *mean = simd.dot(row, weights);
        }
        self.marginal.factor.solve_lower(row);
        (self.kernel.variance(x, true) - simd.dot(row, row)).max(0.0) + self.noise
    }
}
