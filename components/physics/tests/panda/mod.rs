//! The catalogue's Panda, ready to simulate.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::path::Path;

use motorium_physics::{JointCommand, Options, Rapier, Simulator, World};
use motorium_robots::{Loaded, load};

pub(crate) fn loaded() -> Loaded {
    load("panda", Path::new(".")).unwrap()
}

pub(crate) fn home() -> Vec<f64> {
    let panda = loaded();
    panda.profile.unwrap().home(&panda.model).unwrap().as_slice().to_vec()
}

/// At home in `world`.
pub(crate) fn at_home(world: World, options: Options) -> Rapier {
    Rapier::new(loaded().model, world, &home(), options).unwrap()
}

/// The gains of the catalogue, holding `q`.
pub(crate) fn hold(q: &[f64]) -> Vec<JointCommand> {
    let panda = loaded();
    let gains = panda.profile.unwrap().gains(&panda.model).unwrap();
    q.iter().enumerate().map(|(i, &q)| JointCommand::hold(q, gains.kp[i], gains.kd[i])).collect()
}

/// Holds `q` with the catalogue's gains from now on.
pub(crate) fn command_hold(simulation: &mut Rapier, q: &[f64]) {
    simulation.commands_mut().copy_from_slice(&hold(q));
}
