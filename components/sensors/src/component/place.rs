//! Sensors of the place and the motion of a point on a robot, as components: altimeter, satellite navigation, magnetometer.

use motorium::prelude::*;
use motorium::state::{Altitude, GeoFix, MagneticField};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::readings::{Readings, refused};
use super::robot::{Motion, Mount, Needs, TrueMotion};
use crate::channel::{Channel, ErrorModel, Timing};
use crate::geodesy::{Geodetic, TangentPlane};

/// A sensor of the motion of a point.
pub trait PlaceSensor: Sized + 'static {
    /// Name of the kind.
    const KIND: &'static str;
    /// One line on it.
    const SUMMARY: &'static str;
    /// Its output.
    const PORT: (&'static str, &'static str);
    /// Numbers of a reading.
    const WIDTH: usize;
    /// Its configuration.
    type Config: serde::de::DeserializeOwned + JsonSchema;
    /// The message it publishes.
    type Message: StateBuffer;

    /// Its place, its latency, and its seed.
    fn common(config: &Self::Config) -> (&Mount, Timing, Option<u64>);
    /// The sensor of a seed.
    ///
    /// # Errors
    /// A number out of range.
    fn new(config: &Self::Config, seed: u64) -> Result<Self, ConfigError>;
    /// Fills in a reading.
    fn read(&mut self, at: &PlaceMotion, dt: f64, values: &mut [f64]);
    /// Writes a reading into a message.
    fn write(&self, values: &[f64], message: &mut Self::Message);
}

/// The motion of a point of a robot.
#[derive(Clone, Copy, Debug)]
pub struct PlaceMotion(Motion);

/// A component of a [`PlaceSensor`]: it samples the true motion at its own rate, or at that of its trigger.
pub struct AtPlace<S: PlaceSensor> {
    motion: TrueMotion,
    output: Output<S::Message>,
    config: S::Config,
    sensor: S,
    readings: Readings,
    values: Vec<f64>,
    since: Option<u64>,
}

impl<S: PlaceSensor> Component for AtPlace<S> {
    const KIND: &'static str = S::KIND;
    const SUMMARY: &'static str = S::SUMMARY;
    const RESETS: bool = true;
    type Config = S::Config;

    fn declare(config: &S::Config, declare: &mut Declare) -> Result<(), ConfigError> {
        let (mount, timing, _) = S::common(config);
        S::new(config, 0)?;
        Readings::declare(&timing, declare)?;
        TrueMotion::declare(mount, Needs::Place, declare)?;
        declare.output::<S::Message>(S::PORT.0, S::PORT.1);
        Ok(())
    }

