//! Measurements of motorium against the floors of the machine and against peers.
//!
//! `motorium bench latency` runs them; `cargo bench -p motorium-benches` runs the measurements of the models.

pub mod distribution;
mod error;
pub mod gate;
pub mod graphs;
pub mod host;
pub mod kill;
pub mod latency;
pub mod pair;
pub mod payload;
pub mod peers;
mod processes;
mod raw_chain;
mod read;
pub mod relay;
mod role;
pub mod timer;

pub use distribution::Distribution;
pub use error::MeasureError;
pub use role::Role;
