//! Views of the Jacobians of tasks.

use nalgebra::{Const, Dyn, MatrixView, U1};

/// The Jacobian of a task with `R` rows, R x nv.
pub type JacobianView<'a, const R: usize> = MatrixView<'a, f64, Const<R>, Dyn, U1, Dyn>;
