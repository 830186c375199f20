//! The joints keep a posture, by their accelerations.

use motorium_robots::Model;
use nalgebra::DVector;

use super::impedance::Mobility;
use super::{AccelerationTask, Cost, Feedback};
use crate::inverse_dynamics::{InverseDynamics, MotionState};

/// Moves joint positions `q` to a posture `q*` \[rad or m\], which may move:
///
/// ```text
/// A = S                                           the accelerations of the independent joints
/// b = q*'' + kd (q*' - q') + kp (q* - q)
/// W = weight diag(shares)
/// ```
///
/// With an [impedance](Self::impedance) the joints are pulled by springs and dampers instead of rates, and
/// accelerate as their efforts would move a robot without contacts: `M^-1 (K (q* - q) + D (q*' - q'))`
/// instead of `kp (q* - q) + kd (q*' - q')`. A floating base is not affected; use
/// [`CartesianAcceleration`](super::CartesianAcceleration) of its frame.
#[derive(Clone, Debug)]
pub struct PostureAcceleration {
    feedback: Feedback,
    /// Stiffness and damping of each joint.
    impedance: Option<(DVector<f64>, DVector<f64>)>,
    efforts: DVector<f64>,
    mobility: Mobility,
    weight: f64,
    target: DVector<f64>,
    velocity: DVector<f64>,
    acceleration: DVector<f64>,
    shares: DVector<f64>,
    error: DVector<f64>,
    cost: Cost,
}

impl PostureAcceleration {
    /// A task for all joints of `model`, with weight 1 \[1/(rad/s2) or 1/(m/s2)\].
    ///
    /// # Panics
    /// If `target` has not one entry per independent joint.
    pub fn new(model: &Model, target: &[f64], feedback: Feedback) -> Self {
        let joints = model.joint_count();
        assert_eq!(target.len(), joints, "length of the posture");
        Self {
            feedback,
            impedance: None,
            efforts: DVector::zeros(joints),
            mobility: Mobility::new(model),
            weight: 1.0,
            target: DVector::from_column_slice(target),
            velocity: DVector::zeros(joints),
            acceleration: DVector::zeros(joints),
            shares: DVector::repeat(joints, 1.0),
            error: DVector::zeros(joints),
            cost: Cost::identity(model.nv() - joints, joints),
        }
    }

    /// The same task with a weight \[1/(rad/s2) or 1/(m/s2)\].
    #[must_use]
    pub fn weight(mut self, weight: f64) -> Self {
        self.weight = weight;
        self
    }

    /// The same task with springs and dampers in place of the feedback: a stiffness \[N m/rad or N/m\] and a
    /// damping \[N m s/rad or N s/m\] for each independent joint.
    ///
    /// # Panics
    /// If one of them has not one entry per independent joint.
    #[must_use]
    pub fn impedance(mut self, stiffness: &[f64], damping: &[f64]) -> Self {
        assert_eq!([stiffness.len(), damping.len()], [self.error.len(); 2], "length of the impedance");
        self.impedance = Some((DVector::from_column_slice(stiffness), DVector::from_column_slice(damping)));
        self
    }

    /// Changes feedback and weight from the next update on.
    pub fn set(&mut self, feedback: Feedback, weight: f64) {
        (self.feedback, self.weight) = (feedback, weight);
    }

    /// Sets the posture, at rest.
    ///
    /// # Panics
    /// If `target` has not one entry per independent joint.
    pub fn set_target(&mut self, target: &[f64]) {
        self.target.copy_from_slice(target);
        self.velocity.fill(0.0);
        self.acceleration.fill(0.0);
    }

    /// Sets the posture, its velocity and its acceleration.
    ///
    /// # Panics
    /// If one of them has not one entry per independent joint.
    pub fn set_moving_target(&mut self, target: &[f64], velocity: &[f64], acceleration: &[f64]) {
        self.target.copy_from_slice(target);
        self.velocity.copy_from_slice(velocity);
        self.acceleration.copy_from_slice(acceleration);
    }

    /// Sets the weight factor of one joint; zero removes it.
    ///
    /// # Panics
    /// If the joint does not exist.
    pub fn set_share(&mut self, joint: usize, share: f64) {
        self.shares[joint] = share;
    }

    /// `q* - q` at the last update.
    pub fn error(&self) -> &[f64] {
        self.error.as_slice()
    }
}

impl AccelerationTask for PostureAcceleration {
    fn update(&mut self, state: &MotionState<'_>, dynamics: &InverseDynamics) {
        let (q, v) = (state.model.joints_of_q(state.q), state.model.joints_of_v(state.v));
        let Feedback { kp, kd } = self.feedback;
        for joint in 0..q.len() {
            self.error[joint] = self.target[joint] - q[joint];
            self.cost.desired_mut()[joint] =
                self.acceleration[joint] + kd * (self.velocity[joint] - v[joint]) + kp * self.error[joint];
            self.cost.weights_mut()[joint] = self.weight * self.shares[joint];
        }
        let Some((stiffness, damping)) = &self.impedance else { return };
        for joint in 0..q.len() {
            self.efforts[joint] =
                stiffness[joint] * self.error[joint] + damping[joint] * (self.velocity[joint] - v[joint]);
        }
        let moving = self.mobility.of_joints(dynamics, &self.efforts);
        for ((desired, moving), ahead) in
            self.cost.desired_mut().iter_mut().zip(moving).zip(&self.acceleration)
        {
            *desired = ahead + moving;
        }
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
