//! Joint command writer: extends the setpoints of some joints to a command of all joints.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium::state::{JointCommand, JointState};
use motorium::transport::{Input, Output, Parameter};
use motorium::units::TimeSpan;
use motorium_robots::{Dynamics, Gains, Loaded, Model, PerJoint, Profile, ProfileError};
use nalgebra::{DVector, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use motorium_primitives::dmp::{Jet, Quintic};

/// Gains, easing and feed-forward of joint commands.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct JointCommandConfig {
    /// Stiffness, N m/rad or N/m: one number for all joints, or one for each. Default: the stiffness of the
    /// robot's profile.
    pub kp: Option<PerJoint>,
    /// Damping, N m s/rad or N s/m: one number for all joints, or one for each. Default: the damping of the
    /// robot's profile.
    pub kd: Option<PerJoint>,
    /// Duration of the transition from the robot's current position to the movement, such as "1 s". Default 1
    /// s.
    pub ease: TimeSpan,
    /// True to add the torque that compensates gravity. A floating base is assumed to be upright and at rest.
    /// Default true.
    pub gravity_compensation: bool,
}

impl Default for JointCommandConfig {
    fn default() -> Self {
        Self { kp: None, kd: None, ease: TimeSpan { ns: 1_000_000_000 }, gravity_compensation: true }
    }
}

/// Returns the gravity of a graph that specifies none, in the world frame, m/s^2.
pub(crate) fn earth() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

/// Names of the ports through which a robot's joints are read and commanded.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointPorts {
    state: String,
    command: String,
}

impl JointPorts {
    /// Returns the ports of a component for a single robot.
    pub(crate) fn single() -> Self {
        Self { state: "joint_state".to_string(), command: "joint_command".to_string() }
    }

    /// Returns the ports of one of several robots.
    pub(crate) fn for_robot(name: &str) -> Self {
        Self { state: format!("state_{name}"), command: format!("command_{name}") }
    }

    /// Declares the ports.
    pub(crate) fn declare(&self, declare: &mut Declare) {
        declare.input::<JointState>(&self.state, "measured joint state of the robot");
        declare
            .output::<JointCommand>(&self.command, "setpoints, feed-forward efforts and gains of all joints");
    }
}

/// The robot model of a component, its gains and the joints that a policy moves.
#[derive(Debug)]
pub(crate) struct CommandedJoints {
    pub(crate) model: Model,
    gains: Gains,
    gravity: Vector3<f64>,
    joints: Vec<usize>,
    /// Joints without a drive.
    passive: Vec<usize>,
}

/// The gains required by a command are unavailable.
#[derive(Debug, thiserror::Error)]
pub(crate) enum GainsError {
    /// The robot has no profile, or a profile without gains.
    #[error("robot `{robot}` has no profile with gains")]
    Missing {
        /// Name of the robot in the graph.
        robot: String,
    },
    /// The profile does not match the robot.
    #[error(transparent)]
    Profile(ProfileError),
}

/// Returns the gains of a robot's profile, in the order of its joints.
pub(crate) fn profile_gains(
    robot: &str,
    model: &Model,
    profile: Option<&Profile>,
) -> Result<Gains, GainsError> {
    let missing = || GainsError::Missing { robot: robot.to_owned() };
    profile.ok_or_else(missing)?.gains(model).map_err(|error| match error {
        ProfileError::NoGains => missing(),
        other => GainsError::Profile(other),
    })
}

