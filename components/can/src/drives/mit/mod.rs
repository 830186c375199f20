//! The protocol of the MIT mini cheetah, and of the drives that took it over: CubeMars, Damiao, RobStride.
//!
//! A command is one frame of eight bytes with position (16 bits), velocity, position gain, velocity gain and
//! torque (12 bits each), most significant bit first; the drive answers every command with one frame.
//! Enabling, disabling and setting the zero position are commands of seven bytes 0xFF and a code.
//!
//! Numbers are mapped to [`Ranges`] stored in the drive: a wrong range scales them silently.

mod ranges;
mod state;

use super::range::{Fields, Range};
use crate::frame::{DecodeError, Form, Frame, Id, exactly};

pub use ranges::{CommandFields, Ranges};
pub use state::{Fault, State};
use state::{cubemars_code, cubemars_state, damiao_code, damiao_state};

/// The command of a drive, in the units of its output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Position setpoint, rad.
    pub position: f64,
    /// Velocity setpoint, rad/s.
    pub velocity: f64,
    /// Position gain, N m/rad.
    pub kp: f64,
    /// Velocity gain, N m s/rad.
    pub kd: f64,
    /// Feed-forward torque, N m.
    pub torque: f64,
}

impl Command {
    /// The torque that a drive gives for it at this position \[rad\] and velocity \[rad/s\], within no
    /// limits, N m.
    ///
    /// ```
    /// use motorium_can::mit::Command;
    ///
    /// let command = Command { position: 1.0, kp: 20.0, kd: 0.5, torque: 3.0, ..Command::default() };
    /// assert_eq!(command.torque_at(0.9, 2.0), 3.0 + 20.0 * (1.0 - 0.9) - 0.5 * 2.0);
    /// ```
    pub fn torque_at(&self, position: f64, velocity: f64) -> f64 {
        self.torque + self.kp * (self.position - position) + self.kd * (self.velocity - velocity)
    }
}

/// A frame to a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Instruction {
    /// Setpoints and gains.
    Command(Command),
    /// The drive begins to follow commands.
    Enable,
    /// The drive is disabled.
    Disable,
    /// The present position becomes zero.
    SetZero,
}

/// The form of a drive's answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Six bytes: device, position, velocity, torque.
    MiniCheetah,
    /// Eight bytes: as before, then an unused byte and the supply voltage over 40 V.
    MiniCheetahVoltage,
    /// Eight bytes: as before, then temperature (signed, degrees Celsius) and error.
    CubeMars,
    /// Eight bytes: device and state in one byte, position, velocity, torque, temperatures of transistors and
    /// rotor.
    Damiao,
    /// Eight bytes: device, position, velocity, torque, temperature in tenths of a degree Celsius.
    RobStride,
}

impl Reply {
    /// Bytes of the answer.
    pub fn length(self) -> usize {
        if self == Self::MiniCheetah { 6 } else { 8 }
    }
}

/// A drive's answer, in the units of its output shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Position, rad.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Torque, N m.
    pub torque: f64,
    /// Temperature of the drive, degrees Celsius, if reported.
    pub temperature: Option<f64>,
    /// Supply voltage, V, if reported.
    pub voltage: Option<f64>,
    /// Its state.
    pub state: State,
}

/// One drive as both ends of the bus see it: identifiers, ranges, form of its answer.
///
/// ```
/// use motorium_can::{Id, mit};
///
/// let knee = mit::Drive::mini_cheetah(3);
/// let nothing = knee.command(&mit::Command::default());
/// assert_eq!(nothing.data(), [0x7f, 0xff, 0x7f, 0xf0, 0x00, 0x00, 0x07, 0xff]);
/// assert_eq!(nothing.id, Id::Standard(3));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Number of the drive: the identifier of its commands.
    pub node: u8,
    /// Identifier of its answers.
    pub reply_id: Id,
    /// Form of its answers.
    pub reply: Reply,
    /// Form of its frames on the wire.
    pub form: Form,
    ranges: Ranges,
    fields: CommandFields,
}

const ENABLE: u8 = 0xfc;
const DISABLE: u8 = 0xfd;
const SET_ZERO: u8 = 0xfe;
/// Supply voltage encoded by the largest byte, V.
const VOLTAGE: Fields<1> = Range::from_zero(40.0).field(8);

/// The data of the frame with this code.
const fn code(code: u8) -> [u8; 8] {
    [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, code]
}

impl Drive {
    /// A drive with these ranges, and answers of this identifier and form.
    pub const fn new(node: u8, reply_id: Id, reply: Reply, ranges: Ranges) -> Self {
        Self { node, reply_id, reply, form: Form::Classic, ranges, fields: ranges.fields() }
    }

    /// A drive with the published firmware of the mini cheetah: ranges of [`Ranges::MINI_CHEETAH`], answers
    /// of six bytes with identifier 0.
    pub const fn mini_cheetah(node: u8) -> Self {
        Self::new(node, Id::Standard(0), Reply::MiniCheetah, Ranges::MINI_CHEETAH)
    }

    /// A Damiao drive with these ranges, whose answers have the identifier `master`.
    pub const fn damiao(node: u8, master: u16, ranges: Ranges) -> Self {
        Self::new(node, Id::Standard(master & 0x7ff), Reply::Damiao, ranges)
    }

    /// The same with other ranges.
    #[must_use]
    pub const fn with_ranges(self, ranges: Ranges) -> Self {
        Self { ranges, fields: ranges.fields(), ..self }
    }

