//! Joint sensors: errors, latency and lost readings between the true joint state and the measured one.

mod model;
mod settings;

pub use model::{EncoderModel, Reading, SampleError, StateTimes};
pub use settings::{Differentiation, EncoderSettings, JointErrors, SettingsError};
