//! Probabilistic movement primitives (Paraschos, Daniel, Peters, Neumann, *Probabilistic movement
//! primitives*, NIPS 2013, and *Using probabilistic movement primitives in robotics*, Autonomous Robots 42,
//! 2018).
//!
//! A movement of `D` dimensions is `y(p) = Phi(p) w + e`, with the basis `Phi` over the phase `p` (0 at the
//! start, 1 at the end), weights `w ~ N(mu, Sigma)` (ordered by dimension) and `e ~ N(0, s^2 I)`. `mu`
//! describes the mean movement, `Sigma` its variation and the correlation of its parts.
//!
//! - [`ProMp::fit`] learns from several demonstrations, by expectation maximisation or by ridge regression of
//!   each;
//! - [`ProMp::conditioned`] makes the movement pass a via point, goal or velocity;
//! - [`ProMp::product`] combines primitives where they agree, [`blend`] makes a transition from one primitive
//!   to another;
//! - [`ProMpRunner`] follows the mean at the control rate without allocating.

mod basis;
mod error;
mod fit;
mod model;
mod product;
mod run;

pub use basis::ProMpBasis;
pub use error::ProMpError;
pub use fit::{Learning, ProMpFit};
pub use model::{Observed, ProMp, StoredProMp};
pub use product::blend;
pub use run::{ProMpMean, ProMpRunner};
