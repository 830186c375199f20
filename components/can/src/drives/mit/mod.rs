//! The protocol of the MIT mini cheetah, and of the drives that took it over: CubeMars, Damiao, RobStride.
//!
//! A command is one frame of eight bytes with position (16 bits), velocity, position gain, velocity gain and torque (12
//! bits each), most significant bit first; the drive answers every command with one frame. Enabling, disabling and setting
//! the zero position are commands of seven bytes 0xFF and a code.
//!
//! Numbers are spread over [`Ranges`] that stand in the drive: a wrong range scales them silently.

mod state;

use super::range::Range;
use crate::frame::{DecodeError, Form, Frame, Id, exactly};

pub use state::{Fault, State};
use state::{cubemars_code, cubemars_state, damiao_code, damiao_state};

/// The ranges of the fields, in the units of the drive's output shaft.
///
/// ```
/// use motorium_can::mit::Ranges;
///
/// assert_eq!(Ranges::MINI_CHEETAH.velocity.max, 65.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ranges {
    /// Positions, rad.
    pub position: Range,
    /// Velocities, rad/s.
    pub velocity: Range,
    /// Position gains, N m/rad.
    pub kp: Range,
    /// Velocity gains, N m s/rad.
    pub kd: Range,
    /// Torques, N m.
    pub torque: Range,
}

impl Ranges {
    /// Those of the published firmware of the mini cheetah's drives.
    pub const MINI_CHEETAH: Self = Self::new(12.5, 65.0, 18.0);
    /// Those of the CubeMars AK80-64.
    pub const AK80_64: Self = Self::new(12.5, 8.0, 144.0);
    /// Those of the RobStride RS00.
    pub const RS00: Self = Self::new(12.57, 33.0, 14.0);

    /// Ranges from the largest position, velocity and torque, with gains up to 500 N m/rad and 5 N m s/rad.
    pub const fn new(position: f64, velocity: f64, torque: f64) -> Self {
        Self {
            position: Range::symmetric(position),
            velocity: Range::symmetric(velocity),
            kp: Range::from_zero(500.0),
            kd: Range::from_zero(5.0),
            torque: Range::symmetric(torque),
        }
    }

    /// A command with each field brought within its range.
    pub fn clamped(&self, command: &Command) -> Command {
        self.map(command, |range, x, _| range.nearest(x))
    }

    /// A command as the drive reads it: each field within its range, and rounded to its bits.
    ///
    /// ```
    /// use motorium_can::mit::{Command, Ranges};
    ///
    /// let ranges = Ranges::new(12.5, 30.0, 10.0);
    /// let read = ranges.rounded(&Command { torque: 1.234, ..Command::default() });
    /// assert!((read.torque - 1.234).abs() <= ranges.torque.resolution(12) / 2.0);
    /// assert!(read.velocity < 0.0, "no integer stands for zero in the middle of a range");
    /// ```
    pub fn rounded(&self, command: &Command) -> Command {
        self.map(command, |range, x, bits| range.decode(range.encode(x, bits), bits))
    }

    fn map(&self, command: &Command, change: impl Fn(&Range, f64, u32) -> f64) -> Command {
        Command {
            position: change(&self.position, command.position, 16),
            velocity: change(&self.velocity, command.velocity, 12),
            kp: change(&self.kp, command.kp, 12),
            kd: change(&self.kd, command.kd, 12),
            torque: change(&self.torque, command.torque, 12),
        }
    }

    /// The same with other largest gains.
    #[must_use]
    pub const fn with_gains(self, kp: f64, kd: f64) -> Self {
        Self { kp: Range::from_zero(kp), kd: Range::from_zero(kd), ..self }
    }
}

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
    /// The torque that a drive gives for it at this position \[rad\] and velocity \[rad/s\], within no limits, N m.
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
    /// The drive lets go.
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
    /// Eight bytes: device and state in one byte, position, velocity, torque, temperatures of transistors and rotor.
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
    /// Temperature of the drive, degrees Celsius, if it tells.
    pub temperature: Option<f64>,
    /// Supply voltage, V, if it tells.
    pub voltage: Option<f64>,
    /// Its state.
    pub state: State,
}

/// One drive as both ends of the bus know it: identifiers, ranges, form of its answer.
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
    /// Ranges of the fields.
    pub ranges: Ranges,
    /// Form of its frames on the wire.
    pub form: Form,
}

const ENABLE: u8 = 0xfc;
const DISABLE: u8 = 0xfd;
const SET_ZERO: u8 = 0xfe;
/// The supply voltage that the largest byte stands for, V.
const VOLTAGE: Range = Range::from_zero(40.0);

impl Drive {
    /// A drive with the published firmware of the mini cheetah: ranges of [`Ranges::MINI_CHEETAH`], answers of six bytes
    /// with identifier 0.
    pub const fn mini_cheetah(node: u8) -> Self {
        Self {
            node,
            reply_id: Id::Standard(0),
            reply: Reply::MiniCheetah,
            ranges: Ranges::MINI_CHEETAH,
            form: Form::Classic,
        }
    }

