//! Errors of Gaussian processes.

/// Error of a Gaussian process.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GpError {
    /// The dimensions of the data do not match.
    #[error("found {found} {what}, expected {expected}")]
    Shape {
        /// Name of the counted quantity.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Number expected.
        expected: usize,
    },
    /// A value is not finite.
    #[error("{what} {index} is {value}, expected a finite number")]
    NotFinite {
        /// Name of the quantity to which the value belongs.
        what: &'static str,
        /// Index of the invalid value.
        index: usize,
        /// Value found.
        value: f64,
    },
    /// A hyperparameter is out of range, or the kernel does not match the inputs.
    #[error(
        "the kernel does not match inputs of {dimensions} dimensions, or a parameter or the noise is not a positive finite number"
    )]
    Kernel {
        /// Number of input dimensions.
        dimensions: usize,
    },
    /// The covariance is not positive definite.
    #[error(
        "the covariance of {points} points is not positive definite, tried jitters {tried:?} on its diagonal\n\
         help: remove repeated points or raise the noise variance"
    )]
    Factorisation {
        /// Number of points.
        points: usize,
        /// Jitters added to the diagonal, all without success.
        tried: Vec<f64>,
    },
}

pub(crate) fn check_finite(what: &'static str, values: &[f64]) -> Result<(), GpError> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(GpError::NotFinite { what, index, value: values[index] }),
        None => Ok(()),
    }
}
