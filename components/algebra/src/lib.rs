//! Dense linear algebra for the models and the motion library, without a heavy dependency.
//!
//! - [`Simd`]: dot products and matrix-vector products with the widest vector instructions of the machine.
//! - [`Cholesky`]: a blocked factorisation with inverse, solves, and single-row append and remove.
//! - [`symmetric_eigen`]: Householder tridiagonalisation and divide and conquer.
//! - [`eigen_of_rank_one_update`]: eigenvalues of `diag(d) + z z^T` from their secular equation.
//! - [`riccati`]: the discrete algebraic Riccati equation and the linear-quadratic regulator.
//! - [`left_singular`]: singular values and left singular vectors from Gram matrices, with a separate matrix
//!   for each scale of singular values, so that squaring does not cost accuracy.
//!
//! References: Gu, Eisenstat, *A divide-and-conquer algorithm for the symmetric tridiagonal eigenproblem*,
//! SIAM J. Matrix Anal. Appl. 16, 1995. Li, *Solving secular equations stably and efficiently*, LAPACK
//! Working Note 89, 1993. Golub, Van Loan, *Matrix Computations*, 4th ed., sections 4.2, 6.5, 8.3 and 8.4.

mod cholesky;
mod left;
pub mod riccati;
mod secular;
mod simd;
mod symmetric;
mod tiles;
mod tridiagonal;

pub use cholesky::{Cholesky, NotPositiveDefinite};
pub use left::{LeftSingular, Wanted, count_wanted, left_singular};
pub use secular::{RankOne, eigen_of_rank_one_update};
pub use simd::Simd;
pub use symmetric::{SymmetricEigen, symmetric_eigen};
