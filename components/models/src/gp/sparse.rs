//! Sparse Gaussian processes: `O(N M^2)` with `M` inducing points, for data sets that are too large for a
//! full covariance matrix.

use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector, Dyn};

use super::marginal::NUGGET;
use super::{GpError, check_finite, clamp, release};
use crate::kernel::{Kernel, Points};
use crate::optimise::{Minimum, Options, minimise};

/// Approximation of the covariance `K`, with `Q = K_fu K_uu^-1 K_uf` for the inducing points `u`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Approximation {
    /// Fully independent training conditional: `Q + diag(K - Q) + n I` (Snelson, Ghahramani, NIPS 2005).
    Fitc,
    /// Variational free energy: `Q + n I`, and the penalty `tr(K - Q) / (2 n)`. The objective is an upper
    /// bound of the exact objective (Titsias, AISTATS 2009).
    Variational,
}

/// Jitters added to the diagonal of `K_uu` until it is positive definite.
const JITTERS: [f64; 4] = [1e-8, 1e-7, 1e-6, 1e-4];

/// A Gaussian process regression that approximates the covariance with inducing points. One or several
/// outputs share a kernel.
#[derive(Clone, Debug)]
pub struct SparseGaussianProcess {
    kernel: Kernel,
    noise: f64,
    approximation: Approximation,
    /// The inducing points, then all others.
    points: Points,
    inducing: usize,
    /// Targets, one output per column.
    targets: DMatrix<f64>,
    fitted: Fitted,
}

/// Factors for one set of hyperparameters.
#[derive(Clone, Debug)]
struct Fitted {
    /// Factor of `K_uu = L L^T`.
    inner: Cholesky<f64, Dyn>,
    /// Factor of `I + V D^-1 V^T`, with `V = L^-1 K_uf` and `D` the diagonal part of the covariance.
    outer: Cholesky<f64, Dyn>,
    /// `L^-T` times the projected targets, one output per column.
    weights: DMatrix<f64>,
    energy: f64,
}

/// Workspace of [`SparseGaussianProcess::predict`].
#[derive(Clone, Debug)]
pub struct SparseScratch {
    row: DVector<f64>,
    solved: DVector<f64>,
    kernel: Vec<f64>,
}

/// Returns the indices of points far from each other: first the point nearest to the mean, then repeatedly
/// the point farthest from all previous points.
fn spread(points: &Points, count: usize) -> Vec<usize> {
    let n = points.len();
    let deviation = |d: usize| {
        let x = points.coordinate(d);
        let mean = x.iter().sum::<f64>() / n as f64;
        (mean, (x.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n as f64).sqrt().max(1e-12))
    };
    let scales: Vec<(f64, f64)> = (0..points.dimensions()).map(deviation).collect();
    let distance = |a: usize, target: &dyn Fn(usize) -> f64| -> f64 {
        scales.iter().enumerate().map(|(d, (_, s))| ((points.coordinate(d)[a] - target(d)) / s).powi(2)).sum()
    };
    let mut nearest: Vec<f64> = (0..n).map(|a| distance(a, &|d| scales[d].0)).collect();
    let first = (0..n).min_by(|a, b| nearest[*a].total_cmp(&nearest[*b])).unwrap_or(0);
    nearest.fill(f64::INFINITY);
    let mut found = vec![first];
    while found.len() < count {
        let last = found[found.len() - 1];
        for (a, nearest) in nearest.iter_mut().enumerate() {
            *nearest = nearest.min(distance(a, &|d| points.coordinate(d)[last]));
        }
        // repeated points have no effect
        let Some(next) = (0..n).max_by(|a, b| nearest[*a].total_cmp(&nearest[*b])) else { break };
        if nearest[next] <= 0.0 {
            break;
        }
        found.push(next);
    }
    found
}

