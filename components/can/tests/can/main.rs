//! Tests of the library, and of its components in graphs.

mod adapter;
mod bits;
mod bus;
mod calibrate;
mod cia402;
mod components;
mod currents;
mod damiao;
mod database;
mod drives;
mod eds;
mod fast_read;
mod faults;
mod homing;
mod homing_doubts;
mod homing_faults;
mod homing_graph;
mod homing_hand_over;
mod homing_tables;
mod merge;
mod mit;
mod moteus;
mod observe;
mod odrive;
mod offered;
mod protocols;
mod random;
mod real_time;
mod recipe;
mod safety;
mod servo;
mod servo_line;
mod slcan;
mod table;
mod wire_tables;

motorium::count_allocations!();
