//! Encoding of numbers as unsigned integers of a few bits, evenly spaced over a range.

/// Range of the numbers that a field of a frame represents.
///
/// A field of `n` bits contains `(x - min) (2^n - 1) / (max - min)`, rounded to the nearest integer. In a
/// symmetric range, zero is midway between two integers and is rounded down. Numbers outside the range are
/// clamped.
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
    /// Lowest number.
    pub min: f64,
    /// Highest number.
    pub max: f64,
}

impl Range {
    /// Creates a range from `-max` to `max`.
    pub const fn symmetric(max: f64) -> Self {
        Self { min: -max, max }
    }

    /// Creates a range from 0 to `max`.
    pub const fn from_zero(max: f64) -> Self {
        Self { min: 0.0, max }
    }

    /// Returns the number in the range that is nearest to `x`. If `x` is NaN, returns the number nearest to
    /// zero.
    pub fn nearest(&self, x: f64) -> f64 {
        let x = if x.is_nan() { 0.0 } else { x };
        x.clamp(self.min, self.max)
    }

    /// Returns a field of `bits` bits (1 to 16) that represents the range.
    pub const fn field(&self, bits: u32) -> Fields<1> {
        Fields::new([*self], [bits])
    }

    /// Encodes a number as an integer of `bits` bits. NaN is encoded as the number nearest to zero.
    pub fn encode(&self, x: f64, bits: u32) -> u16 {
        let [value] = self.field(bits).encode([x]);
        value as u16
    }

    /// Decodes an integer of `bits` bits to a number in the range.
    pub fn decode(&self, value: u16, bits: u32) -> f64 {
        self.field(bits).decode::<0>(value)
    }

    /// Returns the distance between two adjacent numbers that a field of `bits` bits represents.
    pub const fn resolution(&self, bits: u32) -> f64 {
        (self.max - self.min) / largest(bits) as f64
    }

    /// Returns `true` if the limits of the range are finite and in ascending order.
    pub fn is_valid(&self) -> bool {
        self.min.is_finite() && self.max.is_finite() && self.min < self.max
    }
}

/// Returns the largest integer of `bits` bits, 1 to 16.
const fn largest(bits: u32) -> u32 {
    debug_assert!(1 <= bits && bits <= 16);
    (1 << bits) - 1
}

/// Fields of a frame: their ranges and bit counts, with precomputed factors for encoding and decoding.
///
/// Encoding and decoding need no divisions, and no branches except for NaN. Steps are counted from the upper
/// end of the range and rounded half to even, which rounds zero in the middle of a symmetric range down.
///
/// ```
/// use motorium_can::Range;
///
/// let torque = Range::symmetric(10.0).field(12);
/// assert_eq!([torque.encode([0.0]), torque.encode([99.0]), torque.encode([f64::NAN])], [[0x7ff], [0xfff], [0x7ff]]);
/// assert!((torque.decode::<0>(0x900) - 1.2527).abs() < 1e-4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fields<const N: usize> {
    /// Number of steps from the lower end to the upper end.
    largest: [f64; N],
    /// Steps per unit.
    per_unit: [f64; N],
    /// Number of steps from zero to the upper end.
    to_end: [f64; N],
    /// Number nearest to zero.
    nothing: [f64; N],
    /// Units per step.
    step: [f64; N],
    min: [f64; N],
}

/// Number whose last mantissa bit has the value one. Adding it to a smaller number leaves that number,
/// rounded to the nearest integer, in the last bits of the sum.
const ROUNDING: f64 = 4_503_599_627_370_496.0;

impl<const N: usize> Fields<N> {
    /// Creates fields with these ranges. `bits` contains the number of bits of each field, 1 to 16.
    pub const fn new(ranges: [Range; N], bits: [u32; N]) -> Self {
        let none = [0.0; N];
        let mut fields =
            Self { largest: none, per_unit: none, to_end: none, nothing: none, step: none, min: none };
        let mut i = 0;
        while i < N {
            let Range { min, max } = ranges[i];
            let (steps, span) = (largest(bits[i]) as f64, max - min);
            fields.largest[i] = steps;
            fields.per_unit[i] = steps / span;
            // exactly half of the steps for a symmetric range: rounding makes the quotient wrong for one in
            // seven ranges
            fields.to_end[i] = if max == -min { steps / 2.0 } else { max * steps / span };
            fields.nothing[i] = match () {
                () if min > 0.0 => min,
                () if max < 0.0 => max,
                () => 0.0,
            };
            fields.step[i] = span / steps;
            fields.min[i] = min;
            i += 1;
        }
        fields
    }

    /// Encodes one number per field. A number outside its range is clamped, and NaN is encoded as the number
    /// nearest to zero.
    #[inline]
    pub fn encode(&self, x: [f64; N]) -> [u64; N] {
        let from_end = self.encode_from_end(x);
        core::array::from_fn(|i| self.largest[i] as u64 - from_end[i])
    }

    /// Encodes `x` as integers counted from the upper end, with all bits inverted.
    #[inline(always)]
    pub(crate) fn encode_from_end(&self, x: [f64; N]) -> [u64; N] {
        // the sum is NaN if a number is NaN, or if two are infinite with opposite signs
        if x.iter().sum::<f64>().is_nan() { self.encode_doubtful(x) } else { self.encode_numbers(x) }
    }

    #[inline(always)]
    fn encode_numbers(&self, x: [f64; N]) -> [u64; N] {
        core::array::from_fn(|i| {
            let steps = self.to_end[i] - x[i] * self.per_unit[i];
            let steps = if steps > 0.0 { steps } else { 0.0 };
            let steps = if steps < self.largest[i] { steps } else { self.largest[i] };
            (steps + ROUNDING).to_bits() & 0xffff
        })
    }

    #[cold]
    fn encode_doubtful(&self, x: [f64; N]) -> [u64; N] {
        self.encode_numbers(core::array::from_fn(|i| if x[i].is_nan() { self.nothing[i] } else { x[i] }))
    }

    /// Decodes the integer of field `I` to a number in its range.
    #[inline]
    pub fn decode<const I: usize>(&self, value: u16) -> f64 {
        f64::from(value) * self.step[I] + self.min[I]
    }
}
