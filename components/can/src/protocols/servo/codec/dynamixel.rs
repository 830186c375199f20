//! Registers of the Dynamixel X series, such as the XL330, XL430 and XM540: position servos with protocol
//! 2.0.
//!
//! A servo follows its goal position with an internal loop. A turn has 4096 steps, and the middle position is
//! step 2048. Numbers are little-endian and in two's complement. The bus watchdog stops the servo if no
//! packet arrives within its time; goals are then refused until the watchdog is set again.

use core::f64::consts::TAU;

use super::steps;
pub use super::steps::{MIDDLE, TURN};
use crate::frame::DecodeError;
use crate::protocols::dialogue::Layout;
use crate::servo::Protocol;

/// Register of the operating mode.
pub const OPERATING_MODE: u16 = 11;
/// Operating mode for positions within a turn.
pub const POSITIONS: u8 = 3;
/// Operating mode for positions with a current limit.
pub const POSITIONS_BY_CURRENT: u8 = 5;
/// Register of the homing offset, four bytes, steps.
pub const HOMING_OFFSET: u16 = 20;
/// Register of the largest current that [`GOAL_CURRENT`] accepts, two bytes.
pub const CURRENT_LIMIT: u16 = 38;
/// Register of the largest current in the mode [`POSITIONS_BY_CURRENT`], two bytes; its value is lost at
/// power-off.
pub const GOAL_CURRENT: u16 = 102;
/// First register of the goal limits, four bytes each: the highest goal, then the lowest.
pub const POSITION_LIMITS: u16 = 48;
/// Register that switches torque on.
pub const TORQUE_ENABLE: u16 = 64;
/// Register of the bus watchdog, in units of [`WATCHDOG_UNIT_NS`]. 0 is off, and [`WATCHDOG_EXPIRED`] means
/// that the watchdog has stopped the servo.
pub const BUS_WATCHDOG: u16 = 98;
/// Unit of the bus watchdog, ns.
pub const WATCHDOG_UNIT_NS: u64 = 20_000_000;
/// Maximum time of the bus watchdog, units.
pub const LONGEST_WATCHDOG: u64 = 127;
/// Value of the bus watchdog after it has stopped the servo: -1.
pub const WATCHDOG_EXPIRED: u8 = 0xff;
/// Register of the goal position, four bytes.
pub const GOAL_POSITION: u16 = 116;
/// First register of the state, which contains the current or the load.
pub const STATE: u16 = 126;
/// Number of bytes in a state: load, velocity, position, velocity and position trajectory, voltage,
/// temperature.
pub const STATE_BYTES: u8 = 21;
/// Flag in each answer: the servo has a hardware error and has disabled itself.
pub const ALERT: u8 = 0x80;

/// Unit of velocities, 0.229 turns per minute, in rad/s.
pub const VELOCITY_UNIT: f64 = 0.229 * TAU / 60.0;

/// Registers written and read in a cycle.
pub(crate) static LAYOUT: Layout = Layout {
    protocol: Protocol::Two,
    written: &[
        (TORQUE_ENABLE, 1),
        (BUS_WATCHDOG, 1),
        (BUS_WATCHDOG, 1),
        (GOAL_POSITION, 4),
        (TORQUE_ENABLE, 1),
        (GOAL_CURRENT, 2),
    ],
    read: &[
        (OPERATING_MODE, 1),
        (POSITION_LIMITS, 8),
        (BUS_WATCHDOG, 1),
        (HOMING_OFFSET, 4),
        (GOAL_CURRENT, 2),
        (STATE, STATE_BYTES),
    ],
};

/// Offsets in a state.
const LOAD: usize = 0;
const VELOCITY: usize = 2;
const POSITION: usize = 6;
const VOLTAGE: usize = 18;
const TEMPERATURE: usize = 20;

/// State of a servo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Position of the shaft, rad.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Raw current in units of about 1 mA, or raw load in thousandths of full effort, depending on the model.
    pub load: i16,
    /// Supply voltage, V.
    pub voltage: f64,
    /// Temperature, degrees Celsius.
    pub temperature: f64,
}

