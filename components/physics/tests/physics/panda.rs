//! Simulations of the catalogue's Panda.

use std::path::Path;
use std::sync::LazyLock;

use motorium_physics::{JointSetpoint, Options, Simulator, World};
use motorium_robots::{Loaded, load};

use crate::engines::Engine;

pub(crate) fn loaded() -> Loaded {
    load("panda", Path::new(".")).unwrap()
}

/// Home pose and joint gains: read once, because tests need them in every step.
static HOME_AND_GAINS: LazyLock<(Vec<f64>, Vec<[f64; 2]>)> = LazyLock::new(|| {
    let panda = loaded();
    let profile = panda.profile.unwrap();
    let gains = profile.gains(&panda.model).unwrap();
    let gains = gains.kp.iter().zip(gains.kd.iter()).map(|(kp, kd)| [*kp, *kd]).collect();
    (profile.home(&panda.model).unwrap().as_slice().to_vec(), gains)
});

pub(crate) fn home() -> Vec<f64> {
    HOME_AND_GAINS.0.clone()
}

/// Returns a simulation at home in `world`.
pub(crate) fn at_home(engine: Engine, world: World, options: Options) -> Box<dyn Simulator> {
    engine.simulate(loaded().model, world, &home(), options)
}

/// Returns commands that hold `q` with the catalogue's gains.
pub(crate) fn hold(q: &[f64]) -> Vec<JointSetpoint> {
    q.iter().zip(&HOME_AND_GAINS.1).map(|(q, [kp, kd])| JointSetpoint::hold(*q, *kp, *kd)).collect()
}

/// Commands the catalogue's gains to hold `q` from now on.
pub(crate) fn command_hold(simulation: &mut dyn Simulator, q: &[f64]) {
    simulation.commands_mut().copy_from_slice(&hold(q));
}
