//! CANSimple, the protocol of ODrive drives.
//!
//! The 11-bit identifier is `node << 5 | command`. Numbers are little-endian, and positions are in turns of
//! the motor. The drive sends heartbeats and encoder estimates unsolicited, at configured rates. The messages
//! follow the published database `odrive-cansimple.dbc` of firmware 0.5.6.

use core::f64::consts::TAU;

use crate::frame::{DecodeError, Frame, Id, finite};

/// Axis state, active or requested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum AxisState {
    /// Not started yet.
    Undefined = 0,
    /// Disabled.
    Idle = 1,
    /// Running the configured startup sequence.
    StartupSequence = 2,
    /// Calibrating motor and encoder.
    FullCalibration = 3,
    /// Calibrating the motor.
    MotorCalibration = 4,
    /// Searching for the encoder index.
    IndexSearch = 6,
    /// Measuring the encoder offset.
    EncoderOffset = 7,
    /// Following commands.
    ClosedLoop = 8,
    /// Spinning with an imposed phase.
    LockinSpin = 9,
    /// Finding the direction of the encoder.
    EncoderDirection = 10,
    /// Homing.
    Homing = 11,
    /// Calibrating the polarity of Hall sensors.
    HallPolarity = 12,
    /// Calibrating the phase of Hall sensors.
    HallPhase = 13,
}

impl AxisState {
    const ALL: [Self; 13] = [
        Self::Undefined,
        Self::Idle,
        Self::StartupSequence,
        Self::FullCalibration,
        Self::MotorCalibration,
        Self::IndexSearch,
        Self::EncoderOffset,
        Self::ClosedLoop,
        Self::LockinSpin,
        Self::EncoderDirection,
        Self::Homing,
        Self::HallPolarity,
        Self::HallPhase,
    ];

    fn from_code(code: u32) -> Result<Self, DecodeError> {
        let found = Self::ALL.into_iter().find(|state| *state as u32 == code);
        found.ok_or(DecodeError::Field { field: "the axis state", found: code })
    }
}

/// Controlled quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum ControlMode {
    /// Voltage.
    Voltage = 0,
    /// Torque.
    Torque = 1,
    /// Velocity.
    Velocity = 2,
    /// Position.
    Position = 3,
}

/// Mapping from an input to a setpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum InputMode {
    /// Setpoints do not change.
    Inactive = 0,
    /// The input is the setpoint.
    Passthrough = 1,
    /// The setpoint follows the input with limited acceleration.
    VelocityRamp = 2,
    /// The setpoint follows the input through a second-order filter.
    PositionFilter = 3,
}

/// Message to a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Instruction {
    /// Disables the drive immediately. The drive then reports an error.
    EmergencyStop,
    /// Requests a state of the axis.
    SetState(AxisState),
    /// Sets control mode and input mode.
    SetModes(ControlMode, InputMode),
    /// Position \[rad\], feed-forward velocity \[rad/s\] and torque \[N m\] of the motor.
    Position {
        /// Position, rad. Sent as 32-bit floating-point turns.
        position: f64,
        /// Velocity, rad/s. Sent in thousandths of a turn per second, at most 32.767.
        velocity: f64,
        /// Torque, N m. Sent in thousandths, at most 32.767.
        torque: f64,
    },
    /// Velocity \[rad/s\] and feed-forward torque \[N m\] of the motor.
    Velocity {
        /// Velocity, rad/s.
        velocity: f64,
        /// Torque, N m.
        torque: f64,
    },
    /// Torque of the motor, N m.
    Torque(f64),
    /// Limits of the drive's own loops.
    Limits {
        /// Velocity, rad/s.
        velocity: f64,
        /// Current of the motor, A.
        current: f64,
    },
    /// Clears the errors.
    ClearErrors,
}

/// Message from a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Report {
    /// Periodic message with the errors and the state of the axis.
    Heartbeat {
        /// Error flags of the axis; 0 without an error.
        error: u32,
        /// State of the axis.
        state: AxisState,
        /// Result of the last procedure: 0 for success, 1 while running. With firmware before 0.6, the motor
        /// error flag.
        result: u8,
    },
    /// Encoder estimates of the motor.
    Encoder {
        /// Position, rad.
        position: f64,
        /// Velocity, rad/s.
        velocity: f64,
    },
    /// Supply voltage \[V\] and current \[A\].
    Supply {
        /// Voltage, V.
        voltage: f64,
        /// Current, A.
        current: f64,
    },
    /// Temperatures, degrees Celsius; 0 without a thermistor.
    Temperature {
        /// Transistors.
        transistors: f64,
        /// Motor.
        motor: f64,
    },
    /// Setpoint and measurement of the motor current, A.
    Currents {
        /// Setpoint.
        target: f64,
        /// Measurement.
        measured: f64,
    },
    /// Setpoint and estimate of the torque, N m. Only sent by firmware newer than 0.5.6.
    Torques {
        /// Setpoint.
        target: f64,
        /// Estimate.
        estimate: f64,
    },
}