/// Returns the gains configured in `joint_command`, or else the profile's.
fn configured_gains(
    config: &JointCommandConfig,
    robot: &str,
    model: &Model,
    profile: Option<&Profile>,
) -> Result<Gains, ConfigError> {
    let usual = match (&config.kp, &config.kd) {
        (Some(_), Some(_)) => None,
        _ => Some(profile_gains(robot, model, profile).map_err(|error| match error {
            GainsError::Missing { .. } => ConfigError::new(error.to_string()).advise(
                "give `joint_command.kp` and `joint_command.kd`, one number for all joints or one for each",
            ),
            GainsError::Profile(error) => ConfigError::new(error.to_string()),
        })?),
    };
    let arrange = |given: &Option<PerJoint>, key: &str, usual: Option<&DVector<f64>>| match (given, usual) {
        (Some(given), _) => {
            let values = given.resolve(model.joint_count()).map_err(|error| {
                let names = model.joint_names().join(", ");
                ConfigError::key(key, error.to_string()).advise(format!("in this order: {names}"))
            })?;
            match values.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
                Some(value) => Err(ConfigError::key(
                    key,
                    format!("a gain of {value}, expected a finite number of at least 0"),
                )),
                None => Ok(DVector::from_vec(values)),
            }
        }
        (None, Some(usual)) => Ok(usual.clone()),
        (None, None) => Ok(DVector::zeros(model.joint_count())),
    };
    Ok(Gains {
        kp: arrange(&config.kp, "joint_command.kp", usual.as_ref().map(|gains| &gains.kp))?,
        kd: arrange(&config.kd, "joint_command.kd", usual.as_ref().map(|gains| &gains.kd))?,
    })
}

/// Returns the robot of a component that requires one.
pub(crate) fn required(robot: Option<&RobotReference>) -> Result<&RobotReference, ConfigError> {
    robot.ok_or_else(|| {
        ConfigError::new("the component names no robot, and needs its joints")
            .advise("add `robot = \"NAME\"` to the component")
    })
}

impl CommandedJoints {
    /// Checks everything that can be checked before a run. `joints` are names; `key` is their key in the
    /// config. `gravity` is in the world frame, m/s^2.
    pub(crate) fn new<'a>(
        config: &JointCommandConfig,
        gravity: [f64; 3],
        robot: Option<&RobotReference>,
        joints: impl Iterator<Item = (&'a str, String)>,
    ) -> Result<Self, ConfigError> {
        let robot = required(robot)?;
        Self::with_gains(crate::robot::load(robot)?, &robot.name, gravity, joints, |model, profile| {
            configured_gains(config, &robot.name, model, profile)
        })
    }

    /// Like [`new`](Self::new) for a loaded robot, with the gains that `gains` returns for all its joints.
    pub(crate) fn with_gains<'a>(
        loaded: Loaded,
        robot: &str,
        gravity: [f64; 3],
        joints: impl Iterator<Item = (&'a str, String)>,
        gains: impl FnOnce(&Model, Option<&Profile>) -> Result<Gains, ConfigError>,
    ) -> Result<Self, ConfigError> {
        if let Some(number) = gravity.iter().find(|number| !(-1000.0..=1000.0).contains(*number)) {
            return Err(ConfigError::key("gravity", format!("{number}, expected from -1000 to 1000 m/s2")));
        }
        let model = loaded.model;
        let mut found = Vec::new();
        for (name, key) in joints {
            let index = model.joint_index(name).ok_or_else(|| {
                let names = model.joint_names().join(", ");
                ConfigError::key(&key, format!("robot `{robot}` has no joint \"{name}\""))
                    .advise(format!("its joints are {names}"))
            })?;
            if found.contains(&index) {
                return Err(ConfigError::key(key, format!("joint \"{name}\" is named twice")));
            }
            found.push(index);
        }
        let gains = gains(&model, loaded.profile.as_ref())?;
        let passive = loaded.profile.iter().flat_map(|profile| &profile.passive);
        let passive = passive.filter_map(|name| model.joint_index(name)).collect();
        Ok(Self { model, gains, gravity: Vector3::from(gravity), joints: found, passive })
    }

    /// Declares the ports and parameters of the joint command writer of one robot.
    pub(crate) fn declare(declare: &mut Declare) {
        JointPorts::single().declare(declare);
        Self::declare_scales(declare);
    }

    /// Declares the parameters shared by all joint command writers of a component.
    pub(crate) fn declare_scales(declare: &mut Declare) {
        declare.float("kp_scale", 1.0, 0.0..=2.0, "", "factor of the stiffness of all joints");
        declare.float("kd_scale", 1.0, 0.0..=2.0, "", "factor of the damping of all joints");
    }
}

/// Commanded quantity of the moved joints.
enum Drive<'a> {
    Position,
    Velocity,
    Effort(&'a [f64]),
}

