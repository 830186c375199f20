//! Physical properties drawn anew at the start of every episode, and in time.

mod config;
mod quantity;
mod varied;

use std::collections::VecDeque;

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::{Digest, Randomisation as Message};
use motorium::telemetry::set_apart;
use motorium::transport::Output;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use serde_json::{Map, Value, json};

pub use config::{
    ActuatorIntervals, Interval, ObjectIntervals, PlaceIntervals, RandomiseConfig, RobotIntervals,
    SurfaceIntervals, TerrainIntervals,
};
use quantity::{Quantity, check_ties, quantities};
use varied::{Scene, Share, shares};

use super::PhysicsEngine;
use super::build::{Built, BuiltRobot};
use crate::{Connection, Properties, ResetError, Simulation, Simulator};

/// Episodes whose draws are in the report: the newest.
const REPORTED: usize = 64;

/// Draws the properties of each episode, applies them, and tells them.
pub(super) struct Randomiser {
    quantities: Vec<Quantity>,
    shares: Vec<Share>,
    nominal: Properties,
    /// Start without a displacement (nq).
    q: Vec<f64>,
    /// Articulations whose floating base is put on the ground.
    on_ground: Vec<usize>,
    /// One for each robot.
    outputs: Vec<Output<Message>>,
    /// The draws of the newest episodes, the present one last.
    episodes: VecDeque<Draw>,
    /// The present draw has not been published.
    pending: bool,
    /// Time after which it is drawn anew within an episode \[ns\].
    every_ns: Option<u64>,
    /// Per drive of the simulation: factors of its gain and of its strength.
    drives: Vec<[f64; 2]>,
}

/// The draws of an episode, or of a part of it.
#[derive(Clone, Debug, Default, PartialEq)]
struct Draw {
    episode: u64,
    seed: u64,
    /// Number within the episode.
    number: u64,
    values: Vec<f64>,
}

/// The name of the port.
const PORT: &str = "randomisation";

/// Checks the ranges and declares the outputs: nothing where nothing is drawn. `connections` are those besides the world's.
pub(super) fn declare<E: PhysicsEngine>(
    (config, connections): (&RandomiseConfig, &[Connection]),
    built: &Built<E>,
    declare: &mut Declare,
) -> Result<(), ConfigError> {
    if config.is_empty() {
        return Ok(());
    }
    let nominal = built.simulation.properties();
    quantities(config, &built.robots, &nominal)?;
    check_ties(config, nominal.world.connections.iter().chain(connections))?;
    if config.every.is_some() && !E::CAPABILITIES.changes {
        let message = format!("the {} engine takes other properties at resets alone", E::NAME);
        return Err(ConfigError::key("randomise.every", message).advise("use `physics.articulated`"));
    }
    for robot in &built.robots {
        declare.output::<Message>(&robot.port(PORT), "physical properties drawn for the episode");
    }
    Ok(())
}

impl Randomiser {
    /// `None` where nothing is drawn.
    pub(super) fn open<E: PhysicsEngine>(
        config: &RandomiseConfig,
        (simulation, robots, on_ground): (&Simulation<E>, &[BuiltRobot], Vec<usize>),
        setup: &mut Setup,
    ) -> Result<Option<Self>, ConfigureError> {
        if config.is_empty() {
            return Ok(None);
        }
        let nominal = simulation.properties();
        let quantities = quantities(config, robots, &nominal).map_err(ConfigureError::Config)?;
        let outputs: Result<_, _> =
            robots.iter().map(|robot| setup.named_output(&robot.port(PORT))).collect();
        Ok(Some(Self {
            shares: shares(robots),
            q: simulation.configuration().to_vec(),
            outputs: outputs?,
            episodes: VecDeque::new(),
            pending: false,
            every_ns: config.every.map(|every| every.ns),
            drives: vec![[1.0; 2]; simulation.joint_names().len()],
            quantities,
            nominal,
            on_ground,
        }))
    }

    /// Starts an episode with what its seed draws, at rest.
    pub(super) fn start<E: PhysicsEngine>(
        &mut self,
        simulation: &mut Simulation<E>,
        (episode, seed): (u64, u64),
    ) -> Result<(), ResetError> {
        let values = self.values(seed, 0);
        let scene = Scene { nominal: &self.nominal, shares: &self.shares, q: &self.q };
        let start = scene.varied(&self.quantities, &values);
        let v = vec![0.0; simulation.velocity().len()];
        simulation.reset_with(&start.properties, &start.q, &v)?;
        if start.moved && !self.on_ground.is_empty() {
            E::prepare(simulation, &self.on_ground);
        }
        if start.lifts.iter().any(|lift| *lift != 0.0) {
            let mut q = simulation.configuration().to_vec();
            for (own, lift) in simulation.articulations().iter().zip(&start.lifts) {
                // One that is fixed has no height of its own.
                if own.model().base().floating {
                    q[own.q().start + 2] += lift;
                }
            }
            simulation.reset(&q, &v)?;
        }
        self.note(simulation, Draw { episode, seed, number: 0, values }, &start.drives);
        Ok(())
    }

    /// Draws anew what may change within an episode, when it is time: with memory of its own, which is counted apart.
    pub(super) fn follow<E: PhysicsEngine>(
        &mut self,
        simulation: &mut Simulation<E>,
        time_ns: u64,
    ) -> Result<(), ResetError> {
        let Some(every) = self.every_ns else { return Ok(()) };
        let (episode, seed, number) =
            self.episodes.back().map_or((0, 0, 0), |draw| (draw.episode, draw.seed, draw.number));
        if time_ns / every == number {
            return Ok(());
        }
        set_apart(|| {
            let number = time_ns / every;
            let values = self.values(seed, number);
            let scene = Scene { nominal: &self.nominal, shares: &self.shares, q: &self.q };
            let varied = scene.varied(&self.quantities, &values);
            simulation.change(&varied.properties)?;
            self.note(simulation, Draw { episode, seed, number, values }, &varied.drives);
            Ok(())
        })
    }

