//! Tests of the planner of legs, of wheels and of rotors, as libraries and as components of a graph.

mod mpc;
mod multirotor;
mod planner;
mod strides;
mod wheels;

motorium::count_allocations!();
