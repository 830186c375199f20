//! A kernelised primitive, prepared for evaluation.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::reference::{KmpError, KmpReference};
use crate::ValueError;

/// Parameters of a kernelised primitive. [`Default`] returns the values documented on each field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KmpSettings {
    /// Regularisation `lambda_1` of the mean. Default 1.
    pub mean_regularisation: f64,
    /// Regularisation `lambda_2` of the covariance. Default 60.
    pub covariance_regularisation: f64,
    /// Length parameter `l` of the kernel, in the squared unit of the input. Default 2.
    pub length: f64,
}

impl Default for KmpSettings {
    fn default() -> Self {
        Self { mean_regularisation: 1.0, covariance_regularisation: 60.0, length: 2.0 }
    }
}

/// A kernelised primitive. [`mean`](Self::mean) does not allocate; [`covariance`](Self::covariance)
/// allocates.
#[derive(Clone, Debug)]
pub struct Kmp {
    settings: KmpSettings,
    inputs: Vec<DVector<f64>>,
    outputs: usize,
    /// `(K + lambda_1 S)^-1 mu`, point by point.
    coefficients: DVector<f64>,
    /// `K + lambda_2 S`, factored.
    factor: Cholesky<f64, Dyn>,
    mean: DVector<f64>,
}

impl Kmp {
    /// Prepares a primitive from a reference.
    ///
    /// # Errors
    /// [`KmpError`] if a setting is out of range, or a matrix is not positive definite.
    pub fn new(reference: &KmpReference, settings: KmpSettings) -> Result<Self, KmpError> {
        for (name, value) in [
            ("mean_regularisation", settings.mean_regularisation),
            ("covariance_regularisation", settings.covariance_regularisation),
            ("length", settings.length),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(KmpError::Value(ValueError::OutOfRange {
                    name,
                    value,
                    expected: "a positive number",
                }));
            }
        }
        let points = reference.points();
        let outputs = points[0].mean.len();
        let size = points.len() * outputs;
        let matrix = |lambda: f64| {
            let mut matrix = DMatrix::zeros(size, size);
            for (a, first) in points.iter().enumerate() {
                for (b, second) in points.iter().enumerate() {
                    let k = kernel(first.input.as_slice(), second.input.as_slice(), settings.length);
                    (0..outputs).for_each(|d| matrix[(a * outputs + d, b * outputs + d)] = k);
                }
                let mut block = matrix.view_mut((a * outputs, a * outputs), (outputs, outputs));
                block += &first.covariance * lambda;
            }
            matrix.cholesky().ok_or(KmpError::NotPositive { point: 0 })
        };
        let means = DVector::from_iterator(size, points.iter().flat_map(|point| point.mean.iter().copied()));
        Ok(Self {
            coefficients: matrix(settings.mean_regularisation)?.solve(&means),
            factor: matrix(settings.covariance_regularisation)?,
            inputs: points.iter().map(|point| point.input.clone()).collect(),
            mean: DVector::zeros(outputs),
            outputs,
            settings,
        })
    }

    /// Returns the mean of the outputs at an input.
    ///
    /// # Errors
    /// [`KmpError`] if the input has the wrong length or is not finite.
    pub fn mean(&mut self, input: &[f64]) -> Result<&DVector<f64>, KmpError> {
        self.check(input)?;
        self.mean.fill(0.0);
        for (n, place) in self.inputs.iter().enumerate() {
            let k = kernel(input, place.as_slice(), self.settings.length);
            self.mean.axpy(k, &self.coefficients.rows(n * self.outputs, self.outputs), 1.0);
        }
        Ok(&self.mean)
    }

    /// Returns the number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Writes the mean and its derivative at a one-dimensional input.
    pub(super) fn mean_into(&self, input: f64, mean: &mut [f64], slope: &mut [f64]) {
        mean.fill(0.0);
        slope.fill(0.0);
        let points = self.inputs.iter().zip(self.coefficients.as_slice().chunks_exact(self.outputs));
        for (place, coefficients) in points {
            let k = kernel(&[input], place.as_slice(), self.settings.length);
            let per_input = -2.0 * (input - place[0]) / self.settings.length * k;
            for (d, coefficient) in coefficients.iter().enumerate() {
                mean[d] += k * coefficient;
                slope[d] += per_input * coefficient;
            }
        }
    }

    /// Returns the covariance of the outputs at an input.
    ///
    /// # Errors
    /// [`KmpError`] if the input has the wrong length or is not finite.
    pub fn covariance(&self, input: &[f64]) -> Result<DMatrix<f64>, KmpError> {
        self.check(input)?;
        let mut row = DMatrix::zeros(self.inputs.len() * self.outputs, self.outputs);
        for (n, place) in self.inputs.iter().enumerate() {
            let k = kernel(input, place.as_slice(), self.settings.length);
            (0..self.outputs).for_each(|d| row[(n * self.outputs + d, d)] = k);
        }
        let explained = row.tr_mul(&self.factor.solve(&row));
        let scale = self.inputs.len() as f64 / self.settings.covariance_regularisation;
        Ok((DMatrix::identity(self.outputs, self.outputs) - explained) * scale)
    }

    fn check(&self, input: &[f64]) -> Result<(), KmpError> {
        let expected = self.inputs[0].len();
        if input.len() != expected {
            return Err(KmpError::Value(ValueError::Size {
                name: "the input",
                found: input.len(),
                expected,
            }));
        }
        match input.iter().find(|value| !value.is_finite()) {
            Some(&value) => Err(KmpError::Value(ValueError::OutOfRange {
                name: "the input",
                value,
                expected: "finite numbers",
            })),
            None => Ok(()),
        }
    }
}

fn kernel(a: &[f64], b: &[f64], length: f64) -> f64 {
    let squared: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (-squared / length).exp()
}
