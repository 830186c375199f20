//! The reference of a kernelised primitive.

use nalgebra::{DMatrix, DVector};

use crate::ValueError;
use crate::gmm::Gmr;

/// One point of a reference trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferencePoint {
    /// Input `s`.
    pub input: DVector<f64>,
    /// Mean of the outputs at this input.
    pub mean: DVector<f64>,
    /// Covariance of the outputs at this input, positive definite.
    pub covariance: DMatrix<f64>,
}

/// A reference trajectory of Gaussians.
#[derive(Clone, Debug, PartialEq)]
pub struct KmpReference {
    points: Vec<ReferencePoint>,
}

/// Error returned when a kernelised primitive cannot be created or conditioned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KmpError {
    /// A number, vector or matrix is invalid.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// The reference is empty.
    #[error("the reference has no point, expected at least one")]
    Empty,
    /// A covariance is not positive definite, or a value is not finite.
    #[error("reference point {point}: the covariance is not positive definite, or a number is not finite")]
    NotPositive {
        /// Index of the point, from 0.
        point: usize,
    },
    /// The references have different inputs and cannot be superposed.
    #[error("the references have different inputs at point {point}: build them from the same inputs")]
    Different {
        /// Index of the point, from 0.
        point: usize,
    },
    /// The regression rejected an input.
    #[error(transparent)]
    Regression(#[from] crate::gmm::GmmError),
}

impl KmpReference {
    /// Creates a reference from points.
    ///
    /// # Errors
    /// [`KmpError`] if there is no point, sizes differ, or a covariance is not positive definite.
    pub fn new(points: Vec<ReferencePoint>) -> Result<Self, KmpError> {
        let first = points.first().ok_or(KmpError::Empty)?;
        let (inputs, outputs) = (first.input.len(), first.mean.len());
        for (index, point) in points.iter().enumerate() {
            check(point, index, inputs, outputs)?;
        }
        Ok(Self { points })
    }

    /// Creates a reference from the predictions of a regression at these inputs.
    ///
    /// # Errors
    /// [`KmpError`] if there is no input, or the regression rejects an input.
    pub fn from_regression(gmr: &mut Gmr, inputs: &[DVector<f64>]) -> Result<Self, KmpError> {
        let mut points = Vec::with_capacity(inputs.len());
        for input in inputs {
            let (mean, covariance) = gmr.predict(input.as_slice())?;
            points.push(ReferencePoint {
                input: input.clone(),
                mean: mean.clone(),
                covariance: covariance.clone(),
            });
        }
        Self::new(points)
    }

    /// Returns the points of the reference.
    pub fn points(&self) -> &[ReferencePoint] {
        &self.points
    }

    /// Inserts a via point. If the input of an existing point is closer than `within`, the via point replaces
    /// this point.
    ///
    /// # Errors
    /// [`KmpError`] if sizes differ, or the covariance is not positive definite.
    pub fn insert(&mut self, point: ReferencePoint, within: f64) -> Result<(), KmpError> {
        let (inputs, outputs) = (self.points[0].input.len(), self.points[0].mean.len());
        check(&point, self.points.len(), inputs, outputs)?;
        let nearest = self
            .points
            .iter()
            .map(|other| (&other.input - &point.input).norm())
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match nearest {
            Some((index, distance)) if distance < within => self.points[index] = point,
            _ => self.points.push(point),
        }
        Ok(())
    }

    /// Returns the product of several references at the same inputs, weighted by priorities (references x
    /// points): `S_n = (sum_l g_ln S_ln^-1)^-1`, `mu_n = S_n sum_l g_ln S_ln^-1 mu_ln`.
    ///
    /// # Errors
    /// [`KmpError`] if there is no reference, the inputs differ, or the priorities at a point are negative or
    /// all zero.
    pub fn superposed(references: &[&Self], priorities: &DMatrix<f64>) -> Result<Self, KmpError> {
        let first = references.first().ok_or(KmpError::Empty)?;
        let (rows, columns) = (references.len(), first.points.len());
        for (name, found, expected) in [
            ("a column of the priorities", priorities.nrows(), rows),
            ("a row of the priorities", priorities.ncols(), columns),
        ] {
            if found != expected {
                return Err(KmpError::Value(ValueError::Size { name, found, expected }));
            }
        }
        let outputs = first.points[0].mean.len();
        let mut points = Vec::with_capacity(columns);
        for n in 0..columns {
            let mut precision = DMatrix::zeros(outputs, outputs);
            let mut information = DVector::zeros(outputs);
            for (l, reference) in references.iter().enumerate() {
                let priority = priorities[(l, n)];
                if !(priority >= 0.0 && priority.is_finite()) {
                    let expected = "a finite number of at least 0";
                    return Err(KmpError::Value(ValueError::OutOfRange {
                        name: "a priority",
                        value: priority,
                        expected,
                    }));
                }
                let point = reference.points.get(n).ok_or(KmpError::Different { point: n })?;
                if point.input != first.points[n].input || point.mean.len() != outputs {
                    return Err(KmpError::Different { point: n });
                }
                let inverse = point.covariance.clone().cholesky();
                let inverse = inverse.ok_or(KmpError::NotPositive { point: n })?.inverse() * priority;
                information += &inverse * &point.mean;
                precision += inverse;
            }
            let covariance = precision.cholesky().ok_or(KmpError::NotPositive { point: n })?.inverse();
            let mean = &covariance * information;
            points.push(ReferencePoint { input: first.points[n].input.clone(), mean, covariance });
        }
        Self::new(points)
    }
}

fn check(point: &ReferencePoint, index: usize, inputs: usize, outputs: usize) -> Result<(), KmpError> {
    for (name, found, expected) in [
        ("an input", point.input.len(), inputs),
        ("a mean", point.mean.len(), outputs),
        ("a column of a covariance", point.covariance.nrows(), outputs),
        ("a row of a covariance", point.covariance.ncols(), outputs),
    ] {
        if found != expected {
            return Err(KmpError::Value(ValueError::Size { name, found, expected }));
        }
    }
    let mut numbers = point.input.iter().chain(point.mean.iter()).chain(point.covariance.iter());
    if !numbers.all(|value| value.is_finite()) || point.covariance.clone().cholesky().is_none() {
        return Err(KmpError::NotPositive { point: index });
    }
    Ok(())
}
