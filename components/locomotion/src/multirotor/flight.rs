//! Control of the position and attitude of a flying base by thrust and torque.

use nalgebra::{Isometry3, Matrix3, Rotation3, Vector3};

/// Properties of the flying body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Mass \[kg\].
    pub mass: f64,
    /// Inertia about the centre of mass in base axes \[kg m2\].
    pub inertia: Matrix3<f64>,
    /// Gravitational acceleration along -z of the world \[m/s2\].
    pub gravity: f64,
}

/// Gains and limits of [`FlightControl`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightSettings {
    /// Bandwidth of the critically damped position control \[rad/s\].
    pub position: f64,
    /// Bandwidth of the critically damped attitude control \[rad/s\]. Should be several times the position
    /// bandwidth.
    pub attitude: f64,
    /// Rate of integral action on a persistent position error \[1/s\].
    pub integral: f64,
    /// Maximum tilt of the thrust from the vertical \[rad\].
    pub max_tilt: f64,
    /// Minimum and maximum thrust \[N\].
    pub thrust: [f64; 2],
}

/// Desired motion of the base.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlightTarget {
    /// Position \[m\].
    pub position: Vector3<f64>,
    /// Velocity in world axes \[m/s\].
    pub velocity: Vector3<f64>,
    /// Acceleration in world axes \[m/s2\], fed forward.
    pub acceleration: Vector3<f64>,
    /// Yaw \[rad\] and yaw rate \[rad/s\].
    pub yaw: [f64; 2],
}

/// Maximum acceleration of the integral term \[m/s2\].
const MOST_INTEGRAL: f64 = 3.0;

/// A position and attitude controller; see [the module](super).
#[derive(Clone, Debug)]
pub struct FlightControl {
    flight: Flight,
    settings: FlightSettings,
    /// Acceleration of the integral term \[m/s2\].
    lasting: Vector3<f64>,
}

impl FlightControl {
    /// Creates a controller for a flying robot.
    pub fn new(flight: Flight, settings: FlightSettings) -> Self {
        Self { flight, settings, lasting: Vector3::zeros() }
    }

    /// Resets the integral term.
    pub fn reset(&mut self) {
        self.lasting = Vector3::zeros();
    }

    /// Returns the thrust along z of the base \[N\] and the torque in base axes \[Nm\]. `pose`, `velocity`
    /// \[m/s\] and `angular` \[rad/s\] are measured, the velocities in base axes. `dt` is the time since the
    /// previous update \[s\].
    pub fn update(
        &mut self,
        target: &FlightTarget,
        pose: &Isometry3<f64>,
        velocity: &Vector3<f64>,
        angular: &Vector3<f64>,
        dt: f64,
    ) -> (f64, Vector3<f64>) {
        let Flight { mass, inertia, gravity } = self.flight;
        let FlightSettings { position: w, attitude, integral, max_tilt, thrust: [least, most] } =
            self.settings;
        let rotation = pose.rotation.to_rotation_matrix();
        let e_x = pose.translation.vector - target.position;
        let e_v = rotation * velocity - target.velocity;
        let feedback = -w * w * e_x - 2.0 * w * e_v;
        let mut acceleration =
            feedback + self.lasting + target.acceleration + Vector3::new(0.0, 0.0, gravity);
        // limit the magnitude and the tilt of the thrust
        let lowest = 0.1 * gravity;
        acceleration.z = acceleration.z.max(lowest);
        let aside = acceleration.xy().norm();
        let furthest = acceleration.z * max_tilt.tan();
        let leans_too_far = aside > furthest;
        if leans_too_far {
            acceleration.x *= furthest / aside;
            acceleration.y *= furthest / aside;
        }
        let force = mass * acceleration;
        let desired = attitude_of(&force, target.yaw[0]);
        let thrust = force.dot(&(rotation * Vector3::z()));
        let is_saturated = leans_too_far || thrust < least || thrust > most;
        if !is_saturated {
            let lasting = self.lasting - integral * w * w * dt * e_x;
            self.lasting = lasting.map(|part| part.clamp(-MOST_INTEGRAL, MOST_INTEGRAL));
        }
        let between = desired.transpose() * rotation;
        let off = between.matrix() - between.matrix().transpose();
        let e_r = 0.5 * Vector3::new(off[(2, 1)], off[(0, 2)], off[(1, 0)]);
        let turning = rotation.transpose() * Vector3::new(0.0, 0.0, target.yaw[1]);
        let e_w = angular - turning;
        let torque = inertia * (-attitude * attitude * e_r - 2.0 * attitude * e_w)
            + angular.cross(&(inertia * angular));
        (thrust.clamp(least, most), torque)
    }
}

