//! Selection of the channels to read from a file.

use crate::error::RecordingError;
use crate::time::Clock;

/// A selection of the channels to read from a file. [`Default`] selects all position channels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Field whose numbers are the channels, such as `velocity`. In a table, `velocity` selects the columns
    /// `NAME_velocity`; in a state buffer printed as JSON, the field `velocity`. Default: `position` if
    /// present, otherwise all numbers.
    pub field: Option<String>,
    /// Names of the channels to keep, in this order; a name that ends in `*` matches a prefix. Default: all.
    pub channels: Vec<String>,
    /// Name of an MCAP channel, such as `/joint_states`. Default: the only channel with numbers in the field
    /// or, if there are several, the only channel with joint states.
    pub topic: Option<String>,
    /// Samples per second of recordings without times. Default: no rate; recordings without times are
    /// rejected.
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