impl SparseGaussianProcess {
    /// Creates a process from a kernel, a noise variance and data. Each row of `x` is a point with
    /// `dimensions` coordinates. The same row of `y` contains the `outputs` values at this point. `inducing`
    /// is the number of inducing points, which are points of `x` spread over the data. If `x` contains
    /// repeated points, the process may have fewer inducing points.
    ///
    /// # Errors
    /// [`GpError`] if the sizes do not match, a value is not finite, `inducing` is 0 or exceeds the number of
    /// points, or a covariance is not positive definite.
    pub fn new(
        kernel: Kernel,
        noise: f64,
        (x, dimensions): (&[f64], usize),
        (y, outputs): (&[f64], usize),
        inducing: usize,
        approximation: Approximation,
    ) -> Result<Self, GpError> {
        if dimensions == 0 || outputs == 0 || x.is_empty() || !x.len().is_multiple_of(dimensions) {
            let expected = dimensions.max(1) * (x.len() / dimensions.max(1)).max(1);
            return Err(GpError::Shape { what: "inputs", found: x.len(), expected });
        }
        let n = x.len() / dimensions;
        if y.len() != n * outputs {
            return Err(GpError::Shape { what: "targets", found: y.len(), expected: n * outputs });
        }
        if inducing == 0 || inducing > n {
            return Err(GpError::Shape { what: "inducing points", found: inducing, expected: n });
        }
        if !(kernel.is_valid(dimensions) && noise > 0.0 && noise.is_finite()) {
            return Err(GpError::Kernel { dimensions });
        }
        check_finite("input", x)?;
        check_finite("target", y)?;
        let chosen = spread(&Points::from_rows(x, dimensions), inducing);
        let mut rows: Vec<f64> =
            chosen.iter().flat_map(|i| &x[i * dimensions..(i + 1) * dimensions]).copied().collect();
        rows.extend_from_slice(x);
        let points = Points::from_rows(&rows, dimensions);
        let targets = DMatrix::from_row_slice(n, outputs, y);
        let fitted = Terms::new(&kernel, noise, approximation, (&points, chosen.len()), &targets)?.fitted;
        Ok(Self { kernel, noise, approximation, points, inducing: chosen.len(), targets, fitted })
    }

    /// Returns the kernel.
    pub fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    /// Returns the noise variance.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// Returns the number of inducing points.
    pub fn inducing(&self) -> usize {
        self.inducing
    }

    /// Returns the objective at the current hyperparameters: the negative log marginal likelihood of the
    /// approximation, including the penalty of the variational approximation.
    pub fn objective(&self) -> f64 {
        self.fitted.energy
    }

    /// Returns the logarithms of the kernel's parameters and of the noise variance.
    pub fn parameters(&self) -> Vec<f64> {
        let mut found = self.kernel.parameters();
        found.push(self.noise.ln());
        found
    }

    /// Returns the objective for these parameters, and writes its gradient.
    ///
    /// # Errors
    /// [`GpError`] if a covariance is not positive definite.
    ///
    /// # Panics
    /// If the length of a slice differs from the number of parameters.
    pub fn energy(&self, parameters: &[f64], gradient: &mut [f64]) -> Result<f64, GpError> {
        let (noise, own) = parameters.split_last().expect("the noise");
        let mut kernel = self.kernel.clone();
        kernel.set_parameters(own);
        let points = (&self.points, self.inducing);
        let terms = Terms::new(&kernel, noise.exp(), self.approximation, points, &self.targets)?;
        terms.gradient((&kernel, noise.exp()), self.approximation, &self.points, &self.targets, gradient);
        Ok(terms.fitted.energy)
    }

