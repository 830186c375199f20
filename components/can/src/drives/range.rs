//! Numbers as unsigned integers of a few bits, spread evenly over a range.

/// A range of numbers that a field of a frame covers.
///
/// A field of `n` bits holds `(x - min) (2^n - 1) / (max - min)`, rounded to the nearest integer, halves down; what lies
/// outside the range is sent as its end.
///
/// ```
/// use motorium_can::Range;
///
/// let position = Range::symmetric(12.5);
/// assert_eq!(position.encode(0.0, 16), 0x7fff);
/// assert_eq!(position.encode(99.0, 16), 0xffff);
/// assert!((position.decode(position.encode(1.2, 16), 16) - 1.2).abs() <= position.resolution(16) / 2.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The lowest number.
    pub min: f64,
    /// The highest number.
    pub max: f64,
}

impl Range {
    /// From `-max` to `max`.
    pub const fn symmetric(max: f64) -> Self {
        Self { min: -max, max }
    }

    /// From 0 to `max`.
    pub const fn from_zero(max: f64) -> Self {
        Self { min: 0.0, max }
    }

    /// The number of the range that is nearest to this one; to zero, for one that is no number.
    pub fn nearest(&self, x: f64) -> f64 {
        let x = if x.is_nan() { 0.0 } else { x };
        x.clamp(self.min, self.max)
    }

    /// The integer of `bits` bits for a number. One that is no number is sent as the one nearest to zero.
    pub fn encode(&self, x: f64, bits: u32) -> u16 {
        let largest = largest(bits);
        let scaled = (self.nearest(x) - self.min) * largest / (self.max - self.min);
        let whole = scaled as u32;
        let rounded = if scaled - f64::from(whole) > 0.5 { whole + 1 } else { whole };
        rounded.min(largest as u32) as u16
    }

    /// The number for an integer of `bits` bits.
    pub fn decode(&self, value: u16, bits: u32) -> f64 {
        f64::from(value) * (self.max - self.min) / largest(bits) + self.min
    }

    /// Distance between two numbers that `bits` bits tell apart.
    pub fn resolution(&self, bits: u32) -> f64 {
        (self.max - self.min) / largest(bits)
    }

    /// True if it is a range: finite, and with its ends in order.
    pub fn is_valid(&self) -> bool {
        self.min.is_finite() && self.max.is_finite() && self.min < self.max
    }
}

/// The largest integer of so many bits, 1 to 16.
fn largest(bits: u32) -> f64 {
    debug_assert!((1..=16).contains(&bits));
    f64::from((1_u32 << bits) - 1)
}
