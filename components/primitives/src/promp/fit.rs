//! A probabilistic primitive from demonstrations.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::basis::ProMpBasis;
use super::error::ProMpError;
use super::model::{ProMp, symmetrise};
use crate::ValueError;

/// Estimator of the distribution of the weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Learning {
    /// Expectation maximisation of the likelihood of all samples (Lazaric and Ghavamzadeh 2010, with an
    /// uninformative prior), which handles noisy and incomplete demonstrations. With `A = Phi^T Phi`, `S_i =
    /// (A_i / s^2 + Sigma^-1)^-1`, `m_i = S_i (Phi_i^T y_i / s^2 + Sigma^-1 mu)`; `mu = mean m_i`, `Sigma =
    /// mean (S_i + (m_i - mu)(m_i - mu)^T)`, `s^2 = sum (|y_i - Phi_i m_i|^2 + tr(A_i S_i)) / sum of the
    /// samples`.
    Em {
        /// Maximum number of iterations.
        iterations: usize,
        /// Change of the mean of the weights below which the fit ends, as a fraction of the norm of the mean.
        tolerance: f64,
    },
    /// Ridge regression of each demonstration, followed by mean and covariance of the weights.
    Ridge {
        /// Penalty, at least 0.
        lambda: f64,
    },
}

/// Settings of a fit. [`Default`] returns the values documented on each field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProMpFit {
    /// Estimator of the weight distribution. Default: EM with at most 200 iterations and a tolerance of 1e-5.
    pub learning: Learning,
    /// Value added to the diagonal of the covariance of the weights, relative to the mean of the diagonal.
    /// The jitter makes the covariance invertible if there are fewer demonstrations than weights. Default
    /// 1e-6.
    pub jitter: f64,
    /// Strength `k` of the prior that dimensions vary independently, as an equivalent number of
    /// demonstrations, at least 0. From `n` demonstrations with the covariance `S`, the fit estimates `(n S +
    /// k B) / (n + k)`. `B` contains the blocks of `S` within each dimension and is zero elsewhere. 0 is
    /// maximum likelihood. Default 3.
    ///
    /// This is the maximum a posteriori estimate under an inverse-Wishart prior with the scale `k B` and
    /// `k - D N - 1` degrees of freedom (Gomez-Gonzalez, Neumann, Schoelkopf, Peters, *Adaptation and robust
    /// learning of probabilistic movement primitives*, IEEE Transactions on Robotics 36, 2020). `S` has at
    /// most the rank `n - 1`. Without the prior, a few demonstrations therefore appear to vary in some
    /// directions only, and the primitive misses positions in all other directions.
    pub shrinkage: f64,
}

impl Default for ProMpFit {
    fn default() -> Self {
        Self { learning: Learning::Em { iterations: 200, tolerance: 1e-5 }, jitter: 1e-6, shrinkage: 3.0 }
    }
}

/// One demonstration in the form required by the fit.
struct Shown {
    samples: usize,
    /// Index of `Phi^T Phi` of one dimension; demonstrations of equal length share it.
    gram: usize,
    /// `Phi^T y`, all dimensions.
    carried: DVector<f64>,
    /// `y^T y`.
    square: f64,
}

impl ProMp {
    /// Fits a primitive to demonstrations of one movement. Each demonstration is a matrix of samples x
    /// dimensions, evenly spaced from start to end; the numbers of samples may differ.
    ///
    /// # Errors
    /// [`ProMpError`] if there are fewer than two demonstrations, their dimensions differ, there are too few
    /// samples, or a number is not finite.
    pub fn fit(
        basis: ProMpBasis,
        demonstrations: &[DMatrix<f64>],
        fit: &ProMpFit,
    ) -> Result<Self, ProMpError> {
        Self::fit_with_progress(basis, demonstrations, fit, |_| {})
    }

