//! Sampling of physical properties from ranges, for the episodes of a graph and the worlds of a batch.

mod config;
mod quantity;
mod range_error;
mod robot;
mod share;
mod start;

use core::hash::Hasher as _;

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use twox_hash::XxHash3_64;

pub use config::{
    ActuatorIntervals, Interval, ObjectIntervals, PlaceIntervals, RandomiseConfig, RobotIntervals,
    SurfaceIntervals, TerrainIntervals,
};
pub(crate) use quantity::check_ties;
use quantity::quantities;
pub use quantity::{Property, Quantity};
pub use range_error::RangeError;
pub use robot::RandomisedRobot;
use share::{Share, shares};
use start::Scene;
pub use start::Start;

use crate::{Engine, Properties, Simulation, Simulator};

/// Generates samples of physical properties. A seed produces the same values in a graph and in a batch.
///
/// ```
/// use std::path::Path;
/// use motorium_physics::{ArticulatedSimulator, Options, Simulator, World};
/// use motorium_physics::randomise::{Draws, Interval, RandomiseConfig};
/// use motorium_robots::load;
///
/// let model = load("pendulum", Path::new("."))?.model;
/// let mut world = ArticulatedSimulator::new(model, World::default(), &[0.0], Options::default())?;
/// let config = RandomiseConfig { start: Some(Interval([-0.1, 0.1])), ..RandomiseConfig::default() };
/// let draws = Draws::for_one_robot(&config, &world)?;
/// let start = draws.draw(7, 0);
/// world.reset_with(&start.properties, &start.q, &[0.0])?;
/// assert!(world.configuration()[0].abs() <= 0.1 && world.configuration()[0] != 0.0);
/// assert_eq!(draws.draw(7, 0).q, start.q, "the same seed");
/// assert_ne!(draws.draw(8, 0).q, start.q);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Draws {
    quantities: Vec<Quantity>,
    shares: Vec<Share>,
    nominal: Properties,
    /// Start without displacement (nq).
    q: Vec<f64>,
}

impl Draws {
    /// Creates a generator for `robots`, in the order of the simulation, with `nominal` properties and the
    /// initial configuration `q` (nq).
    ///
    /// # Errors
    ///
    /// [`RangeError`] for the first range that is out of bounds, or that does not apply to any part of the
    /// simulation.
    pub fn new(
        config: &RandomiseConfig,
        robots: &[RandomisedRobot],
        (nominal, q): (Properties, &[f64]),
    ) -> Result<Self, RangeError> {
        let quantities = quantities(config, robots, &nominal)?;
        check_ties(config, nominal.world.connections.iter())?;
        Ok(Self { quantities, shares: shares(robots), nominal, q: q.to_vec() })
    }

    /// Creates a generator for a simulation of one robot. The current state of the simulation is the nominal
    /// initial state.
    ///
    /// # Errors
    ///
    /// See [`new`](Self::new).
    pub fn for_one_robot<E: Engine>(
        config: &RandomiseConfig,
        simulation: &Simulation<E>,
    ) -> Result<Self, RangeError> {
        let nominal = simulation.properties();
        let robot = RandomisedRobot { name: None, articulation: 0, model: nominal.model.clone() };
        Self::new(config, &[robot], (nominal, simulation.configuration()))
    }

    /// Returns all sampled quantities in a fixed order.
    pub fn quantities(&self) -> &[Quantity] {
        &self.quantities
    }

    /// Returns the value of each quantity in an episode with this seed, in the order of
    /// [`quantities`](Self::quantities). Properties that [vary in time](Quantity::varies_in_time) are sampled
    /// again within an episode; `number` is the index of the sample, from 0.
    pub fn values(&self, seed: u64, number: u64) -> Vec<f64> {
        let value = |quantity: &Quantity| {
            let number = if quantity.varies_in_time() { number } else { 0 };
            quantity.value(share((seed, number), &quantity.path))
        };
        self.quantities.iter().map(value).collect()
    }

    /// Returns the start of an episode with these sampled [values](Self::values).
    ///
    /// # Panics
    ///
    /// If there are fewer values than quantities.
    pub fn apply(&self, values: &[f64]) -> Start {
        assert!(values.len() >= self.quantities.len(), "a value for each quantity");
        let scene = Scene { nominal: &self.nominal, shares: &self.shares, q: &self.q };
        scene.varied(&self.quantities, values)
    }

    /// Samples the start of an episode: [applies](Self::apply) the [`values`](Self::values) of this seed and
    /// sample number.
    pub fn draw(&self, seed: u64, number: u64) -> Start {
        self.apply(&self.values(seed, number))
    }
}

/// Returns a number from 0 to 1, uniformly distributed over the seeds. It depends only on the seed, the index
/// of the sample in its episode, and the path, so adding a range does not change the other samples.
fn share((seed, number): (u64, u64), path: &[String]) -> f64 {
    let mut digest = XxHash3_64::default();
    digest.write(&seed.to_le_bytes());
    if number > 0 {
        digest.write(&number.to_le_bytes());
    }
    for part in path {
        digest.write(part.as_bytes());
        // not a valid byte of UTF-8
        digest.write(&[0xFF]);
    }
    Pcg64::seed_from_u64(digest.finish()).random()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(name: &str) -> Vec<String> {
        vec!["mass".to_owned(), name.to_owned()]
    }

    #[test]
    fn samples_are_uniform_over_seeds_and_parts() {
        for by_seed in [true, false] {
            let draws: Vec<f64> = (0..4000_u64)
                .map(|k| {
                    if by_seed {
                        share((k, 0), &path("arm"))
                    } else {
                        share((1, 0), &path(&format!("link{k}")))
                    }
                })
                .collect();
            let mean = draws.iter().sum::<f64>() / 4000.0;
            let variance = draws.iter().map(|draw| (draw - mean).powi(2)).sum::<f64>() / 4000.0;
            // five standard deviations of the mean of 4000
            assert!((mean - 0.5).abs() < 5.0 * (1.0_f64 / 12.0 / 4000.0).sqrt(), "{mean}");
            assert!((variance - 1.0 / 12.0).abs() < 0.005, "{variance}");
            assert!(draws.iter().all(|draw| (0.0..1.0).contains(draw)));
        }
    }

    #[test]
    fn samples_depend_on_seed_number_and_path_alone() {
        assert_eq!(share((7, 0), &path("arm")).to_bits(), share((7, 0), &path("arm")).to_bits());
        assert_ne!(share((7, 0), &path("arm")), share((8, 0), &path("arm")));
        assert_ne!(share((7, 0), &path("arm")), share((7, 1), &path("arm")));
        assert_ne!(share((7, 0), &path("arm")), share((7, 0), &path("leg")));
        assert_ne!(share((7, 0), &["ab".into(), "c".into()]), share((7, 0), &["a".into(), "bc".into()]));
    }
}
