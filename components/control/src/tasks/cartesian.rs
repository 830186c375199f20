//! Makes a frame follow a pose.

use motorium::prelude::*;
use motorium_robots::{
    FrameId, Model, Reference, Twist,
    lie::{se3, so3},
};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3, Vector6};
use schemars::JsonSchema;
use serde::Deserialize;

use super::axes::stacked;
use super::context::TaskContext;
use super::held::{HeldTask, TaskCost};
use super::jacobian_view::JacobianView;
use super::kind::{BuiltTask, GAINS, TaskKind, TaskParameter, TaskTable, WEIGHTS};
use super::ramp::{Fades, Ramped, TaskBounds};
use super::target::TargetInput;
use super::{AxesConfig, AxisShares, Cost, Equation, Feedback, PoseAxes, PoseError, Response, Task};
use crate::{GoalError, GoalRecord, GoalTolerance, MotionState, RobotState};

/// Half the time step of numerical differentiation of an error \[s\].
const STEP: f64 = 1e-4;

with_defaults! {
    /// Gains and weights of a [`CartesianTask`].
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct CartesianSettings;

    /// Form of the error. Default: logarithm.
    pub error: PoseError = PoseError::Logarithm;
    /// Rate at which the error decays \[1/s\]. Should be below a tenth of the tick rate. Default 10.
    pub gain: f64 = 10.0;
    /// Cost of a velocity error \[1/(m/s)\], or of an acceleration error \[1/(m/s2)\]; 0 leaves the position
    /// free. Default 1.
    pub position_weight: f64 = 1.0;
    /// Cost of an angular velocity error \[1/(rad/s)\], or of an acceleration error \[1/(rad/s2)\]; 0 leaves
    /// the orientation free. Default 0.5.
    pub orientation_weight: f64 = 0.5;
    /// Maximum speed at which the error is corrected \[m/s\]. Default infinite.
    pub max_linear_speed: f64 = f64::INFINITY;
    /// Maximum angular speed at which the error is corrected \[rad/s\]. Default infinite.
    pub max_angular_speed: f64 = f64::INFINITY;
    /// Levenberg-Marquardt damping per unit of correction speed \[s m/rad^2\]. Prevents oscillation if the
    /// target is out of reach, and vanishes at the target. Should exceed half the tick period times the reach
    /// of the robot. Default 5e-3.
    pub damping: f64 = 5e-3;
    /// Weight factors per axis. Default `None`: the whole pose is controlled.
    pub shares: Option<AxisShares> = None;
}

impl CartesianSettings {
    /// Returns the defaults with a [geometric](PoseError::Geometric) error.
    pub fn geometric() -> Self {
        Self { error: PoseError::Geometric, ..Self::default() }
    }

    fn response(&self) -> Response {
        let max_speeds = [self.max_linear_speed, self.max_angular_speed];
        Response { max_speeds, damping: self.damping, ..Response::decay(self.gain) }
    }
}

/// Makes a frame `b` of the robot follow a target pose `t`.
///
/// With `T_bt` the pose of the target in the frame, a [logarithmic](PoseError::Logarithm) error is the twist
/// that moves the frame onto the target in one unit of time, linear \[m\] then angular \[rad\], in the axes
/// of the frame:
///
/// ```text
/// e  = log(T_bt)
/// nu = Jlog(T_bt) nu_t,   J = Jlog(T_tb) J_b
/// W  = diag(p, p, p, o, o, o)
/// ```
///
/// where `J_b` is the Jacobian of the frame in its own axes, `nu_t` the velocity of the target in the
/// target's axes, and `Jlog` the derivative of the logarithm. Pink's frame task is the same. At acceleration
/// level, the derivatives are finite differences along the motion.
///
/// A [geometric](PoseError::Geometric) error is in world axes, at the origin of the frame. With the
/// orientations `R` of the frame and `R*` of the target, and the classical accelerations of both,
///
/// ```text
/// e  = (p* - p, log(R* R'))                       m, rad
/// nu = (v*, w*),   J = J_world                    geometric Jacobian of the frame
/// ```
///
/// OpenSoT and TSID have the same task. Near the target, both errors are equal.
///
/// With [`shares`](CartesianSettings::shares) position and rotation are separate, so that either can be free
/// without affecting the other. [`AxisShares`] defines `e`, in axes `A` that may rotate with an angular
/// velocity `u`. With the position error `p` in world axes,
///
/// ```text
/// J  = S A'(J_v - [p]x J_w; J_w)                  the term of p for the axes of the frame alone
/// nu = S A'(v* - w* x p; w*)                      the term of p for the axes of the target alone
/// ```
///
/// and, for a logarithmic error, rows of the orientation multiplied by the derivative of the rotation vector.
///
/// Levenberg-Marquardt damping is proportional to the error, not to its square. An error that no motion can
/// reduce bends the cost by about `|W^2 c|` times the reach of the robot, which a step of `dt` must not
/// overshoot. With less damping than `dt reach / 2` a stretched arm chatters between its velocity limits,
/// regardless of the correction speed.
#[derive(Clone, Debug)]
pub struct CartesianTask {
    frame: FrameId,
    settings: CartesianSettings,
    target: Isometry3<f64>,
    velocity: Twist,
    acceleration: Twist,
    position_error: f64,
    orientation_error: f64,
    equation: Equation,
}

