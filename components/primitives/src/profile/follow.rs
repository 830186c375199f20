//! Setpoints that follow a target within limits.

use super::MotionLimits;

/// Fraction of the acceleration used for braking towards a target. The rest is kept for the target's own
/// motion: with the full acceleration, a joint overshoots targets that accelerate.
const APPROACH: f64 = 0.5;

/// Setpoints of several joints that follow targets with step changes. Velocity, acceleration and position
/// stay within limits at every step.
///
/// Each joint moves at the velocity of its target plus an approach velocity `v`. `v` is the largest velocity
/// from which the joint can brake within the remaining distance `d`, in steps of constant velocity:
/// `v^2 / 2a + v dt / 2 <= d`, where `a` is half of the maximum acceleration. The jerk is not limited. Only
/// [`new`](Self::new) allocates.
///
/// ```
/// use motorium_primitives::profile::{Follower, MotionLimits};
///
/// let limits = MotionLimits { velocity: 1.0, acceleration: 10.0, jerk: f64::INFINITY };
/// let mut follower = Follower::new(vec![limits], vec![[-1.0, 1.0]]);
/// follower.start(&[0.0]);
/// follower.step(1e-3, &[0.5], &[0.0]);
/// assert_eq!(follower.velocity(), [0.01]); // 10 rad/s^2 for 1 ms
/// for _ in 0..1000 {
///     follower.step(1e-3, &[0.5], &[0.0]);
/// }
/// assert!((follower.position()[0] - 0.5).abs() < 1e-9);
/// ```
#[derive(Clone, Debug)]
pub struct Follower {
    limits: Vec<MotionLimits>,
    ranges: Vec<[f64; 2]>,
    position: Vec<f64>,
    velocity: Vec<f64>,
}

impl Follower {
    /// Creates a follower at rest at 0, with limits and a position range for each joint. Limits may be
    /// infinite.
    pub fn new(limits: Vec<MotionLimits>, ranges: Vec<[f64; 2]>) -> Self {
        let zeros = vec![0.0; limits.len()];
        Self { limits, ranges, position: zeros.clone(), velocity: zeros }
    }

    /// Starts at rest at the given positions.
    ///
    /// # Panics
    ///
    /// If the number of positions differs from the number of joints.
    pub fn start(&mut self, position: &[f64]) {
        self.position.copy_from_slice(position);
        self.velocity.fill(0.0);
    }

    /// Returns the position setpoints.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Returns the velocities of the setpoints in the last step, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Advances by `dt` \[s\] towards targets at the positions `target` that move with the velocities `rate`
    /// \[1/s\].
    pub fn step(&mut self, dt: f64, target: &[f64], rate: &[f64]) {
        let targets = target.iter().zip(rate);
        let joints = self.position.iter_mut().zip(&mut self.velocity).zip(&self.limits).zip(&self.ranges);
        for ((((position, velocity), limits), [low, high]), (target, rate)) in joints.zip(targets) {
            let MotionLimits { velocity: fastest, acceleration, .. } = *limits;
            // the velocity from which a joint stops within a distance
            let stoppable = |distance: f64, acceleration: f64| {
                let half = 0.5 * acceleration * dt;
                if half.is_finite() {
                    (half * half + 2.0 * acceleration * distance).sqrt() - half
                } else {
                    distance / dt
                }
            };
            let way = target - *position;
            let approach = stoppable(way.abs(), APPROACH * acceleration).min(way.abs() / dt).copysign(way);
            let change = acceleration * dt;
            // braking in whole steps ends up to an eighth of a step's change beyond the distance of smooth
            // braking
            let margin = if change.is_finite() { 0.125 * change * dt } else { 0.0 };
            let room = |end: f64| (end - margin).max(0.0);
            let towards_low = -stoppable(room(*position - low), acceleration);
            let towards_high = stoppable(room(high - *position), acceleration);
            let desired = (rate + approach).clamp(-fastest, fastest).max(towards_low).min(towards_high);
            *velocity = desired.clamp(*velocity - change, *velocity + change);
            *position += *velocity * dt;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 1e-3;

    #[test]
    fn limits_hold_for_targets_with_step_changes() {
        let limits = MotionLimits { velocity: 2.0, acceleration: 7.5, jerk: f64::INFINITY };
        let mut follower =
            Follower::new(vec![limits; 2], vec![[-0.7, 0.8], [f64::NEG_INFINITY, f64::INFINITY]]);
        follower.start(&[0.1, 0.1]);
        let mut state = 7_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * 4.0 - 2.0
        };
        let (mut target, mut rate, mut before) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        let (mut fastest, mut hardest) = (0.0_f64, 0.0_f64);
        for step in 0..200_000 {
            if step % 37 == 0 {
                (target, rate) = ([random(), random()], [random() * 3.0, random() * 3.0]);
            }
            follower.step(DT, &target, &rate);
            for (velocity, before) in follower.velocity().iter().zip(before) {
                fastest = fastest.max(velocity.abs());
                hardest = hardest.max((velocity - before).abs() / DT);
            }
            before.copy_from_slice(follower.velocity());
            assert!((-0.7..=0.8).contains(&follower.position()[0]), "{:?}", follower.position());
        }
        assert!(fastest <= 2.0 && hardest <= 7.5 * (1.0 + 1e-9), "{fastest} {hardest}");
        assert!(hardest > 7.49, "{hardest}");
    }

    #[test]
    fn moving_target_is_followed_without_lag() {
        let limits = MotionLimits { velocity: 2.0, acceleration: 20.0, jerk: f64::INFINITY };
        let mut follower = Follower::new(vec![limits], vec![[-9.0, 9.0]]);
        follower.start(&[0.3]);
        let mut worst = 0.0_f64;
        for step in 0..5000 {
            let (sin, cos) = (f64::from(step) * DT * 3.0).sin_cos();
            // the velocity over this step, which ends at the target of the next step
            follower.step(DT, &[0.5 * sin], &[1.5 * cos]);
            if step > 1000 {
                let next = (f64::from(step + 1) * DT * 3.0).sin();
                worst = worst.max((follower.position()[0] - 0.5 * next).abs());
            }
        }
        assert!(worst < 1e-5, "{worst}");
    }
}
