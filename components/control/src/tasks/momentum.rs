//! Makes the centroidal momentum follow a target.

use motorium::prelude::*;
use motorium_robots::{Dynamics, Model, Momentum};
use nalgebra::Vector3;

use super::context::TaskContext;
use super::held::Driven;
use super::kind::{BuiltTask, Formulations, GAINS, TaskHead, TaskKind, TaskTable, WEIGHTS};
use super::{Cost, Equation, Response, Task};
use crate::{MotionState, RobotState};

const REST: Momentum = Momentum { linear: Vector3::new(0.0, 0.0, 0.0), angular: Vector3::new(0.0, 0.0, 0.0) };

/// Makes the momentum `h` of the whole robot about its centre of mass follow a target, in world axes: linear
/// \[kg m/s\] and angular \[kg m2/s\].
///
/// ```text
/// J  = A_G(q)                                     centroidal momentum matrix, 6 x nv
/// nu = h*
/// W  = diag(l, l, l, g, g, g)                     1/(kg m/s) and 1/(kg m2/s); of accelerations 1/N and 1/Nm
/// ```
///
/// This task combines OpenSoT's tasks of linear and angular momentum. Momentum errors decay at the
/// [`rate`](Self::rate). Without a target the momentum decays to zero. A weight of zero leaves the linear or
/// angular part free: with an angular weight alone, the task keeps the body from turning while the limbs
/// move. Orin, Goswami and Lee, *Centroidal dynamics of a humanoid robot*, 2013.
#[derive(Clone, Debug)]
pub struct MomentumTask {
    linear_weight: f64,
    angular_weight: f64,
    dynamics: Dynamics,
    still: Vec<f64>,
    equation: Equation,
}

methods!(MomentumTask: rate("an error of the momentum"), cost);

impl MomentumTask {
    /// Creates a task that drives the angular momentum of `model` to zero, with weight 1 and a rate of 5/s.
    pub fn angular(model: &Model) -> Self {
        let mut equation = Equation::dense(6, 0, model.nv());
        equation.response = Response::velocity(5.0);
        Self {
            linear_weight: 0.0,
            angular_weight: 1.0,
            dynamics: Dynamics::new(model),
            still: vec![0.0; model.nv()],
            equation,
        }
    }

    /// Sets the weights of the linear \[1/N\] and the angular \[1/Nm\] part.
    #[must_use]
    pub fn weights(mut self, linear: f64, angular: f64) -> Self {
        (self.linear_weight, self.angular_weight) = (linear, angular);
        self
    }

    /// Changes the rate \[1/s\] and the weights from the next update on.
    pub fn set(&mut self, rate: f64, linear_weight: f64, angular_weight: f64) {
        self.equation.response = Response::velocity(rate);
        (self.linear_weight, self.angular_weight) = (linear_weight, angular_weight);
    }

    /// Sets the constant target `h*`.
    pub fn set_target(&mut self, target: Momentum) {
        self.set_moving_target(target, REST);
    }

    /// Sets the target `h*` and its rate `h*'` \[N, Nm\].
    pub fn set_moving_target(&mut self, target: Momentum, rate: Momentum) {
        for (out, momentum) in [(&mut self.equation.rate, target), (&mut self.equation.rate_derivative, rate)]
        {
            out.fixed_rows_mut::<3>(0).copy_from(&momentum.linear);
            out.fixed_rows_mut::<3>(3).copy_from(&momentum.angular);
        }
    }
}

impl Task for MomentumTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        self.dynamics.centroidal_map(state.model, state.q, self.equation.jacobian_mut());
        self.equation.weights_mut().fixed_rows_mut::<3>(0).fill(self.linear_weight);
        self.equation.weights_mut().fixed_rows_mut::<3>(3).fill(self.angular_weight);
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let MotionState { model, q, v, .. } = *state;
        let now = self.dynamics.momentum(model, q, v);
        let change = self.dynamics.momentum_rate(model, q, v, &self.still);
        let Equation { rate, error_rate, drift, .. } = &mut self.equation;
        for (first, now, change) in [(0, now.linear, change.linear), (3, now.angular, change.angular)] {
            error_rate.fixed_rows_mut::<3>(first).copy_from(&(rate.fixed_rows::<3>(first) - now));
            drift.fixed_rows_mut::<3>(first).copy_from(&change);
        }
    }

    equation!();
}

task_config! {
    /// A momentum task: the momentum of the whole robot about its centre of mass decays to zero.
    MomentumConfig "momentum" {
        /// Rate at which the momentum decays, 1/s, 0 to 1000; limited to half the tick rate. Default 5.
        gain: f64 = 5.0 => live(GAINS, "1/s", "rate at which the momentum decays");
        /// Cost of a force, which is the rate of the linear momentum, 1/N, 0 to 1000. Default 0.
        linear_weight: f64 = 0.0 => live(WEIGHTS, "1/N", "cost of a force, the rate of the linear momentum");
        /// Cost of a torque, which is the rate of the angular momentum, 1/Nm, 0 to 1000. Default 0.1.
        angular_weight: f64 = 0.1 => live(WEIGHTS, "1/Nm", "cost of a torque, the rate of the angular momentum");
    }
}

impl TaskKind for MomentumConfig {
    fn head(&self) -> TaskHead<'_> {
        self.table_head().only(Formulations::Torque)
    }

    fn check(&self, _: &TaskContext<'_>) -> Result<(), ConfigError> {
        Ok(())
    }

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let (task, parameters) = (MomentumTask::angular(context.model), self.open(setup)?);
        Ok(Box::new(Driven::motion(task, parameters, |task, [gain, linear, angular], bounds| {
            task.set(gain.min(bounds.max_gain), linear, angular);
        })))
    }
}
