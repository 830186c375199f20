//! Tests of the leg, wheel and rotor controllers, both as libraries and as components of a graph.

mod mpc;
mod multirotor;
mod planner;
mod strides;
mod wheels;

motorium::count_allocations!();