    /// Fits the hyperparameters by L-BFGS; the inducing points stay fixed.
    ///
    /// # Errors
    /// [`GpError`] if a covariance is not positive definite at the final parameters.
    pub fn optimise(&mut self, options: &Options) -> Result<Minimum, GpError> {
        let mut parameters = self.parameters();
        clamp(&mut parameters);
        let found = minimise(&mut parameters, options, |parameters, gradient| {
            let mut inside = parameters.to_vec();
            clamp(&mut inside);
            let value = self.energy(&inside, gradient).unwrap_or(f64::INFINITY);
            release(parameters, gradient);
            value
        });
        clamp(&mut parameters);
        let (noise, own) = parameters.split_last().expect("the noise");
        self.kernel.set_parameters(own);
        self.noise = noise.exp();
        let points = (&self.points, self.inducing);
        self.fitted = Terms::new(&self.kernel, self.noise, self.approximation, points, &self.targets)?.fitted;
        Ok(found)
    }

    /// Returns a workspace for predictions.
    pub fn scratch(&self) -> SparseScratch {
        let m = self.inducing;
        let zeros = DVector::zeros(m);
        SparseScratch { row: zeros.clone(), solved: zeros, kernel: vec![0.0; m * self.kernel.scratch_rows()] }
    }

    /// Writes the mean of the outputs at the point `x` and returns the variance of an observation. Does not
    /// allocate.
    ///
    /// # Panics
    /// If a slice has the wrong length.
    pub fn predict(&self, x: &[f64], mean: &mut [f64], scratch: &mut SparseScratch) -> f64 {
        assert_eq!(x.len(), self.points.dimensions(), "dimensions of the point");
        assert_eq!(mean.len(), self.targets.ncols(), "number of outputs");
        let SparseScratch { row, solved, kernel } = scratch;
        self.kernel.row((x, None), (&self.points, 0), row.as_mut_slice(), kernel);
        for (mean, weights) in mean.iter_mut().zip(self.fitted.weights.column_iter()) {
            *mean = row.dot(&weights);
        }
        solved.copy_from(row);
        self.fitted.inner.l_dirty().solve_lower_triangular_mut(solved);
        let known = solved.norm_squared();
        self.fitted.outer.l_dirty().solve_lower_triangular_mut(solved);
        (self.kernel.variance(x, false) - known).max(0.0) + solved.norm_squared() + self.noise
    }
}

/// Matrices for one set of hyperparameters.
struct Terms {
    /// Variances of the points.
    variances: Vec<f64>,
    /// `V`, `m x n`.
    projected: DMatrix<f64>,
    /// Diagonal part of the covariance.
    diagonal: DVector<f64>,
    /// `(I + V D^-1 V^T)^-1 V D^-1 y`.
    pulled: DMatrix<f64>,
    fitted: Fitted,
}

fn factorise(matrix: &DMatrix<f64>, jitters: &[f64]) -> Result<Cholesky<f64, Dyn>, GpError> {
    for jitter in jitters {
        let mut own = matrix.clone();
        (0..own.nrows()).for_each(|i| own[(i, i)] += jitter);
        if let Some(factor) = own.cholesky() {
            return Ok(factor);
        }
    }
    Err(GpError::Factorisation { points: matrix.nrows(), tried: jitters.to_vec() })
}

