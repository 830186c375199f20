//! Joint sensors: resolution, noise and latency between the true joint state and the measured one.

mod model;
mod settings;

pub use model::{EncoderModel, Reading, SampleError, StateTimes};
pub use settings::{EncoderSettings, SettingsError, VelocitySource};
