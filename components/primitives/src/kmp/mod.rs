//! Kernelised movement primitives (Huang, Rozo, Silverio, Caldwell, *Kernelized movement primitives*, IJRR 38, 2019).
//!
//! A reference trajectory of Gaussians `N(mu_n, S_n)` at the inputs `s_n` (time, or anything else), such as a [`Gmr`] gives,
//! is imitated without basis functions. With the kernel `k(s, s') = exp(-|s - s'|^2 / l)` (times the identity over the
//! outputs), `N` reference points, and `S = diag(S_1, ..., S_N)`:
//!
//! mean `m(s) = k* (K + lambda_1 S)^-1 mu`, covariance `N / lambda_2 (k(s, s) - k* (K + lambda_2 S)^-1 k*^T)`.
//!
//! A via point joins the reference, or replaces a point next to it; several references superpose as a product of Gaussians.
//! [`KernelisedMovement`] is one over the phase, fitted to demonstrations and written to files.
//!
//! [`Gmr`]: crate::gmm::Gmr

mod model;
mod movement;
mod reference;

pub use model::{Kmp, KmpSettings};
pub use movement::{KernelisedFit, KernelisedMean, KernelisedMovement, StoredKernelised};
pub use reference::{KmpError, KmpReference, ReferencePoint};
