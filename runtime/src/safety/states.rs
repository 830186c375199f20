//! Control laws of the safe states.

use motorium_drive::JointSetpoint;

use super::limits::JointLimits;
use crate::plan::SafeState;

/// Damping of the brake, N m s/rad or N s/m: large enough that the effort limit applies until the joint
/// stops.
const BRAKE: f64 = 1e6;

/// Fraction of the acceleration limit with which `hold` brings a moving joint to rest, because the drives
/// follow with some overshoot.
const STOPPING_SHARE: f64 = 0.7;

/// Time constant with which the feed-forward of `hold` blends from the previous effort to gravity
/// compensation, s.
pub(super) const HOLD_EFFORT_BLEND: f64 = 0.03;

/// Speed below which a joint counts as stopped, rad/s or m/s.
const STANDS: f64 = 1e-3;

/// Largest position gain of `hold` relative to the profile's, which is four times the bandwidth.
const MOST_STIFFNESS: f64 = 16.0;

/// Largest velocity gain of `hold` relative to the profile's, which is five times the damping ratio at
/// [`MOST_STIFFNESS`]. A sampled drive oscillates if `kd dt` exceeds twice the inertia, which only the
/// profile accounts for.
const MOST_DAMPING: f64 = 20.0;

/// Measured state of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// Position, rad or m.
    pub position: f64,
    /// Velocity, rad/s or m/s.
    pub velocity: f64,
    /// Effort that holds the joint against gravity at this position, N m or N.
    pub gravity: f64,
}

impl Joint {
    /// Returns the measured state of joint `i`. A reading that is not finite is replaced by the setpoint at
    /// rest.
    pub(super) fn measured(
        position: &[f64],
        velocity: &[f64],
        gravity: f64,
        i: usize,
        setpoint: &JointSetpoint,
    ) -> Self {
        let finite = |x: f64, other: f64| if x.is_finite() { x } else { other };
        Self {
            position: finite(position[i], setpoint.position),
            velocity: finite(velocity[i], 0.0),
            gravity: finite(gravity, 0.0),
        }
    }
}

/// Returns the setpoint with which a joint enters a safe state. The result depends only on the measured
/// joint, its limits and the previously applied setpoint `last`.
///
/// | state | position | gains | feed-forward |
/// |---|---|---|---|
/// | `hold` | current; with an acceleration limit, stop at 0.7 times the limit | held gains | gravity |
/// | `damp` | none | `kd` of the safe states | none |
/// | `zero_torque` | none | none | none |
/// | `brake` | none, then where the joint stopped | 10^6 N m s/rad, then the safe states' gains | gravity |
///
/// Each held gain is the larger of the last command's gain and the profile's gain, but at most 16 times the
/// profile's `kp` and 20 times the profile's `kd`. If the held `kp` is larger than the profile's `kp`, the
/// held `kd` is at least as large as the profile's damping ratio requires.
///
/// ```
/// use motorium::plan::SafeState;
/// use motorium::safety::{Joint, JointLimits, JointSetpoint, enter};
///
/// let limits = JointLimits { kp: 600.0, kd: 40.0, ..JointLimits::new("elbow") }.with_effort(87.0);
/// let joint = Joint { position: -1.2, velocity: 0.3, gravity: 21.0 };
/// let hold = enter(SafeState::Hold, &joint, &limits, &JointSetpoint::default());
/// assert_eq!((hold.position, hold.kp, hold.effort), (-1.2, 600.0, 21.0));
/// ```
pub fn enter(state: SafeState, joint: &Joint, limits: &JointLimits, last: &JointSetpoint) -> JointSetpoint {
    let none = JointSetpoint { position: joint.position, ..JointSetpoint::default() };
    match state {
        // Gravity compensation keeps the arm from sagging. The gains are never softer than the profile's,
        // because a compliant controller's may be too low to stop the arm, and not much stiffer, because a
        // stiff controller's may be unstable.
        SafeState::Hold => {
            let held = |last: f64, profile: f64, most: f64| {
                if profile > 0.0 { last.min(most * profile).max(profile) } else { last }
            };
            let kp = held(last.kp, limits.kp, MOST_STIFFNESS);
            // A stiffer drive needs more damping to stop the joint without oscillation.
            let stiffer = if limits.kp > 0.0 { (kp / limits.kp).sqrt() } else { 1.0 };
            let kd = held(last.kd, limits.kd, MOST_DAMPING).max(stiffer * limits.kd);
            let velocity = if limits.acceleration.is_finite() { joint.velocity } else { 0.0 };
            JointSetpoint { velocity, effort: joint.gravity, kp, kd, ..none }
        }
        SafeState::Damp => JointSetpoint { kd: limits.kd, ..none },
        SafeState::ZeroTorque => none,
        SafeState::Brake => JointSetpoint { kd: BRAKE, effort: joint.gravity, ..none },
    }
}

/// Returns the next setpoint of a joint that stays in a safe state, `dt` s after the previous `setpoint`.
///
/// `hold` brings a moving joint to rest within its range, and blends the feed-forward effort into gravity
/// compensation at the measured pose. `brake` compensates gravity, and holds a joint once the joint has
/// stopped.
pub fn stay(
    state: SafeState,
    joint: &Joint,
    limits: &JointLimits,
    setpoint: &JointSetpoint,
    dt: f64,
) -> JointSetpoint {
    let mut setpoint = setpoint;
    let blended;
    if state == SafeState::Hold && setpoint.effort != joint.gravity {
        let effort = setpoint.effort + (joint.gravity - setpoint.effort) * (dt / HOLD_EFFORT_BLEND).min(1.0);
        blended = JointSetpoint { effort, ..*setpoint };
        setpoint = &blended;
    }
    match state {
        SafeState::Hold if setpoint.velocity != 0.0 => {
            let slower = (setpoint.velocity.abs() - STOPPING_SHARE * limits.acceleration * dt).max(0.0);
            let velocity = slower.copysign(setpoint.velocity);
            let position = setpoint.position + velocity * dt;
            if velocity == 0.0 || position < limits.lower || position > limits.upper {
                return JointSetpoint { velocity: 0.0, ..*setpoint };
            }
            JointSetpoint { position, velocity, ..*setpoint }
        }
        SafeState::Brake if setpoint.kp == 0.0 && joint.velocity.abs() < STANDS => {
            let (position, effort, kp, kd) = (joint.position, joint.gravity, limits.kp, limits.kd);
            JointSetpoint { position, effort, kp, kd, ..*setpoint }
        }
        SafeState::Brake => JointSetpoint { effort: joint.gravity, ..*setpoint },
        _ => *setpoint,
    }
}

/// Lowers the gains of `hold` to the profile's for a joint that shakes, without a step in its effort. Gains
/// that the profile does not define are unchanged.
pub(super) fn soften(setpoint: &mut JointSetpoint, joint: &Joint, limits: &JointLimits) {
    if limits.kp > 0.0 && setpoint.kp > limits.kp {
        let pull = (setpoint.kp - limits.kp) * (setpoint.position - joint.position);
        setpoint.effort = (setpoint.effort + pull).max(-limits.effort).min(limits.effort);
        setpoint.kp = limits.kp;
    }
    if limits.kd > 0.0 {
        setpoint.kd = setpoint.kd.min(limits.kd);
    }
}
