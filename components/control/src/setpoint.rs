//! The joint setpoint: the integral of the joint velocity, within the position limits.

use motorium_robots::Model;
use nalgebra::DVector;

/// Distance outside a position limit that is treated as zero, rad or m.
const AT_LIMIT: f64 = 1e-6;

/// Integrates joint velocities to a setpoint: the commanded joint positions and velocities. The positions are
/// kept within the position limits.
///
/// A joint that starts outside its limits may stay there or return, but never moves farther out.
#[derive(Clone, Debug)]
pub struct SetpointIntegrator {
    position: DVector<f64>,
    velocity: DVector<f64>,
    lower: DVector<f64>,
    upper: DVector<f64>,
}

impl SetpointIntegrator {
    /// Creates a setpoint at rest at `q` \[rad or m\], with the position limits of `model`.
    ///
    /// # Panics
    /// If the length of `q` differs from the number of independent joints.
    pub fn new(model: &Model, q: &[f64]) -> Self {
        assert_eq!(q.len(), model.nv(), "length of q");
        Self {
            position: DVector::from_column_slice(q),
            velocity: DVector::zeros(model.nv()),
            lower: model.lower().clone(),
            upper: model.upper().clone(),
        }
    }

    /// Creates a setpoint for the joints of `model`, with a fixed or a floating base, at rest at zero;
    /// [`reset`](Self::reset) sets the positions.
    pub fn of_joints(model: &Model) -> Self {
        let zeros = DVector::zeros(model.joint_count());
        let (lower, upper) = (model.lower().clone(), model.upper().clone());
        Self { position: zeros.clone(), velocity: zeros, lower, upper }
    }

    /// Resets the setpoint to rest at `q` \[rad or m\]. A joint measured outside its limits by up to 1e-6 rad
    /// or m is set to the limit, because nothing else would correct such a small violation.
    ///
    /// # Panics
    /// If the length of `q` differs from the number of independent joints.
    pub fn reset(&mut self, q: &[f64]) {
        assert_eq!(q.len(), self.position.len(), "length of q");
        for (joint, q) in q.iter().enumerate() {
            let inside = q.max(self.lower[joint]).min(self.upper[joint]);
            self.position[joint] = if (q - inside).abs() <= AT_LIMIT { inside } else { *q };
        }
        self.velocity.fill(0.0);
    }

    /// Moves the positions by `v dt` within the limits, and sets the velocities to the actual motion. `v` is
    /// in rad/s or m/s, `dt` in s. A joint with a NaN velocity does not move.
    ///
    /// # Panics
    /// If the length of `v` differs from the number of independent joints.
    pub fn integrate(&mut self, v: &[f64], dt: f64) {
        assert_eq!(v.len(), self.position.len(), "length of v");
        for (joint, v) in v.iter().enumerate() {
            let from = self.position[joint];
            let desired = from + v * dt;
            if !desired.is_finite() {
                self.velocity[joint] = 0.0;
                continue;
            }
            let to = desired.max(self.lower[joint].min(from)).min(self.upper[joint].max(from));
            self.position[joint] = to;
            self.velocity[joint] = if to == desired { *v } else { (to - from) / dt };
        }
    }

    /// Holds the current position at rest.
    pub fn hold(&mut self) {
        self.velocity.fill(0.0);
    }

    /// Keeps the position setpoint within `max_error` \[rad or m\] of the measured positions `q`. The
    /// setpoint therefore cannot run away from a blocked joint. The velocity of a joint at this limit becomes
    /// zero.
    ///
    /// # Panics
    /// If the length of `q` differs from the number of independent joints.
    pub fn limit_tracking_error(&mut self, q: &[f64], max_error: f64) {
        assert_eq!(q.len(), self.position.len(), "length of q");
        for (joint, q) in q.iter().enumerate() {
            let position = self.position[joint];
            let near = position.max(q - max_error).min(q + max_error);
            // a velocity towards the measured position is kept
            if (position - near) * self.velocity[joint] > 0.0 {
                self.velocity[joint] = 0.0;
            }
            self.position[joint] = near;
        }
    }

    /// Returns the joint positions \[rad or m\].
    pub fn position(&self) -> &[f64] {
        self.position.as_slice()
    }

    /// Returns the joint velocities \[rad/s or m/s\].
    pub fn velocity(&self) -> &[f64] {
        self.velocity.as_slice()
    }
}