settings!(CartesianTask, CartesianSettings);

impl CartesianTask {
    /// Creates a task for `frame` of `model`, with the world's origin as target and default settings.
    pub fn new(model: &Model, frame: FrameId) -> Self {
        let settings = CartesianSettings::default();
        let mut equation = Equation::dense(6, 0, model.nv());
        equation.response = settings.response();
        Self {
            frame,
            settings,
            target: Isometry3::identity(),
            velocity: Twist::zero(),
            acceleration: Twist::zero(),
            position_error: 0.0,
            orientation_error: 0.0,
            equation,
        }
    }

    /// Replaces the acceleration feedback by a spring and a damper.
    #[must_use]
    pub fn impedance(mut self, model: &Model, impedance: CartesianImpedance) -> Self {
        self.equation.set_impedance(model, &[0.0; 6], &[0.0; 6]);
        self.equation.separate_force_jacobian();
        self.set_impedance(impedance);
        self
    }

    /// Changes the spring and damper from the next update on.
    ///
    /// # Panics
    /// If the task was created without an impedance.
    pub fn set_impedance(&mut self, impedance: CartesianImpedance) {
        let CartesianImpedance { stiffness, damping, rotational_stiffness, rotational_damping } = impedance;
        let (k, d) = self.equation.springs_mut().expect("a task with an impedance");
        for (springs, linear, angular) in
            [(k, stiffness, rotational_stiffness), (d, damping, rotational_damping)]
        {
            springs.rows_mut(0, 3).fill(linear);
            springs.rows_mut(3, 3).fill(angular);
        }
    }

    /// Sets a resting target pose in the world.
    pub fn set_target(&mut self, target: Isometry3<f64>) {
        self.set_moving_target(target, Twist::zero(), Twist::zero());
    }

    /// Sets a moving target: its pose in the world, its velocity and its classical acceleration. Velocity and
    /// acceleration are in world axes: linear (of the target's origin) and angular \[m/s, rad/s; m/s2,
    /// rad/s2\].
    pub fn set_moving_target(&mut self, target: Isometry3<f64>, velocity: Twist, acceleration: Twist) {
        (self.target, self.velocity, self.acceleration) = (target, velocity, acceleration);
    }

    /// Returns the controlled frame.
    pub fn frame(&self) -> FrameId {
        self.frame
    }

    /// Returns the target pose in the world.
    pub fn target(&self) -> &Isometry3<f64> {
        &self.target
    }

    /// Returns the error `e` at the last update: linear \[m\], then angular \[rad\]. The axes are the axes of
    /// the frame, of the world for a geometric error, or of the shares. Free directions are zero.
    pub fn error(&self) -> Vector6<f64> {
        self.equation.error.fixed_rows::<6>(0).into()
    }

    /// Returns the distance between the origins of frame and target at the last update \[m\].
    pub fn position_error(&self) -> f64 {
        self.position_error
    }

    /// Returns the angle between frame and target at the last update \[rad\], in `[0, pi]`.
    pub fn orientation_error(&self) -> f64 {
        self.orientation_error
    }

