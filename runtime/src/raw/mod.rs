//! Ports for types that are only known at run time.
//!
//! [`RawInput`] and [`RawOutput`] transfer states as bytes; [`RawStreamInput`] and [`RawStreamOutput`]
//! transfer streams of values and of slices. As for typed ports, the layouts of all ports on a topic must be
//! equal. Published content is checked according to its layout.

mod input;
mod output;
mod stream;
#[cfg(test)]
mod tests;

pub use input::{RawInput, RawReading};
pub use output::{RawError, RawOutput};
pub use stream::{RawSlice, RawStreamInput, RawStreamOutput};
