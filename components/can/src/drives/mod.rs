//! Protocols of drives as pure codecs: values to frames and frames to values, without allocation, clock or
//! bus.
//!
//! Decoding is strict. A frame with a wrong length, identifier or device, a set reserved bit, or a number
//! that is not finite is an error. No frame causes a panic.

pub mod cia402;
pub mod damiao;
pub mod dynamixel;
pub mod feetech;
pub mod mit;
pub mod moteus;
pub mod odrive;
pub mod range;
pub mod servo;
