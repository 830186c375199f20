//! Fits of mixtures to samples.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;

use super::mixture::{Gmm, GmmError, log_sum};
use crate::ValueError;

/// Settings of a fit. [`Default`] returns the values documented on each field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GmmFit {
    /// Maximum number of iterations. Default 200.
    pub iterations: usize,
    /// Growth of the mean log-likelihood per sample below which the fit ends. Default 1e-6.
    pub tolerance: f64,
    /// Variance added to every covariance in every direction, relative to the mean variance of the data, so
    /// that no component collapses onto a sample. Default 1e-5.
    pub floor: f64,
    /// Number of random starts; the best fit is kept. Default 3.
    pub starts: usize,
    /// Seed of the random starts. Default 0.
    pub seed: u64,
}

impl Default for GmmFit {
    fn default() -> Self {
        Self { iterations: 200, tolerance: 1e-6, floor: 1e-5, starts: 3, seed: 0 }
    }
}

/// A fitted mixture with statistics of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct GmmFitted {
    /// The mixture.
    pub gmm: Gmm,
    /// Log-likelihood of the data, summed over all samples.
    pub log_likelihood: f64,
    /// Number of iterations.
    pub iterations: usize,
    /// `true` if the fit reached the tolerance.
    pub converged: bool,
}

impl Gmm {
    /// Fits `components` Gaussians to samples (each a row).
    ///
    /// # Errors
    /// [`GmmError`] if there are fewer samples than components, a number is not finite, or a setting is out
    /// of range.
    pub fn fit(samples: &DMatrix<f64>, components: usize, fit: &GmmFit) -> Result<GmmFitted, GmmError> {
        check(samples, components, fit)?;
        let mut rng = Pcg64::seed_from_u64(fit.seed);
        let mut best: Option<GmmFitted> = None;
        for _ in 0..fit.starts {
            let start = started(samples, components, floor_of(samples, fit), &mut rng)?;
            let fitted = start.improved(samples, fit)?;
            if best.as_ref().is_none_or(|best| fitted.log_likelihood > best.log_likelihood) {
                best = Some(fitted);
            }
        }
        best.ok_or(GmmError::Value(ValueError::OutOfRange {
            name: "starts",
            value: 0.0,
            expected: "at least 1",
        }))
    }

    /// Fits every number of components in a range and returns the model with the smallest [`bic`](Self::bic).
    ///
    /// # Errors
    /// [`GmmError`] in the same cases as [`fit`](Self::fit), and if the range is empty.
    pub fn choose(
        samples: &DMatrix<f64>,
        components: std::ops::RangeInclusive<usize>,
        fit: &GmmFit,
    ) -> Result<GmmFitted, GmmError> {
        let mut best: Option<(f64, GmmFitted)> = None;
        for count in components {
            let fitted = Self::fit(samples, count, fit)?;
            let bic = fitted.gmm.bic(samples)?;
            if best.as_ref().is_none_or(|(least, _)| bic < *least) {
                best = Some((bic, fitted));
            }
        }
        let none = GmmError::Value(ValueError::OutOfRange {
            name: "components",
            value: 0.0,
            expected: "a range with a number",
        });
        best.map(|(_, fitted)| fitted).ok_or(none)
    }

    /// Improves this mixture by expectation maximisation on `samples` (each a row).
    ///
    /// # Errors
    /// [`GmmError`] in the same cases as [`fit`](Self::fit).
    pub fn improved(mut self, samples: &DMatrix<f64>, fit: &GmmFit) -> Result<GmmFitted, GmmError> {
        check(samples, self.components(), fit)?;
        let floor = floor_of(samples, fit);
        let mut responsibilities = DMatrix::zeros(samples.nrows(), self.components());
        let mut before = f64::NEG_INFINITY;
        for iteration in 0..fit.iterations {
            self.log_joint(samples, &mut responsibilities)?;
            let mut log_likelihood = 0.0;
            for mut row in responsibilities.row_iter_mut() {
                let total = log_sum(row.iter().copied().collect::<Vec<_>>().into_iter());
                log_likelihood += total;
                row.iter_mut().for_each(|value| *value = (*value - total).exp());
            }
            if (log_likelihood - before).abs() <= fit.tolerance * samples.nrows() as f64 {
                return Ok(GmmFitted { gmm: self, log_likelihood, iterations: iteration, converged: true });
            }
            before = log_likelihood;
            self.maximise(samples, &responsibilities, floor);
        }
        let log_likelihood = self.log_likelihood(samples)?;
        Ok(GmmFitted { gmm: self, log_likelihood, iterations: fit.iterations, converged: false })
    }

