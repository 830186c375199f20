//! Acceleration-level form of tasks that command joint velocities.

use motorium_robots::Model;

use super::{AccelerationTask, Cost};
use crate::RobotState;
use crate::inverse_dynamics::{InverseDynamics, MotionState};
use crate::tasks::{ManipulabilityTask, MinimumEffortTask, MinimumVelocityTask, Task};

/// A velocity task with `A = 1`: it commands a velocity for each joint.
pub trait JointVelocities: Task {
    /// Velocities and weights of the last update; a floating base comes first.
    fn cost(&self) -> &Cost;
}

impl JointVelocities for ManipulabilityTask {
    fn cost(&self) -> &Cost {
        self.cost()
    }
}

impl JointVelocities for MinimumEffortTask {
    fn cost(&self) -> &Cost {
        self.cost()
    }
}

impl JointVelocities for MinimumVelocityTask {
    fn cost(&self) -> &Cost {
        self.cost()
    }
}

/// Makes the joint velocities follow the velocities `v*` of a velocity task:
///
/// ```text
/// A = S                                           the accelerations of the independent joints
/// b = rate (v* - v)                               rad/s2 or m/s2; an error decays at `rate`
/// W = weights of the task                         1/(rad/s2) or 1/(m/s2)
/// ```
///
/// It provides a torque formulation for the tasks of [manipulability](ManipulabilityTask), [minimum
/// effort](MinimumEffortTask) and [minimum velocity](MinimumVelocityTask) (damping). A floating base is left
/// to other tasks.
///
/// ```
/// use motorium_control::{inverse_dynamics::tasks::JointVelocityAcceleration, tasks::MinimumVelocityTask};
/// use motorium_robots::load;
///
/// let panda = load("panda", std::path::Path::new("."))?.model;
/// // the motion of the joints that other tasks leave open dies away within a tenth of a second
/// let damping = JointVelocityAcceleration::new(&panda, MinimumVelocityTask::new(&panda), 10.0);
/// # let _ = damping;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct JointVelocityAcceleration<T> {
    task: T,
    rate: f64,
    cost: Cost,
}

impl<T: JointVelocities> JointVelocityAcceleration<T> {
    /// The form of `task`, which is for `model`, for accelerations; an error of a velocity decays at `rate`
    /// \[1/s\].
    pub fn new(model: &Model, task: T, rate: f64) -> Self {
        let joints = model.joint_count();
        Self { task, rate, cost: Cost::identity(model.nv() - joints, joints) }
    }

    /// The task of velocities.
    pub fn task_mut(&mut self) -> &mut T {
        &mut self.task
    }
}

impl<T: JointVelocities> AccelerationTask for JointVelocityAcceleration<T> {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let MotionState { model, kinematics, q, v } = *state;
        self.task.update(&RobotState { model, kinematics, q });
        let base = model.nv() - model.joint_count();
        let wanted = self.task.cost();
        for (joint, v) in model.joints_of_v(v).iter().enumerate() {
            self.cost.desired_mut()[joint] = self.rate * (wanted.desired()[base + joint] - v);
            self.cost.weights_mut()[joint] = wanted.weights()[base + joint];
        }
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
