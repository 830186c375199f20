//! Probabilistic movement primitives (Paraschos, Daniel, Peters, Neumann, *Probabilistic movement primitives*, NIPS 2013,
//! and *Using probabilistic movement primitives in robotics*, Autonomous Robots 42, 2018).
//!
//! A movement of `D` dimensions is `y(p) = Phi(p) w + e`, with the basis `Phi` over the phase `p` (0 at the start, 1 at the
//! end), weights `w ~ N(mu, Sigma)` (those of the first dimension first) and `e ~ N(0, s^2 I)`. What movements have in
//! common is in `mu`, how they vary and how their parts go together in `Sigma`.
//!
//! - [`ProMp::fit`] learns from several demonstrations, by expectation maximisation or by ridge regression of each;
//! - [`ProMp::conditioned`] bends the movement through a via point, goal or velocity;
//! - [`ProMp::product`] keeps what several primitives agree on, [`blend`] goes over from one to another;
//! - [`ProMpRunner`] follows the mean at control rate without allocating.

mod basis;
mod fit;
mod model;
mod product;
mod run;

pub use basis::ProMpBasis;
pub use fit::{Learning, ProMpFit};
pub use model::{Observed, ProMp, ProMpError, StoredProMp};
pub use product::blend;
pub use run::{ProMpMean, ProMpRunner};
