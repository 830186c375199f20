//! Bits of a frame on the wire, including bit stuffing.
//!
//! A frame extends from its start bit to the three bits of interframe space. A bit of the opposite value is
//! inserted after every five equal bits; in the CRC field of CAN FD, stuff bits have fixed positions. A byte
//! on a serial line has ten bits.

use crate::frame::{Form, Frame, Id};

/// Bitrates of a bus.
///
/// ```
/// use motorium_can::{Bits, Rates};
///
/// let rates = Rates { nominal: 1_000_000, fast: 5_000_000 };
/// assert_eq!(Bits { nominal: 30, fast: 96 }.ns(&rates), 49_200);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rates {
    /// Arbitration bitrate, bit/s; also the bitrate of whole classic frames.
    pub nominal: u32,
    /// Data bitrate of CAN FD frames with bitrate switching, bit/s.
    pub fast: u32,
}

/// Number of bits of a frame at each bitrate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bits {
    /// Bits at the arbitration rate, including the interframe space.
    pub nominal: u32,
    /// Bits at the data rate.
    pub fast: u32,
}

/// Number of bits from the CRC delimiter to the end of the interframe space, which are never stuffed.
const TAIL: u32 = 13;

impl Bits {
    /// Returns the transmission time at these bitrates, ns, rounded up.
    pub fn ns(self, rates: &Rates) -> u64 {
        let time = |bits: u32, rate: u32| (u64::from(bits) * 1_000_000_000).div_ceil(u64::from(rate.max(1)));
        time(self.nominal, rates.nominal) + time(self.fast, rates.fast)
    }

    /// Returns the exact number of bits of this frame.
    ///
    /// ```
    /// use motorium_can::{Bits, Frame, Id};
    ///
    /// let zeros = Frame::classic(Id::Standard(0), &[0; 8]);
    /// assert!(Bits::from_frame(&zeros).nominal > Bits::from_frame(&Frame::classic(Id::Standard(0x2aa), &[0x55; 8])).nominal);
    /// ```
    pub fn from_frame(frame: &Frame) -> Self {
        let mut wire = Wire::new();
        let data = frame.data();
        if frame.form == Form::Packet {
            return Self::nominal(false, frame.form, data.len());
        }
        match (frame.id, frame.form) {
            (Id::Standard(id), Form::Classic) => {
                wire.push(u32::from(id), 12); // the start bit is zero
                wire.push(0, 3);
            }
            (Id::Extended(id), Form::Classic) => {
                wire.push(id >> 18, 12);
                wire.push(0b11, 2);
                wire.push(id & 0x3_ffff, 18);
                wire.push(0, 3);
            }
            (Id::Standard(id), form) => {
                wire.push(u32::from(id), 12);
                // no remote request, no extension, CAN FD, reserved, rate switch
                wire.push(if form == Form::FdFast { 0b00101 } else { 0b00100 }, 5);
            }
            (Id::Extended(id), form) => {
                wire.push(id >> 18, 12);
                wire.push(0b11, 2);
                wire.push(id & 0x3_ffff, 18);
                wire.push(if form == Form::FdFast { 0b0101 } else { 0b0100 }, 4);
            }
        }
        let head = wire.count;
        if frame.form != Form::Classic {
            wire.push(0, 1); // the sender is not error-passive
        }
        wire.push(length_code(data.len()), 4);
        data.iter().for_each(|byte| wire.push((*byte).into(), 8));
        if frame.form == Form::Classic {
            let checksum = wire.checksum;
            wire.push(checksum.into(), 15);
            return Self { nominal: wire.count + TAIL, fast: 0 };
        }
        let body = wire.count - head + checksum_field(data.len());
        match frame.form {
            Form::FdFast => Self { nominal: head + TAIL, fast: body },
            _ => Self { nominal: head + body + TAIL, fast: 0 },
        }
    }

    /// Returns the largest number of bits that a frame of this form with `bytes` bytes can have.
    pub fn worst(is_extended: bool, form: Form, bytes: usize) -> Self {
        let plain = Self::nominal(is_extended, form, bytes);
        if form == Form::Packet {
            return plain;
        }
        // one stuff bit after the first five equal bits, then after every four
        let stuffed = |bits: u32| (bits - 1) / 4;
        if form == Form::Classic {
            return Self { nominal: plain.nominal + stuffed(plain.nominal - TAIL), fast: 0 };
        }
        let all = plain.nominal + plain.fast - TAIL - checksum_field(bytes);
        if form == Form::Fd {
            return Self { nominal: plain.nominal + stuffed(all), fast: 0 };
        }
        let head = stuffed(plain.nominal - TAIL);
        Self { nominal: plain.nominal + head, fast: plain.fast + stuffed(all) - head }
    }

