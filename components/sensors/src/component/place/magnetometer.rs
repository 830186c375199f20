//! `sensor.magnetometer`: the magnetic field at a point of a robot.

use motorium::prelude::*;
use motorium::state::MagneticField;
use nalgebra::Vector3;

use super::super::doubts::rounded;
use super::super::readings::refused;
use super::{Mount, PlaceMotion, PlaceSensor};
use crate::channel::{Channel, ErrorModel};
use crate::randomise::SensorDraw;

sensor_config! {
    /// Configuration of `sensor.magnetometer`. The default is an ideal sensor in a typical magnetic field of
    /// central Europe.
    ///
    /// ```toml
    /// field  = [0.0, 2.1e-5, -4.3e-5]
    /// errors = { noise = 2e-7, bias = 1e-6, scale_error = 0.01, range = 8e-4 }
    /// ```
    pub struct MagnetometerConfig;

    /// Mount of the sensor on the robot. Default: the root link.
    mount: Mount = Mount::default();
    /// Magnetic flux density in world axes (T). Default: 21 uT along y (north) and 43 uT down.
    field: [f64; 3] = [0.0, 2.1e-5, -4.3e-5];
    /// Errors of the reading, T. Use the bias to model the magnetisation of the robot.
    errors: ErrorModel = ErrorModel::default();
}

/// Strongest plausible field \[T\]: more than ten times the earth's.
const STRONGEST: f64 = 1e-3;
/// Strength of the earth's field at its surface \[T\].
const EARTH: core::ops::RangeInclusive<f64> = 2e-5..=7e-5;
/// Other units of flux density, and their factors to tesla.
const UNITS: [(&str, f64); 4] = [("gauss", 1e-4), ("uT", 1e-6), ("mG", 1e-7), ("nT", 1e-9)];

/// `sensor.magnetometer`: measures the magnetic field at a point of a robot.
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

    fn mount(config: &MagnetometerConfig) -> &Mount {
        &config.mount
    }

    fn new(config: &MagnetometerConfig, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError> {
        if !config.field.iter().all(|number| number.is_finite()) {
            return Err(ConfigError::key("field", "expected finite numbers"));
        }
        let channel = Channel::new("errors", &draw.errors(&config.errors), 3, seed, 0).map_err(refused)?;
        Ok(Self { field: Vector3::from(config.field), channel })
    }

    fn warn(config: &MagnetometerConfig, declare: &mut Declare) {
        let field = Vector3::from(config.field);
        if field.norm() > STRONGEST {
            let warning =
                declare.warn(format!("{} T, expected at most {STRONGEST} T", rounded(field.norm())));
            warning.key("field");
            let earths = |(_, factor): &&(&str, f64)| EARTH.contains(&(field.norm() * factor));
            if let Some((unit, factor)) = UNITS.iter().find(earths) {
                let [x, y, z] = config.field.map(|number| rounded(number * factor));
                warning.advise(format!("if it is in {unit}, write [{x:?}, {y:?}, {z:?}]"));
            }
        }
    }

    fn read(&mut self, at: &PlaceMotion, dt: f64, values: &mut [f64]) {
        values.copy_from_slice(at.0.pose.rotation.inverse_transform_vector(&self.field).as_slice());
        self.channel.measure(dt, values);
    }

    fn write(&self, values: &[f64], message: &mut MagneticField) {
        message.field.copy_from_slice(values);
    }
}