    /// The values of all quantities in a part of an episode.
    fn values(&self, seed: u64, number: u64) -> Vec<f64> {
        let value = |quantity: &Quantity| {
            let number = if quantity.changes() { number } else { 0 };
            quantity.at(share((seed, number), &quantity.path))
        };
        self.quantities.iter().map(value).collect()
    }

    /// Keeps a draw, and hands its factors to the drives.
    fn note<E: PhysicsEngine>(&mut self, simulation: &Simulation<E>, draw: Draw, factors: &[Vec<[f64; 2]>]) {
        for (own, factors) in simulation.articulations().iter().zip(factors) {
            // Rotors come after joints, and have none.
            let first = own.drives().start;
            self.drives[first..first + factors.len()].copy_from_slice(factors);
        }
        if self.episodes.len() == REPORTED {
            self.episodes.pop_front();
        }
        self.episodes.push_back(draw);
        self.pending = true;
    }

    /// Per drive of the simulation: factors of its gain and of its strength.
    pub(super) fn drives(&self) -> &[[f64; 2]] {
        &self.drives
    }

    /// Index and seed of the present episode, as numbers of a checkpoint.
    pub(super) fn checkpoint(&self) -> [f64; 3] {
        let (episode, seed) = self.episodes.back().map_or((0, 0), |draw| (draw.episode, draw.seed));
        [episode as f64, (seed >> 32) as f64, (seed & 0xFFFF_FFFF) as f64]
    }

    /// Index and seed of an episode from the numbers of a checkpoint.
    pub(super) fn episode([episode, high, low]: [f64; 3]) -> (u64, u64) {
        (episode as u64, ((high as u64) << 32) | low as u64)
    }

    /// Publishes the draws of the present episode, once.
    pub(super) fn publish(&mut self) -> Result<(), StepError> {
        let Some(draw) = self.episodes.back().filter(|_| std::mem::take(&mut self.pending)) else {
            return Ok(());
        };
        for (index, output) in self.outputs.iter_mut().enumerate().filter(|(_, output)| output.is_wired()) {
            let own = |quantity: &Quantity| quantity.robot.is_none_or(|robot| robot == index);
            let mut message = output.loan()?;
            (message.episode, message.seed) = (draw.episode, draw.seed);
            message.set_count(self.quantities.iter().filter(|quantity| own(quantity)).count());
            let drawn = self.quantities.iter().zip(&draw.values).filter(|(quantity, _)| own(quantity));
            for (entry, (quantity, value)) in drawn.enumerate() {
                message.property_mut()[entry] = quantity.property;
                message.part_mut()[entry] = quantity.part;
                message.value_mut()[entry] = *value;
            }
            message.publish()?;
        }
        Ok(())
    }

    /// The draws of the newest episodes, as tables of names.
    pub(super) fn report(&self) -> Value {
        let episodes = self.episodes.iter().map(|draw| {
            let mut report = Map::new();
            report.insert("episode".to_owned(), json!(draw.episode));
            report.insert("seed".to_owned(), json!(draw.seed));
            if let Some(every) = self.every_ns {
                let from = draw.number as f64 * every as f64 * 1e-9;
                report.insert("from_s".to_owned(), json!(from));
            }
            for (quantity, value) in self.quantities.iter().zip(&draw.values) {
                insert(&mut report, &quantity.path, *value);
            }
            Value::Object(report)
        });
        Value::Array(episodes.collect())
    }
}

/// Puts a value at a path of tables.
fn insert(table: &mut Map<String, Value>, path: &[String], value: f64) {
    let [first, rest @ ..] = path else { return };
    if rest.is_empty() {
        table.insert(first.clone(), json!(value));
    } else if let Value::Object(inner) =
        table.entry(first.clone()).or_insert_with(|| Value::Object(Map::new()))
    {
        insert(inner, rest, value);
    }
}

/// A number from 0 to 1 for a quantity, evenly distributed over the seeds. It depends on the seed, the number of the draw in its episode and the
/// path alone: another range changes no other draw.
fn share((seed, number): (u64, u64), path: &[String]) -> f64 {
    let mut digest = Digest::default();
    digest.write_u64(seed);
    if number > 0 {
        digest.write_u64(number);
    }
    for part in path {
        digest.write(part.as_bytes());
        // no byte of UTF-8
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
    fn draws_are_evenly_distributed_over_seeds_and_over_parts() {
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
    fn the_same_seed_and_name_draw_the_same_and_others_differ() {
        assert_eq!(share((7, 0), &path("arm")).to_bits(), share((7, 0), &path("arm")).to_bits());
        assert_ne!(share((7, 0), &path("arm")), share((8, 0), &path("arm")));
        assert_ne!(share((7, 0), &path("arm")), share((7, 1), &path("arm")));
        assert_ne!(share((7, 0), &path("arm")), share((7, 0), &path("leg")));
        assert_ne!(share((7, 0), &["ab".into(), "c".into()]), share((7, 0), &["a".into(), "bc".into()]));
    }

    #[test]
    fn a_seed_comes_out_of_a_checkpoint_as_it_went_in() {
        for seed in [0, 1, u64::MAX, 0x1234_5678_9ABC_DEF0] {
            let numbers = [3.0, (seed >> 32) as f64, (seed & 0xFFFF_FFFF) as f64];
            assert_eq!(Randomiser::episode(numbers), (3, seed));
        }
    }
}
