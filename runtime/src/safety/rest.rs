//! Rest: the check that a safe state brought the robot to a standstill.

use super::limits::JointLimits;
use crate::plan::SafeState;

/// Speed below which a joint counts as at rest, rad/s or m/s.
pub const REST_SPEED: f64 = 0.05;
/// Time within which `hold` and `brake` must bring every joint to rest, s. If a joint is still faster than
/// [`REST_SPEED`] after this time, the safe state is reported as not reached.
pub const REST_WITHIN: f64 = 1.0;

/// Number of reversals per second above which a joint counts as shaking. A structure oscillates more slowly.
/// A drive whose gains are too high for its period reverses at every step.
const SHAKES: f64 = 100.0;
/// Time over which reversals are counted, s.
const MEMORY: f64 = 0.1;
/// Time for which every joint must stay slower than [`REST_SPEED`] once one was faster, s. An oscillating
/// joint is slow at each reversal.
const CALM_FOR: f64 = 0.02;

/// Time in a safe state, and the joints that are still moving.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rest {
    elapsed: f64,
    /// Time for which all joints have been slow, s; infinite if none was ever fast.
    calm_for: f64,
}

impl Default for Rest {
    fn default() -> Self {
        Self { elapsed: 0.0, calm_for: f64::INFINITY }
    }
}

impl Rest {
    /// Records a step of `dt` s in a safe state with these joint velocities.
    ///
    /// A velocity that is not finite is unknown, and an unknown joint is not at rest.
    pub(super) fn step(
        &mut self,
        state: SafeState,
        (velocity, joints): (&[f64], &[JointLimits]),
        dt: f64,
        entered: bool,
    ) {
        let stops = matches!(state, SafeState::Hold | SafeState::Brake);
        self.elapsed = if entered { 0.0 } else { self.elapsed + dt };
        self.calm_for = if entered || !stops { f64::INFINITY } else { self.calm_for + dt };
        // A joint without a gain is not held, such as a rotor or a freely swinging pole.
        let mut held = velocity.iter().zip(joints).filter(|(_, joint)| joint.kp > 0.0);
        if stops && held.any(|(velocity, _)| is_moving(*velocity)) {
            self.calm_for = 0.0;
        }
    }

    /// Returns `true` while a joint moves that the safe state should bring to rest.
    pub(super) fn moves(&self) -> bool {
        self.calm_for < CALM_FOR
    }

    /// Returns `false` if a joint still moves after [`REST_WITHIN`]. Always `true` for `damp` and
    /// `zero_torque`, which let joints move.
    pub(super) fn is_reached(&self) -> bool {
        !self.moves() || self.elapsed < REST_WITHIN
    }
}

/// Counts the reversals of a joint in a safe state.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Reversals {
    velocity: f64,
    /// Number of reversals within [`MEMORY`], with exponentially decreasing weight.
    count: f64,
}

impl Reversals {
    /// Records the velocity, `dt` s after the previous one. Returns `true` if the joint shakes: it reverses
    /// more than a hundred times per second, or at more than half of the steps of a slower actuator.
    pub(super) fn step(&mut self, velocity: f64, dt: f64) -> bool {
        let reverses = velocity * self.velocity < 0.0 && is_moving(velocity) && is_moving(self.velocity);
        self.count *= 1.0 - (dt / MEMORY).min(1.0);
        self.count += f64::from(u8::from(reverses));
        self.velocity = velocity;
        self.count > (SHAKES * MEMORY).min(0.5 * MEMORY / dt)
    }
}

/// Returns `true` if a joint is not at rest. A joint with an unknown velocity is not at rest.
fn is_moving(velocity: f64) -> bool {
    velocity.is_nan() || velocity.abs() >= REST_SPEED
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joint_that_reverses_at_every_step_shakes() {
        let shakes = |hertz: f64, dt: f64, speed: f64| {
            let mut reversals = Reversals::default();
            let steps = (0.5 / dt) as usize;
            let velocity = |k: usize| speed * (core::f64::consts::TAU * hertz * (k as f64 + 0.25) * dt).cos();
            (0..steps).any(|k| reversals.step(velocity(k), dt))
        };
        for dt in [1e-4, 1e-3, 4e-3, 1e-2] {
            assert!(shakes(0.5 / dt, dt, 2.0), "{dt} s: at every step");
            assert!(!shakes(0.5 / dt, dt, 0.06), "{dt} s: at rest");
            assert!(!shakes(15.0, dt, 2.0), "{dt} s: a leg that rocks");
        }
    }

    #[test]
    fn a_joint_that_moves_after_a_second_has_not_reached_hold() {
        let held = JointLimits { kp: 600.0, ..JointLimits::new("elbow") };
        let joints = [held.clone(), held];
        let mut rest = Rest::default();
        rest.step(SafeState::Hold, (&[0.0, 1.5], &joints), 1e-3, true);
        assert!(rest.is_reached(), "it is braking");
        for _ in 0..1_001 {
            rest.step(SafeState::Hold, (&[0.0, 1.5], &joints), 1e-3, false);
        }
        assert!(!rest.is_reached());
        rest.step(SafeState::Hold, (&[0.0, 0.049], &joints), 1e-3, false);
        assert!(!rest.is_reached(), "an oscillating joint is slow at each reversal");
        for _ in 0..21 {
            rest.step(SafeState::Hold, (&[0.0, 0.049], &joints), 1e-3, false);
        }
        assert!(rest.is_reached(), "at rest, if late");
        rest.step(SafeState::Hold, (&[0.0, f64::NAN], &joints), 1e-3, false);
        assert!(!rest.is_reached(), "an unknown speed is not rest");
        rest.step(SafeState::Damp, (&[0.0, 1.5], &joints), 1e-3, false);
        assert!(rest.is_reached(), "`damp` lets joints move");
        let free = [JointLimits::new("rotor"), JointLimits::new("pole")];
        rest.step(SafeState::Hold, (&[9.0, 1.5], &free), 1e-3, false);
        assert!(rest.is_reached(), "nothing holds them");
    }
}
