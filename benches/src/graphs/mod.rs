//! Measurements of whole graphs: real processes under the launcher, as started by a user.

mod launch;
mod policy;
mod shapes;

pub use launch::{Ran, run, run_traced};
pub use policy::PolicyFiles;
pub use shapes::{caterpillar, chain, episodes, fan_out, gate, panda, policy, raw_ports, release};
