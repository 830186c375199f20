//! Demonstrations of a fit.

use nalgebra::DMatrix;

/// Evenly spaced positions of every recording (of every period for a rhythm), their durations, and the names.
pub(super) struct Shown {
    pub(super) recordings: usize,
    pub(super) names: Vec<String>,
    pub(super) duration: f64,
    pub(super) demonstrations: Vec<(f64, DMatrix<f64>)>,
}
