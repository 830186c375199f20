//! Bounds of a joint's velocity at the end of a step, from its acceleration limit.

use crate::JointSetpoint;

/// Fraction of the acceleration limit with which a joint plans to stop before the end of its range, or at its
/// position setpoint. The remaining fraction is a reserve for joints that brake together: a shoulder carries
/// the torques of all joints behind it, and must not reach its effort limit.
pub const STOPPING_SHARE: f64 = 0.6;

/// Fraction by which a joint may exceed its acceleration limit. A joint needs this tolerance to catch up with
/// a setpoint that itself accelerates at the limit.
pub const ACCELERATION_BAND: f64 = 0.05;

impl JointSetpoint {
    /// Returns the lowest and highest velocity that the joint may have at the end of a step of `dt` \[s\].
    /// The step starts at position `q` and velocity `v`, and the joint's range is `lower` to `upper`. Both
    /// results are infinite without [`max_acceleration`](Self::max_acceleration).
    ///
    /// The bounds follow from these conditions, the most important first:
    ///
    /// - the acceleration limit, plus [`ACCELERATION_BAND`] as tolerance
    /// - the joint must be able to stop at the end of its range with [`STOPPING_SHARE`] of the limit; if the
    ///   joint follows a moving position setpoint that stops at the end of the range, it may use the whole
    ///   limit
    /// - if [`arrival_velocity`](Self::arrival_velocity) is set, the joint must be able to slow down to this
    ///   velocity at its position setpoint with [`STOPPING_SHARE`] of the limit
    ///
    /// ```
    /// use motorium_drive::JointSetpoint;
    ///
    /// let hold = JointSetpoint { max_acceleration: 10.0, ..JointSetpoint::hold(0.5, 100.0, 10.0) };
    /// let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
    /// let [slowest, fastest] = hold.end_velocities((0.0, 1.0), [-2.0, 2.0], 1e-3);
    /// assert!(near(slowest, 0.9895) && near(fastest, 1.0105));
    /// let [_, fastest] = hold.end_velocities((1.999, 0.05), [-2.0, 2.0], 1e-3);
    /// assert!(near(fastest, 0.0605), "it can stop within 1 mm");
    /// let [_, fastest] = hold.end_velocities((1.999, 0.2), [-2.0, 2.0], 1e-3);
    /// assert!(near(fastest, 0.1895), "it brakes with the whole limit");
    /// ```
    #[inline]
    pub fn end_velocities(&self, (q, v): (f64, f64), [lower, upper]: [f64; 2], dt: f64) -> [f64; 2] {
        if !self.max_acceleration.is_finite() {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        let change = (1.0 + ACCELERATION_BAND) * self.max_acceleration * dt;
        let (slowest, fastest) = (v - change, v + change);
        let highest = self.before_end(1.0, fastest, [upper - q, upper - self.position], dt).max(slowest);
        let lowest = -self.before_end(-1.0, -slowest, [q - lower, self.position - lower], dt).max(-fastest);
        let lowest = lowest.min(highest);
        let Some(arrival) = self.arrival_velocity.filter(|_| self.kp > 0.0) else { return [lowest, highest] };
        let high = self.before_setpoint(highest, self.position - q, arrival, dt).max(lowest);
        let low = -self.before_setpoint(-lowest, q - self.position, -arrival, dt).max(-high);
        [low, high]
    }

    /// Returns the highest end velocity up to `fastest` in the direction of `sign`, at these distances of the
    /// joint and of its position setpoint from the end of the range.
    #[inline]
    fn before_end(&self, sign: f64, fastest: f64, [end, of_setpoint]: [f64; 2], dt: f64) -> f64 {
        let braking = STOPPING_SHARE * self.max_acceleration;
        if stops_within(fastest, end, braking, dt) {
            return fastest;
        }
        // A moving setpoint that can stop in time is followed.
        let follows = self.kp > 0.0 && self.kd > 0.0;
        let setpoint = if follows { sign * self.velocity } else { 0.0 };
        let setpoint = setpoint.min(stopping_velocity(of_setpoint, self.max_acceleration, dt));
        let setpoint = setpoint.min(stopping_velocity(end, self.max_acceleration, dt));
        fastest.min(stopping_velocity(end, braking, dt).max(setpoint))
    }

    /// Returns the highest end velocity up to `fastest` at this distance from the position setpoint, which
    /// moves with `arrival`, in the direction of positive velocities.
    #[inline]
    fn before_setpoint(&self, fastest: f64, distance: f64, arrival: f64, dt: f64) -> f64 {
        let braking = STOPPING_SHARE * self.max_acceleration;
        if distance <= 0.0 || stops_within(fastest - arrival, distance, braking, dt) {
            return fastest;
        }
        fastest.min(arrival + stopping_velocity(distance, braking, dt))
    }
}

/// Returns `true` if a joint that moves with `velocity` during the next `dt` can then stop within `distance`.
#[inline]
fn stops_within(velocity: f64, distance: f64, braking: f64, dt: f64) -> bool {
    velocity <= 0.0 || velocity * velocity <= 2.0 * braking * (distance - velocity * dt)
}

/// Returns the largest velocity for which [`stops_within`] holds; zero beyond the end.
#[cold]
#[inline(never)]
fn stopping_velocity(distance: f64, braking: f64, dt: f64) -> f64 {
    let step = braking * dt;
    (step * step + 2.0 * braking * distance.max(0.0)).sqrt() - step
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 1e-3;
    const RANGE: [f64; 2] = [-1.0, 1.0];

    /// A joint whose drive demands the highest or the lowest velocity that the bounds allow.
    fn pushed(mut setpoint: JointSetpoint, (mut q, mut v): (f64, f64), sign: f64, steps: usize) -> [f64; 2] {
        setpoint.max_acceleration = 10.0;
        for step in 0..steps {
            let [low, high] = setpoint.end_velocities((q, v), RANGE, DT);
            assert!(low <= high, "step {step}: {low} > {high}");
            let next = if sign > 0.0 { high } else { low };
            assert!((next - v).abs() <= 10.5 * DT * (1.0 + 1e-12), "step {step}: {v} to {next}");
            v = next;
            q += v * DT;
            assert!((RANGE[0] - 1e-12..=RANGE[1] + 1e-12).contains(&q), "step {step}: {q}");
        }
        [q, v]
    }

    #[test]
    fn a_pushed_joint_stops_at_the_end_of_its_range() {
        for sign in [1.0, -1.0] {
            for start in [(0.0, 0.0), (-0.9, 0.0), (0.3, 2.0 * sign), (0.0, -2.0 * sign)] {
                let [q, v] = pushed(JointSetpoint::default(), start, sign, 5_000);
                assert!((q - sign).abs() < 1e-6 && v.abs() < 1e-6, "{start:?}: {q}, {v}");
            }
        }
    }

    #[test]
    fn a_pushed_joint_arrives_with_the_velocity_of_its_setpoint() {
        for (position, arrival) in [(0.5, 0.0), (0.3, 0.2), (0.0, -0.2), (-0.7, 0.0)] {
            let mut setpoint =
                JointSetpoint { max_acceleration: 10.0, ..JointSetpoint::hold(position, 1.0, 0.0) };
            setpoint.arrival_velocity = Some(arrival);
            let (mut q, mut v) = (-0.9, 0.0);
            while q < setpoint.position - 1e-4 {
                v = setpoint.end_velocities((q, v), RANGE, DT)[1];
                q += v * DT;
                setpoint.position += arrival * DT;
            }
            assert!((v - arrival).abs() < 0.04, "{position}: arrives with {v}");
        }
    }

    #[test]
    fn the_end_of_the_range_precedes_the_setpoint() {
        // A setpoint moves into the end, just behind the joint.
        let setpoint = JointSetpoint {
            velocity: -1.2,
            max_acceleration: 10.0,
            arrival_velocity: Some(-1.2),
            ..JointSetpoint::hold(-0.99, 1.0, 1.0)
        };
        let [low, high] = setpoint.end_velocities((-0.995, -0.1), RANGE, DT);
        assert!(low <= high && high >= -0.12, "{low} to {high}");
    }

    #[test]
    fn a_reference_that_stops_in_time_is_not_slowed() {
        // Decelerates with the whole limit to the end of the range.
        for time in [0.01, 0.1, 0.3] {
            let (q, v) = (1.0 - 5.0 * time * time, 10.0 * time);
            let reference = JointSetpoint {
                velocity: v - 10.0 * DT,
                max_acceleration: 10.0,
                ..JointSetpoint::hold(q, 1.0, 1.0)
            };
            let [_, high] = reference.end_velocities((q, v), RANGE, DT);
            assert!(high >= v - 10.0 * DT, "{time}: {high}");
            let [_, slowed] = JointSetpoint { kd: 0.0, ..reference }.end_velocities((q, v), RANGE, DT);
            assert!((slowed - (v - 10.5 * DT)).abs() < 1e-12, "{time}: {slowed}");
        }
    }

    #[test]
    fn without_an_acceleration_limit_there_is_no_bound() {
        let bounds = JointSetpoint::hold(0.5, 1.0, 1.0).end_velocities((0.999, 100.0), RANGE, DT);
        assert_eq!(bounds, [f64::NEG_INFINITY, f64::INFINITY]);
    }
}
