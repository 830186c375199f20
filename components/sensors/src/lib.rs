//! Sensor models for motorium: noise, resolution, latency.
//!
//! - [`encoder`]: the joint sensors of a robot.
//! - [`imu`]: gyroscopes and accelerometers. [`contact`]: the contact sensors of feet.
//! - [`channel`]: the errors of a measured quantity: noise, bias, scale, resolution, range.
//! - [`loads`]: wrenches between the links of a robot.
//! - [`geodesy`]: positions on the earth.
//! - [`ranging`]: rays of distance sensors, and their errors.
//! - [`pinhole`]: cameras without distortion. [`rendering`]: camera images. [`blob`]: detection of a coloured
//!   object in images.
//! - [`scenery`]: robot and world as the shapes that rays hit.
//! - [`randomise`]: parameters sampled for every episode.
//! - [`delay`]: delay of readings by their latency.
//! - [`noise`]: reproducible Gaussian noise.
//! - [`estimation`]: signal filters and state estimators, such as for the base of a legged robot.
//! - [`component`]: the sensors as components of a graph: `sensor.joint_encoder`, `sensor.joint_torque`,
//!   `sensor.force_torque`, `sensor.imu`, `sensor.contact`, `sensor.altimeter`, `sensor.magnetometer`,
//!   `sensor.gps`, `sensor.ray`, `sensor.lidar`, `sensor.height_scan`, `sensor.depth_camera`,
//!   `sensor.camera`.
//! - [`component::blob`]: the component `estimator.blob`, which estimates the position of a coloured object.
//! - [`component::estimator`]: the component `estimator.base`, which estimates the state of a legged base.
//! - [`component::merge`]: the component `joint.merge`, which merges joint states from several publishers.
//!
//! The models use only the runtime's unit of time, and allocate only during construction.
//!
//! ```
//! use std::time::Duration;
//! use motorium::units::TimeSpan;
//! use motorium_robots::PerJoint;
//! use motorium_sensors::encoder::{EncoderModel, EncoderSettings, JointErrors};
//!
//! let settings = EncoderSettings {
//!     position: JointErrors { resolution: PerJoint::All(1e-3), ..JointErrors::default() },
//!     latency: TimeSpan { ns: 2_000_000 },
//!     ..EncoderSettings::default()
//! };
//! let mut encoder = EncoderModel::new(1, &settings, 0, Duration::from_millis(1))?;
//! encoder.sample(0, &[0.1234], &[0.5], &[0.0])?;
//! assert!(encoder.reading(1_999_999).is_none());
//! let reading = encoder.reading(2_000_000).unwrap();
//! assert_eq!((reading.sampled_at, reading.position), (0, &[0.123][..]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod blob;
pub mod channel;
pub mod component;
pub mod contact;
pub mod delay;
pub mod encoder;
pub mod estimation;
pub mod geodesy;
pub mod imu;
pub mod loads;
pub mod noise;
pub mod pinhole;
pub mod randomise;
pub mod ranging;
pub mod rendering;
pub mod scenery;

pub use component::merge::JointMerge;
pub use component::{JointEncoder, kinds};
