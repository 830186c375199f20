//! Current limit of a drive.

use crate::protocols::entries::DriveEntry;
use crate::protocols::spec::{CurrentLimit, Refusal};

/// Refuses a current limit that cannot be set in the drive, or whose torque is unknown.
pub(super) fn check(drive: &DriveEntry) -> Result<(), Refusal> {
    let all = [
        ("current_limit", drive.current_limit),
        ("torque_constant", drive.torque_constant),
        ("rated_current", drive.rated_current),
        ("full_current", drive.full_current),
        ("current_unit", drive.current_unit),
    ];
    let positive = |value: f64| value.is_finite() && value > 0.0;
    if let Some((key, Some(value))) =
        all.into_iter().find(|(_, value)| value.is_some_and(|value| !positive(value)))
    {
        return Err((
            format!("`{key}` is {value}"),
            "write a positive number: A, or N m/A of the output shaft",
        ));
    }
    let Some(limit) = drive.current_limit else { return Ok(()) };
    match drive.protocol.spec().current_limit {
        CurrentLimit::Unsupported { advice } => {
            Err((format!("`current_limit` is not supported by {:?}", drive.protocol), advice))
        }
        CurrentLimit::Settable { keys } => {
            let is_missing = |name: &str| all.iter().any(|(key, value)| *key == name && value.is_none());
            match keys.iter().find(|(key, _)| is_missing(key)) {
                Some((key, advice)) => Err((format!("`current_limit` requires `{key}`"), advice)),
                None => drive.protocol.definition().check_current(drive, limit),
            }
        }
    }
}