    /// Returns `J` at the last update, 6 x nv. For a target at rest the error changes at the rate `-J v`;
    /// with shares, `S e` changes at this rate.
    pub fn jacobian(&self) -> JacobianView<'_, 6> {
        self.equation.jacobian().fixed_rows::<6>(0)
    }

    /// Returns the desired value `b` at the last update: linear, then angular \[m/s, rad/s or m/s2, rad/s2\].
    pub fn desired(&self) -> Vector6<f64> {
        self.cost().desired().fixed_rows::<6>(0).into()
    }

    /// Logarithmic error of a frame at `pose`.
    fn logarithm(&self, pose: &Isometry3<f64>, target: &Isometry3<f64>) -> Vector6<f64> {
        match &self.settings.shares {
            None => se3::log(&pose.inv_mul(target)),
            Some(shares) => stacked(shares.error(pose, target)),
        }
    }

    /// Logarithmic error of the whole pose.
    fn evaluate_screw(&mut self, state: &RobotState<'_>, pose: &Isometry3<f64>) {
        let target_in_frame = pose.inv_mul(&self.target);
        let axes = self.target.rotation.inverse();
        let velocity = se3::stack(&(axes * self.velocity.linear), &(axes * self.velocity.angular));
        let equation = &mut self.equation;
        equation.error.copy_from(&se3::log(&target_in_frame));
        equation.rate.copy_from(&(se3::log_jacobian(&target_in_frame) * velocity));
        state.kinematics.jacobian(state.model, self.frame, Reference::Local, equation.jacobian_mut());
        equation.copy_force_jacobian(None);
        let derivative = se3::log_jacobian(&target_in_frame.inverse());
        for mut column in equation.jacobian_mut().column_iter_mut() {
            let rotated = derivative * column.fixed_rows::<6>(0);
            column.copy_from(&rotated);
        }
    }

    /// Geometric error of the whole pose.
    fn evaluate_geometric(&mut self, state: &RobotState<'_>, pose: &Isometry3<f64>) {
        let position = self.target.translation.vector - pose.translation.vector;
        let turn = (self.target.rotation * pose.rotation.inverse()).scaled_axis();
        let equation = &mut self.equation;
        equation.error.copy_from(&stacked((position, turn)));
        equation.rate.copy_from(&self.velocity.vector());
        let reference = Reference::LocalWorldAligned;
        state.kinematics.jacobian(state.model, self.frame, reference, equation.jacobian_mut());
        equation.copy_force_jacobian(None);
    }

    /// Error of the directions with a share.
    fn evaluate_axes(&mut self, state: &RobotState<'_>, pose: &Isometry3<f64>, shares: &AxisShares) {
        let Twist { linear, angular } = self.velocity;
        let from_world = shares.world_to_axes(pose, &self.target);
        // free directions also affect the motion of the axes
        let offset = from_world * (self.target.translation.vector - pose.translation.vector);
        let carried = match shares.axes() {
            PoseAxes::Target => (from_world * angular).cross(&offset),
            _ => Vector3::zeros(),
        };
        let [by_frame, by_target] = match self.settings.error {
            PoseError::Logarithm => self.turn_derivatives(pose, shares, &from_world),
            PoseError::Geometric => [from_world; 2],
        };
        let equation = &mut self.equation;
        equation.error.copy_from(&stacked(shares.error(pose, &self.target)));
        equation.rate.copy_from(&shares.weigh(&(from_world * linear - carried), &(by_target * angular)));
        let reference = Reference::LocalWorldAligned;
        state.kinematics.jacobian(state.model, self.frame, reference, equation.jacobian_mut());
        equation.copy_force_jacobian(Some(&from_world));
        let carries = shares.follow_frame();
        for mut column in equation.jacobian_mut().column_iter_mut() {
            let (v, w) = (column.fixed_rows::<3>(0).into_owned(), column.fixed_rows::<3>(3).into_owned());
            let mut linear = from_world * v;
            if carries {
                linear -= offset.cross(&(from_world * w));
            }
            column.copy_from(&shares.weigh(&linear, &(by_frame * w)));
        }
    }

    /// Returns the derivatives of the rotation vector with respect to the angular velocities of frame and
    /// target, world axes.
    fn turn_derivatives(
        &self,
        pose: &Isometry3<f64>,
        shares: &AxisShares,
        from_world: &Matrix3<f64>,
    ) -> [Matrix3<f64>; 2] {
        let turn = from_world * so3::log(&(self.target.rotation * pose.rotation.inverse()));
        let (left, right) = (so3::left_jacobian_inverse(&turn), so3::right_jacobian_inverse(&turn));
        // the rotation vector is the same in the axes of frame and target
        let to_own = |rotation: UnitQuaternion<f64>| rotation.inverse().to_rotation_matrix().into_inner();
        match shares.axes() {
            PoseAxes::World => [right, left],
            _ => [left * to_own(pose.rotation), right * to_own(self.target.rotation)],
        }
    }

    /// Derivatives of a logarithmic error along the motions of frame and target without joint accelerations.
    fn differentiate_logarithm(&mut self, pose: Isometry3<f64>, moving: Twist, drift: Twist) {
        let error = |[frame, target]: [Isometry3<f64>; 2]| self.logarithm(&frame, &target);
        let (velocities, accelerations) = ([moving, self.velocity], [drift, self.acceleration]);
        let (rate, second) = differentiate_error(error, [pose, self.target], velocities, accelerations);
        self.set_derivatives(rate, second, Vector6::zeros());
    }

    fn differentiate_geometric(&mut self, pose: &Isometry3<f64>, moving: Twist, drift: Twist) {
        let (linear, angular) =
            (self.velocity.linear - moving.linear, self.velocity.angular - moving.angular);
        let Some(shares) = &self.settings.shares else {
            let (ahead, drift) = (self.acceleration.vector(), drift.vector());
            self.set_derivatives(stacked((linear, angular)), ahead, drift);
            return;
        };
        let from_world = shares.world_to_axes(pose, &self.target);
        let offset = self.target.translation.vector - pose.translation.vector;
        let spin = shares.turning(moving.angular, self.velocity.angular);
        let spin_rate = shares.turning(drift.angular, self.acceleration.angular);
        let seen = (from_world * (linear - spin.cross(&offset)), from_world * angular);
        let linear =
            self.acceleration.linear - drift.linear - spin_rate.cross(&offset) - spin.cross(&linear) * 2.0
                + spin.cross(&spin.cross(&offset));
        let angular = self.acceleration.angular - drift.angular;
        let second = stacked((from_world * linear, from_world * angular));
        self.set_derivatives(stacked(seen), second, Vector6::zeros());
    }

    /// Stores `e'`, and `nu'` and `J' v` before the selection of rows.
    fn set_derivatives(&mut self, rate: Vector6<f64>, ahead: Vector6<f64>, drift: Vector6<f64>) {
        let ahead = match &self.settings.shares {
            None => ahead,
            Some(shares) => shares.weigh(&ahead.fixed_rows::<3>(0).into(), &ahead.fixed_rows::<3>(3).into()),
        };
        let equation = &mut self.equation;
        equation.error_rate.copy_from(&rate);
        equation.rate_derivative.copy_from(&ahead);
        equation.drift.copy_from(&drift);
    }
}

