//! `sensor.force_torque`: a force-torque sensor as a component.

use motorium::prelude::*;
use motorium_robots::{FrameId, Model};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use schemars::JsonSchema;
use serde::Deserialize;

use super::config::SensorConfig;
use super::delivery::Delivery;
use super::loads::{Axes, TrueLoads};
use super::readings::refused;
use super::robot::{LARGEST_MOUNT, warn_of_angles};
use crate::channel::{Channel, ErrorModel, SettingError};
use crate::randomise::{SensorDraw, SensorRanges};

/// Configuration of `sensor.force_torque`. `link` is required; the defaults of the other keys are an ideal
/// sensor at the origin of the link.
///
/// ```toml
/// link    = "panda_hand"
/// force   = { noise = 0.1, bias = 0.5, resolution = 0.05, range = 300.0 }
/// torque  = { noise = 0.005, bias = 0.02, resolution = 0.001, range = 30.0 }
/// latency = "1 ms"
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceTorqueConfig {
    /// Link carried by the sensor. The sensor is in the joint between this link and its parent. This joint
    /// may be movable or fixed.
    pub link: String,
    /// Position of the sensor in the frame of the link (m). Default: the link's origin.
    #[serde(default)]
    pub position: [f64; 3],
    /// Orientation of the sensor in the frame of the link: roll, pitch, yaw about the fixed axes x, y, z, in
    /// this order (rad).
    #[serde(default)]
    pub rpy: [f64; 3],
    /// Errors of the force, N.
    #[serde(default)]
    pub force: ErrorModel,
    /// Errors of the torque, N m.
    #[serde(default)]
    pub torque: ErrorModel,
    /// Delay from sampling until the reading is available. Default 0.
    #[serde(default)]
    pub latency: TimeSpan,
    /// Fraction of the readings that are dropped, 0 to 1. Default 0.
    #[serde(default)]
    pub drop_out: f64,
    /// Gravitational acceleration (m/s^2). Default: the value in the graph's `[world]`, otherwise standard
    /// gravity.
    #[serde(default = "earth")]
    pub gravity: [f64; 3],
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Ranges from which noise, bias and latency are sampled at the start of every episode. Default: no
    /// sampling.
    #[serde(default)]
    pub randomise: SensorRanges,
}

sensor_config!(impl ForceTorqueConfig);

/// Number of values in a reading: force and torque.
const WIDTH: usize = 6;

/// Standard gravity \[m/s2\].
pub(super) fn earth() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

impl ForceTorqueConfig {
    fn channels(&self, seed: u64, draw: &SensorDraw) -> Result<[Channel; 2], SettingError> {
        let seed = self.seed.unwrap_or(seed);
        Ok([
            Channel::new("force", &draw.errors(&self.force), 3, seed, 0)?,
            Channel::new("torque", &draw.errors(&self.torque), 3, seed, 1)?,
        ])
    }

    /// Returns the carried link and the sensor's pose in its frame.
    fn locate(&self, model: &Model) -> Result<(FrameId, Isometry3<f64>), ConfigError> {
        let link = model.frame(&self.link).map_err(|error| ConfigError::key("link", error.to_string()))?;
        if model.frames()[link.index()].parent.is_none() {
            return Err(ConfigError::key(
                "link",
                format!("`{}` is the root link, which has no parent to mount the sensor on", self.link),
            )
            .advise("name the first link beyond the sensor, such as the hand"));
        }
        for (key, numbers) in [("position", self.position), ("rpy", self.rpy)] {
            if !numbers.iter().all(|number| number.is_finite()) {
                return Err(ConfigError::key(key, "expected finite numbers"));
            }
        }
        let [roll, pitch, yaw] = self.rpy;
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        Ok((link, Isometry3::from_parts(Translation3::from(self.position), rotation)))
    }
}