/// Commands the joints of a robot. The joints that a policy moves ease from their current positions to its
/// setpoints; the others stay at their initial positions. Setpoints are clamped to the position limits.
#[derive(Debug)]
pub(crate) struct JointCommandWriter {
    driven: CommandedJoints,
    state: Input<JointState>,
    command: Output<JointCommand>,
    kp_scale: Parameter<f64>,
    kd_scale: Parameter<f64>,
    dynamics: Option<Dynamics>,
    ease: f64,
    /// Time since the first joint state, s.
    elapsed: f64,
    /// Joint positions in the first joint state.
    found: Vec<f64>,
    is_found: bool,
    /// Time of the newest joint state, ns since the run began.
    state_ns: u64,
    setpoint: Vec<f64>,
    velocity: Vec<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    /// Configuration of the model: the pose of a floating base (upright) before the joints.
    configuration: Vec<f64>,
    gravity: Vec<f64>,
}

impl JointCommandWriter {
    /// Creates the writer of a component for a single robot.
    pub(crate) fn new(
        driven: CommandedJoints,
        config: &JointCommandConfig,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        Self::with_ports(driven, config, &JointPorts::single(), setup)
    }

    /// Creates a writer with the given ports.
    pub(crate) fn with_ports(
        driven: CommandedJoints,
        config: &JointCommandConfig,
        ports: &JointPorts,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let zeros = vec![0.0; driven.model.joint_count()];
        Ok(Self {
            configuration: driven.model.neutral(),
            gravity: vec![0.0; driven.model.nv()],
            state: setup.input(&ports.state)?,
            command: setup.named_output(&ports.command)?,
            kp_scale: setup.parameter("kp_scale")?,
            kd_scale: setup.parameter("kd_scale")?,
            dynamics: config.gravity_compensation.then(|| Dynamics::new(&driven.model)),
            ease: config.ease.as_secs_f64().max(1e-3),
            elapsed: 0.0,
            found: zeros.clone(),
            is_found: false,
            state_ns: 0,
            setpoint: zeros.clone(),
            velocity: zeros.clone(),
            q: zeros.clone(),
            v: zeros,
            driven,
        })
    }

    /// Restarts with the next joint state.
    pub(crate) fn reset(&mut self) {
        (self.elapsed, self.is_found) = (0.0, false);
    }

    /// Reads the newest joint state. Returns `false` before the first one.
    pub(crate) fn read(&mut self) -> Result<bool, StepError> {
        let Some(state) = self.state.latest() else { return Ok(self.is_found) };
        if state.count() != self.q.len() {
            return Err(StepError::failed(
                "the joint state has another number of joints than the robot's model",
            ));
        }
        self.q.copy_from_slice(state.position());
        self.v.copy_from_slice(state.velocity());
        self.state_ns = state.time_ns();
        if !self.is_found {
            self.found.copy_from_slice(&self.q);
            self.is_found = true;
        }
        Ok(true)
    }

    /// Returns the time of the newest joint state, ns since the run began.
    pub(crate) fn state_ns(&self) -> u64 {
        self.state_ns
    }

    /// Returns the measured position of a moved joint, rad or m.
    pub(crate) fn position(&self, place: usize) -> f64 {
        self.q[self.driven.joints[place]]
    }

    /// Returns the measured velocity of a moved joint, per second.
    pub(crate) fn speed(&self, place: usize) -> f64 {
        self.v[self.driven.joints[place]]
    }

    /// Clamps positions of the moved joints to their limits.
    pub(crate) fn limit(&self, positions: &mut [f64]) {
        let model = &self.driven.model;
        for (position, joint) in positions.iter_mut().zip(&self.driven.joints) {
            *position = position.max(model.lower()[*joint]).min(model.upper()[*joint]);
        }
    }

    /// Returns the velocity limits of the moved joints, rad/s or m/s; infinite if the model specifies none.
    pub(crate) fn velocity_limits(&self) -> impl Iterator<Item = f64> {
        let limits = self.driven.model.velocity_limit();
        self.driven.joints.iter().map(move |joint| limits[*joint])
    }

