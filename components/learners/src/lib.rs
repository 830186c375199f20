//! Learners of the weights of movements and of policies, without the runtime.
//!
//! - [`search`]: black-box search, from policy search by weighted exploration to Bayesian optimisation.
//! - [`random`]: counter-based random numbers, so that a training run repeats to the bit.
//! - [`perception`]: from the picture of a letter to the movement that writes it.
//! - [`experiments`]: experiments of a thesis with them, as numbers.

pub mod experiments;
pub mod perception;
pub mod random;
pub mod search;
