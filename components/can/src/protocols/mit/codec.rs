//! Protocol of the MIT mini cheetah, adopted by CubeMars, Damiao and RobStride drives.
//!
//! A command is a frame of eight bytes with position (16 bits), velocity, position gain, velocity gain and
//! torque (12 bits each), most significant bit first. The drive answers every command with one frame.
//! Commands for enabling, disabling and setting the zero position consist of seven bytes 0xFF and a code.
//!
//! Numbers are mapped to the [`Ranges`] configured in the drive. If these ranges are wrong, all numbers are
//! silently scaled.

use crate::drive::{Command, Fault, Feedback, Ranges, State};
use crate::frame::{DecodeError, Form, Frame, Id, exactly};
use crate::range::{Fields, Range};

/// Instruction to a drive, sent as one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Instruction {
    /// Setpoints and gains.
    Command(Command),
    /// The drive starts following commands.
    Enable,
    /// The drive is disabled.
    Disable,
    /// The current position becomes zero.
    SetZero,
}

/// Format of a drive's answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Six bytes: device ID, position, velocity, torque.
    MiniCheetah,
    /// Eight bytes: the six bytes of [`MiniCheetah`](Self::MiniCheetah), an unused byte, and the supply
    /// voltage in a byte whose largest value represents 40 V.
    MiniCheetahVoltage,
    /// Eight bytes: the six bytes of [`MiniCheetah`](Self::MiniCheetah), the temperature (signed, degrees
    /// Celsius), and the error code.
    CubeMars,
    /// Eight bytes: device and state in one byte, position, velocity, torque, temperatures of transistors and
    /// rotor.
    Damiao,
    /// Eight bytes: device, position, velocity, torque, temperature in tenths of a degree Celsius.
    RobStride,
}

impl Reply {
    /// Returns the length of the answer, bytes.
    pub fn length(self) -> usize {
        if self == Self::MiniCheetah { 6 } else { 8 }
    }
}

/// Codec of one drive, for both ends of the bus: identifiers, ranges, and format of its answers.
///
/// ```
/// use motorium_can::drive::Command;
/// use motorium_can::{Id, mit};
///
/// let knee = mit::Drive::mini_cheetah(3);
/// let nothing = knee.command(&Command::default());
/// assert_eq!(nothing.data(), [0x7f, 0xff, 0x7f, 0xf0, 0x00, 0x00, 0x07, 0xff]);
/// assert_eq!(nothing.id, Id::Standard(3));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// ID of the drive. Commands to the drive have this identifier.
    pub node: u8,
    /// Identifier of the drive's answers.
    pub reply_id: Id,
    /// Format of the drive's answers.
    pub reply: Reply,
    /// Form of the drive's frames on the wire.
    pub form: Form,
    ranges: Ranges,
    fields: CommandFields,
}

const ENABLE: u8 = 0xfc;
const DISABLE: u8 = 0xfd;
const SET_ZERO: u8 = 0xfe;
/// Supply voltage field; the largest byte represents 40 V.
const VOLTAGE: Fields<1> = Range::from_zero(40.0).field(8);

/// Returns the data of the frame with this code.
const fn code(code: u8) -> [u8; 8] {
    [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, code]
}

impl Drive {
    /// Creates a codec for a drive with these ranges, whose answers have the identifier `reply_id` and the
    /// format `reply`.
    pub const fn new(node: u8, reply_id: Id, reply: Reply, ranges: Ranges) -> Self {
        Self { node, reply_id, reply, form: Form::Classic, ranges, fields: ranges.fields() }
    }

    /// Creates a codec for a drive with the published firmware of the mini cheetah. Its ranges are
    /// [`Ranges::MINI_CHEETAH`], and its answers have six bytes and the identifier 0.
    pub const fn mini_cheetah(node: u8) -> Self {
        Self::new(node, Id::Standard(0), Reply::MiniCheetah, Ranges::MINI_CHEETAH)
    }

