//! A base drives like a unicycle.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::Matrix6xX;

use super::{Cost, Rows, Task};
use crate::{RobotState, solver::Problem};

/// Speeds and weights of a [`UnicycleTask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnicycleSettings {
    /// Speed along the x axis of the frame \[m/s\]. Default 0.
    pub forward: f64,
    /// Angular velocity about the z axis of the frame \[rad/s\]. Default 0.
    pub yaw_rate: f64,
    /// Cost of an error of the forward speed \[1/(m/s)\]; 0 leaves it to other tasks. Default 1.
    pub forward_weight: f64,
    /// Cost of a motion sideways \[1/(m/s)\]. Default 1.
    pub sideways_weight: f64,
    /// Cost of an error of the yaw rate \[1/(rad/s)\]; 0 leaves it to other tasks. Default 1.
    pub yaw_weight: f64,
}

impl Default for UnicycleSettings {
    fn default() -> Self {
        Self { forward: 0.0, yaw_rate: 0.0, forward_weight: 1.0, sideways_weight: 1.0, yaw_weight: 1.0 }
    }
}

/// Moves a frame forward and turns it as commanded, and never sideways:
///
/// ```text
/// A = rows x, y of J_v and z of J_w               J: Jacobian of the frame in its own axes, 3 x nv
/// b = (forward, 0, yaw rate)                      m/s, m/s, rad/s
/// W = diag(f, s, y)
/// ```
///
/// (OpenSoT's task, whose wheel is a [`RollingTask`](super::RollingTask) here.) With zero forward and yaw
/// weights only sideways motion is excluded, so that a base moved by other tasks behaves like one on an axle.
///
/// ```
/// use motorium_control::{RobotState, tasks::{Task, UnicycleSettings, UnicycleTask}};
/// use motorium_robots::{Kinematics, load};
///
/// let robot = load("quadruped", std::path::Path::new("."))?.model;
/// let (q, mut kinematics) = (robot.neutral(), Kinematics::new(&robot));
/// kinematics.update(&robot, &q);
/// let mut drive = UnicycleTask::new(&robot, robot.frame("base")?)
///     .with(UnicycleSettings { forward: 0.5, yaw_rate: 0.2, ..UnicycleSettings::default() });
/// drive.update(&RobotState { model: &robot, kinematics: &kinematics, q: &q });
/// let mut v = vec![0.0; robot.nv()];
/// (v[0], v[5]) = (0.5, 0.2);
/// assert!(drive.residual(&v) < 1e-12);
/// v[1] = 0.1; // sideways
/// assert!((drive.residual(&v) - 0.1).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct UnicycleTask {
    frame: FrameId,
    settings: UnicycleSettings,
    jacobian: Matrix6xX<f64>,
    cost: Cost,
}

impl UnicycleTask {
    /// Creates a task for `frame` of `model`, initially at rest, with default weights.
    pub fn new(model: &Model, frame: FrameId) -> Self {
        let (jacobian, cost) = (Matrix6xX::zeros(model.nv()), Cost::dense(3, 0, model.nv()));
        Self { frame, settings: UnicycleSettings::default(), jacobian, cost }
    }

    /// The same task with these settings.
    #[must_use]
    pub fn with(mut self, settings: UnicycleSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Changes speeds and weights from the next update on.
    pub fn set_settings(&mut self, settings: UnicycleSettings) {
        self.settings = settings;
    }

    /// Speeds and weights.
    pub fn settings(&self) -> &UnicycleSettings {
        &self.settings
    }

    /// The cost as of the last update.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}

impl Task for UnicycleTask {
    fn rows(&self) -> usize {
        3
    }

    fn update(&mut self, state: &RobotState<'_>) {
        state.kinematics.jacobian(state.model, self.frame, Reference::Local, &mut self.jacobian);
        for (mut row, frame) in self.cost.matrix_mut().column_iter_mut().zip(self.jacobian.column_iter()) {
            (row[0], row[1], row[2]) = (frame[0], frame[1], frame[5]);
        }
        let UnicycleSettings { forward, yaw_rate, forward_weight, sideways_weight, yaw_weight } =
            self.settings;
        self.cost.desired_mut().copy_from_slice(&[forward, 0.0, yaw_rate]);
        self.cost.weights_mut().copy_from_slice(&[forward_weight, sideways_weight, yaw_weight]);
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        self.cost.residual(velocity)
    }

    fn add_to(&self, problem: &mut Problem) {
        self.cost.add_to(problem);
    }

    fn write_rows(&self, rows: &mut Rows) {
        self.cost.write_rows(rows);
    }
}
