//! Setting up the simulation of a component.

use core::ops::Range;
use std::path::Path;

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MAX_JOINTS;
use motorium::telemetry::set_apart;
use motorium_robots::{BasePose, LoadOptions, Loaded, Model, Placed, RobotSource, Srdf};
use nalgebra::{Isometry3, Translation3};

use super::actuators;
use super::config::{self, PhysicsConfig};
use crate::{Articulated, ArticulatedSimulator, Engine, Mujoco, Rapier, RobotSetup, Simulation, Simulator};

/// The simulation of a component, and the robots in it.
pub(super) struct Built<E> {
    pub(super) simulation: Simulation<E>,
    pub(super) robots: Vec<BuiltRobot>,
    /// A floating base that starts on the ground, wherever that is.
    pub(super) on_ground: bool,
}

/// One robot of a simulation.
pub(super) struct BuiltRobot {
    /// Its name in the graph, where there are several.
    pub(super) name: Option<String>,
    pub(super) loaded: Loaded,
    /// Its drives among those of the simulation.
    pub(super) drives: Range<usize>,
}

impl BuiltRobot {
    /// The name of one of its ports.
    pub(super) fn port(&self, port: &str) -> String {
        self.name.as_ref().map_or_else(|| port.to_string(), |name| format!("{name}.{port}"))
    }

    /// Its part of a text of the simulation: names of links and joints begin with that of the robot where there are
    /// several.
    fn prefix(name: &str) -> String {
        format!("{name}/")
    }
}

/// Loads the robots and sets up their simulation; relative paths of the configuration begin at `folder`.
pub(super) fn build<E: PhysicsEngine>(
    config: &PhysicsConfig,
    robot: Option<&RobotReference>,
    robots: &[RobotReference],
    folder: &Path,
) -> Result<Built<E>, ConfigError> {
    let mut config = config.clone();
    config.world.locate(folder);
    match (robot, robots) {
        (Some(robot), _) => one(&config, robot, folder),
        (None, []) => Err(ConfigError::new("it simulates a robot, but the component names none")
            .advise("add `robot = \"NAME\"`, or `robots = [\"ONE\", \"OTHER\"]`")),
        (None, robots) => several(&config, robots, folder),
    }
}

fn load(config: &PhysicsConfig, robot: &RobotReference) -> Result<(RobotSetup, Loaded), ConfigError> {
    let options = LoadOptions { base: config.base_mode(), ..LoadOptions::default() };
    let pose = robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy });
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose,
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
    };
    let loaded = source.load_with(&options).map_err(|error| ConfigError::new(error.to_string()))?;
    let setup = RobotSetup::of(&loaded).map_err(|error| ConfigError::new(error.to_string()))?;
    let model = &loaded.model;
    let drives = model.joint_count() + setup.rotors.len();
    if drives > MAX_JOINTS || (drives == 0 && !model.base().floating) {
        let message = format!("robot `{}` has {drives} joints, expected 1 to {MAX_JOINTS}", robot.name);
        return Err(ConfigError::new(message).advise("make joints that need not move fixed in its URDF"));
    }
    Ok((setup, loaded))
}

fn one<E: PhysicsEngine>(
    config: &PhysicsConfig,
    robot: &RobotReference,
    folder: &Path,
) -> Result<Built<E>, ConfigError> {
    if let Some(name) = config.start.keys().next() {
        let message = format!("a start for `{name}` of a component with one robot");
        return Err(ConfigError::key("start", message).advise("use `pose` or `position`"));
    }
    let (mut setup, loaded) = load(config, robot)?;
    setup.actuators =
        actuators::settings(config.actuator.as_ref(), &config.actuators, &loaded.model, folder)?;
    config.set_surfaces(&mut setup)?;
    let drives = loaded.model.joint_count() + setup.rotors.len();
    let joints = config.start(&loaded)?;
    let base = config.base_start(&loaded, robot.pose.is_some())?;
    // A base without a given place is put on the ground from high above everything else.
    let above = Translation3::new(0.0, 0.0, 1e3) * loaded.model.base().neutral;
    let q = config::configuration(&loaded.model, &base.unwrap_or(above), &joints);
    let mut simulation =
        Simulation::new(setup, config.world.clone(), &q, config.solver).map_err(config::refused)?;
    E::prepare(&mut simulation, base.is_none());
    let on_ground = loaded.model.base().floating && base.is_none();
    Ok(Built { simulation, robots: vec![BuiltRobot { name: None, loaded, drives: 0..drives }], on_ground })
}

