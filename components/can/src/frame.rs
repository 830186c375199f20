//! Frames of CAN and CAN FD buses, and packets of serial lines.

use core::fmt;

/// Identifier of a frame. If two frames start simultaneously, the one with the lower identifier wins
/// arbitration.
///
/// ```
/// use motorium_can::Id;
///
/// assert_eq!(Id::standard(0x141), Some(Id::Standard(0x141)));
/// assert_eq!(Id::standard(0x800), None, "11 bits");
/// assert!(Id::Standard(0x141).arbitration() < Id::Extended(0x141 << 18).arbitration());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Id {
    /// Identifier of 11 bits.
    Standard(u16),
    /// Identifier of 29 bits.
    Extended(u32),
}

impl Id {
    /// Creates an 11-bit identifier; `None` for a larger number.
    pub fn standard(id: u16) -> Option<Self> {
        (id < 1 << 11).then_some(Self::Standard(id))
    }

    /// Creates a 29-bit identifier; `None` for a larger number.
    pub fn extended(id: u32) -> Option<Self> {
        (id < 1 << 29).then_some(Self::Extended(id))
    }

    /// Returns the bits of the arbitration field as a number, in transmission order and without the remote
    /// bit. If two frames start simultaneously, the one with the smaller number wins. A standard identifier
    /// wins over an extended one with the same first 11 bits.
    pub fn arbitration(self) -> u32 {
        match self {
            Self::Standard(id) => u32::from(id) << 21,
            // substitute remote request and identifier extension are both recessive
            Self::Extended(id) => (id >> 18) << 21 | 0b11 << 19 | (id & 0x3_ffff) << 1,
        }
    }
}

impl fmt::Display for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Standard(id) => write!(f, "0x{id:03X}"),
            Self::Extended(id) => write!(f, "0x{id:08X}"),
        }
    }
}

/// Form of a frame on the wire: classic CAN, CAN FD or a serial packet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Form {
    /// Classic CAN: up to 8 bytes.
    #[default]
    Classic,
    /// CAN FD: up to 64 bytes, all at the arbitration rate.
    Fd,
    /// CAN FD with its data at the data rate.
    FdFast,
    /// Packet of a serial line, such as a servo packet: up to 64 bytes, with header and checksum.
    Packet,
}

impl Form {
    /// Returns the maximum number of data bytes.
    pub fn capacity(self) -> usize {
        match self {
            Self::Classic => 8,
            Self::Fd | Self::FdFast | Self::Packet => 64,
        }
    }
}

/// Data frame of a CAN or CAN FD bus, or a packet of a serial line.
///
/// ```
/// use motorium_can::{Form, Frame, Id};
///
/// let frame = Frame::classic(Id::Standard(0x141), &[0x9c, 0]);
/// assert_eq!((frame.data(), frame.form), (&[0x9c, 0][..], Form::Classic));
/// ```
#[derive(Clone, Copy)]
pub struct Frame {
    /// Identifier of the frame.
    pub id: Id,
    /// Form on the wire.
    pub form: Form,
    length: u8,
    data: [u8; 64],
}

impl Frame {
    /// Number of data bytes of a CAN FD frame for each data length code.
    pub(crate) const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

    /// Creates a classic CAN frame.
    ///
    /// # Panics
    /// Panics if the data has more than 8 bytes.
    pub fn classic(id: Id, data: &[u8]) -> Self {
        Self::new(id, Form::Classic, data).expect("at most 8 bytes")
    }

    /// Creates a frame of eight bytes, a length supported by every form.
    #[inline]
    pub(crate) fn of_eight(id: Id, form: Form, eight: [u8; 8]) -> Self {
        let mut data = [0; 64];
        data[..8].copy_from_slice(&eight);
        Self { id, form, length: 8, data }
    }

    /// Creates a packet of a serial line for the device with this number; `None` beyond 64 bytes.
    pub fn packet(device: u8, bytes: &[u8]) -> Option<Self> {
        Self::new(Id::Standard(device.into()), Form::Packet, bytes)
    }

