//! The engines, for tests that hold for each of them.

use motorium_physics::{ArticulatedSimulator, Options, RapierSimulator, Simulator, World};
use motorium_robots::Model;

/// An engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Engine {
    Articulated,
    Rapier,
}

pub(crate) const ENGINES: [Engine; 2] = [Engine::Articulated, Engine::Rapier];

impl Engine {
    /// A simulation of `model` in `world`, at rest at `q`.
    pub(crate) fn simulate(
        self,
        model: Model,
        world: World,
        q: &[f64],
        options: Options,
    ) -> Box<dyn Simulator> {
        match self {
            Self::Articulated => Box::new(ArticulatedSimulator::new(model, world, q, options).unwrap()),
            Self::Rapier => Box::new(RapierSimulator::new(model, world, q, options).unwrap()),
        }
    }
}
