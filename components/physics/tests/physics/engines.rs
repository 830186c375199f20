//! The engines, for tests that hold for each of them.

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

/// The engines that this machine has: the library of MuJoCo is not part of this repository.
pub(crate) fn engines() -> impl Iterator<Item = Engine> {
    [Engine::Articulated, Engine::Rapier].into_iter().chain(has_mujoco().then_some(Engine::Mujoco))
}

/// Returns `true` if MuJoCo's library is installed. Otherwise prints that once, bypassing the capture of the
/// test's output.
pub(crate) fn has_mujoco() -> bool {
    static SAID: Once = Once::new();
    let found = Mujoco::find();
    if let Err(error) = &found {
        SAID.call_once(|| {
            let _ = writeln!(std::io::stderr(), "tests of physics.mujoco are not run: {error}");
        });
    }
    found.is_ok()
}

impl Engine {
    /// A simulation of `model` in `world`, at rest at `q`.
    pub(crate) fn simulate(
        self,
        model: Model,
        world: World,
        q: &[f64],
        options: Options,
    ) -> Box<dyn Simulator> {
        self.try_simulate(model, world, q, options).unwrap_or_else(|error| panic!("{self:?}: {error}"))
    }

    /// The same, where the engine can.
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

    /// Words against a pendulum in `world`.
    pub(crate) fn refuse(self, world: World) -> String {
        let pendulum = motorium_robots::load("pendulum", std::path::Path::new(".")).unwrap().model;
        let options = Options::default();
        let refused = self.try_simulate(pendulum, world, &[0.0], options).map(drop);
        refused.unwrap_err().to_string()
    }
}
