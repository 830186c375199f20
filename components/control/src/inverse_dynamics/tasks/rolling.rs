//! A wheel rolls without slipping, by its acceleration.

use motorium_robots::{FrameId, Model};
use nalgebra::{Unit, Vector3};

use super::{AccelerationTask, Cost};
use crate::inverse_dynamics::{InverseDynamics, MotionState};
use crate::tasks::RollingWheel;

/// Brings the contact point of a wheel to rest and keeps it at rest: the wheel rolls without slipping or
/// sliding.
///
/// In world axes, with the axis `d` of the wheel, the normal `n` of the ground, the vector `c` from its
/// centre to the contact, the velocity `v`, `w` of the wheel and its acceleration `v'`, `w'` without
/// accelerations of the joints,
///
/// ```text
/// u  = (n - d d' n) / |n - d d' n|,   c = -radius u
/// s  = v + w x c                                  velocity of the point of the wheel at the contact
/// c' = -radius (1 - u u') (-(w x d) d' n - d (w x d)' n) / |n - d d' n|
/// A  = J_v - [c]x J_w                             3 x nv, on the accelerations
/// b  = -rate s - (v' + w' x c + w x c')
/// W  = weight                                     1/(m/s2)
/// ```
///
/// (the [rolling task](crate::tasks::RollingTask) of velocities: slip decays at `rate`). The task is inactive
/// for a flat wheel, which has no contact point.
///
/// ```
/// use motorium_control::inverse_dynamics::tasks::RollingAcceleration;
/// use motorium_robots::load;
/// use nalgebra::Vector3;
///
/// let robot = load("differential-drive", std::path::Path::new("."))?.model;
/// let wheel = robot.frame("left_wheel_link")?;
/// let rolling = RollingAcceleration::new(&robot, wheel, Vector3::y_axis(), 0.033, 20.0).weight(10.0);
/// # let _ = rolling;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RollingAcceleration {
    wheel: RollingWheel,
    rate: f64,
    weight: f64,
    cost: Cost,
}

impl RollingAcceleration {
    /// Creates a task for the wheel whose centre is the origin of `frame`, with its axis in the axes of the
    /// frame and its radius \[m\], on level ground, with weight 1; slip decays at `rate` \[1/s\].
    pub fn new(model: &Model, frame: FrameId, axis: Unit<Vector3<f64>>, radius: f64, rate: f64) -> Self {
        let wheel = RollingWheel::new(model, frame, axis, radius);
        Self { wheel, rate, weight: 1.0, cost: Cost::dense(3, 0, model.nv()) }
    }

    /// The same task on ground with another normal, world axes.
    #[must_use]
    pub fn on(mut self, normal: Unit<Vector3<f64>>) -> Self {
        self.wheel.set_normal(normal);
        self
    }

    /// The same task with a weight \[1/(m/s2)\].
    #[must_use]
    pub fn weight(mut self, weight: f64) -> Self {
        self.weight = weight;
        self
    }

    /// Changes the weight \[1/(m/s2)\] from the next update on.
    pub fn set_weight(&mut self, weight: f64) {
        self.weight = weight;
    }
}

impl AccelerationTask for RollingAcceleration {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let MotionState { model, kinematics, .. } = *state;
        let Some(contact) = self.wheel.contact(model, kinematics) else {
            self.cost.weights_mut().fill(0.0);
            return;
        };
        let (slip, drift) = self.wheel.slip(model, kinematics, &contact);
        self.cost.desired_mut().copy_from(&(-slip * self.rate - drift));
        self.cost.weights_mut().fill(self.weight);
        self.wheel.write_jacobian(model, kinematics, &contact.way, &mut self.cost);
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
