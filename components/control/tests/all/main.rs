//! Tests of the control crate: tasks, solver, inverse kinematics, and `control.qp` in a graph.

mod accelerations;
mod admittance;
mod allocations;
mod axes;
mod component;
mod conflicts;
mod diagnostics;
mod fades;
mod feed_forward;
mod gaze;
mod graph;
mod inverse_kinematics;
mod kinds;
mod known_problems;
mod levels;
mod mpc;
mod multirotor;
mod planner;
mod random_problems;
mod recorded_problems;
mod robot;
mod setpoint;
mod single_precision;
mod strides;
mod tasks;
mod tolerances;
mod torque;
mod torque_kinds;
mod warm_starts;
mod wheels;
mod world;

motorium::count_allocations!();
