//! The linear algebra a motion library stands on: leading left singular vectors, fast and without a heavy dependency.
//!
//! - [`Simd`]: dot products and the products of a tridiagonalisation, with the widest instructions of the machine.
//! - [`eigen_of_rank_one_update`]: eigenvalues of `diag(d) + z z^T` from their secular equation.
//! - [`symmetric_eigen`]: Householder tridiagonalisation and divide and conquer.
//! - [`left_singular`]: singular values and left singular vectors from Gram matrices, one for each scale of singular
//!   values, so that squaring them costs no accuracy.
//!
//! References: Gu, Eisenstat, *A divide-and-conquer algorithm for the symmetric tridiagonal eigenproblem*, SIAM J.
//! Matrix Anal. Appl. 16, 1995. Li, *Solving secular equations stably and efficiently*, LAPACK Working Note 89, 1993.
//! Golub, Van Loan, *Matrix Computations*, 4th ed., sections 8.3 and 8.4.

mod left;
mod secular;
mod simd;
mod symmetric;
mod tridiagonal;

pub(super) use left::count_wanted;
pub use left::{LeftSingular, Wanted, left_singular};
pub use secular::{RankOne, eigen_of_rank_one_update};
pub use simd::Simd;
pub use symmetric::{SymmetricEigen, symmetric_eigen};
