//! Moves the joints towards configurations in which the robot's weight loads the drives less.

use motorium_robots::{Dynamics, Model};
use nalgebra::Vector3;

use super::velocities::{RATE, differentiate_velocities};
use super::{Cost, Equation, Response, Task};
use crate::{MotionState, RobotState};

/// Step along the scaled efforts over which their change is measured \[rad\].
const STEP: f64 = 1e-5;

/// Moves the joints down the gradient of the effort required to support the robot's weight:
///
/// ```text
/// m = 1/2 sum_joints (g_i(q) / tau_max_i)^2       shares of the effort limits; of 1 Nm without a limit
/// J = 1 on all velocities,   nu = -gain dm/dq,   W = weight      1/(rad/s)
/// ```
///
/// OpenSoT has the same task. `dg/dq` of the joints is the second derivative of the potential energy and
/// therefore symmetric. The gradient is thus the change of `g` along the scaled efforts: one central
/// difference for any number of joints. A floating base is commanded to rest. Under acceleration control,
/// velocity errors decay at the [`rate`](Self::rate).
///
/// ```
/// use motorium_control::{RobotState, tasks::{MinimumEffortTask, VelocityTask}};
/// use motorium_robots::{Kinematics, load};
/// use nalgebra::Vector3;
///
/// let panda = load("panda", std::path::Path::new("."))?;
/// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
/// let mut kinematics = Kinematics::new(model);
/// kinematics.update(model, home.as_slice());
/// let mut task = MinimumEffortTask::new(model, Vector3::new(0.0, 0.0, -9.81));
/// task.update(&RobotState { model, kinematics: &kinematics, q: home.as_slice() });
/// assert!(task.measure() > 0.0, "the arm hangs out to the front");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MinimumEffortTask {
    gravity: Vector3<f64>,
    gain: f64,
    weight: f64,
    measure: f64,
    /// `1 / tau_max^2` of each joint.
    shares: Vec<f64>,
    dynamics: Dynamics,
    /// Efforts, the direction, a configuration near `q`, and the efforts there.
    effort: Vec<f64>,
    direction: Vec<f64>,
    stepped: Vec<f64>,
    changed: Vec<f64>,
    equation: Equation,
}

methods!(MinimumEffortTask:
    with("(rad/s)^2 per unit of the measure", "1/(rad/s)"),
    rate("an error of a joint velocity"),
    set,
    cost
);

impl MinimumEffortTask {
    /// Creates a task for `model` under this gravitational acceleration \[m/s2\], with gain 1 and weight
    /// 1e-2.
    pub fn new(model: &Model, gravity: Vector3<f64>) -> Self {
        let share = |limit: &f64| if limit.is_finite() && *limit > 0.0 { limit.powi(-2) } else { 1.0 };
        let mut equation = Equation::identity(0, model.nv());
        equation.response = Response::velocity(RATE);
        Self {
            gravity,
            gain: 1.0,
            weight: 1e-2,
            measure: 0.0,
            shares: model.effort_limit().iter().map(share).collect(),
            dynamics: Dynamics::new(model),
            effort: vec![0.0; model.nv()],
            direction: vec![0.0; model.nv()],
            stepped: model.neutral(),
            changed: vec![0.0; model.nv()],
            equation,
        }
    }

    /// Returns the effort measure `m` at the last update.
    pub fn measure(&self) -> f64 {
        self.measure
    }
}

impl Task for MinimumEffortTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let RobotState { model, q, .. } = *state;
        let Self { dynamics, effort, direction, stepped, changed, gravity, .. } = self;
        let base = model.nv() - model.joint_count();
        dynamics.gravity(model, q, *gravity, effort);
        let (mut measure, mut length) = (0.0, 0.0_f64);
        for (joint, share) in self.shares.iter().enumerate() {
            let effort = effort[base + joint];
            direction[base + joint] = share * effort;
            measure += 0.5 * share * effort * effort;
            length = length.hypot(share * effort);
        }
        self.measure = measure;
        self.equation.weights_mut().fill(self.weight);
        self.equation.rate.fill(0.0);
        if length == 0.0 {
            return;
        }
        let mut efforts = |step: f64, out: &mut [f64]| {
            direction.iter_mut().for_each(|entry| *entry *= step);
            model.integrate(q, direction, stepped);
            direction.iter_mut().for_each(|entry| *entry /= step);
            dynamics.gravity(model, stepped, *gravity, out);
        };
        let step = STEP / length;
        efforts(step, changed);
        efforts(-step, effort);
        let slope = self.equation.rate.as_mut_slice();
        for joint in base..slope.len() {
            slope[joint] = -self.gain * (changed[joint] - effort[joint]) / (2.0 * step);
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        differentiate_velocities(&mut self.equation, state);
    }

    equation!();
}