/// Returns the attitude whose third axis is along a force and whose first axis is closest to `yaw`.
fn attitude_of(force: &Vector3<f64>, yaw: f64) -> Rotation3<f64> {
    let third = force.normalize();
    let heading = Vector3::new(yaw.cos(), yaw.sin(), 0.0);
    let second = third.cross(&heading).normalize();
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[second.cross(&third), second, third]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion};

    const DT: f64 = 1e-3;

    fn flight() -> Flight {
        let inertia = Matrix3::from_diagonal(&Vector3::new(1.66e-5, 1.67e-5, 2.93e-5));
        Flight { mass: 0.028, inertia, gravity: 9.81 }
    }

    fn settings() -> FlightSettings {
        FlightSettings { position: 3.0, attitude: 20.0, integral: 0.5, max_tilt: 0.6, thrust: [0.01, 0.54] }
    }

    /// A rigid body under a thrust and a torque; its mass may differ from the controller's.
    struct Body {
        pose: Isometry3<f64>,
        velocity: Vector3<f64>,
        angular: Vector3<f64>,
        mass: f64,
    }

    impl Body {
        fn at_pose(x: f64, y: f64, z: f64, turn: UnitQuaternion<f64>) -> Self {
            let pose = Isometry3::from_parts(Translation3::new(x, y, z), turn);
            Self { pose, velocity: Vector3::zeros(), angular: Vector3::zeros(), mass: flight().mass }
        }

        /// Returns the largest distance from the target in the second half of a flight.
        fn fly(
            &mut self,
            control: &mut FlightControl,
            target: impl Fn(f64) -> FlightTarget,
            seconds: f64,
        ) -> f64 {
            let (inertia, mut worst) = (flight().inertia, 0.0_f64);
            for step in 0..(seconds / DT) as usize {
                let goal = target(step as f64 * DT);
                let own = self.pose.rotation.inverse() * self.velocity;
                let (thrust, torque) = control.update(&goal, &self.pose, &own, &self.angular, DT);
                let pull = self.pose.rotation * Vector3::new(0.0, 0.0, thrust / self.mass);
                self.velocity += DT * (pull - Vector3::new(0.0, 0.0, 9.81));
                let spin = torque - self.angular.cross(&(inertia * self.angular));
                self.angular += DT * inertia.try_inverse().unwrap() * spin;
                self.pose.translation.vector += DT * self.velocity;
                self.pose.rotation *= UnitQuaternion::from_scaled_axis(DT * self.angular);
                if step as f64 * DT > 0.5 * seconds {
                    worst = worst.max((self.pose.translation.vector - goal.position).norm());
                }
            }
            worst
        }
    }

    fn still(x: f64, y: f64, z: f64, yaw: f64) -> impl Fn(f64) -> FlightTarget {
        move |_| FlightTarget { position: Vector3::new(x, y, z), yaw: [yaw, 0.0], ..FlightTarget::default() }
    }

    #[test]
    fn reaches_goal_position_and_yaw() {
        let mut body = Body::at_pose(0.0, 0.0, 0.0, UnitQuaternion::identity());
        let mut control = FlightControl::new(flight(), settings());
        let worst = body.fly(&mut control, still(0.4, -0.3, 1.0, 2.0), 24.0);
        assert!(worst < 2e-3, "{worst} m");
        let (_, _, yaw) = body.pose.rotation.euler_angles();
        assert!((yaw - 2.0).abs() < 1e-4, "{yaw}");
    }

    #[test]
    fn recovers_from_an_inverted_attitude() {
        let back = UnitQuaternion::from_euler_angles(2.9, 0.2, 0.0);
        let mut body = Body::at_pose(0.0, 0.0, 5.0, back);
        let worst = body.fly(&mut FlightControl::new(flight(), settings()), still(0.0, 0.0, 5.0, 0.0), 16.0);
        assert!(worst < 5e-3, "{worst} m");
    }

    #[test]
    fn integral_removes_the_error_of_a_wrong_mass() {
        let fly = |integral: f64| {
            let mut body = Body::at_pose(0.0, 0.0, 1.0, UnitQuaternion::identity());
            body.mass *= 1.1;
            let settings = FlightSettings { integral, ..settings() };
            body.fly(&mut FlightControl::new(flight(), settings), still(0.0, 0.0, 1.0, 0.0), 24.0)
        };
        assert!(fly(0.5) < 2e-3, "{}", fly(0.5));
        // g / 11 over w^2
        assert!((fly(0.0) - 0.1 * 9.81 / 9.0).abs() < 0.02, "{}", fly(0.0));
    }

    #[test]
    fn circle_is_tracked_with_acceleration_feed_forward() {
        let circle = |time: f64, known: f64| {
            let (sin, cos) = (0.5 * time).sin_cos();
            FlightTarget {
                position: Vector3::new(cos, sin, 1.0),
                velocity: Vector3::new(-0.5 * sin, 0.5 * cos, 0.0),
                acceleration: known * Vector3::new(-0.25 * cos, -0.25 * sin, 0.0),
                yaw: [0.2 * time, 0.2],
            }
        };
        let fly = |known: f64| {
            let mut body = Body::at_pose(1.0, 0.0, 1.0, UnitQuaternion::identity());
            let mut control = FlightControl::new(flight(), settings());
            body.fly(&mut control, |time| circle(time, known), 40.0)
        };
        assert!(fly(1.0) < 5e-3, "{} m", fly(1.0));
        // 0.25 m/s2 over w^2, less the integral's compensation
        assert!((0.005..0.04).contains(&fly(0.0)), "{} m", fly(0.0));
    }

    #[test]
    fn thrust_and_lean_stay_within_their_limits() {
        let mut control = FlightControl::new(flight(), settings());
        let pose = Isometry3::identity();
        let far = FlightTarget { position: Vector3::new(50.0, 0.0, 50.0), ..FlightTarget::default() };
        let (thrust, _) = control.update(&far, &pose, &Vector3::zeros(), &Vector3::zeros(), DT);
        assert_eq!(thrust, 0.54);
        let below = FlightTarget { position: Vector3::new(50.0, 0.0, -50.0), ..FlightTarget::default() };
        let (thrust, torque) = control.update(&below, &pose, &Vector3::zeros(), &Vector3::zeros(), DT);
        assert!((0.01..0.1).contains(&thrust), "{thrust}");
        // limited to a tilt of 0.6 rad: J w^2 sin(0.6)
        let most = 1.67e-5 * 400.0 * 0.6_f64.sin();
        assert!((torque.y - most).abs() < 1e-9 * most.max(1.0), "{torque}, at most {most}");
    }
}
