//! Moves the joints towards configurations in which a frame moves, or exerts forces, more easily.

use motorium::prelude::*;
use motorium_robots::{FrameId, Model, TaskRows};
use schemars::JsonSchema;
use serde::Deserialize;

use super::context::TaskContext;
use super::held::Driven;
use super::kind::{ActsOn, BuiltTask, TaskHead, TaskKind, TaskTable, WEIGHTS};
use super::velocities::{RATE, differentiate_velocities};
use super::{Cost, Equation, Response, Task};
use crate::{MotionState, RobotState};

/// Manipulability measure that a [`ManipulabilityTask`] increases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Velocity manipulability `sqrt(det(J J'))`: the volume of the ellipsoid of frame velocities for joint
    /// velocities of norm 1.
    #[default]
    Velocity,
    /// Force manipulability `sqrt(det((J J')^-1))`: the volume of the ellipsoid of frame forces for joint
    /// torques of norm 1.
    Force,
}

/// Moves the joints along the gradient of a manipulability measure `m` of a frame:
///
/// ```text
/// m = sqrt(det(J J'))                             Yoshikawa's measure of the rows that count: of velocities
/// m = sqrt(det((J J')^-1))                        or of forces, its reciprocal
/// J = 1 on all velocities,   nu = gain dm/dq      no longer than the largest speed
/// W = weight                                      1/(rad/s)
/// ```
///
/// OpenSoT has the same task, and PyRoboLearn has the same task for force manipulability. Velocity
/// manipulability moves the robot away from singular configurations. Force manipulability moves the robot
/// towards singular configurations, where the gradient is unbounded and the maximum speed applies. A singular
/// configuration has no gradient, and the task commands zero velocity. A floating base does not change the
/// measure and is commanded to rest. Under acceleration control, velocity errors decay at the
/// [`rate`](Self::rate).
#[derive(Clone, Debug)]
pub struct ManipulabilityTask {
    frame: FrameId,
    rows: TaskRows,
    of: Measure,
    gain: f64,
    weight: f64,
    max_speed: f64,
    measure: f64,
    equation: Equation,
}

methods!(ManipulabilityTask:
    with("(rad/s)^2 per unit of the measure", "1/(rad/s)"),
    rate("an error of a joint velocity"),
    set,
    cost
);

impl ManipulabilityTask {
    /// Creates a task for the velocity components `rows` of `frame` of `model`, with gain 1 and weight 1e-2.
    pub fn new(model: &Model, frame: FrameId, rows: TaskRows) -> Self {
        let (of, mut equation) = (Measure::Velocity, Equation::identity(0, model.nv()));
        equation.response = Response::velocity(RATE);
        Self { frame, rows, of, gain: 1.0, weight: 1e-2, max_speed: f64::INFINITY, measure: 0.0, equation }
    }

    /// Selects the force manipulability.
    ///
    /// ```
    /// use motorium_control::{RobotState, tasks::{ManipulabilityTask, VelocityTask}};
    /// use motorium_robots::{Kinematics, TaskRows, load};
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update(model, home.as_slice());
    /// let hand = model.frame("panda_hand_tcp")?;
    /// let mut force = ManipulabilityTask::new(model, hand, TaskRows::POSITION).of_forces();
    /// force.update(&RobotState { model, kinematics: &kinematics, q: home.as_slice() });
    /// let velocity = kinematics.manipulability(model, hand, TaskRows::POSITION);
    /// assert!((force.measure() * velocity - 1.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn of_forces(self) -> Self {
        self.with_measure(Measure::Force)
    }

    /// Sets the manipulability measure.
    #[must_use]
    pub fn with_measure(mut self, measure: Measure) -> Self {
        self.of = measure;
        self
    }

    /// Sets the maximum norm of the joint velocity `nu` \[rad/s\].
    #[must_use]
    pub fn max_speed(mut self, speed: f64) -> Self {
        self.max_speed = speed;
        self
    }

    /// Returns the measure `m` at the last update. The force manipulability is infinite in a singular
    /// configuration.
    pub fn measure(&self) -> f64 {
        self.measure
    }
}

impl Task for ManipulabilityTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let slope = self.equation.rate.as_mut_slice();
        let velocity = state.kinematics.manipulability_gradient(state.model, self.frame, self.rows, slope);
        let (measure, factor) = match self.of {
            Measure::Velocity => (velocity, 1.0),
            // d(1/m) = -dm / m^2
            Measure::Force => (velocity.recip(), -velocity.powi(-2)),
        };
        self.measure = measure;
        let length = slope.iter().map(|slope| slope * slope).sum::<f64>().sqrt();
        let most = self.max_speed / length;
        let factor = (self.gain * factor).clamp(-most, most);
        let usable = length > 0.0 && factor.is_finite();
        slope.iter_mut().for_each(|slope| *slope = if usable { *slope * factor } else { 0.0 });
        self.equation.weights_mut().fill(self.weight);
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        differentiate_velocities(&mut self.equation, state);
    }

    equation!();
}

task_config! {
    /// A manipulability task: moves the joints towards configurations in which a frame moves, or exerts
    /// forces, more easily.
    ManipulabilityConfig "manipulability" {
        /// Link of the evaluated frame. Default: the robot's only end effector.
        frame: Option<String> = None;
        /// Velocity components of the frame to evaluate. Default "position".
        rows: ManipulabilityRows = ManipulabilityRows::Position;
        /// Manipulability measure to increase. Default "velocity".
        of: Measure = Measure::Velocity;
        /// Commanded joint speed per gradient of the measure, (rad/s)^2, 0 to 1000. Default 1.
        gain: f64 = 1.0 => live(WEIGHTS, "(rad/s)^2", "speed per slope of the measure");
        /// Cost of a joint velocity error, 1/(rad/s), 0 to 1000. Default 1e-2.
        weight: f64 = 1e-2 => live(WEIGHTS, "1/(rad/s)", "cost of a joint velocity error");
        /// Maximum norm of the commanded joint velocities, rad/s. Default 0.5.
        max_speed: f64 = 0.5 => within(1e-6..=f64::MAX);
        /// With `inverse_dynamics`: decay rate of joint velocity errors, 1/s, 0 to 1000; limited to half the
        /// tick rate. Default 20.
        rate: Option<f64> = None;
    }
}

/// Velocity components of a frame that the manipulability includes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ManipulabilityRows {
    /// Linear velocity of the frame's origin.
    Position,
    /// Angular velocity of the frame.
    Orientation,
    /// Linear and angular velocity; metres and radians have equal weight.
    Pose,
}

impl ManipulabilityConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<ManipulabilityTask, ConfigError> {
        let frame = context.frame("manipulability", self.frame.as_deref())?;
        let rows = match self.rows {
            ManipulabilityRows::Position => TaskRows::POSITION,
            ManipulabilityRows::Orientation => TaskRows::ORIENTATION,
            ManipulabilityRows::Pose => TaskRows::POSE,
        };
        let (task, rate) = (ManipulabilityTask::new(context.model, frame, rows), context.rate(self.rate)?);
        Ok(task.with_measure(self.of).max_speed(self.max_speed).rate(rate))
    }
}

impl TaskKind for ManipulabilityConfig {
    fn head(&self) -> TaskHead<'_> {
        self.table_head().acts_on(ActsOn::Joints)
    }

    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let (task, parameters) = (self.build(context)?, self.open(setup)?);
        Ok(Box::new(Driven::motion(task, parameters, |task, [gain, weight], _| task.set(gain, weight))))
    }
}
