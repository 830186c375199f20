//! Optimisation-based control for motorium: tasks, limits, differential inverse kinematics

pub mod solver;
