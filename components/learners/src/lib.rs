//! Learners of the weights of movements and of policies. Only [`component`] needs the runtime.
//!
//! - [`task`], [`environment`]: what is to be learned, and worlds in which to learn it.
//! - [`component`]: the same task in a graph, `learner.task`.
//! - [`ppo`]: proximal policy optimisation; [`imitation`]: behaviour cloning and DAgger.
//! - [`evaluation`]: returns of a trained policy.
//! - [`search`]: black-box search, from policy search by weighted exploration to Bayesian optimisation.
//! - [`random`]: counter-based random numbers, so that a training run repeats to the bit.
//! - [`perception`]: from the picture of a letter to the movement that writes it.
//! - [`experiments`]: experiments of a thesis with them, as numbers.

pub mod component;
pub mod environment;
pub mod evaluation;
pub mod experiments;
mod files;
mod folder;
pub mod imitation;
pub mod perception;
pub mod ppo;
pub mod random;
pub mod search;
mod sha256;
pub mod task;
mod trained;

pub use component::kinds;
pub use files::FileError;
pub use folder::FolderError;
pub use trained::TrainedPolicyError;
