//! The part of a file that is read.

use crate::error::RecordingError;
use crate::time::Clock;

/// The part of a file that is read; [`Default`] takes all channels of position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Field whose numbers are the channels, such as `velocity`: of a state buffer printed as JSON the field
    /// of that name, of a table the columns `NAME_velocity`. Default `position` where there is one, else all
    /// numbers.
    pub field: Option<String>,
    /// Names of the channels to keep, in this order; a name that ends in `*` stands for all that begin so.
    /// Default all.
    pub channels: Vec<String>,
    /// Channel of an MCAP file, such as `/joint_states`. Default: the only one with numbers in the field, of
    /// several the only one of joint states.
    pub topic: Option<String>,
    /// Samples a second of recordings that hold no time. Default none: such recordings are refused.
    pub rate: Option<f64>,
}

impl Selection {
    /// The clock of recordings without times.
    pub(crate) fn clock(&self) -> Result<Option<Clock>, RecordingError> {
        match self.rate {
            None => Ok(None),
            Some(rate) if rate > 0.0 && rate.is_finite() => Ok(Some(Clock::Rate(rate))),
            Some(value) => {
                let expected = "a positive number of samples a second";
                Err(RecordingError::OutOfRange { name: "rate", value, expected })
            }
        }
    }
}
