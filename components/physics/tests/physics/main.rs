//! Tests of the simulators, of their components in graphs, and of the engines against each other.

mod actuators;
mod allocations;
mod axes;
mod batch;
mod catalogue;
mod component;
mod conformance;
mod contacts;
mod determinism;
mod drives;
mod engines;
mod first_step;
mod floating;
mod floating_catalogue;
mod gait;
mod integrator;
mod legged;
mod mujoco;
mod mujoco_properties;
mod panda;
mod pushes;
mod randomise;
mod several_articulations;
mod robots_of_others;
mod several_robots;
mod standing;
mod terrain;
mod world_file;

use motorium::telemetry::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
