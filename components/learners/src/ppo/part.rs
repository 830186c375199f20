//! Parts of a gradient.

use super::network::Trace;

/// Averages over an update.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Losses {
    pub(super) policy: f64,
    pub(super) value: f64,
    pub(super) entropy: f64,
    pub(super) divergence: f64,
    pub(super) rate: f64,
}

/// Gradient and losses of a chunk, summed over its samples.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    pub(super) policy: Vec<f32>,
    pub(super) value: Vec<f32>,
    pub(super) deviations: Vec<f32>,
    pub(super) losses: Losses,
}

/// Buffers of a thread for the passes through policy and value.
#[derive(Clone, Debug, Default)]
pub(super) struct Passes {
    /// Observations of a chunk.
    pub(super) input: Vec<f32>,
    pub(super) policy: Trace,
    pub(super) value: Trace,
}
