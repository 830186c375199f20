//! Policies that are linear in their parameters, `u = W f(x)`, and movements that are polynomials of the
//! phase. `f(x)` is the input with a constant, or the monomials of the input.

mod movement;
mod polynomial;

pub use movement::{PolynomialMovement, StoredPolynomial};
pub use polynomial::{PolynomialPolicy, RegressionError};
