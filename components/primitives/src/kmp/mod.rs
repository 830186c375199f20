//! Kernelised movement primitives (Huang, Rozo, Silverio, Caldwell, *Kernelized movement primitives*, IJRR
//! 38, 2019).
//!
//! A kernelised primitive imitates a reference trajectory of Gaussians `N(mu_n, S_n)` at inputs `s_n` (such
//! as time) without basis functions. The reference may come from a [`Gmr`]. With the kernel `k(s, s') =
//! exp(-|s - s'|^2 / l)` (times the identity over the outputs), `N` reference points, and `S = diag(S_1, ...,
//! S_N)`:
//!
//! mean `m(s) = k* (K + lambda_1 S)^-1 mu`, covariance `N / lambda_2 (k(s, s) - k* (K + lambda_2 S)^-1
//! k*^T)`.
//!
//! A via point extends the reference or replaces a nearby point. Several references superpose as a product of
//! Gaussians. [`KernelisedMovement`] is a kernelised primitive over the phase, fitted to demonstrations and
//! stored in files.
//!
//! [`Gmr`]: crate::gmm::Gmr

mod model;
mod movement;
mod reference;

pub use model::{Kmp, KmpSettings};
pub use movement::{KernelisedFit, KernelisedMean, KernelisedMovement, StoredKernelised};
pub use reference::{KmpError, KmpReference, ReferencePoint};