impl Terms {
    fn new(
        kernel: &Kernel,
        noise: f64,
        approximation: Approximation,
        (points, m): (&Points, usize),
        targets: &DMatrix<f64>,
    ) -> Result<Self, GpError> {
        let n = points.len() - m;
        let mut query = vec![0.0; points.dimensions()];
        let (mut row, mut scratch) = (vec![0.0; m + n], vec![0.0; kernel.scratch_rows() * (m + n)]);
        let (mut inner, mut cross) = (DMatrix::zeros(m, m), DMatrix::zeros(m, n));
        for a in 0..m {
            points.copy_point(a, &mut query);
            kernel.row((&query, Some(a)), (points, 0), &mut row, &mut scratch);
            row[..m].iter().enumerate().for_each(|(b, value)| inner[(a, b)] = *value);
            row[m..].iter().enumerate().for_each(|(b, value)| cross[(a, b)] = *value);
        }
        let variances: Vec<f64> = (m..m + n)
            .map(|a| {
                points.copy_point(a, &mut query);
                kernel.variance(&query, true)
            })
            .collect();
        let factor = factorise(&inner, &JITTERS)?;
        let mut projected = cross;
        factor.l_dirty().solve_lower_triangular_mut(&mut projected);
        let left: Vec<f64> = projected
            .column_iter()
            .zip(&variances)
            .map(|(column, variance)| (variance - column.norm_squared()).max(0.0))
            .collect();
        let diagonal = DVector::from_iterator(
            n,
            left.iter().map(|left| match approximation {
                Approximation::Fitc => left + noise + NUGGET,
                Approximation::Variational => noise + NUGGET,
            }),
        );
        let mut scaled = projected.clone();
        scaled.column_iter_mut().zip(diagonal.iter()).for_each(|(mut column, d)| column /= *d);
        let outer = factorise(&(DMatrix::identity(m, m) + &scaled * projected.transpose()), &[0.0])?;
        let mut half = &scaled * targets;
        outer.l_dirty().solve_lower_triangular_mut(&mut half);
        let outputs = targets.ncols() as f64;
        let mut energy = outputs * (n as f64 * (2.0 * std::f64::consts::PI).ln());
        energy += outputs * diagonal.iter().map(|d| d.ln()).sum::<f64>();
        energy += outputs * 2.0 * (0..m).map(|i| outer.l_dirty()[(i, i)].ln()).sum::<f64>();
        let squares = targets.row_iter().zip(diagonal.iter()).map(|(row, d)| row.norm_squared() / d);
        energy += squares.sum::<f64>() - half.norm_squared();
        if approximation == Approximation::Variational {
            energy += outputs * left.iter().sum::<f64>() / (noise + NUGGET);
        }
        let mut pulled = half;
        outer.l_dirty().tr_solve_lower_triangular_mut(&mut pulled);
        let mut weights = pulled.clone();
        factor.l_dirty().tr_solve_lower_triangular_mut(&mut weights);
        let fitted = Fitted { inner: factor, outer, weights, energy: 0.5 * energy };
        Ok(Self { variances, projected, diagonal, pulled, fitted })
    }

