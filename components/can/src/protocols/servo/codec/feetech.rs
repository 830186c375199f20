//! Registers of Feetech STS servos, such as the STS3215: position servos with the packets of
//! [`servo`](crate::servo).
//!
//! A servo follows its goal position with an internal loop, whose gains are stored in the servo. A turn has
//! 4096 steps, and the middle position is step 2048. Words are little-endian with a sign bit. These servos
//! have no watchdog: without commands, a servo continues to hold its last goal.

use core::f64::consts::TAU;

use super::steps;
pub use super::steps::{MIDDLE, TURN};
use crate::drive::Fault;
use crate::frame::DecodeError;
use crate::protocols::dialogue::Layout;
use crate::servo::Protocol;

/// First register of the goal limits, two words: the lowest goal, then the highest.
pub const ANGLE_LIMITS: u8 = 9;
/// Register of the homing offset, a word of 11 bits with a sign bit, steps.
pub const HOMING_OFFSET: u8 = 31;
/// Register of the operating mode: 0 for positions.
pub const OPERATING_MODE: u8 = 33;
/// Operating mode for positions.
pub const POSITIONS: u8 = 0;
/// First register of the state: torque on or off.
pub const TORQUE_ENABLE: u8 = 40;
/// Register of the goal position, a word.
pub const GOAL_POSITION: u8 = 42;
/// Register of the largest torque, a word in thousandths of the stall torque; its value is lost at power-off.
pub const TORQUE_LIMIT: u8 = 48;
/// Number of bytes in a state, starting at [`TORQUE_ENABLE`].
pub const STATE_BYTES: u8 = 26;
/// Number of bytes from [`TORQUE_ENABLE`] to the end of the goal registers: torque, acceleration, position,
/// time, speed.
pub const ENABLE_BYTES: u8 = 8;

/// Registers written and read in a cycle.
pub(crate) static LAYOUT: Layout = Layout {
    protocol: Protocol::One,
    written: &[
        (TORQUE_ENABLE as u16, 1),
        (TORQUE_ENABLE as u16, ENABLE_BYTES),
        (GOAL_POSITION as u16, 2),
        (TORQUE_LIMIT as u16, 2),
    ],
    read: &[
        (OPERATING_MODE as u16, 1),
        (ANGLE_LIMITS as u16, 4),
        (HOMING_OFFSET as u16, 2),
        (TORQUE_LIMIT as u16, 2),
        (TORQUE_ENABLE as u16, STATE_BYTES),
    ],
};

/// Offsets in a state.
const POSITION: usize = 16;
const SPEED: usize = 18;
const LOAD: usize = 20;
const VOLTAGE: usize = 22;
const TEMPERATURE: usize = 23;
const STATUS: usize = 25;

/// State of a servo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// `true` if the servo holds its goal.
    pub is_enabled: bool,
    /// Position of the shaft, rad.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Load as a fraction of full effort, -1 to 1.
    pub load: f64,
    /// Supply voltage, V.
    pub voltage: f64,
    /// Temperature, degrees Celsius.
    pub temperature: f64,
    /// Error flags; 0 for none.
    pub status: u8,
}

/// Returns the step nearest to a shaft position \[rad\], 0 to 4095.
///
/// ```
/// use motorium_can::feetech::{position, step};
///
/// assert_eq!((step(0.0), step(core::f64::consts::FRAC_PI_2), step(9.0)), (2048, 3072, 4095));
/// assert!((position(step(0.7)) - 0.7).abs() < 0.8e-3);
/// ```
pub fn step(position: f64) -> u16 {
    steps::nearest(position)
}

/// Returns the shaft position of a step, rad.
pub fn position(step: u16) -> f64 {
    steps::position(step.into())
}

/// Decodes the homing offset in a register word, steps.
pub fn homing_offset(word: u16) -> i32 {
    signed(word, 11) as i32
}

/// Decodes a word with a sign bit.
fn signed(word: u16, sign: u32) -> f64 {
    let size = f64::from(word & ((1 << sign) - 1));
    if word >> sign & 1 == 1 { -size } else { size }
}

/// Encodes a number as a word with a sign bit.
fn with_sign(number: f64, sign: u32) -> u16 {
    let size = (number.abs() + 0.5).min(f64::from((1_u16 << sign) - 1)) as u16;
    if number < 0.0 && size > 0 { size | 1 << sign } else { size }
}

