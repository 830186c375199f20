//! Protocol of moteus drives: registers over CAN FD.
//!
//! A frame consists of subframes. Each subframe writes or queries consecutive registers in one of four
//! resolutions. Positions are in turns of the output. If no command arrives within the time specified in the
//! last command, the drive disables itself and stays disabled.

mod registers;

use core::f64::consts::TAU;

pub use crate::drive::PositionReference as Home;
use crate::frame::{DecodeError, Frame, Id};
pub use registers::Resolution;
use registers::{
    COMMAND, COMMANDED, FAULT, HOME, MODE, MOTOR_TEMPERATURE, POSITION, READ, REPLY, TEMPERATURE, TORQUE,
    VELOCITY, VOLTAGE, WATCHDOG, WRITE, Writer, registers,
};

/// State of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// The drive is disabled.
    Stopped = 0,
    /// The drive disabled itself because of a fault.
    Fault = 1,
    /// The drive is about to follow commands.
    Enabling = 2,
    /// Calibration is running.
    Calibrating = 3,
    /// Calibration is complete.
    CalibrationComplete = 4,
    /// The drive applies duty cycles.
    Pwm = 5,
    /// The drive applies voltages.
    Voltage = 6,
    /// The drive applies a voltage at a phase.
    VoltageFoc = 7,
    /// The drive applies voltages in the rotor frame.
    VoltageDq = 8,
    /// The drive controls currents.
    Current = 9,
    /// The drive follows positions.
    Position = 10,
    /// No command arrived in time; the drive ignores commands until it is stopped.
    Timeout = 11,
    /// The drive holds the velocity at zero.
    ZeroVelocity = 12,
    /// The drive stays within position bounds.
    StayWithin = 13,
    /// The drive measures its inductance.
    MeasureInductance = 14,
    /// The phases are shorted.
    Brake = 15,
}

impl Mode {
    const ALL: [Self; 16] = [
        Self::Stopped,
        Self::Fault,
        Self::Enabling,
        Self::Calibrating,
        Self::CalibrationComplete,
        Self::Pwm,
        Self::Voltage,
        Self::VoltageFoc,
        Self::VoltageDq,
        Self::Current,
        Self::Position,
        Self::Timeout,
        Self::ZeroVelocity,
        Self::StayWithin,
        Self::MeasureInductance,
        Self::Brake,
    ];
}

/// Command of the position mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Position setpoint of the output, rad; NaN for the present position.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Feed-forward torque, N m.
    pub torque: f64,
    /// Fraction of the position gain stored in the drive, 0 to 1.
    pub kp_scale: f64,
    /// Fraction of the velocity gain stored in the drive, 0 to 1.
    pub kd_scale: f64,
    /// Largest torque, N m; NaN for the drive's own limit.
    pub max_torque: f64,
    /// Time without a command after which the drive disables itself, s. 0 selects the drive's own setting
    /// (`servo.default_timeout_s`), NaN disables the watchdog.
    pub watchdog: f64,
}

impl Default for Command {
    /// Holds the present position with the gains and limits of the drive.
    fn default() -> Self {
        Self {
            position: f64::NAN,
            velocity: 0.0,
            torque: 0.0,
            kp_scale: 1.0,
            kd_scale: 1.0,
            max_torque: f64::NAN,
            watchdog: 0.0,
        }
    }
}

/// Number of registers from the motor temperature to the fault.
const TOLD: usize = (FAULT - MOTOR_TEMPERATURE + 1) as usize;

/// Message to a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Instruction {
    /// Disable the drive, which also clears a fault or a time-out.
    Stop,
    /// Short the phases.
    Brake,
    /// Follow a position.
    Position(Command),
    /// Report the state without changing it.
    Query,
}

/// Answer of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Active mode.
    pub mode: Mode,
    /// Position of the output, rad.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Torque, N m.
    pub torque: f64,
    /// Supply voltage, V.
    pub voltage: f64,
    /// Temperature of the board, degrees Celsius.
    pub temperature: f64,
    /// Temperature of the motor, degrees Celsius; `None` if not reported.
    pub motor_temperature: Option<f64>,
    /// Reference of the position; `None` if not reported.
    pub home: Option<Home>,
    /// Fault code, up to 127; 0 for none. Codes from 96 on indicate an active limit instead of a fault.
    pub fault: u8,
}