    /// Writes the gradient with respect to the logarithms of the parameters.
    ///
    /// With `S` the covariance of the approximation, `A = K_uu^-1 K_uf` and `G = (D S^-1 - sum a a^T) / 2`,
    /// `a = S^-1 y`: the derivative with respect to `K_uf` is `2 A G'`, and with respect to `K_uu` it is
    /// `-A G' A^T`. `G'` is `G` without the part absorbed by the diagonal of `K - Q`.
    fn gradient(
        &self,
        (kernel, noise): (&Kernel, f64),
        approximation: Approximation,
        points: &Points,
        targets: &DMatrix<f64>,
        gradient: &mut [f64],
    ) {
        let (m, n) = self.projected.shape();
        let outputs = targets.ncols() as f64;
        let mut solution = targets - self.projected.transpose() * &self.pulled;
        solution.row_iter_mut().zip(self.diagonal.iter()).for_each(|(mut row, d)| row /= *d);
        // A, and A S^-1 = L^-T (I + V D^-1 V^T)^-1 V D^-1
        let mut a = self.projected.clone();
        self.fitted.inner.l_dirty().tr_solve_lower_triangular_mut(&mut a);
        let mut outer = self.projected.clone();
        self.fitted.outer.l_dirty().solve_lower_triangular_mut(&mut outer);
        let explained: Vec<f64> = outer.column_iter().map(|column| column.norm_squared()).collect();
        self.fitted.outer.l_dirty().tr_solve_lower_triangular_mut(&mut outer);
        self.fitted.inner.l_dirty().tr_solve_lower_triangular_mut(&mut outer);
        outer.column_iter_mut().zip(self.diagonal.iter()).for_each(|(mut column, d)| column /= *d);
        let mut slopes = 0.5 * (outer * outputs - &self.fitted.weights * solution.transpose());
        let own: Vec<f64> = (0..n)
            .map(|i| {
                let d = self.diagonal[i];
                0.5 * (outputs * (1.0 / d - explained[i] / (d * d)) - solution.row(i).norm_squared())
            })
            .collect();
        let s = noise + NUGGET;
        let by_variance: Vec<f64> = match approximation {
            Approximation::Fitc => own.clone(),
            Approximation::Variational => vec![0.5 * outputs / s; n],
        };
        let mut by_noise: f64 = own.iter().sum();
        if approximation == Approximation::Variational {
            let left = self
                .projected
                .column_iter()
                .zip(&self.variances)
                .map(|(v, k)| (k - v.norm_squared()).max(0.0));
            by_noise -= 0.5 * outputs * left.sum::<f64>() / (s * s);
        }
        for ((mut slope, a), share) in slopes.column_iter_mut().zip(a.column_iter()).zip(&by_variance) {
            slope.axpy(-share, &a, 1.0);
        }
        let inner = -(&slopes * a.transpose());
        gradient.fill(0.0);
        let (by_noise_slot, by_kernel) = gradient.split_last_mut().expect("the noise");
        *by_noise_slot = noise * by_noise;
        let (mut values, mut derivatives, mut weights) =
            (vec![0.0; m + n], vec![0.0; m + n], vec![0.0; m + n]);
        let mut query = vec![0.0; points.dimensions()];
        let mut scratch = vec![0.0; kernel.scratch_rows() * (m + n)];
        for row in 0..m {
            let count = m + n - row;
            for b in row..m {
                weights[b - row] =
                    if b == row { inner[(row, row)] } else { inner[(row, b)] + inner[(b, row)] };
            }
            for i in 0..n {
                weights[m - row + i] = 2.0 * slopes[(row, i)];
            }
            points.copy_point(row, &mut query);
            let out = (&mut values[..count], &mut derivatives[..count]);
            kernel.row_with_slopes((&query, Some(row)), (points, row), out, &mut scratch);
            let covariances = (&values[..count], &derivatives[..count]);
            kernel.add_gradient((row, points), covariances, &weights[..count], by_kernel, None);
        }
        for (i, (variance, weight)) in self.variances.iter().zip(&by_variance).enumerate() {
            // the distance of a point from itself is 0, so the slope is irrelevant
            kernel.add_gradient((m + i, points), (&[*variance], &[0.0]), &[*weight], by_kernel, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gp::GaussianProcess;

    fn data(n: usize) -> (Vec<f64>, Vec<f64>) {
        let x: Vec<f64> =
            (0..2 * n).map(|i| 3.0 * ([0.618_034, 0.754_878][i % 2] * (i + 1) as f64).fract()).collect();
        let noise = |i: usize| 0.1 * ((i * i) as f64 * 0.754_877).sin();
        let y = x.chunks(2).enumerate();
        let y = y.flat_map(|(i, x)| [(2.0 * x[0]).sin() * x[1].cos() + noise(i), x[0] - x[1] + noise(i + 7)]);
        (x.clone(), y.collect())
    }

    fn process(n: usize, m: usize, approximation: Approximation) -> SparseGaussianProcess {
        let (x, y) = data(n);
        SparseGaussianProcess::new(Kernel::matern52(2, 0.8), 0.02, (&x, 2), (&y, 2), m, approximation)
            .expect("a process")
    }

    #[test]
    fn all_points_as_inducing_points_give_the_full_process() {
        let (x, y) = data(40);
        let full = GaussianProcess::new(Kernel::matern52(2, 0.8), 0.02, &x, 2, &y, 2).expect("a process");
        let parameters = full.parameters();
        let mut gradient = vec![0.0; parameters.len()];
        let energy = full.energy(&parameters, &mut gradient).expect("an energy");
        for approximation in [Approximation::Fitc, Approximation::Variational] {
            let sparse = process(40, 40, approximation);
            assert_eq!(sparse.inducing(), 40);
            assert!((sparse.objective() - energy).abs() < 1e-3, "{} and {energy}", sparse.objective());
            let (mut a, mut b) = ([0.0; 2], [0.0; 2]);
            let point = [1.23, 0.77];
            let variances = (
                full.predict(&point, &mut a, &mut full.scratch()),
                sparse.predict(&point, &mut b, &mut sparse.scratch()),
            );
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4), "{a:?} {b:?}");
            assert!((variances.0 - variances.1).abs() < 1e-4, "{variances:?}");
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        for approximation in [Approximation::Fitc, Approximation::Variational] {
            let sparse = process(60, 12, approximation);
            let parameters = sparse.parameters();
            let mut gradient = vec![0.0; parameters.len()];
            sparse.energy(&parameters, &mut gradient).expect("an energy");
            let mut other = gradient.clone();
            for i in 0..parameters.len() {
                let mut side = |step: f64| {
                    let mut moved = parameters.clone();
                    moved[i] += step;
                    sparse.energy(&moved, &mut other).expect("an energy")
                };
                let difference = (side(1e-5) - side(-1e-5)) / 2e-5;
                let error = (difference - gradient[i]).abs();
                assert!(
                    error < 1e-4 * difference.abs().max(1.0),
                    "{approximation:?} {i}: {difference} {}",
                    gradient[i]
                );
            }
        }
    }

    #[test]
    fn the_variational_objective_bounds_the_exact_one() {
        let (x, y) = data(60);
        let full = GaussianProcess::new(Kernel::matern52(2, 0.8), 0.02, &x, 2, &y, 2).expect("a process");
        let parameters = full.parameters();
        let energy = full.energy(&parameters, &mut vec![0.0; parameters.len()]).expect("an energy");
        let objectives = [5, 15, 40].map(|m| process(60, m, Approximation::Variational).objective());
        assert!(objectives.iter().all(|objective| *objective > energy), "{objectives:?} and {energy}");
        assert!(objectives.is_sorted_by(|a, b| a > b), "{objectives:?}");
    }

    #[test]
    fn a_thousand_points_are_fitted_with_sixty() {
        let (x, y) = data(1000);
        for approximation in [Approximation::Fitc, Approximation::Variational] {
            let mut sparse = process(1000, 60, approximation);
            let before = sparse.objective();
            let found = sparse.optimise(&Options { iterations: 15, ..Options::default() }).expect("a fit");
            assert!(sparse.objective() < before - 10.0 && (sparse.objective() - found.value).abs() < 1e-6);
            let (mut mean, mut scratch, mut squares) = ([0.0; 2], sparse.scratch(), 0.0);
            for (x, y) in x.chunks(2).zip(y.chunks(2)).step_by(13) {
                let variance = sparse.predict(x, &mut mean, &mut scratch);
                assert!(variance > 0.0);
                squares += mean.iter().zip(y).map(|(m, y)| (m - y) * (m - y)).sum::<f64>() / 154.0;
            }
            // the noise is a sine of amplitude 0.1
            assert!(squares.sqrt() < 0.1, "{approximation:?}: {}", squares.sqrt());
        }
    }

    #[test]
    fn mistakes_are_named() {
        let (x, y) = data(10);
        let new = |y: &[f64], m: usize| {
            SparseGaussianProcess::new(Kernel::rbf(2, 1.0), 0.1, (&x, 2), (y, 2), m, Approximation::Fitc)
        };
        assert_eq!(new(&y, 11).expect_err("many").to_string(), "found 11 inducing points, expected 10");
        assert!(matches!(new(&y[1..], 5), Err(GpError::Shape { what: "targets", .. })));
        let mut broken = y.clone();
        broken[3] = f64::NAN;
        assert!(matches!(new(&broken, 5), Err(GpError::NotFinite { index: 3, .. })));
    }
}
