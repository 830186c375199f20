//! Measurements of motorium, compared with the floors of the machine (the lowest possible latencies) and with
//! peers.
//!
//! `motorium bench latency` runs the measurements of latencies; `cargo bench -p motorium-benches` runs the
//! measurements of computing times.

pub mod distribution;
mod episodes;
mod error;
mod gate;
pub mod graphs;
pub mod host;
mod joint_reader;
pub mod kill;
pub mod latency;
pub mod pair;
pub mod payload;
pub mod peers;
mod processes;
mod raw_chain;
mod raw_ports;
mod read;
mod relay;
mod role;
pub mod timer;

pub use distribution::Distribution;
pub use error::MeasureError;
pub use role::Role;

use motorium::worker::Kind;

/// Returns the kinds of the measured components, for the program that hosts them.
pub fn kinds() -> impl Iterator<Item = Kind> {
    let kinds = [relay::kind(), episodes::kind(), joint_reader::kind()].into_iter();
    kinds.chain(gate::kinds()).chain(raw_ports::kinds())
}
