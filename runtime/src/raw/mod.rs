//! Ports for types that are only known at run time.
//!
//! [`RawInput`] and [`RawOutput`] transfer states as bytes; [`RawStreamInput`] and [`RawStreamOutput`]
//! transfer streams of values and of slices. Layouts are compared as for typed ports, and published content
//! is checked by its layout.

mod input;
mod output;
mod stream;
#[cfg(test)]
mod tests;

pub use input::{RawInput, RawReading};
pub use output::{RawError, RawOutput};
pub use stream::{RawSlice, RawStreamInput, RawStreamOutput};
