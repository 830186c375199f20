//! Latent spaces shared by a human and any number of robots (shared Gaussian process latent variable models).
//!
//! Each space `i`, a set of poses `Y_i` with `N` rows, is a Gaussian process of a common latent matrix `X`
//! with `N` rows and `q` columns: `E_i = (D_i N ln 2 pi + D_i ln |K_i| + tr K_i^-1 Y_i Y_i^T) / 2`, with
//! noise and an RBF kernel that has one length scale for each latent dimension. Training minimises
//! `sum_i E_i + |X|^2 / 2` by L-BFGS with analytic gradients, starting from the principal components of the
//! first space.
//!
//! **Back constraints** make the latent point a function of one space's pose: the standardised pose itself
//! (the default), a kernel regression, or a network with one hidden layer. A new pose then maps directly to a
//! latent point. If the latent point is the pose, the spaces share no unknowns, and each space is fitted
//! separately, as in a transfer.
//!
//! The **prior** on the latent points is flat, standard normal (the default), or a Gaussian process from each
//! point to the next point of its movement.
//!
//! **Transfer** adds a robot to a trained model: `X` and all other spaces stay fixed, and only the robot's
//! `q + 2` hyperparameters are fitted. The fit tries three starts.
//!
//! References: Lawrence, *Probabilistic non-linear principal component analysis with Gaussian process latent
//! variable models*, JMLR 6, 2005; Lawrence, Quinonero-Candela, *Local distance preservation in the GP-LVM
//! through back constraints*, ICML 2006; Ek, Torr, Lawrence, *Gaussian process latent variable models for
//! human pose estimation*, MLMI 2007; Wang, Fleet, Hertzmann, *Gaussian process dynamical models for human
//! motion*, IEEE TPAMI 30, 2008.

mod back;
mod dynamics;
mod evaluate;
mod experiment;
mod file;
mod infer;
mod model;
mod poses;
mod space;
mod train;

pub use back::BackForm;
pub use evaluate::{MethodError, compare};
pub use experiment::{
    Estimate, FewPoses, TransferResult, few_poses, trained_together, transfer_and_training,
};
pub use file::{FileError, VERSION};
pub use infer::Scratch;
pub use model::{LatentModel, Transferred};
pub use poses::{Poses, PosesError};
pub use space::{Space, SpaceData};
pub use train::{Prior, Settings, Trained, Workspace};

use crate::gp::GpError;

/// Error of a latent model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LatentError {
    /// The poses of a space are invalid.
    #[error("space {space}: {error}")]
    Space {
        /// Name of the space.
        space: String,
        /// Reason why the poses are invalid.
        error: GpError,
    },
    /// The model has no space with this name.
    #[error("unknown space {name}, expected one of {known:?}")]
    UnknownSpace {
        /// The unknown name.
        name: String,
        /// Names of the existing spaces.
        known: Vec<String>,
    },
    /// Two spaces have the same name.
    #[error("the space {name} exists twice, expected different names")]
    SameName {
        /// The duplicate name.
        name: String,
    },
    /// A setting is out of range.
    #[error("{setting} is {found}, expected {expected}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Value found.
        found: String,
        /// Description of the valid range.
        expected: String,
    },
}
