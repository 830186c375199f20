//! Values that follow their commands smoothly.

use crate::dmp::Stride;

/// A value on its way to a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Follower {
    /// The value and its rate.
    pub(super) state: (f64, f64),
    pub(super) target: f64,
}

impl Follower {
    pub(super) fn at(value: f64) -> Self {
        Self { state: (value, 0.0), target: value }
    }

    pub(super) fn step(&mut self, stride: &Stride) {
        self.state = stride.advance(self.state, self.target, self.target);
    }
}