    /// Fits like [`fit`](Self::fit), and reports the completed fraction of the work, from 0 to 1, to
    /// `progress`.
    ///
    /// # Errors
    /// [`ProMpError`] in the same cases as [`fit`](Self::fit).
    pub fn fit_with_progress(
        basis: ProMpBasis,
        demonstrations: &[DMatrix<f64>],
        fit: &ProMpFit,
        mut progress: impl FnMut(f64),
    ) -> Result<Self, ProMpError> {
        basis.check()?;
        let dimensions = check(demonstrations)?;
        for (name, value) in [("jitter", fit.jitter), ("shrinkage", fit.shrinkage)] {
            if !(value >= 0.0 && value.is_finite()) {
                let expected = "a finite number of at least 0";
                return Err(ProMpError::Value(ValueError::OutOfRange { name, value, expected }));
            }
        }
        let (grams, shown) = prepare(&basis, demonstrations);
        let size = basis.count() * dimensions;
        let (mean, covariance) = (DVector::zeros(size), DMatrix::identity(size, size));
        let mut promp = Self { basis, dimensions, mean, covariance, noise: 1.0, duration: 1.0 };
        match fit.learning {
            Learning::Ridge { lambda } => promp.ridge(&grams, &shown, lambda, (fit.shrinkage, fit.jitter))?,
            Learning::Em { iterations, tolerance } => {
                promp.ridge(&grams, &shown, 1e-6, (fit.shrinkage, fit.jitter.max(1e-4)))?;
                for iteration in 0..iterations {
                    let before = promp.mean.clone();
                    promp.improve(&grams, &shown, (fit.shrinkage, fit.jitter))?;
                    progress((iteration + 1) as f64 / iterations as f64);
                    if (&promp.mean - before).norm() <= tolerance * promp.mean.norm() {
                        break;
                    }
                }
            }
        }
        progress(1.0);
        Ok(promp)
    }

    fn ridge(
        &mut self,
        grams: &[DMatrix<f64>],
        shown: &[Shown],
        lambda: f64,
        (shrinkage, jitter): (f64, f64),
    ) -> Result<(), ProMpError> {
        let count = self.basis.count();
        let mut weights = DMatrix::zeros(self.mean.len(), shown.len());
        let factors = grams
            .iter()
            .map(|gram| inverse_of(gram + DMatrix::identity(count, count) * lambda, "the normal matrix"))
            .collect::<Result<Vec<_>, _>>()?;
        let (mut squares, mut samples) = (0.0, 0);
        for (demo, mut column) in shown.iter().zip(weights.column_iter_mut()) {
            let mut square = demo.square;
            for d in 0..self.dimensions {
                let carried = demo.carried.rows(d * count, count).into_owned();
                let solution = factors[demo.gram].solve(&carried);
                square += solution.dot(&(&grams[demo.gram] * &solution)) - 2.0 * solution.dot(&carried);
                column.rows_mut(d * count, count).copy_from(&solution);
            }
            squares += square.max(0.0);
            samples += demo.samples * self.dimensions;
        }
        self.mean = weights.column_mean();
        weights.column_iter_mut().for_each(|mut column| column -= &self.mean);
        self.covariance = &weights * weights.transpose() / (shown.len() - 1) as f64;
        self.shrink(shown.len(), shrinkage);
        add_jitter(&mut self.covariance, jitter);
        self.noise = (squares / samples as f64).max(f64::MIN_POSITIVE);
        Ok(())
    }

    /// One iteration of expectation maximisation.
    fn improve(
        &mut self,
        grams: &[DMatrix<f64>],
        shown: &[Shown],
        (shrinkage, jitter): (f64, f64),
    ) -> Result<(), ProMpError> {
        let (count, size) = (self.basis.count(), self.mean.len());
        let precision = inverse_of(self.covariance.clone(), "the covariance of the weights")?.inverse();
        let prior = &precision * &self.mean;
        // demonstrations of equal length share their posterior covariance
        let posteriors = grams
            .iter()
            .map(|gram| {
                let mut matrix = precision.clone();
                for d in 0..self.dimensions {
                    let mut block = matrix.view_mut((d * count, d * count), (count, count));
                    block += gram / self.noise;
                }
                Ok(inverse_of(matrix, "the precision of the weights")?.inverse())
            })
            .collect::<Result<Vec<DMatrix<f64>>, ProMpError>>()?;
        let mut means = DMatrix::zeros(size, shown.len());
        let mut covariance = DMatrix::zeros(size, size);
        let (mut squares, mut samples) = (0.0, 0);
        for (demo, mut column) in shown.iter().zip(means.column_iter_mut()) {
            let posterior = &posteriors[demo.gram];
            let mean = posterior * (&demo.carried / self.noise + &prior);
            covariance += posterior;
            squares += demo.square - 2.0 * mean.dot(&demo.carried);
            for d in 0..self.dimensions {
                let gram = &grams[demo.gram];
                let part = mean.rows(d * count, count);
                squares += part.dot(&(gram * part));
                squares += gram.component_mul(&posterior.view((d * count, d * count), (count, count))).sum();
            }
            samples += demo.samples * self.dimensions;
            column.copy_from(&mean);
        }
        self.mean = means.column_mean();
        means.column_iter_mut().for_each(|mut column| column -= &self.mean);
        covariance.gemm(1.0, &means, &means.transpose(), 1.0);
        self.covariance = covariance / shown.len() as f64;
        symmetrise(&mut self.covariance);
        self.shrink(shown.len(), shrinkage);
        add_jitter(&mut self.covariance, jitter);
        self.noise = (squares / samples as f64).max(1e-12 * self.covariance.trace() / size as f64);
        self.noise = self.noise.max(f64::MIN_POSITIVE);
        Ok(())
    }

