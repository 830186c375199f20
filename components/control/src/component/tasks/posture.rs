//! The posture task of `control.qp`.

use motorium::prelude::*;
use motorium_robots::PerJoint;
use nalgebra::DVector;
use schemars::JsonSchema;
use serde::Deserialize;

use super::impedance::{Gain, JointImpedanceConfig};
use super::{
    ActsOn, Fades, GAINS, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS,
};
use crate::RobotState;
use crate::component::checks::per_joint;
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::tasks::{PostureSettings, PostureTask, VelocityTask};

/// A posture task: the joints keep a posture.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PostureConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "posture".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// A pose of the robot's profile. Default: its home pose, or the first measured pose if it has no
    /// profile.
    pub pose: Option<String>,
    /// The posture itself, rad or m: one number for all joints, or one for each. This or `pose`.
    pub positions: Option<PerJoint>,
    /// Rate at which the error decays, 1/s, 0 to 1000; at most half the tick rate is used. Default 1.
    pub gain: f64,
    /// Springs and dampers replacing the gain. Default: none.
    pub impedance: Option<JointImpedanceConfig>,
    /// Cost of a joint velocity error, 1/(rad/s) or 1/(m/s), 0 to 1000. Default 1e-3.
    pub weight: f64,
}

impl Default for PostureConfig {
    fn default() -> Self {
        let PostureSettings { gain, weight } = PostureSettings::default();
        Self {
            name: "posture".to_owned(),
            level: 1,
            pose: None,
            positions: None,
            gain,
            impedance: None,
            weight,
        }
    }
}

impl PostureConfig {
    /// Builds the task; also returns `true` if the posture comes from the first joint state.
    fn build(&self, place: &TaskPlace<'_>) -> Result<(PostureTask, bool), ConfigError> {
        let TaskPlace { model, profile, .. } = *place;
        let refused =
            |error: motorium_robots::ProfileError| ConfigError::key(place.key("pose"), error.to_string());
        let (target, from_start) = match (&self.pose, &self.positions, profile) {
            (Some(_), Some(_), _) => {
                let message = "both `pose` and `positions` are given";
                return Err(ConfigError::key(place.key("positions"), message).advise("keep one of them"));
            }
            (Some(_), None, None) => {
                let message = format!("robot `{}` has no profile, so its poses have no names", model.name());
                return Err(ConfigError::key(place.key("pose"), message)
                    .advise("give `positions`, or put a profile next to the URDF"));
            }
            (Some(name), None, Some(profile)) => (profile.pose(model, name).map_err(refused)?, false),
            (None, Some(positions), _) => (per_joint(&place.key("positions"), positions, model)?, false),
            (None, None, Some(profile)) => (profile.home(model).map_err(refused)?, false),
            (None, None, None) => (DVector::zeros(model.joint_count()), true),
        };
        let settings = PostureSettings {
            gain: place.in_range("gain", self.gain, GAINS)?,
            weight: place.in_range("weight", self.weight, WEIGHTS)?,
        };
        Ok((PostureTask::new(model, target.as_slice()).with(settings), from_start))
    }
}

impl PostureConfig {
    /// Stiffness and damping of each joint, if it has springs.
    fn springs(&self, place: &TaskPlace<'_>) -> Result<Option<[Vec<f64>; 2]>, ConfigError> {
        let gain = || Gain { given: self.gain, default: PostureSettings::default().gain };
        self.impedance.as_ref().map(|impedance| impedance.build(place, gain())).transpose()
    }
}

impl TaskKind for PostureConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).acts_on(ActsOn::Joints)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        let weight =
            TaskParameter::new("weight", self.weight, WEIGHTS, "1/(rad/s)", "cost of a joint velocity error");
        match self.impedance {
            None => vec![TaskParameter::gain(self.gain), weight],
            Some(_) => vec![weight],
        }
    }

    fn declare(&self, place: &TaskPlace<'_>, _: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        self.springs(place)?;
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let (task, from_start) = self.build(place)?;
        let takes_start = from_start;
        let (task, gain, weight) = match self.springs(place)? {
            None => {
                let [gain, weight] = self.open(setup)?;
                (task, Some(gain), weight)
            }
            Some([stiffness, damping]) => {
                let [weight] = self.open(setup)?;
                (task.impedance(place.model, &stiffness, &damping), None, weight)
            }
        };
        Ok(Box::new(Posture { task, takes_start, from_start, gain, weight }))
    }
}

/// A task that keeps the joints at a posture.
struct Posture {
    task: PostureTask,
    /// `true` if the posture is defined by the first joint state.
    takes_start: bool,
    /// `true` until the posture has been set from the first joint state.
    from_start: bool,
    /// None with springs.
    gain: Option<Ramped>,
    weight: Ramped,
}

impl HeldTask for Posture {
    fn begin(&mut self, start: &RobotState<'_>) {
        if self.from_start {
            self.task.set_target(start.model.joints_of_q(start.q));
            self.from_start = false;
        }
    }

    fn reset(&mut self) {
        self.from_start = self.takes_start;
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let gain = self.gain.as_mut().map(|gain| gain.follow(bounds, fades).min(bounds.max_gain));
        let gain = gain.unwrap_or(self.task.settings().gain);
        let weight = self.weight.follow(bounds, fades);
        self.task.set_settings(PostureSettings { gain, weight });
    }

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        Some(&mut self.task)
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }
}
