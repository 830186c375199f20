//! Linear and polynomial policies.

use nalgebra::DMatrix;

use crate::ValueError;

/// A polynomial policy `u = W f(x)`. `f` contains all monomials of `x` up to a total degree, the constant 1
/// first, in graded lexicographic order: for two inputs and degree 2, `1, x0, x1, x0^2, x0 x1, x1^2`. Degree
/// 1 is the linear policy `u = W x + b`. Only construction allocates.
#[derive(Clone, Debug, PartialEq)]
pub struct PolynomialPolicy {
    inputs: usize,
    degree: usize,
    /// Each monomial is an earlier one multiplied by an input, stored as `(earlier, input)`. The constant
    /// comes first.
    monomials: Vec<(usize, usize)>,
    /// Monomials x outputs.
    weights: DMatrix<f64>,
    features: Vec<f64>,
}

/// Error returned when a polynomial policy cannot be created, fitted or evaluated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RegressionError {
    /// A number, vector or matrix is invalid.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// The samples do not determine all monomials.
    #[error(
        "{samples} samples cannot determine {monomials} monomials: use a lower degree, more samples or lambda > 0"
    )]
    Undetermined {
        /// Number of samples found.
        samples: usize,
        /// Number of monomials to be determined.
        monomials: usize,
    },
}

/// Maximum number of monomials; more indicate a mistaken degree.
const MOST_MONOMIALS: usize = 10_000;

impl PolynomialPolicy {
    /// Creates a policy with zero weights.
    ///
    /// # Errors
    /// [`RegressionError`] if there is no input or no output, or there are more than 10,000 monomials.
    pub fn new(inputs: usize, outputs: usize, degree: usize) -> Result<Self, RegressionError> {
        for (name, value) in [("inputs", inputs), ("outputs", outputs)] {
            if value == 0 {
                return Err(RegressionError::Value(ValueError::OutOfRange {
                    name,
                    value: 0.0,
                    expected: "at least 1",
                }));
            }
        }
        let mut monomials = vec![(0, 0)];
        // monomials of one degree: each of the previous degree times every input from its last one on
        let mut last = vec![(0, 0)];
        for _ in 0..degree {
            let mut next = Vec::new();
            for (place, first) in &last {
                for input in *first..inputs {
                    next.push((monomials.len(), input));
                    monomials.push((*place, input));
                    if monomials.len() > MOST_MONOMIALS {
                        let (name, value) = ("the number of monomials", monomials.len() as f64);
                        return Err(RegressionError::Value(ValueError::OutOfRange {
                            name,
                            value,
                            expected: "at most 10000",
                        }));
                    }
                }
            }
            last = next;
        }
        Ok(Self {
            inputs,
            degree,
            weights: DMatrix::zeros(monomials.len(), outputs),
            features: vec![0.0; monomials.len()],
            monomials,
        })
    }

    /// Fits a policy to inputs (samples x inputs) and outputs (samples x outputs) by least squares with the
    /// penalty `lambda |W|^2`, which excludes the constant.
    ///
    /// # Errors
    /// [`RegressionError`] if sizes do not match, a number is not finite, the penalty is negative, or the
    /// samples do not determine the weights.
    pub fn fit(
        inputs: &DMatrix<f64>,
        outputs: &DMatrix<f64>,
        degree: usize,
        lambda: f64,
    ) -> Result<Self, RegressionError> {
        if outputs.nrows() != inputs.nrows() {
            let (found, expected) = (outputs.nrows(), inputs.nrows());
            return Err(RegressionError::Value(ValueError::Size {
                name: "a column of the outputs",
                found,
                expected,
            }));
        }
        for (name, matrix) in [("the inputs", inputs), ("the outputs", outputs)] {
            if let Some(&value) = matrix.iter().find(|value| !value.is_finite()) {
                return Err(RegressionError::Value(ValueError::NotFinite { name, value }));
            }
        }
        if !(lambda >= 0.0 && lambda.is_finite()) {
            let expected = "a finite number of at least 0";
            return Err(RegressionError::Value(ValueError::OutOfRange {
                name: "lambda",
                value: lambda,
                expected,
            }));
        }
        let mut policy = Self::new(inputs.ncols(), outputs.ncols(), degree)?;
        let (samples, monomials) = (inputs.nrows(), policy.monomials.len());
        let undetermined = || RegressionError::Undetermined { samples, monomials };
        if lambda == 0.0 && samples < monomials {
            return Err(undetermined());
        }
        let mut left = DMatrix::zeros(samples + monomials, monomials);
        let mut row = vec![0.0; inputs.ncols()];
        for k in 0..samples {
            row.iter_mut().enumerate().for_each(|(i, value)| *value = inputs[(k, i)]);
            policy.evaluate(&row);
            left.row_mut(k).iter_mut().zip(&policy.features).for_each(|(place, feature)| *place = *feature);
        }
        for i in 1..monomials {
            left[(samples + i, i)] = lambda.sqrt();
        }
        let mut right = DMatrix::zeros(samples + monomials, outputs.ncols());
        right.rows_mut(0, samples).copy_from(outputs);
        let factored = left.qr();
        factored.q_tr_mul(&mut right);
        let triangle = factored.r();
        let largest = triangle.diagonal().amax();
        if triangle.diagonal().iter().any(|pivot| pivot.abs() <= 100.0 * largest * f64::EPSILON) {
            return Err(undetermined());
        }
        let solution = right.rows(0, monomials).into_owned();
        policy.weights = triangle.solve_upper_triangular(&solution).ok_or_else(undetermined)?;
        Ok(policy)
    }

    /// Returns the number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Returns the number of outputs.
    pub fn outputs(&self) -> usize {
        self.weights.ncols()
    }

    /// Returns the total degree.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Returns the weights, monomials x outputs.
    pub fn weights(&self) -> &DMatrix<f64> {
        &self.weights
    }

    /// Returns the weights (monomials x outputs), so that learners can change them. The number of weights is
    /// fixed.
    pub fn weights_mut(&mut self) -> nalgebra::DMatrixViewMut<'_, f64> {
        self.weights.as_view_mut()
    }

    /// Writes the action for an input.
    ///
    /// # Errors
    /// [`RegressionError`] if a slice has the wrong length.
    pub fn act(&mut self, input: &[f64], action: &mut [f64]) -> Result<(), RegressionError> {
        for (name, found, expected) in
            [("the input", input.len(), self.inputs), ("the action", action.len(), self.outputs())]
        {
            if found != expected {
                return Err(RegressionError::Value(ValueError::Size { name, found, expected }));
            }
        }
        self.evaluate(input);
        for (action, weights) in action.iter_mut().zip(self.weights.column_iter()) {
            *action = weights.iter().zip(&self.features).map(|(weight, feature)| weight * feature).sum();
        }
        Ok(())
    }

    fn evaluate(&mut self, input: &[f64]) {
        self.features[0] = 1.0;
        for (place, (earlier, factor)) in self.monomials.iter().enumerate().skip(1) {
            self.features[place] = self.features[*earlier] * input[*factor];
        }
    }
}
