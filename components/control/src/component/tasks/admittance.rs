//! The admittance task of `control.qp`.

use motorium::prelude::*;
use motorium_robots::{FrameId, Twist};
use nalgebra::{Isometry3, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    Fades, GAINS, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS,
};
use crate::component::checks::pose_of;
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::tasks::{CartesianSettings, CartesianTask, VelocityTask};
use crate::{Admittance, AdmittanceSettings, RobotState};

/// Range of masses, dampings and stiffnesses.
const FIGURES: core::ops::RangeInclusive<f64> = 0.0..=1e6;

/// The least mass \[kg\] and moment of inertia \[kg m2\].
const LIGHTEST: f64 = 1e-3;

/// An admittance task: a frame yields to a measured wrench like a mass on a spring and a damper.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AdmittanceConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "admittance".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Link whose frame yields. Default: the robot's only end effector.
    pub frame: Option<String>,
    /// Link in whose frame the wrench is measured. Default: `frame`.
    pub sensor: Option<String>,
    /// Name of the input port of its target, the pose of the frame without a wrench. The input is optional:
    /// without a target it is the pose at the start. Default "target".
    pub target: String,
    /// Name of the input port of the wrench that the world exerts on the robot. Default "wrench".
    pub wrench: String,
    /// Mass, kg, 1e-3 to 1e6. Default 4.
    pub mass: f64,
    /// Damping, N s/m, 0 to 1e6. Default 40.
    pub damping: f64,
    /// Stiffness, N/m, 0 to 1e6; with 0 the frame stays where it was pushed. Default 100.
    pub stiffness: f64,
    /// Moment of inertia, kg m2, 1e-3 to 1e6. Default 0.1.
    pub inertia: f64,
    /// Rotational damping, N m s/rad, 0 to 1e6. Default 2.
    pub rotational_damping: f64,
    /// Rotational stiffness, N m/rad, 0 to 1e6. Default 10.
    pub rotational_stiffness: f64,
    /// Largest displacement, m, 0 to 10. Default 0.2.
    pub max_displacement: f64,
    /// Largest turn, rad, 0 to 3. Default 0.8.
    pub max_rotation: f64,
    /// Rate at which the frame approaches the displaced pose, 1/s, 0 to 1000; limited to half the tick rate.
    /// Default 20.
    pub gain: f64,
    /// Cost of a velocity error, 1/(m/s), 0 to 1000. Default 1.
    pub position_weight: f64,
    /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 0.5.
    pub orientation_weight: f64,
}

impl Default for AdmittanceConfig {
    fn default() -> Self {
        let (law, settings) = (AdmittanceSettings::default(), CartesianSettings::default());
        Self {
            name: "admittance".to_owned(),
            level: 1,
            frame: None,
            sensor: None,
            target: "target".to_owned(),
            wrench: "wrench".to_owned(),
            mass: law.mass,
            damping: law.damping,
            stiffness: law.stiffness,
            inertia: law.inertia,
            rotational_damping: law.rotational_damping,
            rotational_stiffness: law.rotational_stiffness,
            max_displacement: law.max_displacement,
            max_rotation: law.max_rotation,
            gain: 20.0,
            position_weight: settings.position_weight,
            orientation_weight: settings.orientation_weight,
        }
    }
}

impl AdmittanceConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<(CartesianTask, FrameId, Admittance), ConfigError> {
        let frame = place.frame("admittance", self.frame.as_deref())?;
        let sensor = match &self.sensor {
            None => frame,
            Some(name) => place
                .model
                .frame(name)
                .map_err(|error| ConfigError::key(place.key("sensor"), error.to_string()))?,
        };
        let figure = |name, value| place.in_range(name, value, FIGURES);
        let heavy = |name, value| place.in_range(name, value, LIGHTEST..=*FIGURES.end());
        let law = Admittance::new(AdmittanceSettings {
            mass: heavy("mass", self.mass)?,
            damping: figure("damping", self.damping)?,
            stiffness: figure("stiffness", self.stiffness)?,
            inertia: heavy("inertia", self.inertia)?,
            rotational_damping: figure("rotational_damping", self.rotational_damping)?,
            rotational_stiffness: figure("rotational_stiffness", self.rotational_stiffness)?,
            max_displacement: place.in_range("max_displacement", self.max_displacement, 0.0..=10.0)?,
            max_rotation: place.in_range("max_rotation", self.max_rotation, 0.0..=3.0)?,
        });
        let task = CartesianTask::new(place.model, frame).with(CartesianSettings {
            error: place.pose_error(),
            gain: place.in_range("gain", self.gain, GAINS)?,
            position_weight: place.in_range("position_weight", self.position_weight, WEIGHTS)?,
            orientation_weight: place.in_range("orientation_weight", self.orientation_weight, WEIGHTS)?,
            damping: place.damping(None, CartesianSettings::default().damping)?,
            ..CartesianSettings::default()
        });
        Ok((task, sensor, law))
    }
}

