//! Frames of CAN and CAN FD buses, and packets of serial lines.

use core::fmt;

/// The identifier of a frame: the lower of two wins the bus.
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
    /// 11 bits.
    Standard(u16),
    /// 29 bits.
    Extended(u32),
}

impl Id {
    /// An identifier of 11 bits; `None` for a larger number.
    pub fn standard(id: u16) -> Option<Self> {
        (id < 1 << 11).then_some(Self::Standard(id))
    }

    /// An identifier of 29 bits; `None` for a larger number.
    pub fn extended(id: u32) -> Option<Self> {
        (id < 1 << 29).then_some(Self::Extended(id))
    }

    /// Bits of the arbitration field in the order of transmission, without the remote bit: of two frames that
    /// start together the one with the smaller number is sent. A standard identifier wins over an extended
    /// one with the same first 11 bits.
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

/// The form of a frame on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Form {
    /// Classic CAN: up to 8 bytes.
    #[default]
    Classic,
    /// CAN FD: up to 64 bytes, all at the rate of the arbitration.
    Fd,
    /// CAN FD with its data at the higher rate.
    FdFast,
    /// A packet of a serial line, such as a servo's: up to 64 bytes, including header and checksum.
    Packet,
}

impl Form {
    /// Bytes of the longest frame.
    pub fn capacity(self) -> usize {
        match self {
            Self::Classic => 8,
            Self::Fd | Self::FdFast | Self::Packet => 64,
        }
    }
}

/// A data frame of a CAN or CAN FD bus, or a packet of a serial line.
///
/// ```
/// use motorium_can::{Form, Frame, Id};
///
/// let frame = Frame::classic(Id::Standard(0x141), &[0x9c, 0]);
/// assert_eq!((frame.data(), frame.form), (&[0x9c, 0][..], Form::Classic));
/// ```
#[derive(Clone, Copy)]
pub struct Frame {
    /// Its identifier.
    pub id: Id,
    /// Its form.
    pub form: Form,
    length: u8,
    data: [u8; 64],
}

impl Frame {
    /// A frame of classic CAN.
    ///
    /// # Panics
    /// If the data has more than 8 bytes.
    pub fn classic(id: Id, data: &[u8]) -> Self {
        Self::new(id, Form::Classic, data).expect("at most 8 bytes")
    }

    /// A frame of eight bytes, which every form can have.
    #[inline]
    pub(crate) fn of_eight(id: Id, form: Form, eight: [u8; 8]) -> Self {
        let mut data = [0; 64];
        data[..8].copy_from_slice(&eight);
        Self { id, form, length: 8, data }
    }

    /// A packet of a serial line, of the device with this number; `None` beyond 64 bytes.
    pub fn packet(device: u8, bytes: &[u8]) -> Option<Self> {
        Self::new(Id::Standard(device.into()), Form::Packet, bytes)
    }

    /// Creates a frame of any form; `None` if it cannot have this length. CAN FD supports 0 to 8, 12, 16, 20,
    /// 24, 32, 48 and 64 bytes.
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

    /// The same data in another form.
    #[must_use]
    pub fn in_form(self, form: Form) -> Self {
        debug_assert!(usize::from(self.length) <= form.capacity());
        Self { form, ..self }
    }

    /// The bytes in use.
    #[inline]
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.length).min(64)]
    }

    /// The bytes in use, to be changed.
    pub fn data_mut(&mut self) -> &mut [u8] {
        &mut self.data[..usize::from(self.length).min(64)]
    }
}

impl Default for Frame {
    /// An empty frame with the identifier that loses against all others of 11 bits.
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

/// A frame that cannot be decoded.
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
    /// Addressed to another node.
    #[error("a frame with the identifier {found}, expected {expected}")]
    Id {
        /// The identifier found.
        found: Id,
        /// Identifier of the frame.
        expected: Id,
    },
    /// Sent by another device with the same identifier.
    #[error("a frame of device {found}, expected {expected}")]
    Device {
        /// The device named in the data.
        found: u8,
        /// The device that was to answer.
        expected: u8,
    },
    /// Unexpected length.
    #[error("{found} bytes, expected {expected}")]
    Length {
        /// Bytes found.
        found: usize,
        /// Bytes that a frame of this kind has.
        expected: usize,
    },
    /// A field has a value that the protocol does not know, or a reserved bit is set.
    #[error("{field} is 0x{found:X}, which the protocol does not know")]
    Field {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u32,
    },
    /// A number is not finite.
    #[error("{field} is not finite")]
    NotFinite {
        /// The field.
        field: &'static str,
    },
    /// A number is beyond anything that the device can have measured.
    #[error("{field} cannot be: it is beyond what the device can have reached")]
    Implausible {
        /// The field.
        field: &'static str,
    },
    /// Answers something that was not requested.
    #[error("an answer about 0x{found:X}, asked was 0x{expected:X}")]
    Answer {
        /// The register or object that it is about.
        found: u32,
        /// Requested register or object.
        expected: u32,
    },
    /// The device refused the request.
    #[error("the device refused: code 0x{code:08X}")]
    Refused {
        /// The device's code.
        code: u32,
    },
}

/// The data of a frame of exactly `N` bytes and this identifier.
#[inline]
pub(crate) fn exactly<const N: usize>(frame: &Frame, expected: Id) -> Result<&[u8; N], DecodeError> {
    if frame.id != expected {
        return Err(DecodeError::Id { found: frame.id, expected });
    }
    let found = frame.data().len();
    frame.data().try_into().map_err(|_| DecodeError::Length { found, expected: N })
}

/// A finite number of four bytes, little-endian.
pub(crate) fn finite(bytes: [u8; 4], field: &'static str) -> Result<f64, DecodeError> {
    let value = f32::from_le_bytes(bytes);
    if value.is_finite() { Ok(f64::from(value)) } else { Err(DecodeError::NotFinite { field }) }
}
