//! Physical properties, sampled at the start of and during every episode.

use std::collections::VecDeque;

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::{MAX_DRAWN, Randomisation as Message};
use motorium::telemetry::set_apart;
use motorium::transport::Output;
use serde_json::{Map, Value, json};

use super::PhysicsEngine;
use super::build::{Built, BuiltRobot};
use crate::randomise::{Draws, Property, Quantity, RandomiseConfig, RandomisedRobot, RangeError, check_ties};
use crate::{Connection, Properties, ResetError, Simulation, Simulator};

/// Number of newest episodes whose samples are reported.
const REPORTED: usize = 64;

/// Samples the properties of each episode, applies them, and publishes them.
pub(super) struct Randomiser {
    draws: Draws,
    /// Articulations whose floating base starts on the ground.
    on_ground: Vec<usize>,
    /// One output for each robot.
    outputs: Vec<Output<Message>>,
    /// The draws of the newest episodes, the current one last.
    episodes: VecDeque<Draw>,
    /// True if the current draw has not been published.
    pending: bool,
    /// Interval between draws within an episode \[ns\].
    every_ns: Option<u64>,
    /// Factors of the gain and the strength of each drive of the simulation.
    drives: Vec<[f64; 2]>,
}

/// The sampled values of an episode, or of a part of it.
#[derive(Clone, Debug, Default, PartialEq)]
struct Draw {
    episode: u64,
    seed: u64,
    /// Index of the draw within the episode.
    number: u64,
    values: Vec<f64>,
}

/// Name of the port.
const PORT: &str = "randomisation";

/// Checks the ranges and declares the outputs; does nothing if nothing is sampled. `connections` are the
/// connections that are not in the world.
pub(super) fn declare<E: PhysicsEngine>(
    (config, connections): (&RandomiseConfig, &[Connection]),
    built: &Built<E>,
    declare: &mut Declare,
) -> Result<(), ConfigError> {
    if config.is_empty() {
        return Ok(());
    }
    let nominal = built.simulation.properties();
    let q = built.simulation.configuration();
    draws(config, &built.robots, (nominal.clone(), q))?;
    check_ties(config, nominal.world.connections.iter().chain(connections)).map_err(in_table)?;
    if config.every.is_some() && !E::CAPABILITIES.changes {
        let message = format!("the {} engine changes properties only at resets", E::NAME);
        return Err(ConfigError::key("randomise.every", message).advise("use `physics.articulated`"));
    }
    for robot in &built.robots {
        declare.output::<Message>(&robot.port(PORT), "physical properties sampled for the episode");
    }
    Ok(())
}

/// Returns the samples of this table for these robots. Each robot's message has room for `MAX_DRAWN` values.
fn draws(
    config: &RandomiseConfig,
    robots: &[BuiltRobot],
    (nominal, q): (Properties, &[f64]),
) -> Result<Draws, ConfigError> {
    let of_robot = |robot: &BuiltRobot| RandomisedRobot {
        name: robot.name.clone(),
        articulation: robot.articulation,
        model: robot.loaded.model.clone(),
    };
    let robots: Vec<_> = robots.iter().map(of_robot).collect();
    let draws = Draws::new(config, &robots, (nominal, q)).map_err(in_table)?;
    for index in 0..robots.len() {
        let own = |quantity: &&Quantity| quantity.robot.is_none_or(|robot| robot == index);
        let count = draws.quantities().iter().filter(own).count();
        if count > MAX_DRAWN {
            let message = format!(
                "{count} numbers are sampled, expected at most {MAX_DRAWN}, which fit into a message"
            );
            return Err(ConfigError::key("randomise", message).advise("sample fewer properties"));
        }
    }
    Ok(draws)
}

/// Converts an error in the `randomise` table into a configuration error of the component.
fn in_table(error: RangeError) -> ConfigError {
    let RangeError { key, message, advice } = error;
    ConfigError { key: Some(format!("randomise.{key}")), message, advice }
}

