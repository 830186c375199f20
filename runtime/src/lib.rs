//! The motorium runtime: a graph of components, each its own real-time process, sharing state buffers in memory.
//!
//! Start reading at [`component`]: it holds the trait a user implements. [`graph`] turns a graph file into a
//! checked [`plan`], [`schedule`] finds out whether its times can hold, [`launcher`] turns a plan into running
//! processes, and [`worker`] is the loop inside each of them. [`state`] are the types they exchange, [`transport`] the
//! shared memory they exchange them through.

mod atomics;
pub mod component;
pub mod graph;
pub mod launcher;
#[cfg(all(test, feature = "loom"))]
mod model;
pub mod os;
pub mod plan;
pub mod region;
pub mod run_folder;
pub mod safety;
pub mod schedule;
pub mod state;
pub mod telemetry;
pub mod transport;
pub mod worker;
