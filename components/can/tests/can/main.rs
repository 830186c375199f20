//! Tests of the library, and of its components in graphs.

mod adapter;
mod bits;
mod bus;
mod cia402;
mod components;
mod damiao;
mod mit;
mod odrive;
mod random;
mod table;

motorium::count_allocations!();