const HEARTBEAT: u16 = 0x01;
const ESTOP: u16 = 0x02;
const SET_STATE: u16 = 0x07;
const ENCODER: u16 = 0x09;
const SET_MODES: u16 = 0x0b;
const SET_POSITION: u16 = 0x0c;
const SET_VELOCITY: u16 = 0x0d;
const SET_TORQUE: u16 = 0x0e;
const SET_LIMITS: u16 = 0x0f;
const CURRENTS: u16 = 0x14;
const TEMPERATURE: u16 = 0x15;
const SUPPLY: u16 = 0x17;
const CLEAR_ERRORS: u16 = 0x18;
const TORQUES: u16 = 0x1c;

/// Node ID of a drive, 0 to 63.
///
/// ```
/// use motorium_can::odrive::{Instruction, Node};
///
/// let node = Node::new(3).ok_or("0 to 63")?;
/// let turn = Instruction::Position { position: core::f64::consts::TAU, velocity: 0.0, torque: -1.0 };
/// let frame = node.frame(&turn);
/// assert_eq!(format!("{frame:?}"), "0x06C#0000803F000018FC");
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node(u8);

impl Node {
    /// Drive with the lowest node ID.
    pub(crate) const FIRST: Self = Self(0);

    /// Creates a node ID; `None` above 63.
    pub fn new(node: u8) -> Option<Self> {
        (node < 64).then_some(Self(node))
    }

    /// Returns the identifier of one of the drive's messages.
    pub(crate) fn id(self, command: u16) -> Id {
        Id::Standard(u16::from(self.0) << 5 | command)
    }

