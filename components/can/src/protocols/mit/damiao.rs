//! Registers of Damiao drives, with settings that must be known before a drive is enabled.
//!
//! All drives on a bus listen to the identifier 0x7FF; the first two bytes contain the ID of the addressed
//! drive. The answer to a request has the same identifier as the drive's answers to commands, and repeats the
//! request.

use crate::frame::{DecodeError, Frame, Id, exactly, finite};

/// Identifier that all drives listen to.
pub(crate) const EVERYBODY: Id = Id::Standard(0x7ff);
const READ: u8 = 0x33;
const WRITE: u8 = 0x55;
/// Unit of the watchdog register, ns.
const TIMEOUT_NS: u64 = 50_000;

/// Register of a Damiao drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Register {
    /// Current at which the drive disables itself, as a fraction of its full current.
    OverCurrent = 3,
    /// Time without a command after which the drive disables itself, in units of 50 us; 0 for never.
    Timeout = 9,
    /// Control mode: 1 MIT, 2 position and velocity, 3 velocity, 4 position and force.
    ControlMode = 10,
    /// Largest position of the range, rad.
    PositionMax = 21,
    /// Largest velocity of the range, rad/s.
    VelocityMax = 22,
    /// Largest torque of the range, N m.
    TorqueMax = 23,
}

impl Register {
    /// Registers read before a drive is enabled, in the given order.
    pub const CHECKED: [Self; 5] =
        [Self::Timeout, Self::ControlMode, Self::PositionMax, Self::VelocityMax, Self::TorqueMax];
    /// Value of [`ControlMode`](Self::ControlMode) with which a drive follows MIT commands.
    pub const MIT_MODE: u32 = 1;

    /// Returns the name of the register.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OverCurrent => "OverCurrent",
            Self::Timeout => "Timeout",
            Self::ControlMode => "ControlMode",
            Self::PositionMax => "PositionMax",
            Self::VelocityMax => "VelocityMax",
            Self::TorqueMax => "TorqueMax",
        }
    }

    fn from_code(code: u8) -> Result<Self, DecodeError> {
        let mut all = Self::CHECKED.into_iter().chain([Self::OverCurrent]);
        let found = all.find(|register| *register as u8 == code);
        found.ok_or(DecodeError::Field { field: "the register", found: code.into() })
    }
}

/// Value of a register.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Time without a command after which the drive disables itself, ns; `None` for never.
    Watchdog(Option<u64>),
    /// Control mode.
    Mode(u32),
    /// Limit of a range (rad, rad/s or N m), or a fraction of the full current.
    Number(f64),
}

/// Read or write request for a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// ID of the addressed drive.
    pub node: u8,
    /// Register.
    pub register: Register,
}

impl Request {
    /// Returns the frame that reads the register.
    ///
    /// ```
    /// use motorium_can::damiao::{Register, Request};
    ///
    /// let request = Request { node: 1, register: Register::VelocityMax };
    /// assert_eq!(request.frame().data(), [1, 0, 0x33, 22, 0, 0, 0, 0]);
    /// ```
    pub fn frame(&self) -> Frame {
        Frame::classic(EVERYBODY, &[self.node, 0, READ, self.register as u8, 0, 0, 0, 0])
    }

    /// Returns the frame that sets the register to `number`. The value is lost at power-off.
    ///
    /// ```
    /// use motorium_can::damiao::{Register, Request};
    ///
    /// let request = Request { node: 1, register: Register::OverCurrent };
    /// assert_eq!(request.change(0.5).data(), [1, 0, 0x55, 3, 0, 0, 0, 0x3f]);
    /// ```
    pub fn change(&self, number: f64) -> Frame {
        let [a, b, c, d] = (number as f32).to_le_bytes();
        Frame::classic(EVERYBODY, &[self.node, 0, WRITE, self.register as u8, a, b, c, d])
    }

