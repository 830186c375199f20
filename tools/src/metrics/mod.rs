//! Measurements of a running graph from outside: its region and `/proc`, and both as Prometheus text.
//!
//! Reading memory and files does not disturb components and uses no observer slot.

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