    /// Creates a codec for a Damiao drive with these ranges, whose answers have the identifier `master`.
    pub const fn damiao(node: u8, master: u16, ranges: Ranges) -> Self {
        Self::new(node, Id::Standard(master & 0x7ff), Reply::Damiao, ranges)
    }

    /// Replaces the ranges.
    #[must_use]
    pub const fn with_ranges(self, ranges: Ranges) -> Self {
        Self { ranges, fields: ranges.fields(), ..self }
    }

    /// Returns the ranges of the fields.
    pub const fn ranges(&self) -> &Ranges {
        &self.ranges
    }

    /// Returns the fields of the drive's frames.
    pub const fn fields(&self) -> &CommandFields {
        &self.fields
    }

    /// Returns the identifier of commands to the drive.
    #[inline]
    pub fn id(&self) -> Id {
        Id::Standard(u16::from(self.node))
    }

    /// Returns the frame of a command. Values outside the ranges are clamped.
    // built in place: a returned frame is copied, and the copy stalls until all parts are stored
    #[inline(always)]
    pub fn command(&self, command: &Command) -> Frame {
        let packed = self.fields.pack(command);
        // All fields at their maximum would form the code for enabling, disabling or zeroing, so the torque
        // is reduced.
        let is_code = packed >= u64::from_be_bytes(code(ENABLE));
        self.frame(if is_code { code(ENABLE - 1) } else { packed.to_be_bytes() })
    }

    /// Returns the frame of an instruction.
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

    /// Decodes the instruction in a frame that the drive has received.
    ///
    /// # Errors
    /// Returns an error if the frame is for another drive, has the wrong length, or ends in an unknown code.
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

    /// Returns the frame with which the drive answers. Values that have no field in the `reply` format of the
    /// drive are omitted.
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

