//! Function approximators without the runtime.
//!
//! - [`networks`]: neural networks with seeded training on the CPU.
//! - [`kernel`], [`gp`]: covariance functions and Gaussian processes.
//! - [`gplvm`]: latent spaces that several robots and a human share.
//! - [`hmm`]: hidden Markov models.
//! - [`optimise`]: minimisation of smooth functions by L-BFGS.

pub mod gp;
pub mod gplvm;
pub mod hmm;
pub mod kernel;
pub mod networks;
pub mod optimise;
