//! Settings of drives that differ from the table.

use crate::damiao::Register;
use crate::moteus::Home;

/// A setting of a drive that differs from the table.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum WrongSetting {
    /// The watchdog, ns; `None` for off.
    #[error("its watchdog is {}, the table says {} ms", ms(*.found), *.expected as f64 / 1e6)]
    Watchdog {
        /// Value in the drive.
        found: Option<u64>,
        /// Value in the table.
        expected: u64,
    },
    /// The end of a range.
    #[error("its {register:?} is {found}, the table says {expected}")]
    Range {
        /// The register.
        register: Register,
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// The control mode.
    #[error("its control mode ({register}) is {found}, expected {expected}")]
    ControlMode {
        /// The drive's.
        found: i64,
        /// The adapter's.
        expected: i64,
        /// Register or object that has it.
        register: &'static str,
    },
    /// The position before it is enabled, rad or m.
    #[error(
        "it reads {found:.3}, the joint has {lower:.3} to {upper:.3} (and a margin of {margin}): {}",
        correction(*turns)
    )]
    Position {
        /// The joint position that follows from its reading.
        found: f64,
        /// The joint's lowest position.
        lower: f64,
        /// The joint's highest position.
        upper: f64,
        /// Distance beyond both that is allowed.
        margin: f64,
        /// `turns` of the drive table with which the reading would be in the range, if there are any.
        turns: Option<i32>,
    },
    /// The limit of the current, in the units of the drive's register.
    #[error("its limit of current is {found}, the table says {expected}, in the units of its register")]
    CurrentLimit {
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// The homing offset of a servo, steps.
    #[error("its homing offset is {found} steps, the table says {expected}")]
    HomingOffset {
        /// Value in the servo.
        found: i32,
        /// Value in the table.
        expected: i32,
    },
    /// The rated torque, of which torques are thousandths, N m.
    #[error("its rated torque is {found} N m, the table says {expected}")]
    RatedTorque {
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// The rated current, of which currents are thousandths, A.
    #[error("its rated current is {found} A, the table says {expected}")]
    RatedCurrent {
        /// Value in the drive.
        found: f64,
        /// Value in the table.
        expected: f64,
    },
    /// The place from which a moteus counts its position.
    #[error(
        "its position is counted from {found}, the table needs one counted from {expected}: give the joint a `homing`, tell the drive where it stands (`d exact`, `d nearest`), or write `reference`"
    )]
    Reference {
        /// Value in the drive.
        found: Home,
        /// Value in the table.
        expected: Home,
    },
    /// The operating mode of a servo.
    #[error("its operating mode is {found}, expected {expected}, that of positions")]
    OperatingMode {
        /// Value in the servo.
        found: u8,
        /// Mode of positions.
        expected: u8,
    },
    /// The limits of a servo's goals, rad.
    #[error("its goals end at {:.3} and {:.3} rad, the table has positions up to {expected}", .found[0], .found[1])]
    Goals {
        /// Values in the servo.
        found: [f64; 2],
        /// The largest position of the table.
        expected: f64,
    },
    /// Process data whose mapping cannot be written, and is another one.
    #[error(
        "the object 0x{index:04X} maps 0x{found:08X}, expected 0x{expected:08X}, and its data sheet says that it cannot be written"
    )]
    Mapping {
        /// The index of the object.
        index: u16,
        /// Value in the drive.
        found: u32,
        /// Value of the adapter.
        expected: u32,
    },
    /// An object that the drive does not let be set, or does not have.
    #[error("it refuses the object 0x{index:04X}: code 0x{code:08X}")]
    Refused {
        /// The index of the object.
        index: u16,
        /// The code of the drive.
        code: u32,
    },
}

/// The correction of a position outside of the joint's range.
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
