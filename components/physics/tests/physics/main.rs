//! Tests of the simulators, of their components in graphs, and of the engines against each other.

mod actuators;
mod allocations;
mod axes;
mod batch;
mod catalogue;
mod component;
mod conformance;
mod contacts;
mod conveyors;
mod determinism;
mod drives;
mod drivetrains;
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
mod piles;
mod pushes;
mod randomise;
mod robots_of_others;
mod rolling;
mod several_articulations;
mod several_articulations_graph;
mod several_robots;
mod shaped_terrain;
mod sleeping;
mod standing;
mod surfaces;
mod terrain;
mod world_file;

use motorium::telemetry::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
