//! Robot models for motorium: URDF, kinematics and dynamics, without any runtime
