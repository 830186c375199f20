//! An inertial measurement unit: gyroscopes and accelerometers.

use motorium_robots::lie::so3;
use nalgebra::{UnitQuaternion, Vector3};

use crate::channel::{Channel, ErrorModel, SettingError};

/// Motion of a sensor in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorMotion {
    /// Orientation of the sensor in the world.
    pub rotation: UnitQuaternion<f64>,
    /// Velocity of the sensor's origin in world axes \[m/s\].
    pub velocity: Vector3<f64>,
}

/// One reading of an inertial measurement unit, in sensor axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuReading {
    /// Specific force: acceleration minus gravitational acceleration \[m/s2\].
    pub specific_force: Vector3<f64>,
    /// Angular velocity \[rad/s\].
    pub angular_velocity: Vector3<f64>,
}

/// Model of an inertial measurement unit that integrates between its readings, as units with digital output
/// do.
///
/// A reading contains the mean angular velocity `omega` and the mean specific force `f` over the interval
/// between two samples at `t` and `t + dt`:
///
/// ```text
/// omega = log(R(t)' R(t + dt)) / dt        f = R(t + dt/2)' ((v(t + dt) - v(t)) / dt - g)
/// ```
///
/// `R` and `v` are the orientation and the velocity of the sensor in the world, and `g` is the gravitational
/// acceleration. `omega` and `f` are in the sensor's axes at the middle of the interval. Sensor errors are
/// added to both. The first sample gives no reading.
///
/// ```
/// use motorium_sensors::channel::ErrorModel;
/// use motorium_sensors::imu::{ImuModel, SensorMotion};
/// use nalgebra::{UnitQuaternion, Vector3};
///
/// let ideal = ErrorModel::default();
/// let mut imu = ImuModel::new(&ideal, &ideal, Vector3::new(0.0, 0.0, -9.81), 0)?;
/// let rest = SensorMotion { rotation: UnitQuaternion::identity(), velocity: Vector3::zeros() };
/// assert!(imu.sample(0, &rest).is_none());
/// let reading = imu.sample(1_000_000, &rest).unwrap();
/// assert_eq!(reading.specific_force, Vector3::new(0.0, 0.0, 9.81));
/// # Ok::<(), motorium_sensors::channel::SettingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ImuModel {
    gyroscope: Channel,
    accelerometer: Channel,
    gravity: Vector3<f64>,
    last: Option<(u64, SensorMotion)>,
}

impl ImuModel {
    /// Creates a model under the gravitational acceleration `gravity` \[m/s2\] in the world.
    ///
    /// # Errors
    /// [`SettingError`] if a setting of `gyroscope` or `accelerometer` is invalid.
    pub fn new(
        gyroscope: &ErrorModel,
        accelerometer: &ErrorModel,
        gravity: Vector3<f64>,
        seed: u64,
    ) -> Result<Self, SettingError> {
        Ok(Self {
            gyroscope: Channel::new("gyroscope", gyroscope, 3, seed, 0)?,
            accelerometer: Channel::new("accelerometer", accelerometer, 3, seed, 1)?,
            gravity,
            last: None,
        })
    }

    /// Sets the gravitational acceleration in the world \[m/s2\].
    pub fn set_gravity(&mut self, gravity: Vector3<f64>) {
        self.gravity = gravity;
    }

    /// Samples the motion at a time \[ns\] and returns the reading for the interval since the last sample.
    /// Returns `None` for the first sample. A time that is not after the previous sample's restarts the
    /// motion, and also returns `None`.
    pub fn sample(&mut self, time_ns: u64, motion: &SensorMotion) -> Option<ImuReading> {
        let (since, before) = self.last.replace((time_ns, *motion))?;
        let dt = time_ns.checked_sub(since).filter(|ns| *ns > 0)? as f64 * 1e-9;
        let turn = so3::log(&(before.rotation.inverse() * motion.rotation));
        let middle = before.rotation * so3::exp(&(turn * 0.5));
        let acceleration = (motion.velocity - before.velocity) / dt;
        let mut force = middle.inverse_transform_vector(&(acceleration - self.gravity));
        let mut rate = turn / dt;
        self.gyroscope.measure(dt, rate.as_mut_slice());
        self.accelerometer.measure(dt, force.as_mut_slice());
        Some(ImuReading { specific_force: force, angular_velocity: rate })
    }

    /// Returns the current biases of each axis of the gyroscope \[rad/s\] and of the accelerometer \[m/s2\].
    pub fn biases(&self) -> (Vector3<f64>, Vector3<f64>) {
        let bias = |channel: &Channel| Vector3::from_column_slice(channel.bias());
        (bias(&self.gyroscope), bias(&self.accelerometer))
    }
}