    fn configure(config: S::Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (mount, timing, seed) = S::common(&config);
        let seed = seed.unwrap_or(setup.seed());
        Ok(Self {
            motion: TrueMotion::open(mount, Needs::Place, setup)?,
            output: setup.output(S::PORT.0)?,
            readings: Readings::new(&timing, S::WIDTH, setup.period(), seed)?,
            sensor: S::new(&config, seed)?,
            values: vec![0.0; S::WIDTH],
            since: None,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if let Some(motion) = self.motion.newest()? {
            let time = motion.times.state;
            let dt = self.since.replace(time).map_or(0.0, |since| time.saturating_sub(since) as f64 * 1e-9);
            self.sensor.read(&PlaceMotion(motion), dt, &mut self.values);
            self.readings.push(tick.time_ns, motion.times.source, &self.values);
        }
        let Some((source, values)) = self.readings.due(tick.time_ns) else { return Ok(()) };
        let mut message = self.output.loan()?;
        self.sensor.write(values, &mut message);
        message.publish_from(source)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let seed = S::common(&self.config).2.unwrap_or(episode.seed);
        self.sensor = S::new(&self.config, seed).map_err(|error| StepError::failed(error.to_string()))?;
        self.readings.reset(seed);
        self.motion.reset();
        self.since = None;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(self.readings.result())
    }
}

/// Configuration of `sensor.altimeter`. The default is an ideal sensor.
///
/// ```toml
/// height  = { noise = 0.1, bias_walk = 0.01, resolution = 0.01 }
/// latency = "20 ms"
/// ```
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AltimeterConfig {
    /// Place of the sensor on the robot. Default: the root link.
    pub mount: Mount,
    /// Height in the world that reads 0 (m). Default 0.
    pub reference: f64,
    /// Errors of the height, m.
    pub height: ErrorModel,
    /// Errors of its rate, m/s.
    pub rate: ErrorModel,
    /// Time from sampling until the reading is available. Default none.
    pub latency: TimeSpan,
    /// Share of the readings that are lost, 0 to 1. Default 0.
    pub drop_out: f64,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    pub seed: Option<u64>,
}

/// `sensor.altimeter`: the height of a point of a robot.
pub struct Altimeter {
    reference: f64,
    height: Channel,
    rate: Channel,
}

impl PlaceSensor for Altimeter {
    const KIND: &'static str = "sensor.altimeter";
    const SUMMARY: &'static str = "height and its rate: noise, bias that walks, latency";
    const PORT: (&'static str, &'static str) = ("altitude", "height above the reference, and its rate");
    const WIDTH: usize = 2;
    type Config = AltimeterConfig;
    type Message = Altitude;

    fn common(config: &AltimeterConfig) -> (&Mount, Timing, Option<u64>) {
        let timing = Timing { latency: config.latency, drop_out: config.drop_out };
        (&config.mount, timing, config.seed)
    }

    fn new(config: &AltimeterConfig, seed: u64) -> Result<Self, ConfigError> {
        if !config.reference.is_finite() {
            return Err(ConfigError::key("reference", "expected a finite number"));
        }
        Ok(Self {
            reference: config.reference,
            height: Channel::new("height", &config.height, 1, seed, 0).map_err(refused)?,
            rate: Channel::new("rate", &config.rate, 1, seed, 1).map_err(refused)?,
        })
    }

    fn read(&mut self, at: &PlaceMotion, dt: f64, values: &mut [f64]) {
        values[0] = at.0.pose.translation.z - self.reference;
        values[1] = at.0.linear.z;
        let (height, rate) = values.split_at_mut(1);
        self.height.measure(dt, height);
        self.rate.measure(dt, rate);
    }

    fn write(&self, values: &[f64], message: &mut Altitude) {
        (message.height, message.rate) = (values[0], values[1]);
    }
}

/// Configuration of `sensor.magnetometer`. The default is an ideal sensor in a field as in central Europe.
///
/// ```toml
/// field  = [0.0, 2.1e-5, -4.3e-5]
/// errors = { noise = 2e-7, bias = 1e-6, scale_error = 0.01, range = 8e-4 }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MagnetometerConfig {
    /// Place of the sensor on the robot. Default: the root link.
    pub mount: Mount,
    /// Flux density in the axes of the world (T). Default: 21 uT to the north, which is y, and 43 uT down.
    pub field: [f64; 3],
    /// Errors of the reading, T. A bias is what the robot's own iron adds.
    pub errors: ErrorModel,
    /// Time from sampling until the reading is available. Default none.
    pub latency: TimeSpan,
    /// Share of the readings that are lost, 0 to 1. Default 0.
    pub drop_out: f64,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    pub seed: Option<u64>,
}

impl Default for MagnetometerConfig {
    fn default() -> Self {
        Self {
            mount: Mount::default(),
            field: [0.0, 2.1e-5, -4.3e-5],
            errors: ErrorModel::default(),
            latency: TimeSpan { ns: 0 },
            drop_out: 0.0,
            seed: None,
        }
    }
}

/// `sensor.magnetometer`: the magnetic field at a point of a robot.
pub struct Magnetometer {
    field: Vector3<f64>,
    channel: Channel,
}

impl PlaceSensor for Magnetometer {
    const KIND: &'static str = "sensor.magnetometer";
    const SUMMARY: &'static str = "magnetic field in the axes of the sensor: noise, bias, scale, latency";
    const PORT: (&'static str, &'static str) = ("magnetic_field", "flux density in the axes of the sensor");
    const WIDTH: usize = 3;
    type Config = MagnetometerConfig;
    type Message = MagneticField;

    fn common(config: &MagnetometerConfig) -> (&Mount, Timing, Option<u64>) {
        let timing = Timing { latency: config.latency, drop_out: config.drop_out };
        (&config.mount, timing, config.seed)
    }

    fn new(config: &MagnetometerConfig, seed: u64) -> Result<Self, ConfigError> {
        if !config.field.iter().all(|number| number.is_finite()) {
            return Err(ConfigError::key("field", "expected finite numbers"));
        }
        let channel = Channel::new("errors", &config.errors, 3, seed, 0).map_err(refused)?;
        Ok(Self { field: Vector3::from(config.field), channel })
    }

    fn read(&mut self, at: &PlaceMotion, dt: f64, values: &mut [f64]) {
        values.copy_from_slice(at.0.pose.rotation.inverse_transform_vector(&self.field).as_slice());
        self.channel.measure(dt, values);
    }