impl Task for CartesianTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let CartesianSettings { error, position_weight, orientation_weight, shares, .. } = self.settings;
        let pose = state.kinematics.pose(state.model, self.frame);
        self.position_error = (self.target.translation.vector - pose.translation.vector).norm();
        self.orientation_error = pose.rotation.angle_to(&self.target.rotation);
        self.equation.selection = shares.map(|shares| shares.factors());
        let weights = self.equation.weights_mut();
        weights.fixed_rows_mut::<3>(0).fill(position_weight);
        weights.fixed_rows_mut::<3>(3).fill(orientation_weight);
        if let Some(shares) = &shares {
            // a row without a factor is ignored
            weights.component_mul_assign(&shares.rows());
        }
        match (shares, error) {
            (Some(shares), _) => self.evaluate_axes(state, &pose, &shares),
            (None, PoseError::Logarithm) => self.evaluate_screw(state, &pose),
            (None, PoseError::Geometric) => self.evaluate_geometric(state, &pose),
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let MotionState { model, kinematics, .. } = *state;
        let pose = kinematics.pose(model, self.frame);
        let moving = kinematics.velocity(model, self.frame);
        let drift = kinematics.acceleration(model, self.frame);
        match self.settings.error {
            PoseError::Logarithm => self.differentiate_logarithm(pose, moving, drift),
            PoseError::Geometric => self.differentiate_geometric(&pose, moving, drift),
        }
    }

    equation!();
}