    /// Decodes the register and number of a write request that the drive has received.
    ///
    /// # Errors
    /// Returns an error if the frame does not write a supported register, or addresses another drive.
    pub fn decode_change(frame: &Frame, node: u8) -> Result<(Self, f64), DecodeError> {
        let data: &[u8; 8] = exactly(frame, EVERYBODY)?;
        let [low, high, action, register, a, b, c, d] = *data;
        if (low, high) != (node, 0) {
            return Err(DecodeError::Device { found: low, expected: node });
        }
        if action != WRITE || register != Register::OverCurrent as u8 {
            return Err(DecodeError::Field { field: "the action", found: action.into() });
        }
        let number = finite([a, b, c, d], "the number of a register")?;
        Ok((Self { node, register: Register::OverCurrent }, number))
    }

    /// Returns the drive's answer to a write request, with the identifier `master`. The answer echoes the
    /// data of the request.
    pub fn changed(&self, master: Id, number: f64) -> Frame {
        Frame::classic(master, self.change(number).data())
    }

    /// Decodes a read request that the drive has received in a frame to all drives.
    ///
    /// # Errors
    /// Returns an error if the frame does not read a supported register, or addresses another drive.
    pub fn decode(frame: &Frame, node: u8) -> Result<Self, DecodeError> {
        let data: &[u8; 8] = exactly(frame, EVERYBODY)?;
        let [low, high, action, register, ..] = *data;
        if (low, high) != (node, 0) {
            return Err(DecodeError::Device { found: low, expected: node });
        }
        if action != READ {
            return Err(DecodeError::Field { field: "the action", found: action.into() });
        }
        Ok(Self { node, register: Register::from_code(register)? })
    }

    /// Returns the drive's answer to a read request: `value`, with the identifier `master`.
    pub fn answer(&self, master: Id, value: Value) -> Frame {
        let bytes = match value {
            Value::Watchdog(time) => {
                let units = time.unwrap_or(0).div_ceil(TIMEOUT_NS);
                u32::try_from(units).unwrap_or(u32::MAX).to_le_bytes()
            }
            Value::Mode(mode) => mode.to_le_bytes(),
            Value::Number(max) => (max as f32).to_le_bytes(),
        };
        let [a, b, c, d] = bytes;
        Frame::classic(master, &[self.node, 0, READ, self.register as u8, a, b, c, d])
    }

    /// Returns `true` if the frame is this drive's answer to a read or write request for a register, rather
    /// than an answer to a command.
    pub fn is_answer(&self, frame: &Frame, master: Id) -> bool {
        let asks = |data: &[u8]| data[0] == self.node && data[1] == 0 && matches!(data[2], READ | WRITE);
        frame.id == master && frame.data().len() == 8 && asks(frame.data())
    }

    /// Decodes the value in an answer with the identifier `master`.
    ///
    /// # Errors
    /// Returns an error if the answer comes from another drive or concerns a register that was not requested,
    /// or if its number is not finite.
    pub fn value(&self, frame: &Frame, master: Id) -> Result<Value, DecodeError> {
        self.value_of(READ, frame, master)
    }

    /// Decodes the number that the drive confirms after a write.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`value`](Self::value).
    pub fn changed_value(&self, frame: &Frame, master: Id) -> Result<Value, DecodeError> {
        self.value_of(WRITE, frame, master)
    }

    fn value_of(&self, expected: u8, frame: &Frame, master: Id) -> Result<Value, DecodeError> {
        let data: &[u8; 8] = exactly(frame, master)?;
        let [low, high, action, register, a, b, c, d] = *data;
        if (low, high) != (self.node, 0) {
            return Err(DecodeError::Device { found: low, expected: self.node });
        }
        if action != expected {
            return Err(DecodeError::Field { field: "the action", found: action.into() });
        }
        if register != self.register as u8 {
            return Err(DecodeError::Answer { found: register.into(), expected: self.register as u32 });
        }
        let bytes = [a, b, c, d];
        match self.register {
            Register::Timeout => {
                let units = u64::from(u32::from_le_bytes(bytes));
                Ok(Value::Watchdog((units > 0).then_some(units * TIMEOUT_NS)))
            }
            Register::ControlMode => Ok(Value::Mode(u32::from_le_bytes(bytes))),
            _ => finite(bytes, "the number of a register").map(Value::Number),
        }
    }
}
