//! Setting up the simulation of a component.

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MAX_JOINTS;
use motorium::telemetry::set_apart;
use motorium_robots::{LoadOptions, Loaded, load_with};
use nalgebra::Translation3;

use super::config::{self, PhysicsConfig};
use crate::{Articulated, Engine, Rapier, RobotSetup, Simulation};

/// Loads the robot and sets up its simulation.
pub(super) fn build<E: PhysicsEngine>(
    config: &PhysicsConfig,
    robot: &RobotReference,
) -> Result<(Simulation<E>, Loaded), ConfigError> {
    let options = LoadOptions { base: config.base_mode(), ..LoadOptions::default() };
    let loaded = load_with(&robot.urdf, &robot.base, &options);
    let loaded = loaded.map_err(|error| ConfigError::new(error.to_string()))?;
    let setup = RobotSetup::of(&loaded).map_err(|error| ConfigError::new(error.to_string()))?;
    let model = &loaded.model;
    let drives = model.joint_count() + setup.rotors.len();
    if drives > MAX_JOINTS || (drives == 0 && !model.base().floating) {
        let message = format!("robot `{}` has {drives} joints, expected 1 to {MAX_JOINTS}", robot.name);
        return Err(ConfigError::new(message).advise("make joints that need not move fixed in its URDF"));
    }
    let joints = config.start(&loaded)?;
    let base = config.base_start(&loaded)?;
    // A base without a given place is put on the ground from high above everything else.
    let above = Translation3::new(0.0, 0.0, 1e3) * model.base().neutral;
    let q = config::configuration(model, &base.unwrap_or(above), &joints);
    let mut simulation =
        Simulation::new(setup, config.world.clone(), &q, config.solver).map_err(config::refused)?;
    E::prepare(&mut simulation, base.is_none());
    Ok((simulation, loaded))
}

/// An engine with a component kind of its own.
pub trait PhysicsEngine: Engine + Send + 'static {
    /// Name of the kind.
    const KIND: &'static str;
    /// One line on the kind.
    const SUMMARY: &'static str;

    /// Prepares a new simulation for its component; `placed_anywhere` when the configuration does not say where a
    /// floating base starts.
    fn prepare(simulation: &mut Simulation<Self>, placed_anywhere: bool);
}

impl PhysicsEngine for Articulated {
    const KIND: &'static str = "physics.articulated";
    const SUMMARY: &'static str = "simulates a robot in a world of simple objects, with contacts";

    fn prepare(simulation: &mut Simulation<Self>, placed_anywhere: bool) {
        if placed_anywhere {
            simulation.place_on_ground();
        }
    }
}

impl PhysicsEngine for Rapier {
    const KIND: &'static str = "physics.rapier";
    const SUMMARY: &'static str = "simulates a robot with a fixed base by the rapier engine";

    fn prepare(simulation: &mut Simulation<Self>, _: bool) {
        simulation.enclose_rapier(|call| set_apart(call));
    }
}
