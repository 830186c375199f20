//! Subframes: registers as encoded in a frame.

use crate::frame::{DecodeError, Form, Frame, Id};

/// Encoding of registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// 8 bits.
    Int8,
    /// 16 bits: positions resolve 0.0001 turns, up to 3.3 turns.
    Int16,
    /// 32 bits.
    Int32,
    /// 32-bit floating-point numbers.
    Float,
}

impl Resolution {
    fn from_bits(bits: u8) -> Self {
        [Self::Int8, Self::Int16, Self::Int32, Self::Float][usize::from(bits & 3)]
    }

    fn bits(self) -> u8 {
        self as u8
    }

    fn bytes(self) -> usize {
        match self {
            Self::Int8 => 1,
            Self::Int16 => 2,
            Self::Int32 | Self::Float => 4,
        }
    }
}

/// Quantity in a register, which determines its scales.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Quantity {
    Number,
    Position,
    Velocity,
    Torque,
    Share,
    Time,
    Voltage,
    Temperature,
}

impl Quantity {
    /// Returns the quantity in a supported register.
    fn from_register(register: u32) -> Option<Self> {
        Some(match register {
            MODE | HOME | FAULT => Self::Number,
            POSITION | COMMAND | 0x26 => Self::Position,
            VELOCITY | 0x21 => Self::Velocity,
            TORQUE | 0x22 | 0x25 => Self::Torque,
            0x23 | 0x24 => Self::Share,
            WATCHDOG => Self::Time,
            VOLTAGE => Self::Voltage,
            TEMPERATURE | MOTOR_TEMPERATURE => Self::Temperature,
            _ => return None,
        })
    }

    /// Returns the value of one integer step.
    fn step(self, resolution: Resolution) -> f64 {
        let steps = match self {
            Self::Number => [1.0; 3],
            Self::Position => [0.01, 0.0001, 0.00001],
            Self::Velocity => [0.1, 0.00025, 0.00001],
            Self::Torque => [0.5, 0.01, 0.001],
            Self::Share => [1.0 / 127.0, 1.0 / 32767.0, 1.0 / 2_147_483_647.0],
            Self::Time => [0.01, 0.001, 0.000_001],
            Self::Voltage => [0.5, 0.1, 0.001],
            Self::Temperature => [1.0, 0.1, 0.001],
        };
        match resolution {
            Resolution::Int8 => steps[0],
            Resolution::Int16 => steps[1],
            Resolution::Int32 => steps[2],
            Resolution::Float => 1.0,
        }
    }
}

pub(super) const MODE: u32 = 0x00;
pub(super) const POSITION: u32 = 0x01;
pub(super) const VELOCITY: u32 = 0x02;
pub(super) const TORQUE: u32 = 0x03;
/// Temperature of the motor, degrees Celsius; 0 unless a thermistor is connected and enabled.
pub(super) const MOTOR_TEMPERATURE: u32 = 0x0a;
/// Position reference: power-up position, rotor or output.
pub(super) const HOME: u32 = 0x0c;
pub(super) const VOLTAGE: u32 = 0x0d;
pub(super) const TEMPERATURE: u32 = 0x0e;
pub(super) const FAULT: u32 = 0x0f;
pub(super) const COMMAND: u32 = 0x20;
pub(super) const WATCHDOG: u32 = 0x27;
/// Registers of a command: position, velocity, torque, gains, largest torque, stop position, watchdog.
pub(super) const COMMANDED: u32 = 8;

pub(super) const WRITE: u8 = 0x00;
pub(super) const READ: u8 = 0x10;
pub(super) const REPLY: u8 = 0x20;
pub(super) const WRITE_ERROR: u8 = 0x30;
pub(super) const READ_ERROR: u8 = 0x31;
pub(super) const NOTHING: u8 = 0x50;

/// Output buffer.
#[derive(Debug)]
pub(super) struct Writer {
    data: [u8; 64],
    length: usize,
}

impl Default for Writer {
    fn default() -> Self {
        Self { data: [0; 64], length: 0 }
    }
}

impl Writer {
    pub(super) fn put(&mut self, bytes: &[u8]) {
        self.data[self.length..self.length + bytes.len()].copy_from_slice(bytes);
        self.length += bytes.len();
    }

