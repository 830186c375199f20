//! Learning of policies and of movement weights. Only the module [`component`] needs the runtime.
//!
//! - [`task`], [`environment`]: definitions of tasks, and worlds in which to learn them.
//! - [`component`]: the component `learner.task`, which evaluates a task in a graph, and a topic with the
//!   progress of a training run.
//! - [`learner`]: trait, names and checkpoints of all gradient-based learners.
//! - [`training`]: training runs of any gradient-based learner, stored in a folder.
//! - [`ppo`], [`a2c`], [`reinforce`]: on-policy learners.
//! - [`sac`], [`td3`], [`ddpg`], [`dqn`]: off-policy learners, which use a [`replay`] buffer.
//! - [`imitation`]: behaviour cloning and DAgger.
//! - [`evaluation`]: returns of a trained policy.
//! - [`search`]: black-box search, from reward-weighted policy search to Bayesian optimisation.
//! - [`tuning`]: searches in a folder, with checkpoints, a table of evaluations, and several threads.
//! - [`random`]: counter-based random numbers, which make training runs reproducible bit for bit.
//! - [`perception`]: maps the picture of a letter to the movement that writes it.
//! - [`experiments`]: experiments reproduced from Delhaisse's PhD thesis (2019).

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
