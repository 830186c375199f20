//! Makes the capture point follow a point, by accelerating the centre of mass.

use motorium::prelude::*;
use motorium_robots::Model;
use nalgebra::{Matrix3xX, Vector2, Vector3};

use super::Cost;
use super::context::TaskContext;
use super::held::{HeldTask, TaskCost};
use super::kind::{BuiltTask, Formulations, GAINS, TaskHead, TaskKind, TaskTable, WEIGHTS};
use super::ramp::{Fades, Ramped, TaskBounds};
use super::target::TargetInput;
use crate::inverse_dynamics::{AccelerationTask, InverseDynamics};
use crate::{GoalTolerance, MotionState, RobotState};

/// Minimum height of the centre of mass above the contacts \[m\]; lower heights are raised to this minimum.
const LOWEST: f64 = 0.05;

/// Moves the capture point `k`, where the robot would have to step to come to rest, to a point `k*` on the
/// ground \[m, world axes\]:
///
/// ```text
/// h = height of the centre of mass above the active contacts (their mean)   m
/// o = sqrt(|g| / h)                                                         1/s
/// k = c + c' / o                                                            x and y of centre of mass
/// A = J_com                                                                 rows x and y, on accelerations
/// b = o (k*' + gain (k* - k) - c') - J_com' v                               so that k' = k*' + gain (k* - k)
/// W = weight                                                                1/(m/s2)
/// ```
///
/// for a slowly changing height (Pratt, Carff, Drakunov and Goswami, *Capture point: a step toward humanoid
/// push recovery*, 2006; Englsberger, Ott and Albu-Schäffer, *Three-dimensional bipedal walking control based
/// on divergent component of motion*, 2015). The capture point converges to its target at the rate `gain`,
/// and the centre of mass follows the capture point at the rate `o`, so no velocity has to be specified. The
/// zero-moment point `k + gain / o (k - k*)` must be within the support. The task is inactive without an
/// active contact.
///
/// ```
/// use motorium_control::{inverse_dynamics::{Contact, InverseDynamics, MotionState}, tasks::CapturePoint};
/// use motorium_robots::{Kinematics, load};
///
/// let robot = load("humanoid", std::path::Path::new("."))?;
/// let (model, profile) = (&robot.model, robot.profile.as_ref().expect("a catalogue robot has a profile"));
/// let (q, v) = (profile.configuration(model, "standing")?, vec![0.0; model.nv()]);
/// let mut kinematics = Kinematics::new(model);
/// kinematics.update_with_velocity(model, q.as_slice(), &v);
/// let state = MotionState { model, kinematics: &kinematics, q: q.as_slice(), v: &v };
/// let contacts = profile.feet.iter().map(|(name, foot)| Contact::of_foot(model, name, foot)).collect::<Result<Vec<_>, _>>()?;
/// let mut control = InverseDynamics::new(model, contacts);
/// let mut balance = CapturePoint::new(model, 3.0);
/// balance.set_target(kinematics.centre_of_mass(model).position.xy());
/// control.begin(&state, 0.001);
/// control.add_task(&state, 0, &mut balance);
/// assert!(balance.error().norm() < 1e-12, "at rest it is below the centre of mass");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CapturePoint {
    gain: f64,
    weight: f64,
    target: Vector2<f64>,
    velocity: Vector2<f64>,
    point: Vector2<f64>,
    rate: f64,
    jacobian: Matrix3xX<f64>,
    cost: Cost,
}

methods!(CapturePoint: weight("1/(m/s2)"), set);

impl CapturePoint {
    /// Creates a task for `model` with a gain \[1/s\], the world's origin as target, and a weight of 1
    /// \[1/(m/s2)\].
    pub fn new(model: &Model, gain: f64) -> Self {
        Self {
            gain,
            weight: 1.0,
            target: Vector2::zeros(),
            velocity: Vector2::zeros(),
            point: Vector2::zeros(),
            rate: 0.0,
            jacobian: Matrix3xX::zeros(model.nv()),
            cost: Cost::dense(2, 0, model.nv()),
        }
    }

    /// Sets a resting target `k*` \[m, world axes\].
    pub fn set_target(&mut self, target: Vector2<f64>) {
        self.set_moving_target(target, Vector2::zeros());
    }

    /// Sets a moving target: its position `k*` \[m\] and velocity \[m/s\], in world axes.
    pub fn set_moving_target(&mut self, target: Vector2<f64>, velocity: Vector2<f64>) {
        (self.target, self.velocity) = (target, velocity);
    }

    /// Returns the capture point `k` at the last update \[m, world axes\].
    pub fn point(&self) -> &Vector2<f64> {
        &self.point
    }

