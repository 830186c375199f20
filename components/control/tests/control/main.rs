//! Tests of the control crate: tasks, inverse kinematics, and `control.qp` in a graph.

mod accelerations;
mod admittance;
mod allocations;
mod axes;
mod component;
mod conflicts;
mod diagnostics;
mod fades;
mod feed_forward;
mod fingers;
mod gaze;
mod graph;
mod inverse_kinematics;
mod kinds;
mod levels;
mod robot;
mod schedules;
mod setpoint;
mod tasks;
mod torque;
mod torque_kinds;
mod world;

motorium::count_allocations!();