/// Returns the step nearest to a shaft position \[rad\], 0 to 4095.
///
/// ```
/// use motorium_can::dynamixel::{position, step};
///
/// assert_eq!((step(0.0), step(-core::f64::consts::FRAC_PI_2), step(9.0)), (2048, 1024, 4095));
/// assert!((position(2148) - 0.1534).abs() < 1e-4);
/// ```
pub fn step(position: f64) -> i32 {
    steps::nearest(position).into()
}

/// Returns the shaft position of a step, rad. A shaft turned by hand may be beyond one turn.
pub fn position(step: i32) -> f64 {
    steps::position(step)
}

impl State {
    /// Decodes the state in the registers from [`STATE`] on.
    ///
    /// # Errors
    /// Returns an error if the number of registers is wrong, or if the position is beyond 256 turns.
    pub fn decode(data: &[u8]) -> Result<Self, DecodeError> {
        let (found, expected) = (data.len(), usize::from(STATE_BYTES));
        if found != expected {
            return Err(DecodeError::Length { found, expected });
        }
        let word = |at: usize| u16::from_le_bytes([data[at], data[at + 1]]);
        let long = |at: usize| i32::from_le_bytes([data[at], data[at + 1], data[at + 2], data[at + 3]]);
        let place = long(POSITION);
        // the limit of extended positions according to the manual
        if place.unsigned_abs() > 256 * TURN as u32 {
            return Err(DecodeError::Field { field: "the position", found: place as u32 });
        }
        Ok(Self {
            position: position(place),
            velocity: f64::from(long(VELOCITY)) * VELOCITY_UNIT,
            load: word(LOAD) as i16,
            voltage: f64::from(word(VOLTAGE)) * 0.1,
            temperature: data[TEMPERATURE].into(),
        })
    }

    /// Writes the state into a servo's registers from [`STATE`] on.
    pub fn encode(&self, data: &mut [u8; STATE_BYTES as usize]) {
        let nearest = |x: f64| if x < 0.0 { (x - 0.5) as i32 } else { (x + 0.5) as i32 };
        data[LOAD..LOAD + 2].copy_from_slice(&self.load.to_le_bytes());
        data[VELOCITY..VELOCITY + 4].copy_from_slice(&nearest(self.velocity / VELOCITY_UNIT).to_le_bytes());
        let place = nearest(MIDDLE + self.position / TAU * TURN);
        data[POSITION..POSITION + 4].copy_from_slice(&place.to_le_bytes());
        let volts = (self.voltage * 10.0 + 0.5) as u16;
        data[VOLTAGE..VOLTAGE + 2].copy_from_slice(&volts.to_le_bytes());
        data[TEMPERATURE] = (self.temperature + 0.5).clamp(0.0, 255.0) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_survives_its_registers_within_their_resolution() {
        for (position, velocity, load) in [(0.0, 0.0, 0), (1.2, -2.5, 731), (-7.0, 4.0, -1000)] {
            let state = State { position, velocity, load, voltage: 12.1, temperature: 31.0 };
            let mut data = [0; STATE_BYTES as usize];
            state.encode(&mut data);
            let read = State::decode(&data).unwrap();
            assert!((read.position - position).abs() <= TAU / TURN / 2.0, "{read:?}");
            assert!((read.velocity - velocity).abs() <= VELOCITY_UNIT / 2.0, "{read:?}");
            assert_eq!((read.load, read.temperature), (load, 31.0));
            assert!((read.voltage - 12.1).abs() < 1e-9);
        }
    }

    #[test]
    fn registers_that_hold_no_state_are_refused() {
        let mut data = [0; STATE_BYTES as usize];
        data[POSITION + 3] = 0x7f;
        assert_eq!(
            State::decode(&data),
            Err(DecodeError::Field { field: "the position", found: 0x7f00_0000 })
        );
        data[POSITION + 3] = 0x80;
        assert!(State::decode(&data).is_err());
        assert_eq!(State::decode(&data[1..]), Err(DecodeError::Length { found: 20, expected: 21 }));
    }
}
