//! The catalogue's Panda, ready to simulate.

use std::path::Path;

use motorium_physics::{JointCommand, Options, Simulator, World};
use motorium_robots::{Loaded, load};

use crate::engines::Engine;

pub(crate) fn loaded() -> Loaded {
    load("panda", Path::new(".")).unwrap()
}

pub(crate) fn home() -> Vec<f64> {
    let panda = loaded();
    panda.profile.unwrap().home(&panda.model).unwrap().as_slice().to_vec()
}

/// At home in `world`.
pub(crate) fn at_home(engine: Engine, world: World, options: Options) -> Box<dyn Simulator> {
    engine.simulate(loaded().model, world, &home(), options)
}

/// The gains of the catalogue, holding `q`.
pub(crate) fn hold(q: &[f64]) -> Vec<JointCommand> {
    let panda = loaded();
    let gains = panda.profile.unwrap().gains(&panda.model).unwrap();
    q.iter().enumerate().map(|(i, &q)| JointCommand::hold(q, gains.kp[i], gains.kd[i])).collect()
}

/// Holds `q` with the catalogue's gains from now on.
pub(crate) fn command_hold(simulation: &mut dyn Simulator, q: &[f64]) {
    simulation.commands_mut().copy_from_slice(&hold(q));
}
