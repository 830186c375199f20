//! Drives on CAN buses.
//!
//! [`drives`] holds the protocols as pure codecs, [`bus`] the buses: the bits of frames and their times, and a simulated one
//! with arbitration, error states and faults. All that is a plain library, usable without the runtime.

pub mod bus;
pub mod drives;
mod frame;

pub use bus::bits::{Bits, Rates};
pub use drives::range::Range;
pub use drives::{cia402, damiao, mit, odrive};
pub use frame::{DecodeError, Form, Frame, Id};