    /// Returns the natural frequency `o` at the last update \[1/s\]; 0 without an active contact.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Returns the error `k* - k` at the last update \[m, world axes\].
    pub fn error(&self) -> Vector2<f64> {
        self.target - self.point
    }
}

impl AccelerationTask for CapturePoint {
    fn update(&mut self, state: &MotionState<'_>, dynamics: &InverseDynamics) {
        let moving = state.kinematics.centre_of_mass(state.model);
        let heights = dynamics.contacts.iter().filter(|place| place.active).map(|place| {
            let frame = state.kinematics.pose(state.model, place.contact.frame).translation.vector;
            (frame + place.arms.iter().sum::<Vector3<f64>>() / place.arms.len() as f64).z
        });
        let (sum, count) = heights.fold((0.0, 0.0), |(sum, count), height| (sum + height, count + 1.0));
        let gravity = dynamics.settings.gravity.norm();
        if count == 0.0 || gravity == 0.0 {
            (self.point, self.rate) = (moving.position.xy(), 0.0);
            self.cost.weights_mut().fill(0.0);
            return;
        }
        let height = (moving.position.z - sum / count).max(LOWEST);
        self.rate = (gravity / height).sqrt();
        let velocity = moving.velocity.xy();
        self.point = moving.position.xy() + velocity / self.rate;
        let desired = (self.velocity + self.error() * self.gain - velocity) * self.rate;
        self.cost.desired_mut().copy_from(&(desired - moving.acceleration.xy()));
        self.cost.weights_mut().fill(self.weight);
        state.kinematics.com_jacobian(state.model, &mut self.jacobian);
        self.cost.matrix_mut().copy_from(&self.jacobian.fixed_rows::<2>(0));
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}

task_config! {
    /// A capture-point task: the point where the robot would have to step to come to rest follows a target on
    /// the ground.
    CapturePointConfig "capture_point" {
        /// Name of the input port of the target; only x and y of its position and linear velocity are used.
        /// The input is optional: without a target, the capture point stays below the initial centre of mass.
        /// Default "capture_point_target".
        target: String = "capture_point_target".to_owned() => target(
            optional PoseTarget,
            "position and linear velocity of the capture point on the ground, in the world frame"
        );
        /// Rate at which the error decays, 1/s, 0 to 1000; limited to half the tick rate. Default 3.
        gain: f64 = 3.0 => live(GAINS, "1/s", "rate at which the error decays");
        /// Cost of an acceleration error of the centre of mass, 1/(m/s2), 0 to 1000. Default 1.
        weight: f64 = 1.0 => live(
            WEIGHTS, "1/(m/s2)", "cost of an acceleration error of the centre of mass"
        );
    }
}

impl TaskKind for CapturePointConfig {
    fn head(&self) -> TaskHead<'_> {
        self.table_head().only(Formulations::Torque)
    }

    fn check(&self, _: &TaskContext<'_>) -> Result<(), ConfigError> {
        Ok(())
    }

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        Ok(Box::new(HeldCapturePoint {
            task: CapturePoint::new(context.model, self.gain),
            target: TargetInput::new(setup.input(&self.target)?, GoalTolerance::default()),
            parameters: self.open(setup)?,
            largest: 0.0,
        }))
    }
}

/// A running capture-point task that follows the positions of one input.
struct HeldCapturePoint {
    task: CapturePoint,
    target: TargetInput,
    /// Gain and weight.
    parameters: [Ramped; 2],
    /// Largest distance from the target so far, m.
    largest: f64,
}

impl HeldTask for HeldCapturePoint {
    fn begin(&mut self, start: &RobotState<'_>) {
        if !self.target.is_set() {
            self.task.set_target(start.kinematics.centre_of_mass(start.model).position.xy());
        }
    }

    fn reset(&mut self) {
        self.target.reset();
        self.largest = 0.0;
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let [gain, weight] = self.parameters.each_mut().map(|parameter| parameter.follow(bounds, fades));
        self.task.set(gain.min(bounds.max_gain), weight);
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        if let Some((point, velocity)) = self.target.point(bounds) {
            self.task.set_moving_target(point.xy(), velocity.xy());
        }
    }

    fn cost(&mut self) -> TaskCost<'_> {
        TaskCost::Forces(&mut self.task)
    }

    fn record(&mut self, _: &RobotState<'_>, _: f64) {
        self.largest = self.largest.max(self.task.error().norm());
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({
            "largest_error_m": self.largest,
            "last_error_m": self.task.error().norm(),
            "last_point": self.task.point().as_slice(),
        }))
    }
}