    /// Returns the frame of a message to the drive.
    pub fn frame(self, instruction: &Instruction) -> Frame {
        let turns = |rad: f64| ((rad / TAU) as f32).to_le_bytes();
        let thousandths = |x: f64| ((x * 1e3).round_to_even().clamp(-32768.0, 32767.0) as i16).to_le_bytes();
        let words = |a: [u8; 4], b: [u8; 4]| [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]];
        let make = |command, data: &[u8]| Frame::classic(self.id(command), data);
        match *instruction {
            Instruction::EmergencyStop => make(ESTOP, &[]),
            Instruction::SetState(state) => make(SET_STATE, &(state as u32).to_le_bytes()),
            Instruction::SetModes(control, input) => {
                make(SET_MODES, &words((control as u32).to_le_bytes(), (input as u32).to_le_bytes()))
            }
            Instruction::Position { position, velocity, torque } => {
                let ([a, b], [c, d]) = (thousandths(velocity / TAU), thousandths(torque));
                make(SET_POSITION, &words(turns(position), [a, b, c, d]))
            }
            Instruction::Velocity { velocity, torque } => {
                make(SET_VELOCITY, &words(turns(velocity), (torque as f32).to_le_bytes()))
            }
            Instruction::Torque(torque) => make(SET_TORQUE, &(torque as f32).to_le_bytes()),
            Instruction::Limits { velocity, current } => {
                make(SET_LIMITS, &words(turns(velocity), (current as f32).to_le_bytes()))
            }
            Instruction::ClearErrors => make(CLEAR_ERRORS, &[]),
        }
    }

    /// Decodes a message that the drive has received.
    ///
    /// # Errors
    /// Returns an error if the frame is for another drive, is not a message to a drive, has the wrong length,
    /// or contains an invalid number.
    pub fn instruction(self, frame: &Frame) -> Result<Instruction, DecodeError> {
        let command = self.command(frame)?;
        let data = frame.data();
        Ok(match command {
            ESTOP => length::<0>(data).map(|_| Instruction::EmergencyStop)?,
            CLEAR_ERRORS => length::<0>(data).map(|_| Instruction::ClearErrors)?,
            SET_STATE => Instruction::SetState(AxisState::from_code(u32::from_le_bytes(*length(data)?))?),
            SET_MODES => {
                let (control, input) = halves(data)?;
                Instruction::SetModes(
                    match u32::from_le_bytes(control) {
                        0 => ControlMode::Voltage,
                        1 => ControlMode::Torque,
                        2 => ControlMode::Velocity,
                        3 => ControlMode::Position,
                        found => return Err(DecodeError::Field { field: "the control mode", found }),
                    },
                    match u32::from_le_bytes(input) {
                        0 => InputMode::Inactive,
                        1 => InputMode::Passthrough,
                        2 => InputMode::VelocityRamp,
                        3 => InputMode::PositionFilter,
                        found => return Err(DecodeError::Field { field: "the input mode", found }),
                    },
                )
            }
            SET_POSITION => {
                let (position, [a, b, c, d]) = halves(data)?;
                Instruction::Position {
                    position: finite(position, "the position")? * TAU,
                    velocity: f64::from(i16::from_le_bytes([a, b])) * 1e-3 * TAU,
                    torque: f64::from(i16::from_le_bytes([c, d])) * 1e-3,
                }
            }
            SET_VELOCITY => {
                let (velocity, torque) = halves(data)?;
                Instruction::Velocity {
                    velocity: finite(velocity, "the velocity")? * TAU,
                    torque: finite(torque, "the torque")?,
                }
            }
            SET_LIMITS => {
                let (velocity, current) = halves(data)?;
                Instruction::Limits {
                    velocity: finite(velocity, "the largest velocity")? * TAU,
                    current: finite(current, "the largest current")?,
                }
            }
            SET_TORQUE => Instruction::Torque(finite(*length(data)?, "the torque")?),
            found => return Err(DecodeError::Field { field: "the command", found: found.into() }),
        })
    }

    /// Returns the frame with which the drive sends a report.
    pub fn report_frame(self, report: &Report) -> Frame {
        let words = |a: [u8; 4], b: [u8; 4]| [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]];
        let floats = |a: f64, b: f64| words((a as f32).to_le_bytes(), (b as f32).to_le_bytes());
        let (command, data) = match *report {
            Report::Heartbeat { error, state, result } => {
                (HEARTBEAT, words(error.to_le_bytes(), [state as u8, result, 0, 0]))
            }
            Report::Encoder { position, velocity } => (ENCODER, floats(position / TAU, velocity / TAU)),
            Report::Supply { voltage, current } => (SUPPLY, floats(voltage, current)),
            Report::Temperature { transistors, motor } => (TEMPERATURE, floats(transistors, motor)),
            Report::Currents { target, measured } => (CURRENTS, floats(target, measured)),
            Report::Torques { target, estimate } => (TORQUES, floats(target, estimate)),
        };
        Frame::classic(self.id(command), &data)
    }

    /// Decodes a report of the drive.
    ///
    /// # Errors
    /// Returns an error if the frame comes from another drive, is not a supported report, has the wrong
    /// length, or contains an invalid number.
    pub fn report(self, frame: &Frame) -> Result<Report, DecodeError> {
        let command = self.command(frame)?;
        let (first, second) = halves(frame.data())?;
        Ok(match command {
            // the last two bytes contain encoder and controller flags; newer firmware also reports the end of
            // a trajectory there
            HEARTBEAT => Report::Heartbeat {
                error: u32::from_le_bytes(first),
                state: AxisState::from_code(second[0].into())?,
                result: second[1],
            },
            ENCODER => Report::Encoder {
                position: finite(first, "the position")? * TAU,
                velocity: finite(second, "the velocity")? * TAU,
            },
            SUPPLY => Report::Supply {
                voltage: finite(first, "the voltage")?,
                current: finite(second, "the current")?,
            },
            TEMPERATURE => Report::Temperature {
                transistors: finite(first, "the temperature of the transistors")?,
                motor: finite(second, "the temperature of the motor")?,
            },
            CURRENTS => Report::Currents {
                target: finite(first, "the target")?,
                measured: finite(second, "the measurement")?,
            },
            TORQUES => Report::Torques {
                target: finite(first, "the target")?,
                estimate: finite(second, "the estimate")?,
            },
            found => return Err(DecodeError::Field { field: "the command", found: found.into() }),
        })
    }

    /// Returns the command code in the identifier of a frame of this drive.
    fn command(self, frame: &Frame) -> Result<u16, DecodeError> {
        match frame.id {
            Id::Standard(id) if id >> 5 == u16::from(self.0) => Ok(id & 0x1f),
            found => Err(DecodeError::Id { found, expected: self.id(0) }),
        }
    }
}

/// Returns data of exactly `N` bytes.
fn length<const N: usize>(data: &[u8]) -> Result<&[u8; N], DecodeError> {
    data.try_into().map_err(|_| DecodeError::Length { found: data.len(), expected: N })
}

/// Splits data into two words of four bytes.
fn halves(data: &[u8]) -> Result<([u8; 4], [u8; 4]), DecodeError> {
    let [a, b, c, d, e, f, g, h] = *length::<8>(data)?;
    Ok(([a, b, c, d], [e, f, g, h]))
}

/// Rounding without a system library.
trait RoundToEven {
    fn round_to_even(self) -> f64;
}

impl RoundToEven for f64 {
    /// Rounds to the nearest integer, halves to even, for numbers below 2^51.
    fn round_to_even(self) -> f64 {
        const SHIFT: f64 = 6_755_399_441_055_744.0;
        if self.abs() < 2_251_799_813_685_248.0 { (self + SHIFT) - SHIFT } else { self }
    }
}
