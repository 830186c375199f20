//! The clock that test programs and this program share.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Returns the Unix time [s].
pub(crate) fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO).as_secs_f64()
}