/// Returns the first and second derivative of an error along the motions of two poses, by central
/// differences. Velocities and accelerations are in world axes.
pub(super) fn differentiate_error(
    error: impl Fn([Isometry3<f64>; 2]) -> Vector6<f64>,
    poses: [Isometry3<f64>; 2],
    velocities: [Twist; 2],
    accelerations: [Twist; 2],
) -> (Vector6<f64>, Vector6<f64>) {
    let after = |time: f64| {
        let half = 0.5 * time * time;
        error(std::array::from_fn(|index| {
            let (pose, v, a) = (&poses[index], &velocities[index], &accelerations[index]);
            let translation = pose.translation.vector + v.linear * time + a.linear * half;
            let turn = UnitQuaternion::from_scaled_axis(v.angular * time + a.angular * half);
            Isometry3::from_parts(translation.into(), turn * pose.rotation)
        }))
    };
    let [behind, now, ahead] = [-STEP, 0.0, STEP].map(after);
    ((ahead - behind) / (2.0 * STEP), (ahead - now * 2.0 + behind) / (STEP * STEP))
}

/// A spring and damper that pull a frame to its target.
///
/// The task requests the acceleration caused by the forces `f = K e + D e'` at the frame without contacts: `J
/// M^-1 J' f`, from the torques `J' f`, instead of `kp e + kd e'`. A push `p` on the frame of a fixed-base
/// robot therefore displaces it by `p / K`, independently of its inertia. Choose stiffness and damping to
/// suit that inertia: with a step of `dt`, a damping beyond `2 / dt` times the inertia is unstable. Light
/// wrists have little inertia.
///
/// ```
/// use motorium_control::tasks::{CartesianImpedance, CartesianSettings, CartesianTask};
/// use motorium_robots::load;
///
/// let iiwa = load("iiwa14", std::path::Path::new("."))?.model;
/// let hand = iiwa.frame("iiwa_link_ee")?;
/// let (stiffness, damping, rotational_stiffness, rotational_damping) = (300.0, 50.0, 20.0, 3.0);
/// let soft = CartesianImpedance { stiffness, damping, rotational_stiffness, rotational_damping };
/// let task = CartesianTask::new(&iiwa, hand).with(CartesianSettings::geometric()).impedance(&iiwa, soft);
/// # let _ = task;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartesianImpedance {
    /// Stiffness along each axis \[N/m\].
    pub stiffness: f64,
    /// Damping along each axis \[N s/m\].
    pub damping: f64,
    /// Stiffness about each axis \[N m/rad\].
    pub rotational_stiffness: f64,
    /// Damping about each axis \[N m s/rad\].
    pub rotational_damping: f64,
}

/// Range of every stiffness and damping of an impedance.
pub(super) const SPRINGS: core::ops::RangeInclusive<f64> = 0.0..=1e6;

task_config! {
    /// A Cartesian task: a frame follows a pose target.
    CartesianConfig "cartesian" {
        /// Link whose frame follows the target. Default: the robot's only end effector.
        frame: Option<String> = None;
        /// Name of the input port of the target. Without a target, the frame keeps its initial pose. Default
        /// "target".
        target: String = "target".to_owned() => target(
            required PoseTarget, "pose and velocity of the frame, in the world frame"
        );
        /// Rate at which the error decays, 1/s, 0 to 1000; limited to half the tick rate. Default 10.
        gain: f64 = CartesianSettings::default().gain => live(GAINS, "1/s", "rate at which the error decays");
        /// Spring and damper that replace the gain. Default: not used.
        impedance: Option<CartesianImpedanceConfig> = None;
        /// Cost of a velocity error, 1/(m/s), 0 to 1000. Default 1.
        position_weight: f64 = CartesianSettings::default().position_weight => live(
            WEIGHTS, "1/(m/s)", "cost of a velocity error"
        );
        /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 0.5.
        orientation_weight: f64 = CartesianSettings::default().orientation_weight => live(
            WEIGHTS, "1/(rad/s)", "cost of an angular velocity error"
        );
        /// Contact of `inverse_dynamics`, such as a foot. The task is active only while this contact is
        /// lifted. Default: always active.
        while_lifted: Option<String> = None;
        /// Weight factors per axis; axes with factor 0 are free. Default: all axes have factor 1.
        axes: Option<AxesConfig> = None;
        /// Maximum linear speed of the correction, m/s. Default: no limit.
        max_linear_speed: Option<f64> = None;
        /// Maximum angular speed of the correction, rad/s. Default: no limit.
        max_angular_speed: Option<f64> = None;
        /// Levenberg-Marquardt damping, s m/rad^2; prevents oscillation if the target is out of reach.
        /// Default: 5e-3, or two tick periods times one metre if that is larger.
        damping: Option<f64> = None;
        /// Maximum distance from a goal at which the goal counts as reached, m. Default 5e-3; unlimited if
        /// `position_weight` is 0.
        position_tolerance: f64 = GoalTolerance::default().position => within(0.0..=f64::MAX);
        /// Maximum angle from a goal at which the goal counts as reached, rad. Default 0.02; unlimited if
        /// `orientation_weight` is 0.
        orientation_tolerance: f64 = GoalTolerance::default().orientation => within(0.0..=f64::MAX);
    }
}

