//! What a robot's joint sensors make of the true joint state.

mod joint_encoder;
mod settings;

pub use joint_encoder::{JointEncoder, Reading, SampleError};
pub use settings::{EncoderSettings, PerJoint, SettingsError, VelocitySource};
