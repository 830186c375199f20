//! The protocols of drives, as pure codecs: values to frames and frames to values, without allocation, clock
//! or bus.
//!
//! Decoding is strict: a frame of another length, identifier or device, a reserved bit and a number that is
//! not finite are errors, and no frame whatever makes it panic.

pub mod cia402;
pub mod damiao;
pub mod dynamixel;
pub mod feetech;
pub mod mit;
pub mod moteus;
pub mod odrive;
pub mod range;
pub mod servo;
