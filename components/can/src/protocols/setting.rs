//! Settings of drives that differ from the table.

use crate::drive::PositionReference;

/// Setting of a drive that differs from the table.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum WrongSetting {
    /// Watchdog, ns; `None` for off.
    #[error("its watchdog is {}, the table says {} ms", ms(*.found), *.expected as f64 / 1e6)]
    Watchdog {
        /// Value in the drive.
        found: Option<u64>,
        /// Value in the table.
        expected: u64,
    },
    /// Limit of a range.
    #[error("its {register} is {found}, the table says {expected}")]
    Range {
        /// Register.
        register: &'static str,
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// Control mode.
    #[error("its control mode ({register}) is {found}, expected {expected}")]
    ControlMode {
        /// Value in the drive.
        found: i64,
        /// Value that the adapter requires.
        expected: i64,
        /// Register or object that holds the mode.
        register: &'static str,
    },
    /// Position before the drive is enabled, rad or m.
    #[error(
        "it reads {found:.3}, outside the range of the joint, {lower:.3} to {upper:.3} (margin {margin}): {}",
        correction(*turns)
    )]
    Position {
        /// Joint position computed from the reading.
        found: f64,
        /// Lowest position of the joint.
        lower: f64,
        /// Highest position of the joint.
        upper: f64,
        /// Accepted distance beyond both limits.
        margin: f64,
        /// Value of `turns` in the drive table that would shift the reading into the range, if there is one.
        turns: Option<i32>,
    },
    /// Current limit, in units of the drive's register.
    #[error("its current limit is {found}, the table says {expected}, in units of its register")]
    CurrentLimit {
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// Homing offset of a servo, steps.
    #[error("its homing offset is {found} steps, the table says {expected}")]
    HomingOffset {
        /// Value in the servo.
        found: i32,
        /// Value in the table.
        expected: i32,
    },
    /// Rated torque, the base of torques in thousandths, N m.
    #[error("its rated torque is {found} N m, the table says {expected}")]
    RatedTorque {
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// Rated current, the base of currents in thousandths, A.
    #[error("its rated current is {found} A, the table says {expected}")]
    RatedCurrent {
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// Position reference.
    #[error(
        "its position reference is {found}, expected {expected}: give the joint a `homing`, set the position in the drive (`d exact`, `d nearest`), or write `reference`"
    )]
    Reference {
        /// Reference of the drive.
        found: PositionReference,
        /// Reference that the table requires.
        expected: PositionReference,
    },
    /// Operating mode of a servo.
    #[error("its operating mode is {found}, expected {expected} (position control)")]
    OperatingMode {
        /// Value in the servo.
        found: u8,
        /// Mode in which the servo follows positions.
        expected: u8,
    },
    /// Position limits of a servo's goals, rad.
    #[error("its goals end at {:.3} and {:.3} rad, the table has positions up to {expected}", .found[0], .found[1])]
    Goals {
        /// Limits in the servo.
        found: [f64; 2],
        /// Largest position of the table.
        expected: f64,
    },
    /// Read-only process data with a different mapping.
    #[error(
        "the object 0x{index:04X} maps 0x{found:08X}, expected 0x{expected:08X}, but its data sheet declares it read-only"
    )]
    Mapping {
        /// Index of the object.
        index: u16,
        /// Mapping in the drive.
        found: u32,
        /// Mapping that the adapter requires.
        expected: u32,
    },
    /// An object that the drive refuses or lacks.
    #[error("it refuses the object 0x{index:04X}: code 0x{code:08X}")]
    Refused {
        /// Index of the object.
        index: u16,
        /// Abort code of the drive.
        code: u32,
    },
}

/// Advice on how to correct a position outside of the joint's range.
fn correction(turns: Option<i32>) -> String {
    let always =
        "move the joint into its range, give the drive a `homing`, or correct `offset` in the drive table";
    match turns {
        Some(turns) => format!("{always}; if it is whole turns away, write `turns = {turns}` there"),
        None => always.to_string(),
    }
}

fn ms(watchdog: Option<u64>) -> String {
    watchdog.map_or_else(|| "off".to_string(), |ns| format!("{} ms", ns as f64 / 1e6))
}
