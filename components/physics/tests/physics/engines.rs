//! The engines, for tests that apply to each of them.

use std::io::Write;
use std::sync::Once;

use motorium_physics::{
    ArticulatedSimulator, BuildError, Mujoco, MujocoSimulator, Options, RapierSimulator, Simulator, World,
};
use motorium_robots::Model;

/// An engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Engine {
    Articulated,
    Rapier,
    Mujoco,
}

/// Returns the engines available on this machine: the MuJoCo library is not part of this repository.
pub(crate) fn engines() -> impl Iterator<Item = Engine> {
    [Engine::Articulated, Engine::Rapier].into_iter().chain(has_mujoco().then_some(Engine::Mujoco))
}

/// Returns `true` if MuJoCo's library is available. Otherwise each test reports this in its captured output,
/// and the first one on standard error, too.
pub(crate) fn has_mujoco() -> bool {
    static SAID: Once = Once::new();
    let found = Mujoco::find();
    if let Err(error) = &found {
        eprintln!("skipped on physics.mujoco: {error}");
        SAID.call_once(|| {
            let _ = writeln!(std::io::stderr(), "tests of physics.mujoco are not run: {error}");
        });
    }
    found.is_ok()
}

impl Engine {
    /// Creates a simulation of `model` in `world`, at rest at `q`.
    pub(crate) fn simulate(
        self,
        model: Model,
        world: World,
        q: &[f64],
        options: Options,
    ) -> Box<dyn Simulator> {
        self.try_simulate(model, world, q, options).unwrap_or_else(|error| panic!("{self:?}: {error}"))
    }

    /// Creates the same simulation if the engine supports it.
    pub(crate) fn try_simulate(
        self,
        model: Model,
        world: World,
        q: &[f64],
        options: Options,
    ) -> Result<Box<dyn Simulator>, BuildError> {
        Ok(match self {
            Self::Articulated => Box::new(ArticulatedSimulator::new(model, world, q, options)?),
            Self::Rapier => Box::new(RapierSimulator::new(model, world, q, options)?),
            Self::Mujoco => Box::new(MujocoSimulator::new(model, world, q, options)?),
        })
    }

    /// Returns the error message for a pendulum in `world`.
    pub(crate) fn refuse(self, world: World) -> String {
        let pendulum = motorium_robots::load("pendulum", std::path::Path::new(".")).unwrap().model;
        let options = Options::default();
        let refused = self.try_simulate(pendulum, world, &[0.0], options).map(drop);
        refused.unwrap_err().to_string()
    }
}
