//! Sensor models for motorium: noise, resolution, latency.
//!
//! - [`encoder`]: what a robot's joint sensors make of the true joint state.
//! - [`delay`]: readings held back until their latency is over.
//! - [`noise`]: reproducible Gaussian noise.
//! - [`component`]: `sensor.joint_encoder`, the encoder as a component of a graph. Nothing else here knows the runtime.
//!
//! The models are plain libraries: time comes in as nanoseconds, and only construction allocates.
//!
//! ```
//! use std::time::Duration;
//! use motorium_sensors::encoder::{EncoderSettings, EncoderModel, PerJoint};
//!
//! let settings = EncoderSettings {
//!     resolution: PerJoint::Same(1e-3),
//!     latency_ns: 2_000_000,
//!     ..EncoderSettings::default()
//! };
//! let mut encoder = EncoderModel::new(1, &settings, Duration::from_millis(1))?;
//! encoder.sample(0, &[0.1234], &[0.5], &[0.0])?;
//! assert!(encoder.reading(1_999_999).is_none());
//! let reading = encoder.reading(2_000_000).unwrap();
//! assert_eq!((reading.sampled_at, reading.position), (0, &[0.123][..]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod component;
pub mod delay;
pub mod encoder;
pub mod noise;

pub use component::JointEncoder;