impl TaskKind for AdmittanceConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).target(&self.target).wrench(&self.wrench)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        let heavy = LIGHTEST..=*FIGURES.end();
        vec![
            TaskParameter::new("gain", self.gain, GAINS, "1/s", "rate at which the frame follows"),
            TaskParameter::new("mass", self.mass, heavy, "kg", "mass that the frame seems to have"),
            TaskParameter::new("damping", self.damping, FIGURES, "N s/m", "damping of its motion"),
            TaskParameter::new("stiffness", self.stiffness, FIGURES, "N/m", "stiffness towards the target"),
        ]
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        let doc = "pose and velocity of the frame without a wrench, in the world frame";
        declare.optional_input::<PoseTarget>(&self.target, doc);
        let doc =
            "wrench that the world exerts on the robot, at the origin and in the axes of the sensor's frame";
        declare.input::<Wrench>(&self.wrench, doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let (task, sensor, law) = self.build(place)?;
        let (target, wrench) = (setup.input(&self.target)?, setup.input(&self.wrench)?);
        let [gain, mass, damping, stiffness] = self.open(setup)?;
        Ok(Box::new(HeldAdmittance {
            task,
            law,
            sensor,
            target,
            wrench,
            gain,
            mass,
            damping,
            stiffness,
            goal: Isometry3::identity(),
            goal_velocity: Twist::zero(),
            targeted: false,
            origin: Vector3::zeros(),
            sensed: Isometry3::identity(),
            largest: 0.0,
            silent: 0,
        }))
    }
}

/// A frame that yields to the wrenches of one input.
struct HeldAdmittance {
    task: CartesianTask,
    law: Admittance,
    sensor: FrameId,
    target: Input<PoseTarget>,
    wrench: Input<Wrench>,
    gain: Ramped,
    mass: Ramped,
    damping: Ramped,
    stiffness: Ramped,
    /// The target without a wrench, and its velocity.
    goal: Isometry3<f64>,
    goal_velocity: Twist,
    /// True since the first target.
    targeted: bool,
    /// Origin of the frame, and pose of the sensor, as last measured.
    origin: Vector3<f64>,
    sensed: Isometry3<f64>,
    /// Largest displacement so far, m.
    largest: f64,
    /// Steps without a fresh wrench.
    silent: u64,
}

impl HeldAdmittance {
    fn measure(&mut self, state: &RobotState<'_>) {
        self.origin = state.kinematics.pose(state.model, self.task.frame()).translation.vector;
        self.sensed = state.kinematics.pose(state.model, self.sensor);
    }

    /// The newest force and torque, in world axes about the origin of the frame; zero if the sensor is
    /// silent.
    fn push(&mut self, timeout_ns: u64) -> (Vector3<f64>, Vector3<f64>) {
        let reading = self.wrench.latest().filter(|reading| reading.age_ns() <= timeout_ns);
        let Some(reading) = reading else {
            self.silent += 1;
            return (Vector3::zeros(), Vector3::zeros());
        };
        let force = self.sensed.rotation * Vector3::from(reading.force);
        let torque = self.sensed.rotation * Vector3::from(reading.torque);
        (force, torque + (self.sensed.translation.vector - self.origin).cross(&force))
    }
}

impl HeldTask for HeldAdmittance {
    fn begin(&mut self, start: &RobotState<'_>) {
        self.measure(start);
        self.law.reset();
        if !self.targeted {
            let pose = start.kinematics.pose(start.model, self.task.frame());
            (self.goal, self.goal_velocity) = (pose, Twist::zero());
        }
    }

    fn reset(&mut self) {
        (self.targeted, self.largest, self.silent) = (false, 0.0, 0);
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let gain = self.gain.follow(bounds, fades).min(bounds.max_gain);
        self.task.set_settings(CartesianSettings { gain, ..*self.task.settings() });
        self.law.set_settings(AdmittanceSettings {
            mass: self.mass.follow(bounds, fades),
            damping: self.damping.follow(bounds, fades),
            stiffness: self.stiffness.follow(bounds, fades),
            ..*self.law.settings()
        });
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        if let Some(reading) = self.target.latest() {
            // an invalid target pose is ignored
            if let Some(goal) = pose_of(reading.position, reading.orientation) {
                let fresh = reading.age_ns() <= bounds.target_timeout_ns;
                let moving = Twist {
                    linear: Vector3::from(reading.linear_velocity),
                    angular: Vector3::from(reading.angular_velocity),
                };
                self.goal_velocity = if fresh { moving } else { Twist::zero() };
                self.goal = goal;
                self.targeted = true;
            }
        }
        let (force, torque) = self.push(bounds.target_timeout_ns);
        self.law.step(&force, &torque, bounds.dt);
        let (pose, velocity, acceleration) = self.law.displace(&self.goal, &self.goal_velocity);
        self.task.set_moving_target(pose, velocity, acceleration);
        self.largest = self.largest.max(self.law.displacement().norm());
    }

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        Some(&mut self.task)
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }

    fn record(&mut self, measured: &RobotState<'_>, _: f64) {
        self.measure(measured);
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({
            "largest_displacement_m": self.largest,
            "last_displacement_m": self.law.displacement().as_slice(),
            "last_position_error_m": (self.task.target().translation.vector - self.origin).norm(),
            "steps_without_wrench": self.silent,
        }))
    }
}