    /// Creates a frame of any form; `None` if the form does not support the number of bytes. CAN FD supports
    /// 0 to 8, 12, 16, 20, 24, 32, 48 and 64 bytes.
    pub fn new(id: Id, form: Form, data: &[u8]) -> Option<Self> {
        let length = data.len();
        let is_length =
            length <= 8 || form == Form::Packet || matches!(length, 12 | 16 | 20 | 24 | 32 | 48 | 64);
        if length > form.capacity() || !is_length {
            return None;
        }
        let mut frame = Self { id, form, length: length as u8, data: [0; 64] };
        frame.data[..length].copy_from_slice(data);
        Some(frame)
    }

    /// Changes the form, keeping the data.
    #[must_use]
    pub fn in_form(self, form: Form) -> Self {
        debug_assert!(usize::from(self.length) <= form.capacity());
        Self { form, ..self }
    }

    /// Returns the data bytes.
    #[inline]
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.length).min(64)]
    }

    /// Returns mutable data bytes.
    pub fn data_mut(&mut self) -> &mut [u8] {
        &mut self.data[..usize::from(self.length).min(64)]
    }
}

impl Default for Frame {
    /// Returns an empty frame with the 11-bit identifier of the lowest priority.
    fn default() -> Self {
        Self { id: Id::Standard(0x7ff), form: Form::Classic, length: 0, data: [0; 64] }
    }
}

impl PartialEq for Frame {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id && self.form == other.form && self.data() == other.data()
    }
}

impl Eq for Frame {}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#", self.id)?;
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// Error returned when a frame cannot be decoded.
///
/// ```
/// use motorium_can::{DecodeError, Frame, Id, mit};
///
/// let short = Frame::classic(Id::Standard(0), &[1, 2, 3]);
/// let drive = mit::Drive::mini_cheetah(1);
/// assert_eq!(drive.reply(&short), Err(DecodeError::Length { found: 3, expected: 6 }));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// The identifier of the frame is not the expected one.
    #[error("the frame has the identifier {found}, expected {expected}")]
    Id {
        /// Identifier found.
        found: Id,
        /// Identifier expected.
        expected: Id,
    },
    /// The frame has the expected identifier, but comes from an unexpected device.
    #[error("the frame comes from device {found}, expected {expected}")]
    Device {
        /// Device named in the data.
        found: u8,
        /// Device expected.
        expected: u8,
    },
    /// The frame has the wrong length.
    #[error("the frame has {found} bytes, expected {expected}")]
    Length {
        /// Number of bytes found.
        found: usize,
        /// Number of bytes expected.
        expected: usize,
    },
    /// A field has a value that the protocol does not define, or a reserved bit is set.
    #[error("{field} is 0x{found:X}, which the protocol does not define")]
    Field {
        /// Field.
        field: &'static str,
        /// Value of the field.
        found: u32,
    },
    /// A number is not finite.
    #[error("{field} is not finite")]
    NotFinite {
        /// Field.
        field: &'static str,
    },
    /// A number is beyond the measuring range of the device.
    #[error("{field} is implausible: the value is beyond the measuring range of the device")]
    Implausible {
        /// Field.
        field: &'static str,
    },
    /// The frame answers a request for a register or object other than the requested one.
    #[error("the answer concerns register or object 0x{found:X}, expected 0x{expected:X}")]
    Answer {
        /// Register or object in the answer.
        found: u32,
        /// Register or object requested.
        expected: u32,
    },
    /// The device refused the request.
    #[error("the device refused: code 0x{code:08X}")]
    Refused {
        /// Code with which the device refused the request.
        code: u32,
    },
}

/// Returns the data of a frame with exactly `N` bytes and this identifier.
#[inline]
pub(crate) fn exactly<const N: usize>(frame: &Frame, expected: Id) -> Result<&[u8; N], DecodeError> {
    if frame.id != expected {
        return Err(DecodeError::Id { found: frame.id, expected });
    }
    let found = frame.data().len();
    frame.data().try_into().map_err(|_| DecodeError::Length { found, expected: N })
}

/// Decodes a finite little-endian number of four bytes.
pub(crate) fn finite(bytes: [u8; 4], field: &'static str) -> Result<f64, DecodeError> {
    let value = f32::from_le_bytes(bytes);
    if value.is_finite() { Ok(f64::from(value)) } else { Err(DecodeError::NotFinite { field }) }
}
