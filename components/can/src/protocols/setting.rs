//! Settings of drives that differ from the table.

use crate::drive::PositionReference;

/// Setting of a drive that differs from the drive table.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum WrongSetting {
    /// The watchdog time \[ns\] differs; `None` means that the drive's watchdog is off.
    #[error("the watchdog is {}, but the drive table has {} ms", ms(*.found), *.expected as f64 / 1e6)]
    Watchdog {
        /// Value in the drive.
        found: Option<u64>,
        /// Value in the table.
        expected: u64,
    },
    /// The limit of a range differs.
    #[error("{register} is {found}, but the drive table has {expected}")]
    Range {
        /// Name of the register.
        register: &'static str,
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// The drive is not in the control mode that the adapter requires.
    #[error("the control mode ({register}) is {found}, expected {expected}")]
    ControlMode {
        /// Value in the drive.
        found: i64,
        /// Value that the adapter requires.
        expected: i64,
        /// Register or object that contains the mode.
        register: &'static str,
    },
    /// The joint is outside of its range \[rad or m\], so the drive is not enabled.
    #[error(
        "the joint reads {found:.3} rad or m, outside its range of {lower:.3} to {upper:.3} (margin {margin}): {}",
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
    /// The current limit differs, in units of the drive's register.
    #[error(
        "the current limit is {found}, but the drive table has {expected}, in units of the drive's register"
    )]
    CurrentLimit {
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// The homing offset of a servo \[steps\] differs.
    #[error("the homing offset is {found} steps, but the drive table has {expected}")]
    HomingOffset {
        /// Value in the servo.
        found: i32,
        /// Value in the table.
        expected: i32,
    },
    /// The rated torque \[N m\], the base of torques in thousandths, differs.
    #[error("the rated torque is {found} N m, but the drive table has {expected} N m")]
    RatedTorque {
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// The rated current \[A\], the base of currents in thousandths, differs.
    #[error("the rated current is {found} A, but the drive table has {expected} A")]
    RatedCurrent {
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// The position reference is insufficient.
    #[error(
        "the position reference is {found}, expected {expected}: give the joint a `homing`, set the position in the drive (`d exact`, `d nearest`), or write `reference`"
    )]
    Reference {
        /// Reference of the drive.
        found: PositionReference,
        /// Reference that the table requires.
        expected: PositionReference,
    },
    /// A servo is not in the operating mode for position control.
    #[error("the operating mode is {found}, expected {expected} (position control)")]
    OperatingMode {
        /// Value in the servo.
        found: u8,
        /// Mode in which the servo follows positions.
        expected: u8,
    },
    /// The limits of a servo's goals \[rad\] are narrower than the table's range of positions.
    #[error("the drive limits its goals to {:.3} to {:.3} rad, but the drive table has positions up to {expected} rad in both directions", .found[0], .found[1])]
    Goals {
        /// Limits in the servo.
        found: [f64; 2],
        /// Largest position in the table.
        expected: f64,
    },
    /// Read-only process data have a different mapping.
    #[error(
        "the object 0x{index:04X} maps 0x{found:08X}, expected 0x{expected:08X}, but the data sheet declares the object read-only"
    )]
    Mapping {
        /// Index of the object.
        index: u16,
        /// Mapping in the drive.
        found: u32,
        /// Mapping that the adapter requires.
        expected: u32,
    },
    /// The drive refuses or lacks an object.
    #[error("the drive refuses the object 0x{index:04X}: code 0x{code:08X}")]
    Refused {
        /// Index of the object.
        index: u16,
        /// Abort code of the drive.
        code: u32,
    },
}

/// Returns advice on how to correct a position outside of the joint's range.
fn correction(turns: Option<i32>) -> String {
    let always =
        "move the joint into its range, give the drive a `homing`, or correct `offset` in the drive table";
    match turns {
        Some(turns) => {
            format!(
                "{always}; if the reading is off by whole turns, write `turns = {turns}` in the drive table"
            )
        }
        None => always.to_string(),
    }
}

fn ms(watchdog: Option<u64>) -> String {
    watchdog.map_or_else(|| "off".to_string(), |ns| format!("{} ms", ns as f64 / 1e6))
}