/// A spring and damper that pull a frame to its target and replace `gain`. Requires `inverse_dynamics`.
///
/// ```toml
/// impedance = { stiffness = 300.0, damping = 50.0, rotational_stiffness = 20.0, rotational_damping = 3.0 }
/// ```
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CartesianImpedanceConfig {
    /// Stiffness along each axis, N/m, 0 to 1e6.
    pub stiffness: f64,
    /// Damping along each axis, N s/m, 0 to 1e6.
    pub damping: f64,
    /// Stiffness about each axis, N m/rad, 0 to 1e6.
    pub rotational_stiffness: f64,
    /// Damping about each axis, N m s/rad, 0 to 1e6.
    pub rotational_damping: f64,
}

impl CartesianImpedanceConfig {
    /// Converts and checks the spring and the damper.
    fn build(&self, context: &TaskContext<'_>) -> Result<CartesianImpedance, ConfigError> {
        let figure = |name: &str, value| context.in_range(&format!("impedance.{name}"), value, SPRINGS);
        Ok(CartesianImpedance {
            stiffness: figure("stiffness", self.stiffness)?,
            damping: figure("damping", self.damping)?,
            rotational_stiffness: figure("rotational_stiffness", self.rotational_stiffness)?,
            rotational_damping: figure("rotational_damping", self.rotational_damping)?,
        })
    }
}

impl CartesianSettings {
    /// Returns `true` for the position, and for the orientation, if they are controlled.
    fn counts(&self) -> [bool; 2] {
        let Self { position_weight, orientation_weight, shares, .. } = self;
        [
            *position_weight > 0.0 && shares.is_none_or(|shares| shares.has_position()),
            *orientation_weight > 0.0 && shares.is_none_or(|shares| shares.has_orientation()),
        ]
    }
}

impl CartesianConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<CartesianTask, ConfigError> {
        let frame = context.frame("cartesian", self.frame.as_deref())?;
        let mut task = CartesianTask::new(context.model, frame).with(CartesianSettings {
            error: context.pose_error(),
            gain: self.gain,
            position_weight: self.position_weight,
            orientation_weight: self.orientation_weight,
            max_linear_speed: context.max_speed("max_linear_speed", self.max_linear_speed)?,
            max_angular_speed: context.max_speed("max_angular_speed", self.max_angular_speed)?,
            damping: context.damping(self.damping, CartesianSettings::default().damping)?,
            shares: self.axes.as_ref().map(|axes| axes.shares(context)).transpose()?,
        });
        if let Some(impedance) = &self.impedance {
            context.check_impedance(self.gain, CartesianSettings::default().gain)?;
            task = task.impedance(context.model, impedance.build(context)?);
        }
        Ok(task)
    }

    /// Returns the contact during whose lift the task is active.
    fn lifted(&self, context: &TaskContext<'_>) -> Result<Option<usize>, ConfigError> {
        self.while_lifted.as_ref().map(|name| context.contact("while_lifted", name)).transpose()
    }
}

impl TaskKind for CartesianConfig {
    /// The gain, or spring and damper, and the weights.
    fn parameters(&self) -> Vec<TaskParameter> {
        let mut parameters = self.live();
        if let Some(CartesianImpedanceConfig { stiffness, damping, .. }) = self.impedance {
            let springs = [
                TaskParameter::new("stiffness", stiffness, SPRINGS, "N/m", "stiffness towards the target"),
                TaskParameter::new("damping", damping, SPRINGS, "N s/m", "damping of the motion"),
            ];
            drop(parameters.splice(..1, springs));
        }
        parameters
    }

