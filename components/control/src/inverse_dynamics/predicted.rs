//! Prediction of the robot one tick ahead, and limit rows that return towards their limits.

use motorium_robots::{Kinematics, Model};

/// Row capacity of an [`InverseDynamics`](super::InverseDynamics), in addition to contacts, torques and
/// joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DynamicsRows {
    /// Number of rows of constraint tasks.
    pub constrained: usize,
    /// Number of rows of limits.
    pub limits: usize,
}

/// State of the robot one tick ahead, at its present velocity.
#[derive(Debug)]
pub(super) struct Predicted {
    pub(super) kinematics: Kinematics,
    pub(super) q: Vec<f64>,
    pub(super) step: Vec<f64>,
    /// `true` if it was computed in this tick.
    pub(super) ready: bool,
    /// Rows beyond their limit, which must return to it.
    pub(super) returning: Vec<Return>,
}

/// A row beyond its limit, which must return to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Return {
    pub(super) row: usize,
    /// Speed of the return.
    pub(super) speed: f64,
    /// Acceleration bounds that reach this speed, and bounds that keep the row in place.
    pub(super) back: (f64, f64),
    pub(super) stay: (f64, f64),
    /// Requested fraction of the return bounds; 0 to stay in place.
    pub(super) share: f64,
}

impl Return {
    /// Reduces the requested return if that can help; otherwise lets the row stay in place.
    pub(super) fn give_way(&mut self, eases: bool) {
        self.share = if eases && self.share > LEAST { self.share * EASE } else { 0.0 };
    }

    /// Acceleration bounds: the row keeps at least its speed while it returns.
    pub(super) fn bounds(&self) -> (f64, f64) {
        let (Self { back, stay, share, .. }, mut bounds) = (*self, self.stay);
        if share > 0.0 && back.0 > stay.0 {
            let kept = stay.0.max(back.0.min(0.0));
            bounds.0 = kept + share * (back.0 - kept);
        }
        if share > 0.0 && back.1 < stay.1 {
            let kept = stay.1.min(back.1.max(0.0));
            bounds.1 = kept + share * (back.1 - kept);
        }
        bounds
    }
}

/// Factor that reduces a contradicted return, and the fraction at or below which the row stays in place
/// instead.
const EASE: f64 = 0.125;
const LEAST: f64 = 0.1;
impl Predicted {
    pub(super) fn new(model: &Model, limits: usize) -> Self {
        Self {
            returning: Vec::with_capacity(limits),
            kinematics: Kinematics::new(model),
            q: model.neutral(),
            step: vec![0.0; model.nv()],
            ready: false,
        }
    }
}
