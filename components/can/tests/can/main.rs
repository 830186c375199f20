//! Tests of the library.

mod bits;
mod cia402;
mod damiao;
mod mit;
mod odrive;
mod random;
