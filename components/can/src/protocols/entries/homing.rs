//! Keys of a homing in the drive table.

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

/// The homing of a drive. Velocities, efforts and positions are joint quantities.
///
/// ```
/// use motorium_can::{HomingBy, Table};
///
/// let text = r#"
/// [[bus]]
/// name    = "can0"
/// bitrate = 1_000_000
///
/// [[drive]]
/// joint    = "elbow"
/// bus      = "can0"
/// protocol = "damiao"
/// node     = 1
/// watchdog = "20 ms"
/// ranges   = { position = 12.5, velocity = 30.0, torque = 10.0 }
/// homing   = { by = "stop", velocity = -0.3, effort = 1.0, position = -1.6 }
/// "#;
/// let homing = Table::parse(text)?.drives[0].homing.clone().ok_or("it has one")?;
/// assert_eq!((homing.by, homing.timeout().as_secs()), (HomingBy::Stop, 20));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HomingEntry {
    /// How the reference position is found. "drive": the drive runs its own homing procedure (ODrive, CiA
    /// 402), or a servo applies the offset stored in it. "stop": the adapter moves the joint slowly against
    /// its mechanical stop (MIT family, moteus, and drives commanded by torque).
    pub by: HomingBy,
    /// Joints with a lower number are homed before those with a higher one; joints with the same number are
    /// homed together. Default 0.
    pub order: Option<u8>,
    /// Time after which an unfinished homing fails. Default 20 s.
    pub timeout: Option<TimeSpan>,
    /// The procedure of an ODrive: "endstop" (axis state 11) or "index" (axis state 6). Default "endstop".
    pub procedure: Option<HomingProcedure>,
    /// The method, object 0x6098. Required for CiA 402.
    pub method: Option<i8>,
    /// Velocity towards the mark, rad/s or m/s. For CiA 402, a positive number (object 0x6099:01). For
    /// "stop", a number with the sign of the direction to the stop. Required for CiA 402 and for "stop".
    pub velocity: Option<f64>,
    /// Velocity at the mark, object 0x6099:02, rad/s or m/s. Required for CiA 402.
    pub creep_velocity: Option<f64>,
    /// Acceleration, object 0x609A, rad/s2 or m/s2. Required for CiA 402.
    pub acceleration: Option<f64>,
    /// Expected homing offset of a servo, steps. It is compared with the offset stored in the servo before
    /// the servo is enabled. Required for servos.
    pub steps: Option<i32>,
    /// Effort against the stop, N m or N. Required for "stop".
    pub effort: Option<f64>,
    /// Position of the joint at its stop, rad or m. Required for "stop".
    pub position: Option<f64>,
    /// Distance by which the joint moves away from the stop again, rad or m. Default 0.05. Only for "stop".
    pub back_off: Option<f64>,
    /// Largest energy with which the joint may hit its stop, J, computed with the inertia of the robot model.
    /// Default 0.1. Only for "stop".
    pub energy: Option<f64>,
}

/// The method that finds the mark of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HomingBy {
    /// The drive, with its own procedure.
    Drive,
    /// The adapter, at the mechanical stop of the joint.
    Stop,
}

/// A procedure of an ODrive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HomingProcedure {
    /// Moves to the switch at an end of the range.
    #[default]
    Endstop,
    /// Moves to the index of the encoder.
    Index,
}

/// Default timeout of a homing.
const TIMEOUT: TimeSpan = TimeSpan { ns: 20_000_000_000 };
/// Default energy limit at a stop, J: about the energy of 0.5 kg m2 at 0.6 rad/s.
const ENERGY: f64 = 0.1;
/// Default back-off distance from a stop, rad or m.
const BACK_OFF: f64 = 0.05;

impl HomingEntry {
    /// Returns the time after which an unfinished homing fails.
    pub fn timeout(&self) -> core::time::Duration {
        self.timeout.unwrap_or(TIMEOUT).into()
    }

    /// Returns the distance by which the joint moves away from its stop, rad or m.
    pub fn back_off(&self) -> f64 {
        self.back_off.unwrap_or(BACK_OFF)
    }

    /// Returns the largest energy with which the joint may hit its stop, J.
    pub fn energy(&self) -> f64 {
        self.energy.unwrap_or(ENERGY)
    }

    /// Returns the joint position at the end of a homing by "stop", after backing off, rad or m. `None` for a
    /// homing by "drive".
    pub fn end(&self) -> Option<f64> {
        Some(self.position? - self.velocity?.signum() * self.back_off())
    }
}