    fn maximise(&mut self, samples: &DMatrix<f64>, responsibilities: &DMatrix<f64>, floor: f64) {
        for component in 0..self.components() {
            let share = responsibilities.column(component);
            let total = share.sum() + 10.0 * f64::EPSILON;
            self.weights[component] = total / samples.nrows() as f64;
            let mean: DVector<f64> = samples.tr_mul(&share) / total;
            let mut centred = samples.clone();
            for (mut row, share) in centred.row_iter_mut().zip(share.iter()) {
                row -= mean.transpose();
                row *= share.sqrt();
            }
            let mut covariance = centred.tr_mul(&centred) / total;
            (0..mean.len()).for_each(|i| covariance[(i, i)] += floor);
            self.means[component] = mean;
            self.covariances[component] = covariance;
        }
        let sum: f64 = self.weights.iter().sum();
        self.weights.iter_mut().for_each(|weight| *weight /= sum);
    }
}

fn check(samples: &DMatrix<f64>, components: usize, fit: &GmmFit) -> Result<(), GmmError> {
    for (name, value, holds) in [
        ("components", components as f64, components > 0),
        ("dimensions", samples.ncols() as f64, samples.ncols() > 0),
        ("starts", fit.starts as f64, fit.starts > 0),
        ("iterations", fit.iterations as f64, fit.iterations > 0),
    ] {
        if !holds {
            return Err(GmmError::Value(ValueError::OutOfRange { name, value, expected: "at least 1" }));
        }
    }
    for (name, value) in [("tolerance", fit.tolerance), ("floor", fit.floor)] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(GmmError::Value(ValueError::OutOfRange {
                name,
                value,
                expected: "a finite number of at least 0",
            }));
        }
    }
    if samples.nrows() < components {
        return Err(GmmError::TooFew { samples: samples.nrows(), components });
    }
    for (sample, row) in samples.row_iter().enumerate() {
        if let Some(&value) = row.iter().find(|value| !value.is_finite()) {
            return Err(GmmError::NotFinite { sample, value });
        }
    }
    Ok(())
}

/// Returns the floor in squared units of the data.
fn floor_of(samples: &DMatrix<f64>, fit: &GmmFit) -> f64 {
    let mean = samples.column_iter().map(|column| column.variance()).sum::<f64>() / samples.ncols() as f64;
    (fit.floor * mean).max(f64::MIN_POSITIVE)
}

/// Runs k-means++ (Arthur and Vassilvitskii 2007) and a few rounds of k-means, and returns the Gaussians of
/// the clusters.
fn started(samples: &DMatrix<f64>, components: usize, floor: f64, rng: &mut Pcg64) -> Result<Gmm, GmmError> {
    let (count, dimensions) = samples.shape();
    let distance = |sample: usize, centre: &DVector<f64>| -> f64 {
        (0..dimensions).map(|d| (samples[(sample, d)] - centre[d]).powi(2)).sum()
    };
    let mut centres = vec![samples.row(rng.random_range(0..count)).transpose()];
    let mut nearest: Vec<f64> = (0..count).map(|n| distance(n, &centres[0])).collect();
    while centres.len() < components {
        let mut left = rng.random::<f64>() * nearest.iter().sum::<f64>();
        let chosen = nearest
            .iter()
            .position(|square| {
                left -= square;
                left < 0.0
            })
            .unwrap_or(count - 1);
        let centre = samples.row(chosen).transpose();
        for (n, square) in nearest.iter_mut().enumerate() {
            *square = square.min(distance(n, &centre));
        }
        centres.push(centre);
    }
    let mut owner = vec![0; count];
    for _ in 0..10 {
        for (n, owner) in owner.iter_mut().enumerate() {
            let mut squares = centres.iter().map(|centre| distance(n, centre)).enumerate();
            let first = squares.next().unwrap_or((0, 0.0));
            *owner = squares.fold(first, |best, next| if next.1 < best.1 { next } else { best }).0;
        }
        for (k, centre) in centres.iter_mut().enumerate() {
            let members: Vec<usize> = (0..count).filter(|n| owner[*n] == k).collect();
            if !members.is_empty() {
                centre.fill(0.0);
                members.iter().for_each(|n| *centre += samples.row(*n).transpose() / members.len() as f64);
            }
        }
    }
    let responsibilities = DMatrix::from_fn(count, components, |n, k| if owner[n] == k { 1.0 } else { 1e-6 });
    let covariances = vec![DMatrix::identity(dimensions, dimensions); components];
    let mut gmm = Gmm { weights: vec![1.0 / components as f64; components], means: centres, covariances };
    gmm.maximise(samples, &responsibilities, floor);
    Ok(gmm)
}