    /// Returns the number of bits of a frame of this form with `bytes` bytes, without stuffing.
    pub fn nominal(is_extended: bool, form: Form, bytes: usize) -> Self {
        let bits = 8 * bytes as u32;
        match (form, is_extended) {
            // a start bit and a stop bit for each byte
            (Form::Packet, _) => Self { nominal: 10 * bytes as u32, fast: 0 },
            (Form::Classic, extended) => {
                Self { nominal: if extended { 39 } else { 19 } + bits + 15 + TAIL, fast: 0 }
            }
            (form, extended) => {
                let head = if extended { 36 } else { 17 };
                let body = 5 + bits + checksum_field(bytes);
                match form {
                    Form::FdFast => Self { nominal: head + TAIL, fast: body },
                    _ => Self { nominal: head + body + TAIL, fast: 0 },
                }
            }
        }
    }
}

impl core::ops::Add for Bits {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { nominal: self.nominal + other.nominal, fast: self.fast + other.fast }
    }
}

/// Returns the stuff count and CRC of CAN FD, including the fixed stuff bits.
fn checksum_field(bytes: usize) -> u32 {
    if bytes <= 16 { 4 + 17 + 6 } else { 4 + 21 + 7 }
}

/// Returns the data length code for a number of bytes.
fn length_code(bytes: usize) -> u32 {
    match bytes {
        0..=8 => bytes as u32,
        12 => 9,
        16 => 10,
        20 => 11,
        24 => 12,
        32 => 13,
        48 => 14,
        _ => 15,
    }
}

/// Bits on the wire: counts them with stuffing, and updates the 15-bit CRC.
struct Wire {
    count: u32,
    run: Run,
    checksum: u16,
}

impl Wire {
    fn new() -> Self {
        Self { count: 0, run: Run::START, checksum: 0 }
    }

    /// Adds the lowest `bits` bits of a value, most significant first.
    fn push(&mut self, value: u32, bits: u32) {
        let whole = bits / 8;
        for place in (8 * whole..bits).rev() {
            let bit = value >> place & 1 == 1;
            self.count += 1 + u32::from(self.run.add(bit));
            self.checksum = checked(self.checksum, bit);
        }
        for place in (0..whole).rev() {
            let byte = usize::from((value >> (8 * place)) as u8);
            let Stuffed { inserted, run } = STUFFED[self.run.0 as usize][byte];
            (self.count, self.run) = (self.count + 8 + u32::from(inserted), run);
            let place = usize::from(self.checksum >> 7) ^ byte;
            self.checksum = (self.checksum << 8 & CHECKSUM_BITS) ^ CHECKSUMS[place];
        }
    }
}

/// Run of equal bits at the end of the wire, encoded as `bit + 2 * (number - 1)`. A run has at most four
/// bits, because a stuff bit follows the fifth. [`Run::START`] is the state before the first bit.
#[derive(Clone, Copy)]
struct Run(u8);

impl Run {
    const START: Self = Self(8);
    const COUNT: usize = 9;

    /// Adds a bit. Returns `true` if a stuff bit follows it.
    const fn add(&mut self, bit: bool) -> bool {
        let equal = if self.0 < Self::START.0 && (self.0 & 1 == 1) == bit { self.0 / 2 + 1 } else { 0 };
        let is_stuffed = equal == 4;
        *self = if is_stuffed { Self(!bit as u8) } else { Self(bit as u8 + 2 * equal) };
        is_stuffed
    }
}

/// Number of stuff bits inserted into a byte, and the run at its end.
#[derive(Clone, Copy)]
struct Stuffed {
    inserted: u8,
    run: Run,
}

/// Stuffing of each byte for each preceding run.
static STUFFED: [[Stuffed; 256]; Run::COUNT] = {
    let mut table = [[Stuffed { inserted: 0, run: Run::START }; 256]; Run::COUNT];
    let mut index = 0;
    while index < Run::COUNT * 256 {
        let (before, byte) = (index / 256, index % 256);
        let (mut run, mut inserted, mut place) = (Run(before as u8), 0, 8);
        while place > 0 {
            place -= 1;
            inserted += run.add(byte >> place & 1 == 1) as u8;
        }
        table[before][byte] = Stuffed { inserted, run };
        index += 1;
    }
    table
};

/// Polynomial of the 15-bit CRC, and its bits.
const POLYNOMIAL: u16 = 0x4599;
const CHECKSUM_BITS: u16 = 0x7fff;

/// Returns the CRC after one more bit.
const fn checked(checksum: u16, bit: bool) -> u16 {
    let shifted = checksum << 1 & CHECKSUM_BITS;
    if bit == (checksum >> 14 & 1 == 1) { shifted } else { shifted ^ POLYNOMIAL }
}

/// CRC of each byte.
static CHECKSUMS: [u16; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut checksum, mut place) = (0, 8);
        while place > 0 {
            place -= 1;
            checksum = checked(checksum, byte >> place & 1 == 1);
        }
        table[byte] = checksum;
        byte += 1;
    }
    table
};