    /// A Damiao drive with these ranges, whose answers have the identifier `master`.
    pub const fn damiao(node: u8, master: u16, ranges: Ranges) -> Self {
        let reply_id = Id::Standard(master & 0x7ff);
        Self { node, reply_id, reply: Reply::Damiao, ranges, form: Form::Classic }
    }

    /// The identifier of its commands.
    pub fn id(&self) -> Id {
        Id::Standard(u16::from(self.node))
    }

    /// The frame of a command. What lies outside the ranges is sent as their end.
    pub fn command(&self, command: &Command) -> Frame {
        let r = &self.ranges;
        let p = r.position.encode(command.position, 16);
        let v = r.velocity.encode(command.velocity, 12);
        let kp = r.kp.encode(command.kp, 12);
        let kd = r.kd.encode(command.kd, 12);
        let t = r.torque.encode(command.torque, 12);
        let mut data = [
            (p >> 8) as u8,
            p as u8,
            (v >> 4) as u8,
            ((v << 4) | (kp >> 8)) as u8,
            kp as u8,
            (kd >> 4) as u8,
            ((kd << 4) | (t >> 8)) as u8,
            t as u8,
        ];
        // All fields at their highest would be the code for enabling, disabling or zeroing: the torque gives way.
        if data[..7] == [0xff; 7] && data[7] >= ENABLE {
            data[7] = ENABLE - 1;
        }
        self.frame(data)
    }

    /// The frame of an instruction.
    pub fn instruct(&self, instruction: &Instruction) -> Frame {
        let code = match instruction {
            Instruction::Command(command) => return self.command(command),
            Instruction::Enable => ENABLE,
            Instruction::Disable => DISABLE,
            Instruction::SetZero => SET_ZERO,
        };
        self.frame([0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, code])
    }

    fn frame(&self, data: [u8; 8]) -> Frame {
        Frame::of_eight(self.id(), self.form, data)
    }

    /// The drive's side: what a frame asks of it.
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
        let r = &self.ranges;
        let [p1, p0, v1, v_kp, kp0, kd1, kd_t, t0] = data.map(u16::from);
        Ok(Instruction::Command(Command {
            position: r.position.decode(p1 << 8 | p0, 16),
            velocity: r.velocity.decode(v1 << 4 | v_kp >> 4, 12),
            kp: r.kp.decode((v_kp & 0xf) << 8 | kp0, 12),
            kd: r.kd.decode(kd1 << 4 | kd_t >> 4, 12),
            torque: r.torque.decode((kd_t & 0xf) << 8 | t0, 12),
        }))
    }

    /// The drive's side: the frame of an answer. What its form has no field for is left out.
    pub fn answer(&self, feedback: &Feedback) -> Frame {
        let r = &self.ranges;
        let p = r.position.encode(feedback.position, 16);
        let v = r.velocity.encode(feedback.velocity, 12);
        let t = r.torque.encode(feedback.torque, 12);
        let celsius = feedback.temperature.unwrap_or(25.0);
        let mut data =
            [self.node, (p >> 8) as u8, p as u8, (v >> 4) as u8, ((v << 4) | (t >> 8)) as u8, t as u8, 0, 0];
        match self.reply {
            Reply::MiniCheetah => {}
            Reply::MiniCheetahVoltage => {
                data[7] = VOLTAGE.encode(feedback.voltage.unwrap_or(0.0), 8) as u8;
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
    /// The frame has another identifier or length, comes from another drive, or has a code that there is not.
    pub fn reply(&self, frame: &Frame) -> Result<Feedback, DecodeError> {
        let mut data = [0; 8];
        if self.reply == Reply::MiniCheetah {
            data[..6].copy_from_slice(exactly::<6>(frame, self.reply_id)?);
        } else {
            data = *exactly::<8>(frame, self.reply_id)?;
        }
        let (found, expected) = match self.reply {
            Reply::Damiao => (data[0] & 0xf, self.node & 0xf),
            _ => (data[0], self.node),
        };
        if found != expected {
            return Err(DecodeError::Device { found, expected });
        }
        let r = &self.ranges;
        let [_, p1, p0, v1, v_t, t0, ..] = data.map(u16::from);
        let mut feedback = Feedback {
            position: r.position.decode(p1 << 8 | p0, 16),
            velocity: r.velocity.decode(v1 << 4 | v_t >> 4, 12),
            torque: r.torque.decode((v_t & 0xf) << 8 | t0, 12),
            temperature: None,
            voltage: None,
            state: State::Unknown,
        };
        match self.reply {
            Reply::MiniCheetah => {}
            Reply::MiniCheetahVoltage => feedback.voltage = Some(VOLTAGE.decode(data[7].into(), 8)),
            Reply::CubeMars => {
                feedback.temperature = Some(f64::from(data[6] as i8));
                feedback.state = cubemars_state(data[7])?;
            }
            Reply::Damiao => {
                feedback.temperature = Some(f64::from(data[6].max(data[7])));
                feedback.state = damiao_state(data[0] >> 4)?;
            }
            Reply::RobStride => {
                let tenths = u16::from_be_bytes([data[6], data[7]]);
                feedback.temperature = Some(f64::from(tenths) / 10.0);
            }
        }
        Ok(feedback)
    }
}
