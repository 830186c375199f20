//! The engine for a robot: rapier for a fixed base, our own for one that floats.

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MAX_JOINTS;
use motorium::telemetry::set_apart;
use motorium_robots::{LoadOptions, Loaded, load_with};
use nalgebra::Translation3;

use super::config::{self, RapierConfig};
use crate::{Floating, Rapier, RotorDrive, Simulator};

/// What moves the robot.
pub(super) type Engine = Box<dyn Simulator + Send>;

/// Loads the robot and sets up the simulation.
pub(super) fn build(config: &RapierConfig, robot: &RobotReference) -> Result<(Engine, Loaded), ConfigError> {
    let options = LoadOptions { base: config.base_mode(), ..LoadOptions::default() };
    let loaded = load_with(&robot.urdf, &robot.base, &options);
    let loaded = loaded.map_err(|error| ConfigError::new(error.to_string()))?;
    let model = &loaded.model;
    let rotors = match &loaded.profile {
        Some(profile) if model.base().floating => RotorDrive::of(model, profile),
        _ => Ok(Vec::new()),
    };
    let rotors = rotors.map_err(|error| ConfigError::new(error.to_string()))?;
    let drives = model.joint_count() + rotors.len();
    if drives > MAX_JOINTS || (drives == 0 && !model.base().floating) {
        let message = format!("robot `{}` has {drives} joints, expected 1 to {MAX_JOINTS}", robot.name);
        return Err(ConfigError::new(message).advise("make joints that need not move fixed in its URDF"));
    }
    let joints = config.start(&loaded)?;
    let base = config.base_start(&loaded)?;
    let (model, world, options) = (model.clone(), config.world.clone(), config.solver);
    if !model.base().floating {
        let mut simulation = Rapier::new(model, world, &joints, options).map_err(config::refused)?;
        simulation.enclose_rapier(|call| set_apart(call));
        return Ok((Box::new(simulation), loaded));
    }
    // Where nothing says where, it is set down on the ground from high above all else.
    let above = Translation3::new(0.0, 0.0, 1e3) * model.base().neutral;
    let q = config::configuration(&model, &base.unwrap_or(above), &joints);
    let mut simulation = Floating::new(model, rotors, world, &q, options).map_err(config::refused)?;
    if base.is_none() {
        simulation.set_down();
    }
    Ok((Box::new(simulation), loaded))
}