/// A component that publishes the readings of a force-torque sensor between two links of a robot.
///
/// A reading is the wrench that the robot exerts through the sensor on everything it carries, averaged over
/// the time since the last sample. At rest, the force is the weight of the carried parts, directed upwards.
/// The wrench is expressed in the sensor's axes about the sensor's origin, both at the middle of the
/// interval.
pub struct ForceTorque {
    loads: TrueLoads,
    wrench: Output<Wrench>,
    config: ForceTorqueConfig,
    channels: [Channel; 2],
    delivery: Delivery,
    link: FrameId,
    last: Option<u64>,
    /// Mass carried by the sensor \[kg\].
    carried: f64,
}

impl Component for ForceTorque {
    const KIND: &'static str = "sensor.force_torque";
    const SUMMARY: &'static str = "force-torque sensor: noise, bias, resolution, range, latency";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = ForceTorqueConfig;

    fn declare(config: &ForceTorqueConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let common = config.common();
        config.channels(0, &common.declare_draws(declare)?).map_err(refused)?;
        common.declare_readings(WIDTH, declare)?;
        let model = TrueLoads::declare(config.gravity, declare)?;
        let (link, _) = config.locate(&model)?;
        warn_of_angles("rpy", &config.rpy, declare);
        LARGEST_MOUNT.warn("position", &config.position, declare);
        if carried(&model, link) == 0.0 {
            declare
                .warn(format!(
                    "`{}` and the links it carries have no mass, so the sensor measures only contact forces",
                    config.link
                ))
                .key("link");
        }
        declare.output::<Wrench>("wrench", "force and torque on the links beyond the sensor, in its axes");
        Ok(())
    }

    fn configure(config: ForceTorqueConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let mut loads = TrueLoads::open(config.gravity, setup)?;
        let (link, place) = config.locate(loads.model())?;
        loads.follow([Axes::Link(link, place)]);
        let opened = config.common().open(setup)?;
        let (seed, draw) = opened.start();
        Ok(Self {
            wrench: setup.output("wrench")?,
            channels: config.channels(seed, &draw).map_err(refused)?,
            delivery: opened.deliver(WIDTH)?,
            carried: carried(loads.model(), link),
            last: None,
            loads,
            link,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.delivery.publish_draws()?;
        if let Some(times) = self.loads.newest(tick)? {
            let wrench = self.loads.through(self.link);
            let since = self.last.replace(times.state).unwrap_or(times.state);
            let (force, torque) = wrench.seen_from(&self.loads.middle(0));
            let dt = times.state.saturating_sub(since) as f64 * 1e-9;
            let mut values = [force.x, force.y, force.z, torque.x, torque.y, torque.z];
            let [of_force, of_torque] = &mut self.channels;
            of_force.measure(dt, &mut values[..3]);
            of_torque.measure(dt, &mut values[3..]);
            self.delivery.push(tick.time_ns, times.source, &values);
        }
        let Some((source, values)) = self.delivery.due(tick.time_ns) else { return Ok(()) };
        let mut wrench = self.wrench.loan()?;
        wrench.force.copy_from_slice(&values[..3]);
        wrench.torque.copy_from_slice(&values[3..]);
        wrench.publish_from(source)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let (seed, draw) = self.delivery.reset(episode)?;
        let channels = self.config.channels(seed, &draw);
        self.channels = channels.map_err(|error| StepError::failed(error.to_string()))?;
        self.loads.reset();
        self.last = None;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = self.delivery.result();
        let [force, torque] = &self.channels;
        result["samples_with_contacts_left_out"] = serde_json::json!(self.loads.incomplete());
        result["carried_mass_kg"] = serde_json::json!(self.carried);
        result["force_bias"] = serde_json::json!(force.bias());
        result["torque_bias"] = serde_json::json!(torque.bias());
        Some(result)
    }
}

/// Returns the mass of a link and everything it carries \[kg\].
fn carried(model: &Model, link: FrameId) -> f64 {
    model.carried(link).iter().map(|frame| model.frames()[frame.index()].inertia.mass).sum()
}