/// ID of a drive, 1 to 126.
///
/// ```
/// use motorium_can::moteus::{Instruction, Node, Resolution};
///
/// let node = Node::new(1).ok_or("1 to 126")?;
/// let stop = node.frame(&Instruction::Stop, Resolution::Int16);
/// assert_eq!(format!("{stop:?}"), "0x00008001#0100001100170110060A5050");
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node(u8);

impl Node {
    /// Drive with the lowest ID.
    pub(crate) const FIRST: Self = Self(1);

    /// Creates a drive ID; `None` for 0, which is the host, and above 126.
    pub fn new(node: u8) -> Option<Self> {
        (1..127).contains(&node).then_some(Self(node))
    }

    /// Returns the identifier of messages to the drive that request an answer.
    pub fn id(self) -> Id {
        Id::Extended(0x8000 | u32::from(self.0))
    }

    /// Returns the identifier of the drive's answers: 11 bits if the number fits, otherwise 29.
    pub fn reply_id(self) -> Id {
        let id = u16::from(self.0) << 8;
        Id::standard(id).unwrap_or(Id::Extended(id.into()))
    }

    /// Returns the frame of a message, encoded in `resolution`. The frame also queries the state: position,
    /// velocity and torque in `resolution`; mode, temperatures, position reference, voltage and fault in 8
    /// bits.
    pub fn frame(self, instruction: &Instruction, resolution: Resolution) -> Frame {
        let mut out = Writer::default();
        let mode = match instruction {
            Instruction::Stop => Some(Mode::Stopped),
            Instruction::Brake => Some(Mode::Brake),
            Instruction::Position(_) => Some(Mode::Position),
            Instruction::Query => None,
        };
        if let Some(mode) = mode {
            out.head(WRITE, Resolution::Int8, MODE, 1);
            out.put(&[mode as u8]);
        }
        if let Instruction::Position(c) = instruction {
            let turns = [c.position / TAU, c.velocity / TAU, c.torque, c.kp_scale, c.kd_scale, c.max_torque];
            out.head(WRITE, resolution, COMMAND, COMMANDED as usize);
            for (value, register) in turns.into_iter().chain([f64::NAN, c.watchdog]).zip(COMMAND..) {
                out.value(value, register, resolution);
            }
        }
        out.head(READ, Resolution::Int8, MODE, 1);
        out.head(READ, resolution, POSITION, 3);
        out.head(READ, Resolution::Int8, MOTOR_TEMPERATURE, TOLD);
        out.frame(self.id())
    }

    /// Decodes a message that the drive has received.
    ///
    /// # Errors
    /// Returns an error if the frame is for another drive, is truncated, or contains an unsupported mode,
    /// register or subframe.
    pub fn instruction(self, frame: &Frame) -> Result<Instruction, DecodeError> {
        if frame.id != self.id() {
            return Err(DecodeError::Id { found: frame.id, expected: self.id() });
        }
        let (mut mode, mut command) = (None, Command::default());
        registers(frame.data(), |(action, register, value)| {
            match (action, register) {
                (READ, _) => {}
                (WRITE, MODE) => mode = Some(value as i32 as u32),
                (WRITE, 0x20) => command.position = value * TAU,
                (WRITE, 0x21) => command.velocity = value * TAU,
                (WRITE, 0x22) => command.torque = value,
                (WRITE, 0x23) => command.kp_scale = value,
                (WRITE, 0x24) => command.kd_scale = value,
                (WRITE, 0x25) => command.max_torque = value,
                (WRITE, 0x26) if value.is_nan() => {}
                (WRITE, WATCHDOG) => command.watchdog = value,
                (_, register) => return Err(DecodeError::Field { field: "the register", found: register }),
            }
            Ok(())
        })?;
        let finite = [command.velocity, command.torque, command.kp_scale, command.kd_scale];
        match mode {
            _ if !finite.iter().all(|number| number.is_finite()) || command.position.is_infinite() => {
                Err(DecodeError::NotFinite { field: "the command" })
            }
            None => Ok(Instruction::Query),
            Some(0) => Ok(Instruction::Stop),
            Some(10) => Ok(Instruction::Position(command)),
            Some(15) => Ok(Instruction::Brake),
            Some(found) => Err(DecodeError::Field { field: "the mode", found }),
        }
    }