/// Returns the codes of a quantity's property and part in a message.
fn code(quantity: &Quantity) -> (u32, u32) {
    let property = match quantity.property {
        Property::BaseMass => return (Message::BODY_MASS, Message::BASE),
        Property::Gravity => Message::GRAVITY,
        Property::GroundFriction => Message::GROUND_FRICTION,
        Property::GroundRestitution => Message::GROUND_RESTITUTION,
        Property::TerrainSeed => Message::TERRAIN_SEED,
        Property::TerrainScale => Message::TERRAIN_SCALE,
        Property::BodyMass => Message::BODY_MASS,
        Property::Friction => Message::FRICTION,
        Property::Restitution => Message::RESTITUTION,
        Property::Damping => Message::DAMPING,
        Property::JointFriction => Message::JOINT_FRICTION,
        Property::EffortLimit => Message::EFFORT_LIMIT,
        Property::Start => Message::START,
        Property::BaseX => Message::BASE_X,
        Property::BaseY => Message::BASE_Y,
        Property::BaseZ => Message::BASE_Z,
        Property::BaseYaw => Message::BASE_YAW,
        Property::ObjectMass => Message::OBJECT_MASS,
        Property::ObjectFriction => Message::OBJECT_FRICTION,
        Property::ObjectRestitution => Message::OBJECT_RESTITUTION,
        Property::ObjectX => Message::OBJECT_X,
        Property::ObjectY => Message::OBJECT_Y,
        Property::ObjectZ => Message::OBJECT_Z,
        Property::ObjectYaw => Message::OBJECT_YAW,
        Property::ActuatorGain => Message::ACTUATOR_GAIN,
        Property::ActuatorStrength => Message::ACTUATOR_STRENGTH,
        Property::ActuatorDelay => Message::ACTUATOR_DELAY,
        Property::ActuatorLag => Message::ACTUATOR_LAG,
        Property::ActuatorRateLimit => Message::ACTUATOR_RATE_LIMIT,
        Property::ActuatorBacklash => Message::ACTUATOR_BACKLASH,
        Property::ActuatorStiffness => Message::ACTUATOR_STIFFNESS,
    };
    (property, quantity.part as u32)
}

impl Randomiser {
    /// Returns `None` if nothing is sampled.
    pub(super) fn open<E: PhysicsEngine>(
        config: &RandomiseConfig,
        (simulation, robots, on_ground): (&Simulation<E>, &[BuiltRobot], Vec<usize>),
        setup: &mut Setup,
    ) -> Result<Option<Self>, ConfigureError> {
        if config.is_empty() {
            return Ok(None);
        }
        let draws = draws(config, robots, (simulation.properties(), simulation.configuration()))
            .map_err(ConfigureError::Config)?;
        let outputs: Result<_, _> =
            robots.iter().map(|robot| setup.named_output(&robot.port(PORT))).collect();
        Ok(Some(Self {
            outputs: outputs?,
            episodes: VecDeque::new(),
            pending: false,
            every_ns: config.every.map(|every| every.ns),
            drives: vec![[1.0; 2]; simulation.joint_names().len()],
            draws,
            on_ground,
        }))
    }

    /// Starts an episode at rest with the values sampled from its seed.
    pub(super) fn start<E: PhysicsEngine>(
        &mut self,
        simulation: &mut Simulation<E>,
        (episode, seed): (u64, u64),
    ) -> Result<(), ResetError> {
        let values = self.draws.values(seed, 0);
        let start = self.draws.apply(&values);
        let v = vec![0.0; simulation.velocity().len()];
        simulation.reset_with(&start.properties, &start.q, &v)?;
        if start.moved && !self.on_ground.is_empty() {
            E::prepare(simulation, &self.on_ground);
        }
        if start.lifts.iter().any(|lift| *lift != 0.0) {
            let mut q = simulation.configuration().to_vec();
            for (own, lift) in simulation.articulations().iter().zip(&start.lifts) {
                // The height of a fixed base does not change.
                if own.model().base().floating {
                    q[own.q().start + 2] += lift;
                }
            }
            simulation.reset(&q, &v)?;
        }
        self.note(simulation, Draw { episode, seed, number: 0, values }, &start.drives);
        Ok(())
    }

