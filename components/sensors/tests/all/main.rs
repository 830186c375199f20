//! Tests of the sensor models, and of `sensor.joint_encoder` in a graph.

mod allocations;
mod component;
mod encoder;

/// Allocations are counted by thread.
#[global_allocator]
static ALLOCATOR: motorium::telemetry::CountingAllocator = motorium::telemetry::CountingAllocator;
