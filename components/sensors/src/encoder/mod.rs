//! Joint sensors: errors, latency and drop-outs between the true and the measured joint state.

mod model;
mod settings;

pub use model::{EncoderModel, Reading, SampleError, StateTimes};
pub use settings::{Differentiation, EncoderSettings, JointErrors, SettingsError};
