//! Learners of movement weights and policies, without the runtime.
//!
//! - [`task`], [`environment`]: definitions of tasks, and worlds in which to learn them.
//! - [`learner`]: the trait, the runs and the checkpoints of all gradient learners, and their list.
//! - [`ppo`], [`a2c`], [`reinforce`]: learners from the steps of the newest policy.
//! - [`sac`], [`td3`], [`ddpg`], [`dqn`]: learners from a [`replay`] buffer.
//! - [`evaluation`]: returns of a trained policy.
//! - [`search`]: black-box search, from policy search by weighted exploration to Bayesian optimisation.
//! - [`tuning`]: a search in a folder: checkpoints, a table of evaluations, several threads.
//! - [`random`]: counter-based random numbers, so that a training run repeats to the bit.
//! - [`perception`]: maps the picture of a letter to the movement that writes it.
//! - [`experiments`]: experiments of a thesis, reproduced as numbers.

pub mod a2c;
pub mod ddpg;
pub mod dqn;
pub mod environment;
pub mod evaluation;
pub mod experiments;
mod files;
pub mod learner;
pub mod perception;
pub mod ppo;
pub mod random;
pub mod reinforce;
pub mod replay;
pub mod sac;
pub mod search;
mod sha256;
pub mod task;
pub mod td3;
pub mod tuning;

pub use files::FileError;
