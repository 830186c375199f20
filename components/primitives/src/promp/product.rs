//! Combination of several probabilistic primitives.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::error::ProMpError;
use super::model::{ProMp, symmetrise};
use crate::ValueError;

impl ProMp {
    /// Returns the product of several primitives: the product of the Gaussians of their weights, each raised
    /// to its activation, `Sigma = (sum_k a_k Sigma_k^-1)^-1`, `mu = Sigma sum_k a_k Sigma_k^-1 mu_k`. A
    /// primitive dominates where its variance is small.
    ///
    /// # Errors
    /// [`ProMpError`] if there is no primitive, the bases differ, an activation is not positive, or a
    /// covariance is not invertible.
    pub fn product(primitives: &[(&Self, f64)]) -> Result<Self, ProMpError> {
        let [(first, _), ..] = primitives else {
            return Err(ProMpError::TooFew { found: 0 });
        };
        let same = |promp: &Self| promp.basis == first.basis && promp.dimensions == first.dimensions;
        if !primitives.iter().all(|(promp, _)| same(promp)) {
            return Err(ProMpError::Different);
        }
        let gaussians = primitives.iter().map(|(promp, a)| (&promp.mean, &promp.covariance, *a));
        let (mean, covariance) = product_of(gaussians)?;
        Ok(Self { mean, covariance, ..(*first).clone() })
    }
}

/// Blends several primitives at a phase. Returns mean and covariance of the product of their position
/// Gaussians, each raised to its activation at this phase. Activations that vary with the phase give a
/// transition from one primitive to another. The bases may differ.
///
/// # Errors
/// [`ProMpError`] if there is no primitive, the dimensions differ, activations are negative or all zero, or a
/// covariance is not invertible.
pub fn blend(primitives: &[(&ProMp, f64)], phase: f64) -> Result<(DVector<f64>, DMatrix<f64>), ProMpError> {
    let [(first, _), ..] = primitives else {
        return Err(ProMpError::TooFew { found: 0 });
    };
    if primitives.iter().any(|(promp, _)| promp.dimensions != first.dimensions) {
        return Err(ProMpError::Different);
    }
    let active: Vec<_> = primitives
        .iter()
        .filter(|(_, activation)| *activation != 0.0)
        .map(|(promp, activation)| (promp.mean_at(phase), promp.covariance_at(phase), *activation))
        .collect();
    if active.is_empty() {
        let expected = "at least one above zero";
        return Err(ProMpError::Value(ValueError::OutOfRange {
            name: "the activations",
            value: 0.0,
            expected,
        }));
    }
    product_of(active.iter().map(|(mean, covariance, a)| (mean, covariance, *a)))
}

fn product_of<'a>(
    gaussians: impl Iterator<Item = (&'a DVector<f64>, &'a DMatrix<f64>, f64)>,
) -> Result<(DVector<f64>, DMatrix<f64>), ProMpError> {
    let mut sum: Option<(DVector<f64>, DMatrix<f64>)> = None;
    for (mean, covariance, activation) in gaussians {
        if !(activation > 0.0 && activation.is_finite()) {
            let expected = "a positive number";
            return Err(ProMpError::Value(ValueError::OutOfRange {
                name: "an activation",
                value: activation,
                expected,
            }));
        }
        let precision = inverse(covariance.clone())? * activation;
        let information = &precision * mean;
        sum = Some(match sum {
            None => (information, precision),
            Some((a, b)) => (a + information, b + precision),
        });
    }
    let (information, precision) = sum.ok_or(ProMpError::TooFew { found: 0 })?;
    let mut covariance = inverse(precision)?;
    symmetrise(&mut covariance);
    Ok((&covariance * information, covariance))
}

fn inverse(mut matrix: DMatrix<f64>) -> Result<DMatrix<f64>, ProMpError> {
    // a movement that is known exactly somewhere has a singular covariance there; this jitter makes it
    // invertible
    let jitter = 1e-10 * matrix.trace() / matrix.nrows() as f64;
    (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += jitter);
    let factor: Option<Cholesky<f64, Dyn>> = matrix.cholesky();
    Ok(factor.ok_or(ProMpError::NotPositive { name: "a covariance" })?.inverse())
}