    /// Decodes an answer.
    ///
    /// # Errors
    /// Returns an error if the frame has the wrong identifier or length, comes from another drive, or has an
    /// unknown code.
    // decoded in place, like commands
    #[inline(always)]
    pub fn reply(&self, frame: &Frame) -> Result<Feedback, DecodeError> {
        // the first byte is the most significant, in formats with or without the last two bytes
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

impl Ranges {
    /// Ranges of the published firmware for mini cheetah drives.
    pub const MINI_CHEETAH: Self = Self::new(12.5, 65.0, 18.0);
    /// Ranges of the CubeMars AK80-64.
    pub const AK80_64: Self = Self::new(12.5, 8.0, 144.0);
    /// Ranges of the RobStride RS00.
    pub const RS00: Self = Self::new(12.57, 33.0, 14.0);

    /// Returns the fields of a frame that represent these ranges.
    pub const fn fields(&self) -> CommandFields {
        let ranges = [self.position, self.velocity, self.kp, self.kd, self.torque];
        CommandFields(Fields::new(ranges, [16, 12, 12, 12, 12]))
    }
}

/// Fields of a frame, with the conversion factors for their [`Ranges`]. A command has all fields; an answer
/// has three of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandFields(Fields<5>);

/// Extracts twelve bits of a number, starting at bit `from`.
#[inline]
const fn twelve(packed: u64, from: u32) -> u16 {
    (packed >> from) as u16 & 0xfff
}

impl CommandFields {
    /// Returns the command as the drive decodes it: each field clamped to its range and rounded to its
    /// resolution.
    ///
    /// ```
    /// use motorium_can::drive::{Command, Ranges};
    ///
    /// let ranges = Ranges::new(12.5, 30.0, 10.0);
    /// let read = ranges.fields().rounded(&Command { torque: 1.234, ..Command::default() });
    /// assert!((read.torque - 1.234).abs() <= ranges.torque.resolution(12) / 2.0);
    /// assert!(read.velocity < 0.0, "no integer stands for zero in the middle of a range");
    /// ```
    pub fn rounded(&self, command: &Command) -> Command {
        self.command(self.pack(command))
    }

    /// Packs the fields of a command into one number, with the first byte of its frame as the most
    /// significant one.
    #[inline]
    fn pack(&self, command: &Command) -> u64 {
        let Command { position, velocity, kp, kd, torque } = *command;
        let [p, v, kp, kd, t] = self.0.encode_from_end([position, velocity, kp, kd, torque]);
        // the fields fill the whole number, so all bits are inverted together
        !(p << 48 | v << 36 | kp << 24 | kd << 12 | t)
    }

    /// Unpacks a command.
    #[inline]
    fn command(&self, packed: u64) -> Command {
        Command {
            position: self.0.decode::<0>((packed >> 48) as u16),
            velocity: self.0.decode::<1>(twelve(packed, 36)),
            kp: self.0.decode::<2>(twelve(packed, 24)),
            kd: self.0.decode::<3>(twelve(packed, 12)),
            torque: self.0.decode::<4>(twelve(packed, 0)),
        }
    }

    /// Packs position, velocity and torque of an answer into one number, from the lowest bit on.
    fn pack_motion(&self, position: f64, velocity: f64, torque: f64) -> u64 {
        let [p, v, _, _, t] = self.0.encode([position, velocity, 0.0, 0.0, torque]);
        p << 24 | v << 12 | t
    }

    /// Unpacks position, velocity and torque.
    #[inline]
    fn motion(&self, packed: u64) -> [f64; 3] {
        [
            self.0.decode::<0>((packed >> 24) as u16),
            self.0.decode::<1>(twelve(packed, 12)),
            self.0.decode::<4>(twelve(packed, 0)),
        ]
    }
}

fn cubemars_state(code: u8) -> Result<State, DecodeError> {
    Ok(match code {
        0 => State::Unknown,
        1 => State::Fault(Fault::HotMotor),
        2 => State::Fault(Fault::OverCurrent),
        3 => State::Fault(Fault::OverVoltage),
        4 => State::Fault(Fault::UnderVoltage),
        5 => State::Fault(Fault::Encoder),
        6 => State::Fault(Fault::HotTransistors),
        7 => State::Fault(Fault::Overload),
        code => return Err(DecodeError::Field { field: "the error", found: code.into() }),
    })
}

fn cubemars_code(state: State) -> u8 {
    match state {
        State::Fault(Fault::HotMotor) => 1,
        State::Fault(Fault::OverCurrent) => 2,
        State::Fault(Fault::OverVoltage) => 3,
        State::Fault(Fault::UnderVoltage) => 4,
        State::Fault(Fault::Encoder) => 5,
        State::Fault(Fault::HotTransistors) => 6,
        State::Fault(Fault::Overload) => 7,
        // the format has no code for other faults
        _ => 0,
    }
}

fn damiao_state(code: u8) -> Result<State, DecodeError> {
    Ok(match code {
        0x0 => State::Disabled,
        0x1 => State::Enabled,
        0x8 => State::Fault(Fault::OverVoltage),
        0x9 => State::Fault(Fault::UnderVoltage),
        0xa => State::Fault(Fault::OverCurrent),
        0xb => State::Fault(Fault::HotTransistors),
        0xc => State::Fault(Fault::HotMotor),
        0xd => State::Fault(Fault::CommunicationLost),
        0xe => State::Fault(Fault::Overload),
        code => return Err(DecodeError::Field { field: "the state", found: code.into() }),
    })
}

fn damiao_code(state: State) -> u8 {
    match state {
        State::Unknown | State::Disabled => 0x0,
        State::Enabled => 0x1,
        State::Fault(Fault::OverVoltage) => 0x8,
        State::Fault(Fault::UnderVoltage) => 0x9,
        State::Fault(Fault::OverCurrent) => 0xa,
        State::Fault(Fault::HotTransistors) => 0xb,
        State::Fault(Fault::HotMotor) => 0xc,
        State::Fault(Fault::CommunicationLost) => 0xd,
        State::Fault(Fault::Overload | Fault::Encoder | Fault::Other(_)) => 0xe,
    }
}
