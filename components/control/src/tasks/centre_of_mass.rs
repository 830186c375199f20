//! The centre of mass follows a point.

use motorium_robots::Model;
use nalgebra::{Matrix3xX, Vector3};

use super::{Rows, Task, residual};
use crate::{RobotState, solver::Problem};

/// Gain and weights of a [`CentreOfMassTask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CentreOfMassSettings {
    /// Rate at which the error decays \[1/s\]. Useful below a tenth of the tick rate. Default 10.
    pub gain: f64,
    /// Cost of a velocity error \[1/(m/s)\]. Default 1.
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

/// The centre of mass `c` of the robot follows a point `c*` \[m, world axes\]:
///
/// ```text
/// e  = c* - c(q)
/// e' = c*' - J_com v
/// ```
///
/// where `J_com` (3 x nv) is the Jacobian of the centre of mass. Asking for the decay `e' = -k`, `k = gain
/// e`, gives the cost
///
/// ```text
/// 1/2 |W (A v - b)|^2 + 1/2 mu |v|^2
/// A = J_com,   b = k + c*',   W = weight diag(shares),   mu = damping |W^2 k|
/// ```
///
/// (the task of OpenSoT and Pink, there without the velocity `c*'` of the target). `k` is scaled down as a
/// whole where it would exceed the largest speed, so that the direction is kept. Links fixed to the world do
/// not count.
///
/// ```
/// use motorium_control::{RobotState, tasks::{CentreOfMassTask, Task}};
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
    velocity: Vector3<f64>,
    error: Vector3<f64>,
    desired: Vector3<f64>,
    jacobian: Matrix3xX<f64>,
}

impl CentreOfMassTask {
    /// A task for `model`, with the world's origin as target and default settings.
    pub fn new(model: &Model) -> Self {
        Self {
            settings: CentreOfMassSettings::default(),
            target: Vector3::zeros(),
            velocity: Vector3::zeros(),
            error: Vector3::zeros(),
            desired: Vector3::zeros(),
            jacobian: Matrix3xX::zeros(model.nv()),
        }
    }

    /// The same task with these settings.
    #[must_use]
    pub fn with(mut self, settings: CentreOfMassSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Changes gain and weights from the next update on.
    pub fn set_settings(&mut self, settings: CentreOfMassSettings) {
        self.settings = settings;
    }

    /// Gain and weights.
    pub fn settings(&self) -> &CentreOfMassSettings {
        &self.settings
    }

    /// Sets the target `c*` \[m, world axes\], at rest.
    pub fn set_target(&mut self, target: Vector3<f64>) {
        self.set_moving_target(target, Vector3::zeros());
    }

    /// Sets the target `c*` \[m\] and its velocity `c*'` \[m/s\], in world axes.
    pub fn set_moving_target(&mut self, target: Vector3<f64>, velocity: Vector3<f64>) {
        self.target = target;
        self.velocity = velocity;
    }

    /// The target `c*` \[m, world axes\].
    pub fn target(&self) -> &Vector3<f64> {
        &self.target
    }

    /// `e` at the last update \[m, world axes\].
    pub fn error(&self) -> &Vector3<f64> {
        &self.error
    }

    /// `A` at the last update, 3 x nv.
    pub fn jacobian(&self) -> &Matrix3xX<f64> {
        &self.jacobian
    }

    /// `b` at the last update \[m/s\].
    pub fn desired(&self) -> &Vector3<f64> {
        &self.desired
    }

    /// The diagonal of `W^2`.
    fn squared_weights(&self) -> Vector3<f64> {
        Vector3::from(self.settings.shares).map(|share| (self.settings.weight * share).powi(2))
    }

    /// `gain e`, slowed to the largest speed.
    fn correction(&self) -> Vector3<f64> {
        let correction = self.error * self.settings.gain;
        let excess = correction.norm() / self.settings.max_speed;
        if excess > 1.0 { correction / excess } else { correction }
    }
}

impl Task for CentreOfMassTask {
    fn rows(&self) -> usize {
        3
    }

    fn update(&mut self, state: &RobotState<'_>) {
        self.error = self.target - state.kinematics.centre_of_mass(state.model).position;
        self.desired = self.correction() + self.velocity;
        state.kinematics.com_jacobian(state.model, &mut self.jacobian);
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        let squared = self.squared_weights();
        let counted = (0..3).filter(|axis| squared[*axis] > 0.0);
        residual(counted, &self.jacobian, self.desired.as_slice(), velocity)
    }

    fn add_to(&self, problem: &mut Problem) {
        let squared = self.squared_weights();
        let damping = self.settings.damping * squared.component_mul(&self.correction()).norm();
        for j in 0..self.jacobian.ncols() {
            let weighted = squared.component_mul(&self.jacobian.column(j));
            problem.gradient[j] -= weighted.dot(&self.desired);
            for i in 0..=j {
                problem.hessian[(i, j)] += weighted.dot(&self.jacobian.column(i));
            }
            problem.hessian[(j, j)] += damping;
        }
    }

    fn write_rows(&self, rows: &mut Rows) {
        for (axis, share) in self.settings.shares.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            let weight = self.settings.weight * share;
            let row = rows.push(weight * self.desired[axis]).iter_mut();
            row.zip(self.jacobian.row(axis).iter()).for_each(|(row, a)| *row = weight * a);
        }
    }
}