    /// Writes the header of a subframe with `count` registers.
    pub(super) fn head(&mut self, kind: u8, resolution: Resolution, register: u32, count: usize) {
        let kind = kind | resolution.bits() << 2;
        if (1..=3).contains(&count) {
            self.put(&[kind | count as u8, register as u8]);
        } else {
            self.put(&[kind, count as u8, register as u8]);
        }
    }

    pub(super) fn value(&mut self, value: f64, register: u32, resolution: Resolution) {
        let step = Quantity::from_register(register).unwrap_or(Quantity::Number).step(resolution);
        // the smallest integer represents a missing value
        let whole = |most: f64| if value.is_nan() { -most - 1.0 } else { (value / step).clamp(-most, most) };
        match resolution {
            Resolution::Int8 => self.put(&(whole(127.0) as i8).to_le_bytes()),
            Resolution::Int16 => self.put(&(whole(32767.0) as i16).to_le_bytes()),
            Resolution::Int32 => self.put(&(whole(2_147_483_647.0) as i32).to_le_bytes()),
            Resolution::Float => self.put(&(value as f32).to_le_bytes()),
        }
    }

    pub(super) fn frame(mut self, id: Id) -> Frame {
        let length = Frame::LENGTHS.into_iter().find(|fits| *fits >= self.length).unwrap_or(64);
        self.data[self.length..length].fill(NOTHING);
        Frame::new(id, Form::FdFast, &self.data[..length]).unwrap_or_default()
    }
}

/// Register in a frame: operation, register number, and value if present.
pub(super) type Register = (u8, u32, f64);

/// Passes each register of a frame to `take`, in order.
pub(super) fn registers(
    data: &[u8],
    mut take: impl FnMut(Register) -> Result<(), DecodeError>,
) -> Result<(), DecodeError> {
    let mut rest = data;
    let short = || DecodeError::Length { found: data.len(), expected: data.len() + 1 };
    let mut next = |count: usize| -> Result<&[u8], DecodeError> {
        let (bytes, left) = rest.split_at_checked(count).ok_or_else(short)?;
        rest = left;
        Ok(bytes)
    };
    let mut read = 0;
    while read < data.len() {
        let kind = next(1)?[0];
        read += 1;
        if kind == NOTHING {
            continue;
        }
        if matches!(kind, WRITE_ERROR | READ_ERROR) {
            let bytes = next(2)?;
            return Err(DecodeError::Refused { code: u32::from(bytes[0]) << 8 | u32::from(bytes[1]) });
        }
        if kind >= WRITE_ERROR {
            return Err(DecodeError::Field { field: "the subframe", found: kind.into() });
        }
        let (action, resolution) = (kind & 0x30, Resolution::from_bits(kind >> 2));
        let count = match kind & 3 {
            0 => {
                read += 1;
                next(1)?[0]
            }
            count => count,
        };
        let first = u32::from(next(1)?[0]);
        read += 1;
        if first >= 0x80 || count == 0 {
            // multi-byte register numbers are not supported
            return Err(DecodeError::Field { field: "the register", found: first });
        }
        for register in (first..).take(count.into()) {
            let value = if action == READ {
                0.0
            } else {
                read += resolution.bytes();
                value(next(resolution.bytes())?, register, resolution)
            };
            take((action, register, value))?;
        }
    }
    Ok(())
}

fn value(bytes: &[u8], register: u32, resolution: Resolution) -> f64 {
    let number = match *bytes {
        [a] => i32::from(a as i8),
        [a, b] => i32::from(i16::from_le_bytes([a, b])),
        [a, b, c, d] if resolution == Resolution::Float => {
            return f64::from(f32::from_le_bytes([a, b, c, d]));
        }
        [a, b, c, d] => i32::from_le_bytes([a, b, c, d]),
        _ => 0,
    };
    let none = match resolution {
        Resolution::Int8 => i32::from(i8::MIN),
        Resolution::Int16 => i32::from(i16::MIN),
        _ => i32::MIN,
    };
    let quantity = Quantity::from_register(register).unwrap_or(Quantity::Number);
    if number == none && quantity != Quantity::Number {
        f64::NAN
    } else {
        f64::from(number) * quantity.step(resolution)
    }
}