    /// Returns the frame with which the drive answers.
    pub fn reply_frame(self, state: &State, resolution: Resolution) -> Frame {
        let mut out = Writer::default();
        out.head(REPLY, Resolution::Int8, MODE, 1);
        out.put(&[state.mode as u8]);
        out.head(REPLY, resolution, POSITION, 3);
        let values = [state.position / TAU, state.velocity / TAU, state.torque];
        values
            .into_iter()
            .zip(POSITION..)
            .for_each(|(value, register)| out.value(value, register, resolution));
        out.head(REPLY, Resolution::Int8, MOTOR_TEMPERATURE, TOLD);
        out.value(state.motor_temperature.unwrap_or(0.0), MOTOR_TEMPERATURE, Resolution::Int8);
        // trajectories are not limited here, so each one is complete
        out.put(&[1, state.home.unwrap_or(Home::Relative) as u8]);
        out.value(state.voltage, VOLTAGE, Resolution::Int8);
        out.value(state.temperature, TEMPERATURE, Resolution::Int8);
        out.put(&[state.fault]);
        out.frame(self.reply_id())
    }

    /// Decodes an answer in any combination of resolutions. Registers that were not queried are skipped.
    ///
    /// # Errors
    /// Returns an error if the frame comes from another drive, is truncated, is a refusal, lacks a value, or
    /// has an invalid value.
    pub fn reply(self, frame: &Frame) -> Result<State, DecodeError> {
        if frame.id != self.reply_id() {
            return Err(DecodeError::Id { found: frame.id, expected: self.reply_id() });
        }
        let mut values = [None; 0x10];
        registers(frame.data(), |(action, register, value)| {
            if action != REPLY {
                return Err(DecodeError::Field { field: "the subframe", found: action.into() });
            }
            if let Some(place) = values.get_mut(register as usize) {
                *place = Some(value);
            }
            Ok(())
        })?;
        let get = |register: u32, field| match values[register as usize] {
            Some(value) if f64::is_finite(value) => Ok(value),
            Some(_) => Err(DecodeError::NotFinite { field }),
            None => Err(DecodeError::Answer { found: 0, expected: register }),
        };
        let code = get(MODE, "the mode")?;
        let mode = Mode::ALL.into_iter().find(|mode| f64::from(*mode as u8) == code);
        let fault = get(FAULT, "the fault")?;
        let home = values[HOME as usize].map(|code| {
            let home = [Home::Relative, Home::Rotor, Home::Output]
                .into_iter()
                .find(|home| f64::from(*home as u8) == code);
            home.ok_or(DecodeError::Field { field: "the position reference", found: code as i32 as u32 })
        });
        Ok(State {
            mode: mode.ok_or(DecodeError::Field { field: "the mode", found: code as i32 as u32 })?,
            position: get(POSITION, "the position")? * TAU,
            velocity: get(VELOCITY, "the velocity")? * TAU,
            torque: get(TORQUE, "the torque")?,
            voltage: get(VOLTAGE, "the voltage")?,
            temperature: get(TEMPERATURE, "the temperature")?,
            motor_temperature: values[MOTOR_TEMPERATURE as usize]
                .filter(|celsius| *celsius != 0.0 && !celsius.is_nan()),
            home: home.transpose()?,
            fault: if (0.0..128.0).contains(&fault) && fault % 1.0 == 0.0 {
                fault as u8
            } else {
                return Err(DecodeError::Field { field: "the fault", found: fault as i32 as u32 });
            },
        })
    }
}