/// Several robots with fixed bases, as one model: their trees stand side by side in the world.
fn several<E: PhysicsEngine>(
    config: &PhysicsConfig,
    robots: &[RobotReference],
    folder: &Path,
) -> Result<Built<E>, ConfigError> {
    if config.position.is_some() || config.base.is_some() {
        return Err(ConfigError::new("`position` and `base` are those of one robot, and there are several")
            .advise("write `start.NAME.position`, and `base` in `[robot.NAME]`"));
    }
    if let Some(name) = config.start.keys().find(|name| robots.iter().all(|robot| robot.name != **name)) {
        let message = format!("`{name}` is not one of the robots of this component");
        return Err(ConfigError::key(format!("start.{name}"), message));
    }
    let (mut built, mut rules, mut q, mut drives) = (Vec::new(), Srdf::default(), Vec::new(), 0);
    for robot in robots {
        let (setup, loaded) = load(config, robot)?;
        if loaded.model.base().floating {
            let message = format!("robot `{}` has a floating base, which stands alone so far", robot.name);
            return Err(ConfigError::key("robots", message)
                .advise("fix it by `floating = false`, or give it a component of its own"));
        }
        let start = config.start.get(&robot.name).cloned().unwrap_or_default();
        let own = PhysicsConfig {
            pose: start.pose.or(config.pose.clone()),
            position: start.position,
            ..config.clone()
        };
        q.extend(own.start(&loaded).map_err(|error| inside(error, &robot.name))?);
        rules.extend(setup.collision_rules.prefixed(&BuiltRobot::prefix(&robot.name)));
        let count = loaded.model.joint_count();
        built.push(BuiltRobot { name: Some(robot.name.clone()), loaded, drives: drives..drives + count });
        drives += count;
    }
    if drives > MAX_JOINTS {
        let message = format!("the robots have {drives} joints together, at most {MAX_JOINTS} fit");
        return Err(ConfigError::key("robots", message).advise("simulate some of them in another component"));
    }
    rules.enabled.extend(between(&built));
    let prefixes: Vec<String> = robots.iter().map(|robot| BuiltRobot::prefix(&robot.name)).collect();
    let placed: Vec<Placed<'_>> = built
        .iter()
        .zip(&prefixes)
        // each model stands where the graph has it already
        .map(|(robot, prefix)| Placed {
            model: &robot.loaded.model,
            prefix,
            placement: Isometry3::identity(),
        })
        .collect();
    let model =
        Model::world("world", &placed).map_err(|error| ConfigError::key("robots", error.to_string()))?;
    let actuators = actuators::settings(config.actuator.as_ref(), &config.actuators, &model, folder)?;
    let mut setup = RobotSetup { collision_rules: rules, actuators, ..RobotSetup::from(model) };
    config.set_surfaces(&mut setup)?;
    let mut simulation =
        Simulation::new(setup, config.world.clone(), &q, config.solver).map_err(config::refused)?;
    E::prepare(&mut simulation, false);
    Ok(Built { simulation, robots: built, on_ground: false })
}

/// An error about the start of one of several robots.
fn inside(error: ConfigError, robot: &str) -> ConfigError {
    match &error.key {
        Some(key) => ConfigError { key: Some(format!("start.{robot}.{key}")), ..error },
        None => error,
    }
}

/// Pairs of links near the bases of two robots. Within one robot such links never touch: a joint joins them, or they are
/// neighbours; and in the common model all bases are one.
fn between(robots: &[BuiltRobot]) -> Vec<(String, String)> {
    let near = |robot: &BuiltRobot| -> Vec<String> {
        let model = &robot.loaded.model;
        let first = model.bodies().iter().filter(|body| body.parent.is_none());
        let shapes = model.base_shapes().iter().chain(first.flat_map(|body| &body.shapes));
        let prefix = robot.name.as_deref().map(BuiltRobot::prefix).unwrap_or_default();
        let mut links: Vec<String> = shapes.map(|shape| format!("{prefix}{}", shape.link)).collect();
        links.dedup();
        links
    };
    let near: Vec<Vec<String>> = robots.iter().map(near).collect();
    let mut pairs = Vec::new();
    for (index, links) in near.iter().enumerate() {
        for other in &near[index + 1..] {
            pairs.extend(links.iter().flat_map(|a| other.iter().map(move |b| (a.clone(), b.clone()))));
        }
    }
    pairs
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
    const SUMMARY: &'static str = "simulates robots in a world of simple objects, with contacts";

    fn prepare(simulation: &mut Simulation<Self>, placed_anywhere: bool) {
        if placed_anywhere {
            simulation.place_on_ground();
        }
    }
}

impl PhysicsEngine for Rapier {
    const KIND: &'static str = "physics.rapier";
    const SUMMARY: &'static str = "simulates robots with fixed bases by the rapier engine";

    fn prepare(simulation: &mut Simulation<Self>, _: bool) {
        simulation.enclose_rapier(|call| set_apart(call));
    }
}

impl PhysicsEngine for Mujoco {
    const KIND: &'static str = "physics.mujoco";
    const SUMMARY: &'static str = "simulates robots by MuJoCo, where its library is installed";

    fn prepare(simulation: &mut Simulation<Self>, placed_anywhere: bool) {
        if !placed_anywhere {
            return;
        }
        // The same shapes stand on the same ground.
        let (model, world) = (simulation.model().clone(), simulation.world.clone());
        let (q, options) = (simulation.configuration().to_vec(), *simulation.options());
        if let Ok(mut twin) = ArticulatedSimulator::new(model, world, &q, options) {
            twin.place_on_ground();
            let placed = simulation.reset(twin.configuration(), twin.velocity());
            placed.expect("the same robot has the same coordinates");
        }
    }
}
