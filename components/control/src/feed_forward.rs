//! Feed-forward efforts: gravity, inertia, centrifugal and Coriolis forces.

use motorium_robots::{Dynamics, Model};
use nalgebra::{DVector, Vector3};

use crate::SetpointIntegrator;

/// Feed-forward efforts of the independent joints, computed from the model of the robot.
///
/// A joint drive adds this effort to its feedback: `tau = effort + kp (position - q) + kd (velocity - v)`.
/// Without gravity and inertia compensation the effort is zero. Only `new` allocates.
///
/// ```
/// use motorium_control::{FeedForward, SetpointIntegrator};
/// use nalgebra::Vector3;
///
/// let panda = motorium_robots::load("panda", std::path::Path::new("."))?;
/// let (model, q) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
/// let setpoint = SetpointIntegrator::new(model, q.as_slice());
/// let mut feed_forward = FeedForward::new(model, Some(Vector3::new(0.0, 0.0, -9.81)));
/// let effort = feed_forward.effort(model, q.as_slice(), &[], &setpoint);
/// assert!(effort[1].abs() > 1.0, "the shoulder carries the arm");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct FeedForward {
    gravity: Option<Vector3<f64>>,
    inertia: Option<Inertia>,
    dynamics: Dynamics,
    effort: DVector<f64>,
}

/// Motion of the setpoint, for inertia compensation.
#[derive(Clone, Debug)]
struct Inertia {
    /// Time constant of the acceleration, s.
    smoothing: f64,
    /// Velocities: the measured one of a floating base, then the setpoint of the previous tick, valid if
    /// `known`.
    velocity: DVector<f64>,
    known: bool,
    /// Accelerations: 0 for a floating base, then the smoothed one of the setpoint.
    acceleration: DVector<f64>,
}

impl FeedForward {
    /// Creates a feed-forward for `model`. If `gravity` \[m/s^2, world axes\] is given, the robot's weight is
    /// compensated.
    pub fn new(model: &Model, gravity: Option<Vector3<f64>>) -> Self {
        Self { gravity, inertia: None, dynamics: Dynamics::new(model), effort: DVector::zeros(model.nv()) }
    }

    /// Adds the efforts that give the robot the acceleration of the setpoint, and that balance centrifugal
    /// and Coriolis forces: `effort = M(q) a + C(q, v) v + g(q)`. Here `v` is the velocity setpoint and `a`
    /// its derivative. A low-pass filter with the time constant `smoothing` \[s\] attenuates noise in `a`,
    /// which arises from setpoints derived from measurements.
    #[must_use]
    pub fn with_inertia(mut self, smoothing: f64) -> Self {
        let zeros = self.effort.map(|_| 0.0);
        self.inertia =
            Some(Inertia { smoothing, velocity: zeros.clone(), known: false, acceleration: zeros });
        self
    }

    /// Updates the acceleration of the setpoint. Call this once per tick of `dt` \[s\], before
    /// [`effort`](Self::effort). No effect without [`with_inertia`](Self::with_inertia).
    pub fn update(&mut self, setpoint: &SetpointIntegrator, dt: f64) {
        let Some(inertia) = &mut self.inertia else { return };
        let share = if inertia.known { dt / (dt + inertia.smoothing) } else { 0.0 };
        let base = inertia.velocity.len() - setpoint.velocity().len();
        let velocities = inertia.velocity.iter_mut().skip(base).zip(setpoint.velocity());
        for (acceleration, (before, now)) in inertia.acceleration.iter_mut().skip(base).zip(velocities) {
            *acceleration += share * ((now - *before) / dt - *acceleration);
            *before = *now;
        }
        inertia.known = true;
    }

    /// Clears the motion of the setpoint. The acceleration is zero until the second [`update`](Self::update).
    pub fn reset(&mut self) {
        if let Some(inertia) = &mut self.inertia {
            inertia.known = false;
            inertia.acceleration.fill(0.0);
        }
    }

    /// Returns the efforts \[Nm or N\], one per independent joint, within the effort limits of the model.
    ///
    /// `q` is the measured configuration: the pose of a floating base, then the joint positions \[rad or m\].
    /// `base_velocity` is the measured velocity of a floating base in its own axes, linear \[m/s\], then
    /// angular \[rad/s\]; empty for a fixed base.
    ///
    /// # Panics
    /// If the length of `q`, `base_velocity` or the setpoint does not match the model.
    pub fn effort(
        &mut self,
        model: &Model,
        q: &[f64],
        base_velocity: &[f64],
        setpoint: &SetpointIntegrator,
    ) -> &[f64] {
        let effort = self.effort.as_mut_slice();
        let base = effort.len() - model.joint_count();
        match (&mut self.inertia, self.gravity) {
            (Some(inertia), gravity) => {
                inertia.velocity.as_mut_slice()[..base].copy_from_slice(base_velocity);
                inertia.velocity.as_mut_slice()[base..].copy_from_slice(setpoint.velocity());
                let (v, a) = (inertia.velocity.as_slice(), inertia.acceleration.as_slice());
                self.dynamics.rnea(model, q, v, a, gravity.unwrap_or_default(), effort);
            }
            (None, Some(gravity)) => self.dynamics.gravity(model, q, gravity, effort),
            (None, None) => {}
        }
        let efforts = &mut self.effort.as_mut_slice()[base..];
        for (effort, limit) in efforts.iter_mut().zip(model.effort_limit()) {
            *effort = effort.max(-limit).min(*limit);
        }
        efforts
    }
}
