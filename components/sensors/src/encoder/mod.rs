//! What a robot's joint sensors make of the true joint state.

mod model;
mod settings;

pub use model::{EncoderModel, Reading, SampleError};
pub use settings::{EncoderSettings, PerJoint, SettingsError, VelocitySource};