    /// Commands the setpoints of the moved joints and their rates, per second.
    pub(crate) fn command(&mut self, dt: f64, setpoint: &[f64], rate: &[f64]) -> Result<(), StepError> {
        if !self.is_found {
            return Ok(());
        }
        let found = &self.found;
        self.elapsed += dt;
        let ease = Quintic::new(0.0, self.ease, Jet::default(), 1.0).sample(self.elapsed);
        self.setpoint.copy_from_slice(found);
        self.velocity.fill(0.0);
        let model = &self.driven.model;
        for ((joint, y), rate) in self.driven.joints.iter().zip(setpoint).zip(rate) {
            let off = y - found[*joint];
            let wanted = found[*joint] + ease.value * off;
            let (low, high) = (model.lower()[*joint], model.upper()[*joint]);
            self.setpoint[*joint] = wanted.max(low).min(high);
            let moves = self.setpoint[*joint] == wanted;
            self.velocity[*joint] = if moves { ease.value * rate + ease.rate * off } else { 0.0 };
        }
        self.publish(&Drive::Position)
    }

    /// Commands all joints to hold their positions of the first joint state.
    pub(crate) fn hold(&mut self) -> Result<(), StepError> {
        self.setpoint.copy_from_slice(&self.found);
        self.velocity.fill(0.0);
        self.publish(&Drive::Position)
    }

    /// Commands velocities of the moved joints, per second, using only the damping.
    pub(crate) fn command_velocities(&mut self, rate: &[f64]) -> Result<(), StepError> {
        self.setpoint.copy_from_slice(&self.found);
        self.velocity.fill(0.0);
        for (joint, rate) in self.driven.joints.iter().zip(rate) {
            (self.setpoint[*joint], self.velocity[*joint]) = (self.q[*joint], *rate);
        }
        self.publish(&Drive::Velocity)
    }

    /// Commands efforts of the moved joints, N m or N, without gains.
    pub(crate) fn command_efforts(&mut self, effort: &[f64]) -> Result<(), StepError> {
        self.setpoint.copy_from_slice(&self.found);
        self.velocity.fill(0.0);
        for joint in &self.driven.joints {
            self.setpoint[*joint] = self.q[*joint];
        }
        self.publish(&Drive::Effort(effort))
    }

    /// Publishes the setpoints.
    fn publish(&mut self, drive: &Drive<'_>) -> Result<(), StepError> {
        let model = &self.driven.model;
        let mut command = self.command.loan()?;
        command.set_count(self.q.len());
        command.position_mut().copy_from_slice(&self.setpoint);
        command.velocity_mut().copy_from_slice(&self.velocity);
        command.effort_mut().fill(0.0);
        if let Some(dynamics) = &mut self.dynamics {
            let base = self.configuration.len() - self.q.len();
            self.configuration[base..].copy_from_slice(&self.q);
            dynamics.gravity(model, &self.configuration, self.driven.gravity, &mut self.gravity);
            command.effort_mut().copy_from_slice(model.joints_of_v(&self.gravity));
        }
        let scaled = |gains: &DVector<f64>, scale: f64, out: &mut [f64]| {
            out.iter_mut().zip(gains).for_each(|(out, gain)| *out = scale * gain);
        };
        scaled(&self.driven.gains.kp, self.kp_scale.get(), command.kp_mut());
        scaled(&self.driven.gains.kd, self.kd_scale.get(), command.kd_mut());
        for (driven, joint) in self.driven.joints.iter().enumerate() {
            match drive {
                Drive::Position => continue,
                Drive::Velocity => {}
                Drive::Effort(effort) => {
                    command.kd_mut()[*joint] = 0.0;
                    command.effort_mut()[*joint] += effort[driven];
                }
            }
            command.kp_mut()[*joint] = 0.0;
        }
        for (effort, limit) in command.effort_mut().iter_mut().zip(model.effort_limit()) {
            *effort = effort.max(-limit).min(*limit);
        }
        for joint in &self.driven.passive {
            command.effort_mut()[*joint] = 0.0;
        }
        command.publish()
    }

    /// Returns `true` once the easing into the movement has finished.
    pub(crate) fn is_eased_in(&self) -> bool {
        self.elapsed >= self.ease
    }
}
