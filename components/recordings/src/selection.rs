//! The part of a file to read.

use crate::error::RecordingError;
use crate::time::Clock;

/// The part of a file to read; [`Default`] selects all position channels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Field whose numbers are the channels, such as `velocity`. For a state buffer printed as JSON it is the
    /// field of that name, for a table the columns `NAME_velocity`. Default: `position` if present, otherwise
    /// all numbers.
    pub field: Option<String>,
    /// Names of the channels to keep, in this order; a name that ends in `*` matches a prefix. Default: all.
    pub channels: Vec<String>,
    /// Channel of an MCAP file, such as `/joint_states`. Default: the only one with numbers in the field or,
    /// of several, the only one with joint states.
    pub topic: Option<String>,
    /// Samples per second of recordings without times. Default: none, and such recordings are rejected.
    pub rate: Option<f64>,
}

impl Selection {
    /// Returns the clock of recordings without times.
    pub(crate) fn clock(&self) -> Result<Option<Clock>, RecordingError> {
        match self.rate {
            None => Ok(None),
            Some(rate) if rate > 0.0 && rate.is_finite() => Ok(Some(Clock::Rate(rate))),
            Some(value) => {
                let expected = "a positive number of samples per second";
                Err(RecordingError::OutOfRange { name: "rate", value, expected })
            }
        }
    }
}
