//! Policies that are linear in their parameters: `u = W f(x)`, with `f(x)` the input and a constant, or monomials of it.

mod polynomial;

pub use polynomial::{PolynomialPolicy, RegressionError};
