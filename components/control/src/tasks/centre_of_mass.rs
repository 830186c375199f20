//! The centre of mass follows a point.

use motorium_robots::Model;
use nalgebra::Vector3;

use super::{Cost, Equation, Feedback, JacobianView, Response, Task};
use crate::{MotionState, RobotState};

/// Gain and weights of a [`CentreOfMassTask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CentreOfMassSettings {
    /// Rate at which the error decays \[1/s\]. Useful below a tenth of the tick rate. Default 10.
    pub gain: f64,
    /// Cost of a velocity error \[1/(m/s)\], or of an acceleration error \[1/(m/s2)\]. Default 1.
    pub weight: f64,
    /// Factors of the weight along x, y and z of the world; 0 leaves an axis free. Default 1.
    pub shares: [f64; 3],
    /// Largest speed at which the error is corrected \[m/s\]. Default infinite.
    pub max_speed: f64,
    /// Levenberg-Marquardt damping per speed of correction \[s m/rad^2\]: keeps the robot calm where the
    /// target is out of reach, and vanishes at the target. Should exceed half the tick period times the reach
    /// of the robot. Default 5e-3.
    pub damping: f64,
}

impl Default for CentreOfMassSettings {
    fn default() -> Self {
        Self { gain: 10.0, weight: 1.0, shares: [1.0; 3], max_speed: f64::INFINITY, damping: 5e-3 }
    }
}

impl CentreOfMassSettings {
    fn response(&self) -> Response {
        let Self { gain, max_speed, damping, .. } = *self;
        Response { max_speeds: [max_speed, f64::INFINITY], damping, ..Response::decay(gain) }
    }
}

/// The centre of mass `c` of the robot follows a point `c*` \[m, world axes\]:
///
/// ```text
/// e = c* - c(q),   nu = c*',   J = J_com          Jacobian of the centre of mass, 3 x nv
/// W = weight diag(shares)
/// ```
///
/// (the task of OpenSoT, Pink and TSID). Links fixed to the world do not count.
///
/// ```
/// use motorium_control::{RobotState, tasks::{CentreOfMassTask, VelocityTask}};
/// use motorium_robots::{Kinematics, load};
/// use nalgebra::Vector3;
///
/// let panda = load("panda", std::path::Path::new("."))?;
/// let (model, q) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
/// let mut kinematics = Kinematics::new(model);
/// kinematics.update(model, q.as_slice());
///
/// let mut task = CentreOfMassTask::new(model);
/// task.set_target(kinematics.centre_of_mass(model).position + Vector3::new(0.0, 0.05, 0.0));
/// task.update(&RobotState { model, kinematics: &kinematics, q: q.as_slice() });
/// assert!((task.error().y - 0.05).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CentreOfMassTask {
    settings: CentreOfMassSettings,
    target: Vector3<f64>,
    equation: Equation,
}

settings!(CentreOfMassTask, CentreOfMassSettings);
weight!(CentreOfMassTask);

impl CentreOfMassTask {
    /// A task for `model`, with the world's origin as target and default settings.
    pub fn new(model: &Model) -> Self {
        let settings = CentreOfMassSettings::default();
        let mut equation = Equation::dense(3, 0, model.nv());
        equation.response = settings.response();
        Self { settings, target: Vector3::zeros(), equation }
    }

    /// Sets the target `c*` \[m, world axes\], at rest.
    pub fn set_target(&mut self, target: Vector3<f64>) {
        self.set_moving_target(target, Vector3::zeros(), Vector3::zeros());
    }

    /// Sets the target `c*`, its velocity and its acceleration \[m, m/s, m/s2, world axes\].
    pub fn set_moving_target(
        &mut self,
        target: Vector3<f64>,
        velocity: Vector3<f64>,
        acceleration: Vector3<f64>,
    ) {
        self.target = target;
        self.equation.rate.copy_from(&velocity);
        self.equation.rate_derivative.copy_from(&acceleration);
    }

    /// The target `c*` \[m, world axes\].
    pub fn target(&self) -> &Vector3<f64> {
        &self.target
    }

    /// `e` at the last update \[m, world axes\].
    pub fn error(&self) -> Vector3<f64> {
        self.equation.error.fixed_rows::<3>(0).into()
    }

    /// `J` at the last update, 3 x nv.
    pub fn jacobian(&self) -> JacobianView<'_, 3> {
        self.equation.jacobian().fixed_rows::<3>(0)
    }

    /// The desired value `b` at the last update \[m/s or m/s2\].
    pub fn desired(&self) -> Vector3<f64> {
        self.cost().desired().fixed_rows::<3>(0).into()
    }
}

impl Task for CentreOfMassTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let CentreOfMassSettings { weight, shares, .. } = self.settings;
        let position = state.kinematics.centre_of_mass(state.model).position;
        self.equation.error.copy_from(&(self.target - position));
        state.kinematics.com_jacobian(state.model, self.equation.jacobian_mut());
        for (out, share) in self.equation.weights_mut().iter_mut().zip(shares) {
            *out = weight * share;
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let moving = state.kinematics.centre_of_mass(state.model);
        let Equation { rate, error_rate, drift, .. } = &mut self.equation;
        error_rate.copy_from(rate);
        *error_rate -= moving.velocity;
        drift.copy_from(&moving.acceleration);
    }

    equation!();
}