impl State {
    /// Decodes the state in the registers from [`TORQUE_ENABLE`] on.
    ///
    /// # Errors
    /// Returns an error if the number of registers is wrong, if torque is neither on nor off, or if the
    /// position is beyond one turn.
    pub fn decode(data: &[u8]) -> Result<Self, DecodeError> {
        let (found, expected) = (data.len(), usize::from(STATE_BYTES));
        if found != expected {
            return Err(DecodeError::Length { found, expected });
        }
        let word = |at: usize| u16::from_le_bytes([data[at], data[at + 1]]);
        let is_enabled = match data[0] {
            0 => false,
            1 => true,
            found => return Err(DecodeError::Field { field: "the torque switch", found: found.into() }),
        };
        let place = word(POSITION);
        if f64::from(place) >= TURN {
            return Err(DecodeError::Field { field: "the position", found: place.into() });
        }
        if word(LOAD) & 0xf800 != 0 {
            return Err(DecodeError::Field { field: "the load", found: word(LOAD).into() });
        }
        Ok(Self {
            is_enabled,
            position: position(place),
            velocity: signed(word(SPEED), 15) / TURN * TAU,
            load: signed(word(LOAD), 10) * 1e-3,
            voltage: f64::from(data[VOLTAGE]) * 0.1,
            temperature: data[TEMPERATURE].into(),
            status: data[STATUS],
        })
    }

    /// Writes the measured values into a servo's registers from [`TORQUE_ENABLE`] on.
    pub fn encode(&self, data: &mut [u8; STATE_BYTES as usize]) {
        data[0] = self.is_enabled.into();
        let mut put = |at: usize, word: u16| data[at..at + 2].copy_from_slice(&word.to_le_bytes());
        put(POSITION, step(self.position));
        put(SPEED, with_sign(self.velocity / TAU * TURN, 15));
        put(LOAD, with_sign(self.load * 1e3, 10));
        data[VOLTAGE] = (self.voltage * 10.0 + 0.5).clamp(0.0, 255.0) as u8;
        data[TEMPERATURE] = (self.temperature + 0.5).clamp(0.0, 255.0) as u8;
        data[STATUS] = self.status;
    }

    /// Returns the most serious fault among the error flags; `None` without a fault.
    pub fn fault(&self) -> Option<Fault> {
        let has = |flag: u8| self.status & flag != 0;
        match () {
            () if has(OVERLOAD) => Some(Fault::Overload),
            () if has(OVERCURRENT) => Some(Fault::OverCurrent),
            () if has(OVERHEATED) => Some(Fault::HotMotor),
            () if has(SENSOR) => Some(Fault::Encoder),
            () if has(WRONG_VOLTAGE) => Some(Fault::UnderVoltage),
            () if self.status != 0 => Some(Fault::Other(self.status.into())),
            () => None,
        }
    }
}

/// Error flag: the supply voltage is outside of its limits.
pub const WRONG_VOLTAGE: u8 = 0x01;
/// Error flag: the encoder failed.
pub const SENSOR: u8 = 0x02;
/// Error flag: overheated.
pub const OVERHEATED: u8 = 0x04;
/// Error flag: over-current.
pub const OVERCURRENT: u8 = 0x08;
/// Error flag: overload, that is, full effort for too long.
pub const OVERLOAD: u8 = 0x20;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_survives_its_registers_within_their_resolution() {
        for (position, velocity, load) in [(0.0, 0.0, 0.0), (1.2, -2.5, 0.731), (-3.0, 4.0, -1.0)] {
            let state = State {
                is_enabled: true,
                position,
                velocity,
                load,
                voltage: 7.4,
                temperature: 31.0,
                status: OVERHEATED,
            };
            let mut data = [0; STATE_BYTES as usize];
            state.encode(&mut data);
            let read = State::decode(&data).unwrap();
            assert!((read.position - position).abs() <= TAU / TURN / 2.0, "{read:?}");
            assert!((read.velocity - velocity).abs() <= TAU / TURN / 2.0, "{read:?}");
            assert!((read.load - load).abs() <= 0.5e-3, "{read:?}");
            assert_eq!((read.temperature, read.fault()), (31.0, Some(Fault::HotMotor)));
        }
    }

    #[test]
    fn registers_that_hold_no_state_are_refused() {
        let mut data = [0; STATE_BYTES as usize];
        data[0] = 128;
        assert_eq!(State::decode(&data), Err(DecodeError::Field { field: "the torque switch", found: 128 }));
        data[0] = 1;
        data[POSITION + 1] = 0x10;
        assert_eq!(State::decode(&data), Err(DecodeError::Field { field: "the position", found: 0x1000 }));
        assert_eq!(State::decode(&data[1..]), Err(DecodeError::Length { found: 25, expected: 26 }));
    }
}
