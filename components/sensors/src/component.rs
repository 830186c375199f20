//! `sensor.joint_encoder`: what a robot's joint sensors make of the true joint state.

use std::time::Duration;

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium::state::JointState;
use motorium::transport::{Input, Output};
use motorium::units::{TimeSpan, UnitError};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use crate::encoder::{EncoderModel, EncoderSettings, PerJoint, SettingsError, VelocitySource};

/// Configuration of `sensor.joint_encoder`; the default is an ideal sensor. Units are those of the joint: rad or, where
/// it slides, m. Each number may be a list with one entry for each joint of the robot.
///
/// ```toml
/// resolution     = 1e-5
/// position_noise = 2e-5
/// velocity       = { kind = "differentiated", cutoff_hz = 100.0 }
/// latency        = "500 us"
/// ```
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JointEncoderConfig {
    /// Step of the position reading, rad (or m); 0 for a continuous one. A count of `n` bits is `2 pi / 2^n`.
    pub resolution: PerJoint,
    /// Standard deviation of the position before it is quantised, rad (or m).
    pub position_noise: PerJoint,
    /// Standard deviation of a measured velocity, rad/s (or m/s).
    pub velocity_noise: PerJoint,
    /// Standard deviation of the effort, N m (or N).
    pub effort_noise: PerJoint,
    /// Where the velocity comes from. Default measured.
    pub velocity: VelocitySource,
    /// Time from sampling until the reading is available, such as "500 us". Default none.
    #[serde(deserialize_with = "time")]
    #[schemars(with = "TimeSpan")]
    pub latency: Duration,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    pub seed: Option<u64>,
}

/// Publishes what the joint sensors of a robot read.
///
/// It samples each joint state once, at the tick at which it first sees it, and publishes each reading once, at the first
/// tick at which its latency is over. When the joint state stops coming, so do the readings.
#[derive(Debug)]
pub struct JointEncoder {
    state: Input<JointState>,
    measured: Output<JointState>,
    model: EncoderModel,
    last_state: (u32, u32, u64),
    last_reading: Option<u64>,
    published: u64,
}

impl Component for JointEncoder {
    const KIND: &'static str = "sensor.joint_encoder";
    const SUMMARY: &'static str = "joint sensors: resolution, noise, latency";
    type Config = JointEncoderConfig;

    fn declare(config: &JointEncoderConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let robot = declare.robot().ok_or_else(|| {
            ConfigError::new("an encoder has the joints of a robot, and there is none")
                .advise("add `robot = \"NAME\"` to the component")
        })?;
        // the period is not known yet: one that allows any latency here
        build(config, joints(robot)?, 0, config.latency)?;
        declare.input::<JointState>("joint_state", "true joint state");
        declare.output::<JointState>("measured", "joint state as it is measured");
        Ok(())
    }

    fn configure(config: JointEncoderConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let joints = joints(setup.robot()?)?;
        Ok(Self {
            state: setup.input("joint_state")?,
            measured: setup.output("measured")?,
            model: build(&config, joints, setup.seed(), setup.period())?,
            last_state: (0, 0, 0),
            last_reading: None,
            published: 0,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if let Some(state) = self.state.latest() {
            let stamp = state.stamp();
            let name = (stamp.origin, stamp.incarnation, stamp.sequence);
            if name != self.last_state {
                self.last_state = name;
                self.model.sample(tick.time_ns, state.position(), state.velocity(), state.effort()).map_err(
                    |_| StepError::failed("the joint state has another number of joints than the robot"),
                )?;
            }
        }
        let Some(reading) = self.model.reading(tick.time_ns) else { return Ok(()) };
        if self.last_reading == Some(reading.sampled_at) {
            return Ok(());
        }
        self.last_reading = Some(reading.sampled_at);
        let mut measured = self.measured.loan()?;
        measured.set_count(reading.position.len());
        measured.position_mut().copy_from_slice(reading.position);
        measured.velocity_mut().copy_from_slice(reading.velocity);
        measured.effort_mut().copy_from_slice(reading.effort);
        measured.publish()?;
        self.published += 1;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "readings": self.published, "lost": self.model.lost() }))
    }
}

fn joints(robot: &RobotReference) -> Result<usize, ConfigError> {
    let loaded = motorium_robots::load(&robot.urdf, &robot.base)
        .map_err(|error| ConfigError::new(error.to_string()))?;
    // What a joint state has: no pose of a floating base, but the rotors that fly it.
    let rotors = loaded.profile.map_or(0, |profile| profile.rotors.len());
    let joints = loaded.model.joint_count() + rotors;
    if joints > motorium::state::MAX_JOINTS {
        let most = motorium::state::MAX_JOINTS;
        return Err(ConfigError::new(format!(
            "robot `{}` has {joints} joints, at most {most} fit",
            robot.name
        )));
    }
    Ok(joints)
}

fn build(
    config: &JointEncoderConfig,
    joints: usize,
    seed: u64,
    period: Duration,
) -> Result<EncoderModel, ConfigError> {
    let settings = EncoderSettings {
        resolution: config.resolution.clone(),
        position_noise: config.position_noise.clone(),
        velocity_noise: config.velocity_noise.clone(),
        effort_noise: config.effort_noise.clone(),
        velocity: config.velocity,
        latency_ns: u64::try_from(config.latency.as_nanos()).unwrap_or(u64::MAX),
        seed: config.seed.unwrap_or(seed),
    };
    EncoderModel::new(joints, &settings, period).map_err(|error| {
        let key = match error {
            SettingsError::Count { name, .. } | SettingsError::OutOfRange { name, .. } => name,
            SettingsError::NeedlessVelocityNoise => "velocity_noise",
            SettingsError::Latency { .. } => "latency",
        };
        ConfigError::key(key, error.to_string())
    })
}

fn time<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Duration, D::Error> {
    let text = String::deserialize(deserializer)?;
    let span: TimeSpan = text.parse().map_err(|error: UnitError| {
        serde::de::Error::custom(format!("the time {}: {}", error.found, error.expected))
    })?;
    Ok(Duration::from_nanos(span.ns))
}
