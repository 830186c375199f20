//! Current limit of a drive, in its own units.

use super::refusal::Refusal;
use super::{DriveEntry, Protocol};

/// Largest number in a Dynamixel's current register.
const MOST_UNITS: f64 = 2047.0;

impl DriveEntry {
    /// Torque at the current limit, N m, if the table has one.
    pub(super) fn torque_of_current(&self) -> Option<f64> {
        let limit = self.current_limit?;
        match self.protocol {
            Protocol::Cia402 => Some(limit * self.rated_torque? / self.rated_current?),
            // at standstill, the torque's share of the stall torque equals the current's share of the stall
            // current
            Protocol::Feetech => Some((limit / self.full_current?).min(1.0) * self.ranges.torque),
            _ => Some(limit * self.torque_constant?),
        }
    }

    /// Current limit in units of its register: a share of the full current for a Damiao drive, thousandths of
    /// the stall current for a Feetech, units for a Dynamixel. Never more than the table's limit.
    pub(crate) fn current_register(&self) -> Option<f64> {
        let limit = self.current_limit?;
        match self.protocol {
            Protocol::Damiao => Some(limit / self.full_current?),
            Protocol::Feetech => Some((limit / self.full_current? * 1e3 + 1e-6).floor()),
            Protocol::Dynamixel => Some((limit / self.current_unit? + 1e-6).floor()),
            _ => None,
        }
    }
}

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
    check_known(drive)?;
    let missing = |key: &str, advice| Err((format!("`current_limit` without `{key}`"), advice));
    let register = drive.current_register();
    match drive.protocol {
        Protocol::Odrive | Protocol::Damiao | Protocol::Dynamixel if drive.torque_constant.is_none() => {
            missing(
                "torque_constant",
                "write the N m/A of the output shaft: 8.27 / KV of the motor, times its gear",
            )
        }
        Protocol::Cia402 if drive.rated_current.is_none() => missing(
            "rated_current",
            "write object 0x6075 in A, or an `eds` that has it: 0x6073 is in thousandths of it",
        ),
        Protocol::Cia402 if drive.rated_current.is_some_and(|rated| limit / rated > 65.535) => Err((
            format!(
                "a current of {limit} A, which is more than 65 times the rated {} A",
                drive.rated_current.unwrap_or_default()
            ),
            "write it in A",
        )),
        Protocol::Damiao if drive.full_current.is_none() => missing(
            "full_current",
            "write the largest current of the drive by its data sheet, A: register 3 is a share of it",
        ),
        Protocol::Feetech if drive.full_current.is_none() => missing(
            "full_current",
            "write the stall current of the servo at its voltage, A: register 48 is in thousandths of it",
        ),
        Protocol::Dynamixel if drive.current_unit.is_none() => missing(
            "current_unit",
            "write the unit of register 102, A: 0.00269 of XM, XH and XW, 0.001 of XL330 and XC330",
        ),
        Protocol::Damiao if register.is_some_and(|share| share >= 1.0) => Err((
            format!("a current of {limit} A, which the drive does not reach"),
            "write less than `full_current`: register 3 is a share below 1",
        )),
        Protocol::Feetech if register.is_some_and(|number| !(1.0..=1e3).contains(&number)) => Err((
            format!("a current of {limit} A, of a servo with {} A", drive.full_current.unwrap_or_default()),
            "write a thousandth of `full_current` or more, and no more than it",
        )),
        Protocol::Dynamixel if register.is_some_and(|number| !(1.0..=MOST_UNITS).contains(&number)) => Err((
            format!("a current of {limit} A, which is {} units", register.unwrap_or_default()),
            "write 1 to 2047 units of `current_unit`, and no more than register 38 of the servo",
        )),
        _ => Ok(()),
    }
}

/// Refuses a limit for a drive without such a setting.
fn check_known(drive: &DriveEntry) -> Result<(), Refusal> {
    let advice = match drive.protocol {
        Protocol::Moteus => "leave it out: moteus gets `ranges.torque` with each command",
        Protocol::MiniCheetah | Protocol::MiniCheetahVoltage | Protocol::Cubemars | Protocol::Robstride => {
            "leave it out, and set the limit in the drive with its maker's tool: the frames of this protocol have none"
        }
        _ => return Ok(()),
    };
    Err((format!("`current_limit`, which {:?} does not support", drive.protocol), advice))
}