    fn write(&self, values: &[f64], message: &mut MagneticField) {
        message.field.copy_from_slice(values);
    }
}

/// Configuration of `sensor.gps`. The world's x points to the east, unless `heading` turns it, its z up.
///
/// ```toml
/// origin     = { latitude = 46.52, longitude = 6.57, altitude = 400.0 }
/// horizontal = { noise = 0.5, bias = 1.0 }
/// vertical   = { noise = 1.0, bias = 2.0 }
/// latency    = "100 ms"
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GpsConfig {
    /// Place of the world's origin on the earth.
    pub origin: Origin,
    /// Angle from the east to the world's x, counter-clockwise (rad). Default 0.
    #[serde(default)]
    pub heading: f64,
    /// Place of the antenna on the robot. Default: the root link.
    #[serde(default)]
    pub mount: Mount,
    /// Errors of the position to the east and to the north, m.
    #[serde(default)]
    pub horizontal: ErrorModel,
    /// Errors of the height, m.
    #[serde(default)]
    pub vertical: ErrorModel,
    /// Errors of the velocity, m/s.
    #[serde(default)]
    pub velocity: ErrorModel,
    /// Time from sampling until the fix is available. Default none.
    #[serde(default)]
    pub latency: TimeSpan,
    /// Share of the fixes that are lost, 0 to 1. Default 0.
    #[serde(default)]
    pub drop_out: f64,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    #[serde(default)]
    pub seed: Option<u64>,
}

/// A place on the earth, WGS 84.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Latitude (degrees, north positive).
    pub latitude: f64,
    /// Longitude (degrees, east positive).
    pub longitude: f64,
    /// Height above the ellipsoid (m). Default 0.
    #[serde(default)]
    pub altitude: f64,
}

/// `sensor.gps`: a receiver of satellite navigation.
pub struct Gps {
    plane: TangentPlane,
    heading: nalgebra::UnitQuaternion<f64>,
    horizontal: Channel,
    vertical: Channel,
    velocity: Channel,
    deviations: [f64; 6],
}

impl PlaceSensor for Gps {
    const KIND: &'static str = "sensor.gps";
    const SUMMARY: &'static str =
        "satellite navigation: latitude, longitude, altitude, velocity, with errors";
    const PORT: (&'static str, &'static str) = ("fix", "place on the earth and velocity");
    const WIDTH: usize = 6;
    type Config = GpsConfig;
    type Message = GeoFix;

    fn common(config: &GpsConfig) -> (&Mount, Timing, Option<u64>) {
        let timing = Timing { latency: config.latency, drop_out: config.drop_out };
        (&config.mount, timing, config.seed)
    }

    fn new(config: &GpsConfig, seed: u64) -> Result<Self, ConfigError> {
        let Origin { latitude, longitude, altitude } = config.origin;
        if !(-90.0..=90.0).contains(&latitude) {
            return Err(ConfigError::key(
                "origin.latitude",
                format!("{latitude}: expected -90 to 90 degrees"),
            ));
        }
        if !(-360.0..=360.0).contains(&longitude) || !altitude.is_finite() || !config.heading.is_finite() {
            return Err(ConfigError::key(
                "origin",
                "expected a longitude of -360 to 360 degrees and finite numbers",
            ));
        }
        let spread = |errors: &ErrorModel| errors.noise.hypot(errors.bias);
        let (across, up, speed) =
            (spread(&config.horizontal), spread(&config.vertical), spread(&config.velocity));
        Ok(Self {
            plane: TangentPlane::at(&Geodetic { latitude, longitude, altitude }),
            heading: nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), config.heading),
            horizontal: Channel::new("horizontal", &config.horizontal, 2, seed, 0).map_err(refused)?,
            vertical: Channel::new("vertical", &config.vertical, 1, seed, 1).map_err(refused)?,
            velocity: Channel::new("velocity", &config.velocity, 3, seed, 2).map_err(refused)?,
            deviations: [across, across, up, speed, speed, speed],
        })
    }

    fn read(&mut self, at: &PlaceMotion, dt: f64, values: &mut [f64]) {
        let place = self.heading * at.0.pose.translation.vector;
        values[..3].copy_from_slice(place.as_slice());
        values[3..].copy_from_slice((self.heading * at.0.linear).as_slice());
        self.horizontal.measure(dt, &mut values[..2]);
        self.vertical.measure(dt, &mut values[2..3]);
        self.velocity.measure(dt, &mut values[3..]);
    }

    fn write(&self, values: &[f64], message: &mut GeoFix) {
        let place = self.plane.geodetic(&Vector3::new(values[0], values[1], values[2]));
        (message.latitude, message.longitude, message.altitude) =
            (place.latitude, place.longitude, place.altitude);
        message.velocity.copy_from_slice(&values[3..]);
        message.position_deviation.copy_from_slice(&self.deviations[..3]);
        message.velocity_deviation.copy_from_slice(&self.deviations[3..]);
    }
}