    /// Shrinks the covariances between dimensions, estimated from a number of demonstrations; see
    /// [`ProMpFit::shrinkage`].
    fn shrink(&mut self, demonstrations: usize, shrinkage: f64) {
        let count = self.basis.count();
        let kept = demonstrations as f64 / (demonstrations as f64 + shrinkage);
        for (j, mut column) in self.covariance.column_iter_mut().enumerate() {
            let other = |i: &usize| i / count != j / count;
            (0..column.len()).filter(other).for_each(|i| column[i] *= kept);
        }
    }
}

fn check(demonstrations: &[DMatrix<f64>]) -> Result<usize, ProMpError> {
    let [first, _, ..] = demonstrations else {
        return Err(ProMpError::TooFew { found: demonstrations.len() });
    };
    let dimensions = first.ncols();
    if dimensions == 0 {
        return Err(ProMpError::Value(ValueError::OutOfRange {
            name: "dimensions",
            value: 0.0,
            expected: "at least 1",
        }));
    }
    for demonstration in demonstrations {
        if demonstration.ncols() != dimensions {
            let (found, expected) = (demonstration.ncols(), dimensions);
            return Err(ProMpError::Value(ValueError::Size {
                name: "a sample of a demonstration",
                found,
                expected,
            }));
        }
        if demonstration.nrows() < 2 {
            let (name, value) = ("the samples of a demonstration", demonstration.nrows() as f64);
            return Err(ProMpError::Value(ValueError::OutOfRange { name, value, expected: "at least 2" }));
        }
        if let Some(&value) = demonstration.iter().find(|value| !value.is_finite()) {
            return Err(ProMpError::Value(ValueError::NotFinite { name: "a demonstration", value }));
        }
    }
    Ok(dimensions)
}

fn prepare(basis: &ProMpBasis, demonstrations: &[DMatrix<f64>]) -> (Vec<DMatrix<f64>>, Vec<Shown>) {
    let count = basis.count();
    let mut designs: Vec<DMatrix<f64>> = Vec::new();
    let mut slopes = vec![0.0; count];
    let mut shown = Vec::with_capacity(demonstrations.len());
    for demonstration in demonstrations {
        let samples = demonstration.nrows();
        let gram = designs.iter().position(|design| design.ncols() == samples).unwrap_or_else(|| {
            let mut design = DMatrix::zeros(count, samples);
            for (k, column) in design.as_mut_slice().chunks_exact_mut(count).enumerate() {
                basis.evaluate(k as f64 / (samples - 1) as f64, column, &mut slopes);
            }
            designs.push(design);
            designs.len() - 1
        });
        let carried = &designs[gram] * demonstration;
        shown.push(Shown {
            samples,
            gram,
            carried: DVector::from_column_slice(carried.as_slice()),
            square: demonstration.norm_squared(),
        });
    }
    (designs.iter().map(|design| design * design.transpose()).collect(), shown)
}

fn inverse_of(matrix: DMatrix<f64>, name: &'static str) -> Result<Cholesky<f64, Dyn>, ProMpError> {
    matrix.cholesky().ok_or(ProMpError::NotPositive { name })
}

fn add_jitter(covariance: &mut DMatrix<f64>, jitter: f64) {
    let size = covariance.nrows();
    let added = (jitter * covariance.trace() / size as f64).max(f64::MIN_POSITIVE);
    (0..size).for_each(|i| covariance[(i, i)] += added);
}
