//! Measurements of whole graphs: real processes under the launcher, as started by a user.

mod folder;
mod latent;
mod launch;
mod policy;
mod shapes;

pub use latent::LatentFiles;
pub use launch::{Ran, run, run_traced};
pub use policy::PolicyFiles;
pub use shapes::{
    caterpillar, chain, episodes, fan_out, gate, joint_reader, latent, panda, policy, raw_ports, release,
};
