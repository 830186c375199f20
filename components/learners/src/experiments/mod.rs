//! Experiments with the motion library and its learners, after Delhaisse, *Learning and control of humanoid
//! robots* (PhD thesis, 2019), chapters 2 and 3. The experiments return numbers, which `motorium reproduce`
//! plots.
//!
//! - [`search`]: policy search on weights of a library and of radial kernels.
//! - [`body`]: libraries of a full body and of its parts, and composed movements.
//! - [`locomotion`]: Bayesian optimisation of the gait of a quadruped.
//! - [`ball_in_cup`]: a ball caught in a cup by policy search over weights of a library or of kernels.
//! - [`cartpole`]: a cart-pole balanced by imitation and by reinforcement learning.
//! - [`perception`]: letters written from their pictures, compared with the nearest known picture.

pub mod ball_in_cup;
pub mod body;
pub mod cartpole;
pub mod locomotion;
pub mod perception;
pub mod search;
pub mod trials;
