//! Policies that are linear in their parameters: `u = W f(x)`, with `f(x)` the input and a constant, or monomials of it;
//! and movements that are polynomials of the phase.

mod movement;
mod polynomial;

pub use movement::{PolynomialMovement, StoredPolynomial};
pub use polynomial::{PolynomialPolicy, RegressionError};