    /// Samples the properties that may change within an episode whenever their interval has passed. Its
    /// allocations are counted separately.
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
            let values = self.draws.values(seed, number);
            let varied = self.draws.apply(&values);
            simulation.change(&varied.properties)?;
            self.note(simulation, Draw { episode, seed, number, values }, &varied.drives);
            Ok(())
        })
    }

    /// Records a draw and passes its factors to the drives.
    fn note<E: PhysicsEngine>(&mut self, simulation: &Simulation<E>, draw: Draw, factors: &[Vec<[f64; 2]>]) {
        for (own, factors) in simulation.articulations().iter().zip(factors) {
            // Rotors follow the joints and have no factors.
            let first = own.drives().start;
            self.drives[first..first + factors.len()].copy_from_slice(factors);
        }
        if self.episodes.len() == REPORTED {
            self.episodes.pop_front();
        }
        self.episodes.push_back(draw);
        self.pending = true;
    }

    /// Returns the factors of the gain and the strength of each drive of the simulation.
    pub(super) fn drives(&self) -> &[[f64; 2]] {
        &self.drives
    }

    /// Returns index and seed of the current episode as numbers of a checkpoint.
    pub(super) fn checkpoint(&self) -> [f64; 3] {
        let (episode, seed) = self.episodes.back().map_or((0, 0), |draw| (draw.episode, draw.seed));
        [episode as f64, (seed >> 32) as f64, (seed & 0xFFFF_FFFF) as f64]
    }

    /// Returns index and seed of an episode from the numbers of a checkpoint.
    pub(super) fn episode([episode, high, low]: [f64; 3]) -> (u64, u64) {
        (episode as u64, ((high as u64) << 32) | low as u64)
    }

    /// Publishes the draws of the current episode once.
    pub(super) fn publish(&mut self) -> Result<(), StepError> {
        let Some(draw) = self.episodes.back().filter(|_| std::mem::take(&mut self.pending)) else {
            return Ok(());
        };
        for (index, output) in self.outputs.iter_mut().enumerate().filter(|(_, output)| output.is_wired()) {
            let own = |quantity: &Quantity| quantity.robot.is_none_or(|robot| robot == index);
            let mut message = output.loan()?;
            (message.episode, message.seed) = (draw.episode, draw.seed);
            message.set_count(self.draws.quantities().iter().filter(|quantity| own(quantity)).count());
            let drawn =
                self.draws.quantities().iter().zip(&draw.values).filter(|(quantity, _)| own(quantity));
            for (entry, (quantity, value)) in drawn.enumerate() {
                (message.property_mut()[entry], message.part_mut()[entry]) = code(quantity);
                message.value_mut()[entry] = *value;
            }
            message.publish()?;
        }
        Ok(())
    }

    /// Returns the draws of the newest episodes as tables keyed by name.
    pub(super) fn report(&self) -> Value {
        let episodes = self.episodes.iter().map(|draw| {
            let mut report = Map::new();
            report.insert("episode".to_owned(), json!(draw.episode));
            report.insert("seed".to_owned(), json!(draw.seed));
            if let Some(every) = self.every_ns {
                let from = draw.number as f64 * every as f64 * 1e-9;
                report.insert("from_s".to_owned(), json!(from));
            }
            for (quantity, value) in self.draws.quantities().iter().zip(&draw.values) {
                insert(&mut report, &quantity.path, *value);
            }
            Value::Object(report)
        });
        Value::Array(episodes.collect())
    }
}

/// Inserts a value at a path of nested tables.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_survives_a_checkpoint() {
        for seed in [0, 1, u64::MAX, 0x1234_5678_9ABC_DEF0] {
            let numbers = [3.0, (seed >> 32) as f64, (seed & 0xFFFF_FFFF) as f64];
            assert_eq!(Randomiser::episode(numbers), (3, seed));
        }
    }
}
