//! `sensor.joint_encoder`: the joint sensors of a robot as a component.

#[macro_use]
mod config;
pub mod blob;
pub mod contact;
mod delivery;
mod doubts;
mod draws;
pub mod estimator;
pub mod force_torque;
pub mod imu;
pub mod joint_torque;
mod loads;
pub mod merge;
pub mod place;
pub mod rays;
mod readings;
mod robot;

use std::time::Duration;

use motorium::prelude::*;
use motorium::worker::Kind;

use motorium_robots::RobotSource;

use crate::encoder::{EncoderModel, EncoderSettings, StateTimes};
use crate::randomise::SensorDraw;
use draws::Draws;
pub use robot::Mount;

/// A component that publishes the readings of the joint sensors of a robot.
///
/// Each joint state is sampled once, at the first step that reads the state. The reading is published once,
/// at the first step after its latency, with the source time of the sampled state. When joint states stop
/// arriving, the component stops publishing readings. Differentiated velocities use the run time of the
/// states, which is free of publication jitter.
#[derive(Debug)]
pub struct JointEncoder {
    state: Input<JointState>,
    measured: Output<JointState>,
    settings: EncoderSettings,
    joints: usize,
    period: Duration,
    model: EncoderModel,
    draws: Draws,
    last_state: (u32, u32, u64),
    last_reading: Option<u64>,
    published: u64,
}

impl Component for JointEncoder {
    const KIND: &'static str = "sensor.joint_encoder";
    const SUMMARY: &'static str = "joint sensors: noise, bias, resolution, range, latency, lost readings";
    const RESETS: bool = true;
    type Config = EncoderSettings;

    fn declare(config: &EncoderSettings, declare: &mut Declare) -> Result<(), ConfigError> {
        let robot = robot::named(declare, "the joints of a robot")?;
        // without a known period, any latency is allowed
        let longest = config.randomise.longest(config.latency);
        let period = declare.period().unwrap_or(longest.into());
        let draw = SensorDraw { latency: longest, ..config.randomise.draw(0, config.latency) };
        build(config, joints(robot)?, &draw, 0, period)?;
        Draws::declare(&config.randomise, declare)?;
        if config.latency.ns > 0 && Duration::from(config.latency) < period {
            let period = TimeSpan { ns: period.as_nanos() as u64 };
            declare
                .warn(format!("a latency of {} is shorter than the period", config.latency))
                .key("latency")
                .advise(format!(
                    "readings are published once per step, {period} late; set this latency, or raise the rate"
                ));
        }
        declare.input::<JointState>("joint_state", "true joint state");
        declare.output::<JointState>("measured", "measured joint state");
        Ok(())
    }

    fn configure(config: EncoderSettings, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let joints = joints(setup.robot()?)?;
        let seed = config.seed.unwrap_or(setup.seed());
        let draws = Draws::open(&config.randomise, config.latency, seed, setup)?;
        Ok(Self {
            state: setup.input("joint_state")?,
            measured: setup.output("measured")?,
            model: build(&config, joints, &draws.now(), seed, setup.period())?,
            draws,
            last_state: (0, 0, 0),
            last_reading: None,
            published: 0,
            joints,
            period: setup.period(),
            settings: config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.draws.publish()?;
        if let Some(state) = self.state.latest() {
            let stamp = state.stamp();
            let name = (stamp.publisher, stamp.restart_count, stamp.sequence);
            if name != self.last_state {
                self.last_state = name;
                self.model
                    .sample_state(
                        tick.time_ns,
                        StateTimes { state: state.time_ns(), source: stamp.source_time },
                        state.position(),
                        state.velocity(),
                        state.effort(),
                    )
                    .map_err(|error| StepError::failed(error.to_string()))?;
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
        // A reading's age counts from its state and therefore includes the latency.
        measured.publish_from(reading.source)?;
        self.published += 1;
        Ok(())
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let seed = self.settings.seed.unwrap_or(episode.seed);
        let draw = self.draws.reset(episode.index, seed);
        self.model = EncoderModel::drawn(self.joints, &self.settings, &draw, seed, self.period)
            .map_err(|error| StepError::failed(error.to_string()))?;
        (self.last_state, self.last_reading, self.published) = ((0, 0, 0), None, 0);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = serde_json::json!({
            "readings": self.published,
            "dropped": self.model.dropped(),
            "lost": self.model.lost(),
        });
        self.draws.report(&mut result);
        Some(result)
    }
}

fn joints(robot: &RobotReference) -> Result<usize, ConfigError> {
    let loaded = RobotSource {
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: None,
    }
    .load()
    .map_err(|error| ConfigError::new(error.to_string()))?;
    // a joint state contains the rotors but not the pose of a floating base
    let rotors = loaded.profile.map_or(0, |profile| profile.rotors.len());
    let joints = loaded.model.joint_count() + rotors;
    if joints > MAX_JOINTS {
        return Err(ConfigError::new(format!(
            "robot `{}` has {joints} joints, expected at most {MAX_JOINTS}",
            robot.name
        )));
    }
    Ok(joints)
}

fn build(
    settings: &EncoderSettings,
    joints: usize,
    draw: &SensorDraw,
    seed: u64,
    period: Duration,
) -> Result<EncoderModel, ConfigError> {
    EncoderModel::drawn(joints, settings, draw, seed, period)
        .map_err(|error| ConfigError::key(error.setting(), error.to_string()))
}

/// Returns the component kinds of this crate, which a host program registers.
///
/// ```
/// let names: Vec<_> = motorium_sensors::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"sensor.joint_encoder"));
/// ```
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub fn kinds() -> Vec<Kind> {
    vec![
        Kind::of::<JointEncoder>(),
        Kind::of::<merge::JointMerge>(),
        Kind::of::<imu::Imu>(),
        Kind::of::<contact::FootContactSensor>(),
        Kind::of::<joint_torque::JointTorque>(),
        Kind::of::<force_torque::ForceTorque>(),
        Kind::of::<estimator::BaseEstimator>(),
        Kind::of::<place::AtPlace<place::Altimeter>>(),
        Kind::of::<place::AtPlace<place::Magnetometer>>(),
        Kind::of::<place::AtPlace<place::Gps>>(),
        Kind::of::<rays::AlongRays<rays::RaySensor>>(),
        Kind::of::<rays::AlongRays<rays::Lidar>>(),
        Kind::of::<rays::AlongRays<rays::HeightScanSensor>>(),
        Kind::of::<rays::AlongRays<rays::DepthCamera>>(),
        Kind::of::<rays::AlongRays<rays::Camera>>(),
        Kind::of::<blob::BlobEstimator>(),
    ]
}