    /// The ranges of the fields.
    pub const fn ranges(&self) -> &Ranges {
        &self.ranges
    }

    /// The fields of its frames.
    pub const fn fields(&self) -> &CommandFields {
        &self.fields
    }

    /// The identifier of its commands.
    #[inline]
    pub fn id(&self) -> Id {
        Id::Standard(u16::from(self.node))
    }

    /// Encodes a command as a frame. Values outside the ranges are sent as their end.
    // in place: a frame that is returned is copied, and the copy waits until its parts are stored
    #[inline(always)]
    pub fn command(&self, command: &Command) -> Frame {
        let packed = self.fields.pack(command);
        // All fields at their maximum would encode enabling, disabling or zeroing: the torque is reduced.
        let is_code = packed >= u64::from_be_bytes(code(ENABLE));
        self.frame(if is_code { code(ENABLE - 1) } else { packed.to_be_bytes() })
    }

    /// The frame of an instruction.
    pub fn instruct(&self, instruction: &Instruction) -> Frame {
        self.frame(code(match instruction {
            Instruction::Command(command) => return self.command(command),
            Instruction::Enable => ENABLE,
            Instruction::Disable => DISABLE,
            Instruction::SetZero => SET_ZERO,
        }))
    }

    #[inline]
    fn frame(&self, data: [u8; 8]) -> Frame {
        Frame::of_eight(self.id(), self.form, data)
    }

    /// The drive's side: decodes the request of a frame.
    ///
    /// # Errors
    /// The frame is for another drive, has another length, or ends in a code that there is not.
    pub fn instruction(&self, frame: &Frame) -> Result<Instruction, DecodeError> {
        let data: &[u8; 8] = exactly(frame, self.id())?;
        if data[..7] == [0xff; 7] {
            match data[7] {
                ENABLE => return Ok(Instruction::Enable),
                DISABLE => return Ok(Instruction::Disable),
                SET_ZERO => return Ok(Instruction::SetZero),
                0xff => return Err(DecodeError::Field { field: "the code", found: 0xff }),
                _ => {}
            }
        }
        Ok(Instruction::Command(self.fields.command(u64::from_be_bytes(*data))))
    }

    /// The drive's side: encodes an answer. Values without a field in its form are omitted.
    pub fn answer(&self, feedback: &Feedback) -> Frame {
        let motion = self.fields.pack_motion(feedback.position, feedback.velocity, feedback.torque);
        let [_, _, _, p1, p0, v1, v_t, t0] = motion.to_be_bytes();
        let celsius = feedback.temperature.unwrap_or(25.0);
        let mut data = [self.node, p1, p0, v1, v_t, t0, 0, 0];
        match self.reply {
            Reply::MiniCheetah => {}
            Reply::MiniCheetahVoltage => {
                let [voltage] = VOLTAGE.encode([feedback.voltage.unwrap_or(0.0)]);
                data[7] = voltage as u8;
            }
            Reply::CubeMars => {
                data[6] = celsius.clamp(-128.0, 127.0) as i8 as u8;
                data[7] = cubemars_code(feedback.state);
            }
            Reply::Damiao => {
                data[0] = self.node & 0xf | damiao_code(feedback.state) << 4;
                (data[6], data[7]) = (celsius.clamp(0.0, 255.0) as u8, celsius.clamp(0.0, 255.0) as u8);
            }
            Reply::RobStride => {
                [data[6], data[7]] = ((celsius * 10.0).clamp(0.0, 65535.0) as u16).to_be_bytes();
            }
        }
        Frame::classic(self.reply_id, &data[..self.reply.length()]).in_form(self.form)
    }

    /// The values of an answer.
    ///
    /// # Errors
    /// The frame has another identifier or length, comes from another drive, or has an unknown code.
    // in place, as commands
    #[inline(always)]
    pub fn reply(&self, frame: &Frame) -> Result<Feedback, DecodeError> {
        // most significant byte first, with or without the last two
        let packed = match self.reply {
            Reply::MiniCheetah => {
                let [device, p1, p0, v1, v_t, t0] = *exactly::<6>(frame, self.reply_id)?;
                u64::from_be_bytes([device, p1, p0, v1, v_t, t0, 0, 0])
            }
            _ => u64::from_be_bytes(*exactly::<8>(frame, self.reply_id)?),
        };
        let byte = |place: u32| (packed >> (56 - 8 * place)) as u8;
        let (found, expected) = match self.reply {
            Reply::Damiao => (byte(0) & 0xf, self.node & 0xf),
            _ => (byte(0), self.node),
        };
        if found != expected {
            return Err(DecodeError::Device { found, expected });
        }
        let [position, velocity, torque] = self.fields.motion(packed >> 16);
        let (temperature, voltage, state) = (None, None, State::Unknown);
        let mut feedback = Feedback { position, velocity, torque, temperature, voltage, state };
        match self.reply {
            Reply::MiniCheetah => {}
            Reply::MiniCheetahVoltage => feedback.voltage = Some(VOLTAGE.decode::<0>(byte(7).into())),
            Reply::CubeMars => {
                feedback.temperature = Some(f64::from(byte(6) as i8));
                feedback.state = cubemars_state(byte(7))?;
            }
            Reply::Damiao => {
                feedback.temperature = Some(f64::from(byte(6).max(byte(7))));
                feedback.state = damiao_state(byte(0) >> 4)?;
            }
            Reply::RobStride => {
                feedback.temperature = Some(f64::from(packed as u16) / 10.0);
            }
        }
        Ok(feedback)
    }
}
