//! Position and velocity limits of the joints as bounds of their accelerations.

use motorium_robots::Model;
use schemars::JsonSchema;
use serde::Deserialize;

with_defaults! {
    /// Acceleration bounds that keep a joint within its position and velocity limits and able to brake.
    ///
    /// Over a tick of `dt` with constant acceleration the joint moves from `(q, v)` to
    /// `q+ = q + v dt + a dt^2 / 2`, `v+ = v + a dt`. The joint must end within its limits, and slowly enough
    /// to stop before them with the deceleration `braking`:
    ///
    /// ```text
    /// v+ <= v_max,   v+^2 <= 2 braking (q_max - q+)   or   v+ <= 0
    /// ```
    ///
    /// and likewise at the lower limits (viability; Del Prete, *Joint position and velocity bounds in
    /// discrete-time acceleration/torque control of robot arms*, IEEE RA-L 2018). A joint that is too fast to
    /// stop before its limit, or already beyond it, must stop within the tick, as far as the maximum
    /// deceleration allows. A joint beyond its limit may stay there or return, but not move farther out.
    ///
    /// ```
    /// use motorium_control::inverse_dynamics::JointAccelerationLimits;
    ///
    /// let limits = JointAccelerationLimits { braking: 10.0, ..JointAccelerationLimits::default() };
    /// // at rest in the middle of its range, a joint may use its full acceleration
    /// assert_eq!(limits.bounds(0.0, 0.0, (-1.0, 1.0), f64::INFINITY, 1e-3), (-1000.0, 1000.0));
    /// // at 1 rad/s, 5 cm before its end, it must brake: 1^2 / (2 0.05) = 10 rad/s2
    /// let (_, most) = limits.bounds(0.95, 1.0, (-1.0, 1.0), f64::INFINITY, 1e-3);
    /// assert!((most + 10.0).abs() < 0.1, "{most}");
    /// ```
    #[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct JointAccelerationLimits;

    /// Deceleration that always suffices to stop a joint, rad/s2 or m/s2, more than 0. Default 20.
    pub braking: f64 = 20.0;
    /// Maximum acceleration and deceleration, rad/s2 or m/s2. Must not be less than `braking`. Default 1000.
    pub max_acceleration: f64 = 1000.0;
    /// Distance kept from the position limits of the robot, rad or m, at least 0. Limited to half the range.
    /// Default 0.
    pub margin: f64 = 0.0;
    /// Fraction of the robot's velocity limits that may be used, more than 0, at most 1. Default 1.
    pub velocity_fraction: f64 = 1.0;
}

impl JointAccelerationLimits {
    /// Returns the lower and upper bound of the acceleration \[rad/s2 or m/s2\] of a joint for a tick of `dt`
    /// seconds. The joint is at position `q` with velocity `v`; its limits are `range` and `speed`.
    pub fn bounds(&self, q: f64, v: f64, range: (f64, f64), speed: f64, dt: f64) -> (f64, f64) {
        let margin = self.margin.min(0.5 * (range.1 - range.0));
        let speed = self.velocity_fraction * speed;
        let upper = self.upper(range.1 - margin - q, v, speed, dt);
        let lower = -self.upper(q - range.0 - margin, -v, speed, dt);
        if lower <= upper {
            return (lower, upper);
        }
        // a range too narrow to brake in: between both
        let middle = 0.5 * (lower + upper);
        (middle, middle)
    }

    /// Returns the bound towards a limit at the distance `room`, with the velocity `v` towards it.
    fn upper(&self, room: f64, v: f64, speed: f64, dt: f64) -> f64 {
        // with v+ = v + a dt: v+^2 + braking dt v+ - braking (2 room - v dt) <= 0
        let half = 0.5 * self.braking * dt;
        let root = half * half + self.braking * (2.0 * room - v * dt);
        let fastest = if root > 0.0 { (root.sqrt() - half).max(0.0) } else { 0.0 };
        // the last tick before the limit: do not overshoot it
        let arrive = if room >= 0.0 { 2.0 * (room - v * dt) / (dt * dt) } else { f64::INFINITY };
        let bound = ((fastest.min(speed) - v) / dt).min(arrive.max(-self.braking));
        bound.clamp(-self.max_acceleration, self.max_acceleration)
    }

    /// Returns limits whose acceleration and braking are at most `most`.
    fn up_to(&self, most: f64) -> Self {
        Self { braking: self.braking.min(most), max_acceleration: self.max_acceleration.min(most), ..*self }
    }

    /// Writes the acceleration bounds of all joints of `model` at `q` (nq) and `v` (nv), each at most `most`:
    /// one entry per independent joint.
    pub(super) fn write(
        &self,
        model: &Model,
        (q, v): (&[f64], &[f64]),
        (most, dt): (&[f64], f64),
        lower: &mut [f64],
        upper: &mut [f64],
    ) {
        let (q, v) = (model.joints_of_q(q), model.joints_of_v(v));
        for (joint, (q, v)) in q.iter().zip(v).enumerate() {
            let range = (model.lower()[joint], model.upper()[joint]);
            let limits = self.up_to(most[joint]);
            (lower[joint], upper[joint]) = limits.bounds(*q, *v, range, model.velocity_limit()[joint], dt);
        }
    }
}
