//! Learners of movement weights and policies. Only [`component`] needs the runtime.
//!
//! - [`task`], [`environment`]: definitions of tasks, and worlds in which to learn them.
//! - [`component`]: the same task in a graph, `learner.task`; progress of a training run on a topic.
//! - [`learner`]: the trait and the checkpoints of all gradient learners, and their names.
//! - [`training`]: runs of any of them in a folder.
//! - [`ppo`], [`a2c`], [`reinforce`]: learners from the steps of the newest policy.
//! - [`sac`], [`td3`], [`ddpg`], [`dqn`]: learners from a [`replay`] buffer.
//! - [`imitation`]: behaviour cloning and DAgger.
//! - [`evaluation`]: returns of a trained policy.
//! - [`search`]: black-box search, from policy search by weighted exploration to Bayesian optimisation.
//! - [`tuning`]: a search in a folder: checkpoints, a table of evaluations, several threads.
//! - [`random`]: counter-based random numbers, so that a training run repeats to the bit.
//! - [`perception`]: maps the picture of a letter to the movement that writes it.
//! - [`experiments`]: experiments of a thesis, reproduced as numbers.

pub mod a2c;
pub mod component;
pub mod ddpg;
pub mod dqn;
pub mod environment;
pub mod evaluation;
pub mod experiments;
mod files;
mod folder;
pub mod imitation;
pub mod learner;
pub mod perception;
pub mod ppo;
pub mod random;
pub mod reinforce;
pub mod replay;
pub mod sac;
pub mod search;
pub mod task;
pub mod td3;
mod trained;
pub mod training;
pub mod tuning;

pub use component::kinds;
pub use files::FileError;
pub use folder::FolderError;
pub use trained::TrainedPolicyError;
