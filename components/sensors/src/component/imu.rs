//! `sensor.imu`: an inertial measurement unit as a component.

use motorium::prelude::*;
use motorium::state::Randomisation;
use nalgebra::Vector3;

use super::config::SensorConfig;
use super::delivery::Delivery;
use super::doubts::{Plausible, check_gravity, rounded};
use super::loads::Drawn;
use super::readings::refused;
use super::robot::{Mount, Needs, TrueMotion};
use crate::channel::{Channel, ErrorModel};
use crate::imu::{ImuModel, SensorMotion};
use crate::randomise::SensorDraw;

sensor_config! {
    /// Configuration of `sensor.imu`. The default is an ideal sensor at the root link.
    ///
    /// ```toml
    /// mount         = { frame = "base", position = [0.0, 0.0, 0.02] }
    /// gyroscope     = { noise = 3e-3, bias = 2e-3, bias_walk = 1e-5, range = 35.0 }
    /// accelerometer = { noise = 0.06, bias = 0.02, bias_walk = 1e-4, range = 157.0 }
    /// latency       = "1 ms"
    /// ```
    pub struct ImuConfig;

    /// Mount of the sensor on the robot. Default: the root link.
    mount: Mount = Mount::default();
    /// Errors of the angular velocity, rad/s.
    gyroscope: ErrorModel = ErrorModel::default();
    /// Errors of the specific force, m/s^2.
    accelerometer: ErrorModel = ErrorModel::default();
    /// Standard deviation of the orientation noise about each axis, rad. Default 0.
    orientation_noise: f64 = 0.0;
    /// Gravitational acceleration (m/s^2). Default: the value in the graph's `[world]`, otherwise standard
    /// gravity.
    gravity: [f64; 3] = [0.0, 0.0, -9.81];
}

/// Highest plausible angular velocity of a gyroscope's range \[rad/s\].
const FASTEST: f64 = 100.0;
/// Largest plausible error of a gyroscope \[rad/s\].
const LARGEST_RATE_ERROR: f64 = 1.0;
/// Smallest plausible range of an accelerometer \[m/s2\], slightly below twice standard gravity.
const SMALLEST_RANGE: f64 = 19.0;

impl ImuConfig {
    /// Warns of values that are probably in degrees or in multiples of standard gravity.
    fn warn(&self, declare: &mut Declare) {
        let Self { gyroscope, accelerometer, orientation_noise, .. } = self;
        Plausible::rate(FASTEST).warn("gyroscope.range", gyroscope.range.as_slice(), declare);
        Plausible::rate(LARGEST_RATE_ERROR).warn_of_errors("gyroscope", gyroscope, declare);
        Plausible::angle(1.0).warn("orientation_noise", &[*orientation_noise], declare);
        if let Some(range) = accelerometer.range.filter(|range| *range < SMALLEST_RANGE) {
            declare
                .warn(format!("{range} m/s2, expected at least {SMALLEST_RANGE} m/s2"))
                .key("accelerometer.range")
                .advise(format!("if it is in multiples of gravity, write {}", rounded(9.81 * range)));
        }
    }

    fn models(&self, seed: u64, draw: &SensorDraw) -> Result<(ImuModel, Channel), ConfigError> {
        let seed = self.seed.unwrap_or(seed);
        check_gravity(self.gravity)?;
        let (gyroscope, accelerometer) = (draw.errors(&self.gyroscope), draw.errors(&self.accelerometer));
        let imu = ImuModel::new(&gyroscope, &accelerometer, Vector3::from(self.gravity), seed);
        let attitude = draw.errors(&ErrorModel { noise: self.orientation_noise, ..ErrorModel::default() });
        let attitude = Channel::new("", &attitude, 3, seed, 2)
            .map_err(|error| ConfigError::key("orientation_noise", error.to_string()))?;
        Ok((imu.map_err(refused)?, attitude))
    }
}

/// A component that publishes the readings of an inertial measurement unit on a robot.
///
/// The component samples the true motion at its own rate or on its trigger. A reading is the mean over the
/// time since the previous sample.
pub struct Imu {
    motion: TrueMotion,
    drawn: Drawn,
    sample: Output<ImuSample>,
    config: ImuConfig,
    model: ImuModel,
    attitude: Channel,
    delivery: Delivery,
}

/// Number of values in a reading: specific force, angular velocity, orientation.
const WIDTH: usize = 10;

impl Component for Imu {
    const KIND: &'static str = "sensor.imu";
    const SUMMARY: &'static str = "inertial measurement unit: noise, bias random walk, range, latency";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = ImuConfig;

    fn declare(config: &ImuConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let common = config.common();
        config.models(0, &common.declare_draws(declare)?)?;
        common.declare_readings(WIDTH, declare)?;
        TrueMotion::declare(&config.mount, Needs::Place, declare)?;
        config.warn(declare);
        Drawn::declare(declare);
        declare.output::<ImuSample>("imu", "specific force and angular velocity in the axes of the sensor");
        Ok(())
    }

    fn configure(config: ImuConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let opened = config.common().open(setup)?;
        let (seed, draw) = opened.start();
        let (model, attitude) = config.models(seed, &draw)?;
        Ok(Self {
            motion: TrueMotion::open(&config.mount, Needs::Place, setup)?,
            drawn: Drawn::open(setup)?,
            sample: setup.output("imu")?,
            delivery: opened.deliver(WIDTH)?,
            model,
            attitude,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.delivery.publish_draws()?;
        if let Some(motion) = self.motion.newest()? {
            let rotation = motion.pose.rotation;
            if let Some(drawn) = self.drawn.newest(tick) {
                let factor = drawn.find(Randomisation::GRAVITY, 0).unwrap_or(1.0);
                self.model.set_gravity(Vector3::from(self.config.gravity) * factor);
            }
            let truth = SensorMotion { rotation, velocity: motion.linear };
            if let Some(reading) = self.model.sample(motion.times.state, &truth) {
                let mut tilt = [0.0; 3];
                self.attitude.measure(0.0, &mut tilt);
                let seen = motorium_robots::lie::so3::exp(&Vector3::from(tilt)) * rotation;
                let mut values = [0.0; WIDTH];
                values[..3].copy_from_slice(reading.specific_force.as_slice());
                values[3..6].copy_from_slice(reading.angular_velocity.as_slice());
                values[6..].copy_from_slice(seen.coords.as_slice());
                self.delivery.push(tick.time_ns, motion.times.source, &values);
            }
        }
        let Some((source, values)) = self.delivery.due(tick.time_ns) else { return Ok(()) };
        let mut sample = self.sample.loan()?;
        sample.specific_force.copy_from_slice(&values[..3]);
        sample.angular_velocity.copy_from_slice(&values[3..6]);
        sample.orientation.copy_from_slice(&values[6..]);
        sample.publish_from(source)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let (seed, draw) = self.delivery.reset(episode)?;
        (self.model, self.attitude) =
            self.config.models(seed, &draw).map_err(|error| StepError::failed(error.to_string()))?;
        self.motion.reset();
        self.drawn.reset();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = self.delivery.result();
        let (gyroscope, accelerometer) = self.model.biases();
        result["gyroscope_bias"] = serde_json::json!(gyroscope.as_slice());
        result["accelerometer_bias"] = serde_json::json!(accelerometer.as_slice());
        Some(result)
    }
}
