//! The centroidal momentum follows a target.

use motorium_robots::{Dynamics, Model, Momentum};
use nalgebra::Vector3;

use super::{AccelerationTask, Cost};
use crate::inverse_dynamics::{InverseDynamics, MotionState};

/// The momentum of the whole robot about its centre of mass follows a target, in world axes: `h = (linear,
/// angular)` \[kg m/s, kg m2/s\].
///
/// ```text
/// A = A_G(q)                                      centroidal momentum matrix, 6 x nv, on the accelerations
/// b = h*' + gain (h* - h) - A_G' v                N, Nm
/// W = diag(l, l, l, g, g, g)                      cost of a force (1/N) and of a torque (1/Nm)
/// ```
///
/// so that the error of the momentum decays at the rate `gain`. Without a target the momentum comes to rest.
/// An angular weight alone keeps the body from turning while the limbs move. Orin, Goswami and Lee,
/// *Centroidal dynamics of a humanoid robot*, 2013.
#[derive(Clone, Debug)]
pub struct MomentumRate {
    gain: f64,
    linear_weight: f64,
    angular_weight: f64,
    target: Momentum,
    rate: Momentum,
    dynamics: Dynamics,
    still: Vec<f64>,
    cost: Cost,
}

const REST: Momentum = Momentum { linear: Vector3::new(0.0, 0.0, 0.0), angular: Vector3::new(0.0, 0.0, 0.0) };

impl MomentumRate {
    /// A task that brings the angular momentum of `model` to rest at the rate `gain` \[1/s\], with weight 1
    /// \[1/Nm\].
    pub fn angular(model: &Model, gain: f64) -> Self {
        Self {
            gain,
            linear_weight: 0.0,
            angular_weight: 1.0,
            target: REST,
            rate: REST,
            dynamics: Dynamics::new(model),
            still: vec![0.0; model.nv()],
            cost: Cost::dense(6, 0, model.nv()),
        }
    }

    /// The same task with a weight of the linear \[1/N\] and the angular part \[1/Nm\]; 0 leaves a part free.
    #[must_use]
    pub fn weights(mut self, linear: f64, angular: f64) -> Self {
        (self.linear_weight, self.angular_weight) = (linear, angular);
        self
    }

    /// Sets the target and its rate.
    pub fn set_target(&mut self, target: Momentum, rate: Momentum) {
        (self.target, self.rate) = (target, rate);
    }

    /// Changes gain and weights from the next update on.
    pub fn set(&mut self, gain: f64, linear_weight: f64, angular_weight: f64) {
        (self.gain, self.linear_weight, self.angular_weight) = (gain, linear_weight, angular_weight);
    }
}

impl AccelerationTask for MomentumRate {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let MotionState { model, q, v, .. } = *state;
        let now = self.dynamics.momentum(model, q, v);
        let drift = self.dynamics.momentum_rate(model, q, v, &self.still);
        let wanted =
            |rate: &Vector3<f64>, target: &Vector3<f64>, now: &Vector3<f64>, drift: &Vector3<f64>| {
                rate + (target - now) * self.gain - drift
            };
        let linear = wanted(&self.rate.linear, &self.target.linear, &now.linear, &drift.linear);
        let angular = wanted(&self.rate.angular, &self.target.angular, &now.angular, &drift.angular);
        self.cost.desired_mut().fixed_rows_mut::<3>(0).copy_from(&linear);
        self.cost.desired_mut().fixed_rows_mut::<3>(3).copy_from(&angular);
        self.cost.weights_mut().fixed_rows_mut::<3>(0).fill(self.linear_weight);
        self.cost.weights_mut().fixed_rows_mut::<3>(3).fill(self.angular_weight);
        self.dynamics.centroidal_map(model, q, self.cost.matrix_mut());
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
