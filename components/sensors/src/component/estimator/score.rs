//! Error of the estimate relative to the ground truth, if available.

use motorium::prelude::*;
use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};

use motorium_robots::lie::so3;

/// Number of true states kept for comparison with delayed estimates.
const KEPT: usize = 256;

/// Errors of the estimate.
#[derive(Debug, Default)]
pub(super) struct Score {
    /// Source time, position and orientation.
    truth: Vec<(u64, Vector3<f64>, UnitQuaternion<f64>)>,
    next: usize,
    start: Option<Vector3<f64>>,
    /// Last positions of the truth and of the estimate.
    last: Option<[Vector3<f64>; 2]>,
    /// Position error at the start of the scoring.
    first_error: Vector3<f64>,
    steps: f64,
    squared_angle: f64,
    squared_tilt: f64,
    most_angle: f64,
    most_position: f64,
    nees: f64,
}

/// One estimate.
pub(super) struct Estimate<'a> {
    pub(super) source: u64,
    pub(super) position: Vector3<f64>,
    pub(super) rotation: UnitQuaternion<f64>,
    pub(super) covariance: &'a SMatrix<f64, 9, 9>,
}

impl Score {
    /// Allocates the memory for the truth.
    pub(super) fn new() -> Self {
        Self { truth: Vec::with_capacity(KEPT), ..Self::default() }
    }

    /// Discards all states and errors.
    pub(super) fn reset(&mut self) {
        let mut truth = core::mem::take(&mut self.truth);
        truth.clear();
        *self = Self { truth, ..Self::default() };
    }

    /// Adds a true state.
    pub(super) fn push(&mut self, source: u64, state: &BaseState) {
        let rotation = UnitQuaternion::new_normalize(nalgebra::Quaternion::from(state.orientation));
        let entry = (source, Vector3::from(state.position), rotation);
        if self.truth.len() < KEPT {
            self.truth.push(entry);
        } else {
            self.truth[self.next] = entry;
        }
        self.next = (self.next + 1) % KEPT;
    }

    /// Scores an estimate against the true state with the same source time, if available.
    pub(super) fn add(&mut self, estimate: &Estimate<'_>) {
        let truth = self.truth.iter().find(|(source, ..)| *source == estimate.source);
        let Some(&(_, position, rotation)) = truth else { return };
        let error = estimate.position - position;
        if self.start.is_none() {
            (self.start, self.first_error) = (Some(position), error);
        }
        self.last = Some([position, estimate.position]);
        let turn = so3::log(&(estimate.rotation * rotation.inverse()));
        let tilt = so3::least_rotation(
            &nalgebra::Unit::new_normalize(rotation.inverse_transform_vector(&Vector3::z())),
            &nalgebra::Unit::new_normalize(estimate.rotation.inverse_transform_vector(&Vector3::z())),
        );
        self.steps += 1.0;
        self.squared_angle += turn.norm_squared();
        self.squared_tilt += tilt.angle().powi(2);
        self.most_angle = self.most_angle.max(turn.norm());
        self.most_position = self.most_position.max((error - self.first_error).norm());
        // rotation and position, without the velocity
        let of = |index: usize| if index < 3 { index } else { index + 3 };
        let part = SMatrix::<f64, 6, 6>::from_fn(|row, column| estimate.covariance[(of(row), of(column))]);
        let errors = SVector::<f64, 6>::from_fn(|row, _| if row < 3 { turn[row] } else { error[row - 3] });
        if let Some(factor) = part.cholesky() {
            self.nees += errors.dot(&factor.solve(&errors)) / 6.0;
        }
    }

    /// Returns the part of the result; `None` without ground truth.
    pub(super) fn result(&self) -> Option<serde_json::Value> {
        let (start, [truth, estimate]) = (self.start?, self.last?);
        let way = (truth - start).norm();
        let drift = (estimate - truth - self.first_error).norm();
        let degrees = |squared: f64| (squared / self.steps).sqrt().to_degrees();
        Some(serde_json::json!({
            "scored": self.steps,
            "way_m": way,
            "position_drift_m": drift,
            "position_drift_percent": if way > 0.0 { Some(100.0 * drift / way) } else { None },
            "position_error_m": (estimate - truth).as_slice(),
            "largest_position_drift_m": self.most_position,
            "attitude_error_rms_deg": degrees(self.squared_angle),
            "tilt_error_rms_deg": degrees(self.squared_tilt),
            "attitude_error_largest_deg": self.most_angle.to_degrees(),
            "normalised_error_squared": self.nees / self.steps,
        }))
    }
}
