//! Gaussian mixtures, and regression with them.
//!
//! A mixture is `p(x) = sum_k pi_k N(x; mu_k, S_k)` with full covariances. [`Gmm::fit`] uses expectation
//! maximisation with k-means++ initialisation; [`Gmm::choose`] selects the number of components by the
//! Bayesian information criterion. [`Gmr`] predicts some coordinates from the others (Ghahramani and Jordan
//! 1994; Calinon, *A tutorial on task-parameterized movement learning and retrieval*, Intelligent Service
//! Robotics 9, 2016).

mod fit;
mod mixture;
mod regression;

pub use fit::{GmmFit, GmmFitted};
pub use mixture::{Gmm, GmmError};
pub use regression::Gmr;
