//! Policies that are linear in their parameters, `u = W f(x)`, where `f(x)` is the input with a constant or
//! its monomials; and movements that are polynomials of the phase.

mod movement;
mod polynomial;

pub use movement::{PolynomialMovement, StoredPolynomial};
pub use polynomial::{PolynomialPolicy, RegressionError};
