//! A Cartesian task, fed by a topic.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::Declare;
use motorium::state::PoseTarget;
use motorium::transport::{Input, Parameter};
use motorium_robots::{Kinematics, Model, Twist};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::assembly::{Cartesian, GAINS, WEIGHTS};
use super::goals::{GoalRecord, PoseError};
use crate::tasks::{CartesianSettings, CartesianTask};

/// A frame that follows the poses of one input.
pub(super) struct Reach {
    pub(super) name: String,
    pub(super) task: CartesianTask,
    pub(super) goals: GoalRecord,
    input: Input<PoseTarget>,
    current: Option<PoseTarget>,
    gain: Parameter<f64>,
    position_weight: Parameter<f64>,
    orientation_weight: Parameter<f64>,
    refused: u64,
}

impl Reach {
    pub(super) fn declare(cartesian: &Cartesian, declare: &mut Declare) {
        let Cartesian { name, port, task } = cartesian;
        let settings = task.settings();
        declare.input::<PoseTarget>(
            port,
            "where the frame should be and how it should move, in the world frame",
        );
        declare.float(&format!("{name}_gain"), settings.gain, GAINS, "1/s", "rate at which the error decays");
        declare.float(
            &format!("{name}_position_weight"),
            settings.position_weight,
            WEIGHTS,
            "1/(m/s)",
            "cost of a velocity error",
        );
        declare.float(
            &format!("{name}_orientation_weight"),
            settings.orientation_weight,
            WEIGHTS,
            "1/(rad/s)",
            "cost of an angular velocity error",
        );
    }

    pub(super) fn new(cartesian: Cartesian, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let Cartesian { name, port, task } = cartesian;
        Ok(Self {
            input: setup.input(&port)?,
            gain: setup.parameter(&format!("{name}_gain"))?,
            position_weight: setup.parameter(&format!("{name}_position_weight"))?,
            orientation_weight: setup.parameter(&format!("{name}_orientation_weight"))?,
            name,
            task,
            goals: GoalRecord::default(),
            current: None,
            refused: 0,
        })
    }

    /// Stays at `pose` until there is a target.
    pub(super) fn stay(&mut self, pose: Isometry3<f64>) {
        if self.current.is_none() {
            self.task.set_target(pose);
        }
    }

    /// Takes over parameters and the newest target; one older than `timeout_ns` no longer moves.
    pub(super) fn prepare(&mut self, max_gain: f64, timeout_ns: u64) {
        self.task.set_settings(CartesianSettings {
            gain: self.gain.get().min(max_gain),
            position_weight: self.position_weight.get(),
            orientation_weight: self.orientation_weight.get(),
            ..*self.task.settings()
        });
        let Some(reading) = self.input.latest() else { return };
        let (target, fresh) = (*reading, reading.age_ns() <= timeout_ns);
        let [x, y, z, w] = target.orientation;
        // half the length of a unit quaternion is no rounding error: such a target is not followed
        let Some(rotation) = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.5) else {
            self.refused += 1;
            return;
        };
        let velocity = Twist {
            linear: Vector3::from(target.linear_velocity),
            angular: Vector3::from(target.angular_velocity),
        };
        let pose = Isometry3::from_parts(Translation3::from(target.position), rotation);
        self.task.set_moving_target(pose, if fresh { velocity } else { Twist::zero() });
        self.current = Some(target);
    }

    /// Records how far the measured frame is from its target.
    pub(super) fn judge(&mut self, model: &Model, measured: &Kinematics, dt: f64) {
        let Some(target) = &self.current else { return };
        let pose = measured.pose(model, self.task.frame());
        let error = PoseError {
            position: (self.task.target().translation.vector - pose.translation.vector).norm(),
            orientation: pose.rotation.angle_to(&self.task.target().rotation),
        };
        self.goals.observe(target, error, dt);
    }

    /// What there is to say about the run.
    pub(super) fn result(&self) -> serde_json::Value {
        let (reached, worst) = self.goals.summary();
        let latest = self.goals.latest();
        serde_json::json!({
            "goals_reached": reached,
            "position_error_m": worst.map(|error| error.position),
            "orientation_error_rad": worst.map(|error| error.orientation),
            "last_position_error_m": latest.map(|error| error.position),
            "last_orientation_error_rad": latest.map(|error| error.orientation),
            "targets_refused": self.refused,
        })
    }
}
