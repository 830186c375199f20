//! Payloads of the measured sizes.

use motorium::state::{Field as _, StateBuffer};
use motorium::transport::Loan;

/// A payload of numbers. The sender writes all numbers, and the receiver reads all of them.
pub trait Payload: StateBuffer {
    /// Size of the payload, bytes.
    const BYTES: usize;

    /// Returns the numbers of the payload.
    fn values(&self) -> &[f64];

    /// Returns the numbers of the payload for writing.
    fn values_mut(&mut self) -> &mut [f64];

    /// Writes a time (ns, below 2^52) into each number. To make all numbers different, adds to each number
    /// its index in units in the last place.
    fn write(&mut self, time_ns: u64) {
        self.values_mut().iter_mut().zip(times::<Self>(time_ns)).for_each(|(value, time)| *value = time);
    }

    /// Writes a time like [`write`](Self::write), and checks each number while writing it. Returns `true` if
    /// all numbers are finite.
    fn write_checked(&mut self, time_ns: u64) -> bool {
        f64::write_checked(self.values_mut(), times::<Self>(time_ns)).1
    }

    /// Writes and checks a time like [`write_checked`](Self::write_checked), in the memory of a topic.
    fn write_into(loan: &mut Loan<'_, Self>, time_ns: u64) {
        loan.fill_from(Self::values, times::<Self>(time_ns));
    }

    /// Reads every number and returns the time that was written; `None` if the numbers contain different
    /// times, because the payload was torn.
    fn read(&self) -> Option<u64> {
        let first = self.values()[0];
        let values = self.values().iter().zip(times::<Self>(first as u64));
        let differ = values.fold(0, |differ, (value, time)| differ | (value.to_bits() ^ time.to_bits()));
        (differ == 0).then_some(first as u64)
    }
}

/// Numbers of a payload of this time. All differ, so a check cannot be hoisted. Each costs one addition, so
/// their transfer dominates.
fn times<P: Payload>(time_ns: u64) -> impl Iterator<Item = f64> {
    let time = (time_ns as f64).to_bits();
    (0..P::BYTES / size_of::<f64>()).map(move |index| f64::from_bits(time + index as u64))
}

macro_rules! payloads {
    ($($name:ident, $text:literal, $bytes:literal;)*) => {
        $(
            motorium::state_buffer! {
                #[doc = concat!("A payload of ", $bytes, " bytes.")]
                pub struct $name as $text {
                    /// The numbers of the payload.
                    pub values: [f64; $bytes / 8],
                }
            }

            impl Payload for $name {
                const BYTES: usize = $bytes;

                fn values(&self) -> &[f64] {
                    &self.values
                }

                fn values_mut(&mut self) -> &mut [f64] {
                    &mut self.values
                }
            }
        )*

        /// Available sizes, bytes.
        pub const SIZES: &[usize] = &[$($bytes),*];

        /// Calls `visitor` with the payload type of `bytes` bytes and returns the visitor's result; `None`
        /// for an unknown size.
        pub fn with_payload<V: PayloadVisitor>(bytes: usize, visitor: V) -> Option<V::Output> {
            match bytes {
                $($bytes => Some(visitor.visit::<$name>()),)*
                _ => None,
            }
        }
    };
}

payloads! {
    Payload64, "motorium.bench.Payload64", 64;
    Payload512, "motorium.bench.Payload512", 512;
    Payload4K, "motorium.bench.Payload4K", 4096;
    Payload64K, "motorium.bench.Payload64K", 65536;
    Payload1M, "motorium.bench.Payload1M", 1048576;
}

/// An operation that works for a payload of any size.
pub trait PayloadVisitor {
    /// Result of the operation.
    type Output;

    /// Runs the operation for the payload type `P`.
    fn visit<P: Payload>(self) -> Self::Output;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn payload_is_read_back_and_tearing_detected() {
        let mut payload = Payload512::default();
        payload.write(1_234_567_890_123);
        assert_eq!(payload.read(), Some(1_234_567_890_123));
        payload.values[63] = 1.0;
        assert_eq!(payload.read(), None);
    }

    #[test]
    fn every_size_has_a_type() {
        struct Size;
        impl PayloadVisitor for Size {
            type Output = usize;
            fn visit<P: Payload>(self) -> usize {
                assert_eq!(size_of::<P>(), P::BYTES);
                P::BYTES
            }
        }
        for bytes in SIZES {
            assert_eq!(with_payload(*bytes, Size), Some(*bytes));
        }
        assert_eq!(with_payload(100, Size), None);
    }
}
