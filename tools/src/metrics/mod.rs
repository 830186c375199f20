//! Measurements of a running graph from outside: its region and `/proc`, and both as Prometheus text.
//!
//! Everything here reads memory and files. No component is asked, none waits, and no place of an observer is
//! taken.

mod address;
mod client;
mod exposition;
mod families;
mod request;
mod sample;
mod server;
mod thread;

pub(crate) use address::Address;
#[cfg(test)]
pub(crate) use sample::fixture;
pub(crate) use sample::{ComponentSample, Sample};
pub(crate) use server::Server;
