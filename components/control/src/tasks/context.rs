//! Build context of a task: the robot and the checks of its table.

use core::ops::RangeInclusive;

use motorium::prelude::*;
use motorium_robots::{EndEffectorError, FrameId, Model, Profile};
use motorium_worlds::World;
use nalgebra::{Unit, Vector3};

use super::PoseError;
use super::velocities::RATE;
use crate::checks;
use crate::contact::Contact;

/// Range of every gain, 1/s.
pub(super) const GAINS: RangeInclusive<f64> = 0.0..=1000.0;
/// Range of every weight.
pub(super) const WEIGHTS: RangeInclusive<f64> = 0.0..=1000.0;

/// The robot that a task controls, and the path of its table in the configuration.
pub(crate) struct TaskContext<'a> {
    pub(crate) model: &'a Model,
    pub(crate) profile: Option<&'a Profile>,
    /// Time between two steps, s; 0 while a graph is checked.
    pub(crate) period: f64,
    /// `true` if the controller computes torques.
    pub(crate) torque: bool,
    /// Acceleration of free fall, m/s2.
    pub(crate) gravity: Vector3<f64>,
    /// Ground and objects around the robot.
    pub(crate) world: &'a World,
    /// Contacts of inverse dynamics; empty for a velocity controller.
    pub(crate) contacts: &'a [Contact],
    /// Joints of the wheels that move a floating base, which another component commands.
    pub(crate) wheels: &'a [usize],
    /// `true` if the task holds exactly, above all levels.
    pub(crate) is_constraint: bool,
    /// Path of the table of the task in the configuration, such as `tasks[0].cartesian`.
    pub(crate) path: String,
}

impl TaskContext<'_> {
    /// Returns the frame named by the key `name`.
    pub(super) fn named_frame(&self, name: &str, link: &str) -> Result<FrameId, ConfigError> {
        if link.is_empty() {
            return Err(ConfigError::key(self.key(name), "it is missing").advise("name a link of the robot"));
        }
        self.model.frame(link).map_err(|error| ConfigError::key(self.key(name), error.to_string()))
    }

    /// Returns the contact named by the key `name`.
    pub(super) fn contact(&self, name: &str, contact: &str) -> Result<usize, ConfigError> {
        self.contacts.iter().position(|other| other.name == contact).ok_or_else(|| {
            let names: Vec<_> = self.contacts.iter().map(|contact| contact.name.as_str()).collect();
            let message = format!("there is no contact `{contact}`");
            ConfigError::key(self.key(name), message).advise(match names.is_empty() {
                true => "add `contacts` to `inverse_dynamics`".to_owned(),
                false => format!("the contacts are {}", names.join(", ")),
            })
        })
    }

    /// Parses the direction in the key `name`.
    pub(super) fn axis(&self, name: &str, axis: [f64; 3]) -> Result<Unit<Vector3<f64>>, ConfigError> {
        Unit::try_new(Vector3::from(axis), 1e-9)
            .filter(|axis| axis.iter().all(|number| number.is_finite()))
            .ok_or_else(|| {
                ConfigError::key(self.key(name), format!("{axis:?} has no direction"))
                    .advise("give an axis, such as [0, 0, 1]")
            })
    }

    /// Path of the key `name` of the task.
    pub(crate) fn key(&self, name: &str) -> String {
        format!("{}.{name}", self.path)
    }

    /// Returns the controlled frame: the named one, or the robot's only end effector.
    pub(super) fn frame(&self, kind: &str, named: Option<&str>) -> Result<FrameId, ConfigError> {
        self.model.end_effector(self.profile, named).map_err(|error| match error {
            EndEffectorError::UnknownFrame(unknown) => ConfigError::key(self.key("frame"), unknown.to_string()),
            error => ConfigError::new(error.to_string()).advise(format!(
                "name the link to control: tasks = [{{ {kind} = {{ frame = \"{}\" }} }}, {{ posture = {{}} }}]",
                error.example().unwrap_or_default()
            )),
        })
    }

    /// Returns the value of the key `name` if it is within `range`.
    pub(super) fn in_range(
        &self,
        name: &str,
        value: f64,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ConfigError> {
        checks::in_range(&self.key(name), value, range)
    }

    /// Returns the decay rate of a velocity error for a torque controller, 1/s: the given one, or 20, limited
    /// to half the tick rate.
    pub(super) fn rate(&self, given: Option<f64>) -> Result<f64, ConfigError> {
        if given.is_some() && !self.torque {
            return Err(ConfigError::key(self.key("rate"), "it has no effect without `inverse_dynamics`")
                .advise("leave it out: velocities are commanded immediately"));
        }
        let rate = self.in_range("rate", given.unwrap_or(RATE), GAINS)?;
        Ok(if self.period > 0.0 { rate.min(0.5 / self.period) } else { rate })
    }

    /// Returns the form of pose errors: velocity control moves frames along screws, torque control along
    /// straight lines.
    pub(super) fn pose_error(&self) -> PoseError {
        if self.torque { PoseError::Geometric } else { PoseError::Logarithm }
    }

    /// Maximum speed of a correction; infinite if not given.
    pub(super) fn max_speed(&self, name: &str, speed: Option<f64>) -> Result<f64, ConfigError> {
        speed.map_or(Ok(f64::INFINITY), |speed| self.in_range(name, speed, 1e-6..=f64::MAX))
    }

    /// Levenberg-Marquardt damping, s m/rad^2: the given value, or `usual`, or two tick periods times one
    /// metre if that is larger.
    pub(super) fn damping(&self, given: Option<f64>, usual: f64) -> Result<f64, ConfigError> {
        given.map_or(Ok(usual.max(2.0 * self.period)), |damping| {
            self.in_range("damping", damping, 0.0..=f64::MAX)
        })
    }

    /// Checks that an impedance can replace the gain of a task, which must then have its default.
    pub(super) fn check_impedance(&self, gain: f64, default: f64) -> Result<(), ConfigError> {
        if !self.torque {
            return Err(ConfigError::key(
                self.key("impedance"),
                "it requires `inverse_dynamics`, which computes forces",
            )
            .advise("add `inverse_dynamics = {}`, or use `gain`"));
        }
        if gain != default {
            return Err(ConfigError::key(
                self.key("gain"),
                "it is given together with `impedance`, which replaces it",
            )
            .advise("keep one of the two"));
        }
        Ok(())
    }
}