    fn check(&self, context: &TaskContext<'_>) -> Result<(), ConfigError> {
        self.lifted(context)?;
        self.build(context).map(drop)
    }

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let (task, input) = (self.build(context)?, setup.input(&self.target)?);
        let (pull, weights) = match &self.impedance {
            None => {
                let [gain, position, orientation] = self.open(setup)?;
                (Pull::Gain(gain), [position, orientation])
            }
            Some(impedance) => {
                let [stiffness, damping, position, orientation] = self.open(setup)?;
                let spring = impedance.build(context)?;
                (Pull::Spring { spring, stiffness, damping }, [position, orientation])
            }
        };
        // free directions cannot miss
        let [position, orientation] = task.settings().counts();
        let tolerance = GoalTolerance {
            position: if position { self.position_tolerance } else { f64::INFINITY },
            orientation: if orientation { self.orientation_tolerance } else { f64::INFINITY },
        };
        let target = TargetInput::new(input, tolerance);
        Ok(Box::new(HeldCartesian { task, target, pull, weights, lifted: self.lifted(context)? }))
    }
}

/// Feedback of an error.
enum Pull {
    /// Rate of decay of the error.
    Gain(Ramped),
    /// A spring and a damper, with parameters of the position.
    Spring { spring: CartesianImpedance, stiffness: Ramped, damping: Ramped },
}

/// A running Cartesian task that follows the poses of one input.
struct HeldCartesian {
    task: CartesianTask,
    target: TargetInput,
    pull: Pull,
    /// Weights of position and orientation.
    weights: [Ramped; 2],
    /// Contact during whose lift the task is active.
    lifted: Option<usize>,
}

impl HeldTask for HeldCartesian {
    fn begin(&mut self, start: &RobotState<'_>) {
        if !self.target.is_set() {
            self.task.set_target(start.kinematics.pose(start.model, self.task.frame()));
        }
    }

    fn reset(&mut self) {
        self.target.reset();
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let gain = match &mut self.pull {
            Pull::Gain(gain) => gain.follow(bounds, fades).min(bounds.max_gain),
            Pull::Spring { spring, stiffness, damping } => {
                spring.stiffness = stiffness.follow(bounds, fades);
                spring.damping = damping.follow(bounds, fades);
                self.task.set_impedance(*spring);
                self.task.settings().gain
            }
        };
        let [position_weight, orientation_weight] =
            self.weights.each_mut().map(|parameter| parameter.follow(bounds, fades));
        let settings = *self.task.settings();
        self.task.set_settings(CartesianSettings { gain, position_weight, orientation_weight, ..settings });
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        if let Some((pose, velocity)) = self.target.pose(bounds) {
            self.task.set_moving_target(pose, velocity, Twist::zero());
        }
    }

    fn cost(&mut self) -> TaskCost<'_> {
        TaskCost::Motion(&mut self.task)
    }

    fn while_lifted(&self) -> Option<usize> {
        self.lifted
    }

    fn record(&mut self, measured: &RobotState<'_>, dt: f64) {
        let pose = measured.kinematics.pose(measured.model, self.task.frame());
        let (target, settings) = (self.task.target(), self.task.settings());
        // free directions have no error
        let (position, orientation) = match &settings.shares {
            Some(shares) => {
                let (position, turn) = shares.error(&pose, target);
                (position.norm(), turn.norm())
            }
            None => {
                let position = target.translation.vector - pose.translation.vector;
                (position.norm(), pose.rotation.angle_to(&target.rotation))
            }
        };
        let [moved, turned] = settings.counts();
        let position = if moved { position } else { 0.0 };
        self.target.observe(GoalError { position, orientation: turned.then_some(orientation) }, dt);
    }

    fn goals(&self) -> Option<&GoalRecord> {
        Some(self.target.goals())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let (summary, latest) = (self.target.goals().summary(), self.target.goals().latest());
        let position = |error: GoalError| self.task.settings().counts()[0].then_some(error.position);
        Some(serde_json::json!({
            "goals_reached": summary.reached,
            "goals_missed": summary.missed,
            "position_error_m": summary.worst.and_then(position),
            "orientation_error_rad": summary.worst.and_then(|error| error.orientation),
            "last_position_error_m": latest.and_then(position),
            "last_orientation_error_rad": latest.and_then(|error| error.orientation),
            "targets_refused": self.target.refused(),
        }))
    }
}
