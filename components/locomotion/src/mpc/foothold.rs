//! Footholds and swing motions of the feet.

use nalgebra::{Rotation3, Vector3};

use super::GroundPlane;

/// Inputs for planning a foothold: the motion of the body at the touchdown of the foot, and the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootPlan {
    /// Centre of mass at touchdown \[m\].
    pub position: Vector3<f64>,
    /// Current velocity of the centre of mass \[m/s\].
    pub velocity: Vector3<f64>,
    /// Reference velocity of the centre of mass \[m/s\].
    pub desired: Vector3<f64>,
    /// Heading in the middle of the following stance \[rad\].
    pub heading: f64,
    /// Duration of the following stance \[s\].
    pub stance: f64,
    /// Height of the centre of mass above the ground \[m\].
    pub height: f64,
    /// Gravitational acceleration \[m/s2\].
    pub gravity: f64,
    /// Ground on which the foot lands.
    pub ground: GroundPlane,
}

/// Returns the foothold of a swing in world axes \[m\]. `rest` is the rest position of the foot relative to
/// the centre of mass, in heading axes \[m\]. The foot lands below the rest position predicted for the middle
/// of the following stance. A capture-point correction shifts the foothold to reduce the velocity error;
/// `most` \[m\] is the maximum length of this shift.
///
/// ```text
/// p = c + R(heading) rest + T / 2 v* + cut(sqrt(height / g) (v - v*), most)       x and y;   z: the ground's
/// ```
///
/// Raibert, *Legged Robots That Balance*, 1986; Pratt, Carff, Drakunov and Goswami, *Capture point: a step
/// toward humanoid push recovery*, Humanoids 2006.
///
/// ```
/// use motorium_locomotion::mpc::{FootPlan, GroundPlane, foothold};
/// use nalgebra::Vector3;
///
/// let (position, velocity) = (Vector3::new(1.0, 0.0, 0.25), Vector3::new(0.4, 0.0, 0.0));
/// let plan = FootPlan {
///     position,
///     velocity,
///     desired: velocity,
///     heading: 0.0,
///     stance: 0.2,
///     height: 0.25,
///     gravity: 9.81,
///     ground: GroundPlane::default(),
/// };
/// let rest = Vector3::new(0.2, 0.15, -0.25);
/// assert!((foothold(&plan, &rest, 0.1) - Vector3::new(1.24, 0.15, 0.0)).norm() < 1e-12);
/// ```
pub fn foothold(plan: &FootPlan, rest: &Vector3<f64>, most: f64) -> Vector3<f64> {
    let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), plan.heading) * rest;
    let mut error = plan.velocity - plan.desired;
    error.z = 0.0;
    let mut capture = error * (plan.height.max(0.0) / plan.gravity.max(f64::MIN_POSITIVE)).sqrt();
    let size = capture.norm();
    if size > most {
        capture *= most / size;
    }
    let mut place = plan.position + turned + plan.desired * (0.5 * plan.stance) + capture;
    place.z = plan.ground.height(&place.xy());
    place
}

/// The swing of a foot from its lift-off position to a foothold, which may change during the swing.
///
/// ```text
/// p(s) = from + b(s) (to - from) + clearance 64 s^3 (1 - s)^3 z,   b = 10 s^3 - 15 s^4 + 6 s^5
///                                                                    s: share of the swing
/// ```
///
/// The trajectory starts and ends at rest, with zero acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Position at lift-off \[m\].
    pub from: Vector3<f64>,
    /// Foothold \[m\].
    pub to: Vector3<f64>,
    /// Height of the foot at mid-swing \[m\].
    pub clearance: f64,
    /// Duration of the whole swing \[s\].
    pub time: f64,
}

impl Swing {
    /// Returns the position \[m\] and velocity \[m/s\] of the foot `elapsed` seconds after lift-off.
    pub fn point_at(&self, elapsed: f64) -> (Vector3<f64>, Vector3<f64>) {
        let s = (elapsed / self.time).clamp(0.0, 1.0);
        let way = s * s * s * (10.0 + s * (6.0 * s - 15.0));
        let rate = 30.0 * (s * (1.0 - s)).powi(2);
        let lift = 64.0 * (s * (1.0 - s)).powi(3);
        let lift_rate = 192.0 * (s * (1.0 - s)).powi(2) * (1.0 - 2.0 * s);
        let (across, up) = (self.to - self.from, Vector3::z() * self.clearance);
        (self.from + across * way + up * lift, (across * rate + up * lift_rate) / self.time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SWING: Swing = Swing {
        from: Vector3::new(0.1, 0.2, 0.0),
        to: Vector3::new(0.3, 0.1, 0.05),
        clearance: 0.06,
        time: 0.2,
    };

    #[test]
    fn swing_starts_and_ends_at_rest_with_clearance() {
        assert_eq!(SWING.point_at(0.0), (SWING.from, Vector3::zeros()));
        let (end, velocity) = SWING.point_at(0.2);
        assert!((end - SWING.to).norm() < 1e-15 && velocity.norm() < 1e-15);
        assert_eq!(SWING.point_at(0.3), SWING.point_at(0.2));
        let (middle, _) = SWING.point_at(0.1);
        assert!((middle - Vector3::new(0.2, 0.15, 0.025 + 0.06)).norm() < 1e-15);
    }

    #[test]
    fn swing_velocity_is_the_position_derivative() {
        for step in 1..40 {
            let time = 0.005 * f64::from(step);
            let slope = (SWING.point_at(time + 1e-6).0 - SWING.point_at(time - 1e-6).0) / 2e-6;
            assert!((slope - SWING.point_at(time).1).norm() < 1e-7, "{time}");
        }
    }

    /// A linear inverted pendulum with a point foot that steps onto its capture point comes to rest.
    #[test]
    fn capture_step_brings_a_pendulum_to_rest() {
        let (height, gravity) = (0.5_f64, 9.81_f64);
        let (position, velocity) = (Vector3::new(0.0, 0.0, height), Vector3::new(0.3, -0.2, 0.0));
        let (desired, ground) = (Vector3::zeros(), GroundPlane::default());
        let plan =
            FootPlan { position, velocity, desired, heading: 1.0, stance: 0.5, height, gravity, ground };
        let foot = foothold(&plan, &Vector3::new(0.0, 0.0, -height), 1.0);
        let (mut at, mut moving) = (position, velocity);
        for _ in 0..100_000 {
            let push = (at - foot) * (gravity / height);
            moving += Vector3::new(push.x, push.y, 0.0) * 1e-5;
            at += moving * 1e-5;
        }
        let left = at - foot;
        assert!(left.x.hypot(left.y) < 2e-3 && moving.norm() < 1e-2, "{left} {moving}");
        let cut = foothold(&plan, &Vector3::zeros(), 0.01);
        assert!((cut.x.hypot(cut.y) - 0.01).abs() < 1e-12, "a large step is limited");
    }
}
