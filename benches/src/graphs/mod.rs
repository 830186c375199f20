//! Measurements of whole graphs: real processes under the launcher, as started by a user.

mod launch;
mod shapes;

pub use launch::{Ran, run, run_traced};
pub use shapes::{caterpillar, chain, episodes, fan_out, gate, panda, raw_ports, release};
