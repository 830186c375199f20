//! Tests of the sensor models, and of `sensor.joint_encoder` in a graph.

mod allocations;
mod component;
mod encoder;

motorium::count_allocations!();
