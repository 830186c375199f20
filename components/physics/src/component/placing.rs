//! Loading and placement of several robots of one component, and the shared articulation of robots with fixed
//! bases.

use std::collections::BTreeMap;

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MAX_JOINTS;
use motorium_robots::{BasePose, LoadOptions, Loaded, Model, Placed, RobotSource, Srdf};
use nalgebra::{Isometry3, Translation3};

use super::config::{self, PhysicsConfig};
use crate::{RobotSetup, RotorDrive};

/// Loads a robot, and rejects one with more drives than fit into a message.
pub(super) fn load(
    config: &PhysicsConfig,
    robot: &RobotReference,
) -> Result<(RobotSetup, Loaded), ConfigError> {
    let options = LoadOptions { base: config.base_mode(), ..LoadOptions::default() };
    let pose = robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy });
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose,
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
    };
    let loaded = source.load_with(&options).map_err(|error| ConfigError::new(error.to_string()))?;
    let setup = RobotSetup::from_loaded(&loaded).map_err(|error| ConfigError::new(error.to_string()))?;
    let model = &loaded.model;
    let drives = model.joint_count() + setup.rotors.len();
    if drives > MAX_JOINTS || (drives == 0 && !model.base().floating) {
        let message = format!("robot `{}` has {drives} joints, expected 1 to {MAX_JOINTS}", robot.name);
        return Err(ConfigError::new(message)
            .advise("in the robot's URDF, change joints that need not move to `fixed`"));
    }
    Ok((setup, loaded))
}

/// A robot of a component with several robots, and its start.
pub(super) struct Placing {
    pub(super) loaded: Loaded,
    setup: RobotSetup,
    /// Prefix of its link and joint names.
    prefix: String,
    /// Start configuration (nq).
    pub(super) q: Vec<f64>,
    /// True if the start of its floating base is not configured: the robot then starts on the ground.
    pub(super) anywhere: bool,
}

impl Placing {
    /// Loads a robot and determines its start.
    pub(super) fn load(config: &PhysicsConfig, robot: &RobotReference) -> Result<Self, ConfigError> {
        let (setup, loaded) = load(config, robot)?;
        let start = config.start.get(&robot.name).cloned().unwrap_or_default();
        let own = PhysicsConfig {
            pose: start.pose.or(config.pose.clone()),
            position: start.position,
            base: None,
            ..config.clone()
        };
        let joints = own.start(&loaded).map_err(|error| inside(error, &robot.name))?;
        let base = own.base_start(&loaded, robot.pose.is_some())?;
        // A base without a specified pose starts high above everything else and is then lowered to the
        // ground.
        let above = Translation3::new(0.0, 0.0, 1e3) * loaded.model.base().neutral;
        let q = config::configuration(&loaded.model, &base.unwrap_or(above), &joints);
        let anywhere = loaded.model.base().floating && base.is_none();
        Ok(Self { loaded, setup, prefix: format!("{}/", robot.name), q, anywhere })
    }

    /// Returns the number of its drives.
    pub(super) fn drives(&self) -> usize {
        self.loaded.model.joint_count() + self.setup.rotors.len()
    }

    /// Returns its setup as a separate articulation.
    pub(super) fn alone(&self) -> RobotSetup {
        let rotors = self
            .setup
            .rotors
            .iter()
            .map(|rotor| RotorDrive { name: format!("{}{}", self.prefix, rotor.name), ..rotor.clone() });
        RobotSetup {
            model: self.loaded.model.prefixed(&self.prefix),
            rotors: rotors.collect(),
            collision_rules: self.setup.collision_rules.prefixed(&self.prefix),
            friction: self.of_links(&self.setup.friction).collect(),
            friction_combine: self.of_links(&self.setup.friction_combine).collect(),
            restitution: self.of_links(&self.setup.restitution).collect(),
            soft: self.of_links(&self.setup.soft).collect(),
            grain: self.of_links(&self.setup.grain).collect(),
            actuators: Vec::new(),
            // it has the names without the prefix
            profile: None,
        }
    }

    /// Renames links to their names in the simulation.
    fn of_links<'a, T: Copy>(
        &'a self,
        values: &'a BTreeMap<String, T>,
    ) -> impl Iterator<Item = (String, T)> + 'a {
        values.iter().map(|(link, value)| (format!("{}{link}", self.prefix), *value))
    }

    /// Returns the links near its base, by their names in the simulation.
    fn near_base(&self) -> Vec<String> {
        let model = &self.loaded.model;
        let first = model.bodies().iter().filter(|body| body.parent.is_none());
        let shapes = model.base_shapes().iter().chain(first.flat_map(|body| &body.shapes));
        let mut links: Vec<String> = shapes.map(|shape| format!("{}{}", self.prefix, shape.link)).collect();
        links.dedup();
        links
    }
}

/// Joins robots with fixed bases into one articulation, each at its pose in the graph.
pub(super) fn together(robots: &[&Placing]) -> Result<RobotSetup, ConfigError> {
    let mut rules = Srdf::default();
    for robot in robots {
        rules.extend(robot.setup.collision_rules.prefixed(&robot.prefix));
    }
    rules.enabled.extend(between(robots));
    let placed: Vec<Placed<'_>> = robots
        .iter()
        .map(|robot| Placed {
            model: &robot.loaded.model,
            prefix: &robot.prefix,
            placement: Isometry3::identity(),
        })
        .collect();
    let model =
        Model::world("world", &placed).map_err(|error| ConfigError::key("robots", error.to_string()))?;
    let friction = robots.iter().flat_map(|robot| robot.of_links(&robot.setup.friction)).collect();
    let combine = robots.iter().flat_map(|robot| robot.of_links(&robot.setup.friction_combine)).collect();
    let restitution = robots.iter().flat_map(|robot| robot.of_links(&robot.setup.restitution)).collect();
    let soft = robots.iter().flat_map(|robot| robot.of_links(&robot.setup.soft)).collect();
    let grain = robots.iter().flat_map(|robot| robot.of_links(&robot.setup.grain)).collect();
    Ok(RobotSetup {
        collision_rules: rules,
        friction,
        friction_combine: combine,
        restitution,
        soft,
        grain,
        ..RobotSetup::from(model)
    })
}

/// Converts an error about the start of one of several robots.
fn inside(error: ConfigError, robot: &str) -> ConfigError {
    match &error.key {
        Some(key) => ConfigError { key: Some(format!("start.{robot}.{key}")), ..error },
        None => error,
    }
}

/// Returns the pairs of links near the bases of different robots, which must be able to touch. In the shared
/// model all bases are one link, so that these links count as neighbours, which never touch by default.
fn between(robots: &[&Placing]) -> Vec<(String, String)> {
    let near: Vec<Vec<String>> = robots.iter().map(|robot| robot.near_base()).collect();
    let mut pairs = Vec::new();
    for (index, links) in near.iter().enumerate() {
        for other in &near[index + 1..] {
            pairs.extend(links.iter().flat_map(|a| other.iter().map(move |b| (a.clone(), b.clone()))));
        }
    }
    pairs
}
