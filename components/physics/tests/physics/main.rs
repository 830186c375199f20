//! Tests of the simulators, of their components in graphs, and of the engines against each other.

mod actuators;
mod allocations;
mod axes;
mod batch;
mod calm;
mod catalogue;
mod component;
mod compounds;
mod conformance;
mod connections;
mod contacts;
mod conveyors;
mod determinism;
mod drives;
mod drivetrains;
mod engines;
mod extremes;
mod first_step;
mod floating;
mod floating_catalogue;
mod gait;
mod grain;
mod hold;
mod integrator;
mod legged;
mod mesh_slopes;
mod meshes;
mod midpoint;
mod mujoco;
mod mujoco_properties;
mod panda;
mod piles;
mod pushes;
mod randomise;
mod randomise_in_time;
mod robots_of_others;
mod rolling;
mod several_articulations;
mod several_articulations_graph;
mod several_robots;
mod shaped_terrain;
mod sleeping;
mod soft;
mod springs;
mod standing;
mod starts;
mod surfaces;
mod terrain;
mod truth;
mod world_file;
mod world_paths;

use motorium::telemetry::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
