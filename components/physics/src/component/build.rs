//! Set-up of a component's simulation.

use core::ops::Range;
use std::collections::BTreeMap;
use std::path::Path;

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MAX_JOINTS;
use motorium::telemetry::set_apart;
use motorium_robots::Loaded;
use nalgebra::Translation3;

use super::actuators;
use super::config::{self, PhysicsConfig};
use super::placing::{Placing, load, together};
use crate::{Articulated, ArticulatedSimulator, Engine, Mujoco, Rapier, RobotSetup, Simulation, Simulator};

/// The simulation of a component and its robots.
pub(super) struct Built<E> {
    pub(super) simulation: Simulation<E>,
    pub(super) robots: Vec<BuiltRobot>,
    /// Articulations whose floating base starts on the ground at an unspecified height.
    pub(super) on_ground: Vec<usize>,
    /// Warnings about the world file.
    pub(super) doubts: Vec<String>,
}

/// One robot of a simulation.
pub(super) struct BuiltRobot {
    /// Name in the graph, if there are several robots.
    pub(super) name: Option<String>,
    pub(super) loaded: Loaded,
    /// The articulation that contains the robot.
    pub(super) articulation: usize,
    /// Range of the robot's drives in the simulation.
    pub(super) drives: Range<usize>,
    /// True if the robot follows a state instead of commands.
    pub(super) follows: bool,
}

impl BuiltRobot {
    /// Returns the name of one of the robot's ports.
    pub(super) fn port(&self, port: &str) -> String {
        self.name.as_ref().map_or_else(|| port.to_string(), |name| format!("{name}.{port}"))
    }

    /// Returns the prefix of the robot's link and joint names in the simulation; empty for a single robot.
    pub(super) fn prefix(&self) -> String {
        self.name.as_ref().map(|name| format!("{name}/")).unwrap_or_default()
    }
}

/// Loads the robots and builds their simulation. `follows` is true for each robot that follows a state.
/// Relative paths of the configuration are resolved against `folder`.
pub(super) fn build<E: PhysicsEngine>(
    config: &PhysicsConfig,
    robot: Option<&RobotReference>,
    (robots, follows): (&[RobotReference], &[bool]),
    folder: &Path,
) -> Result<Built<E>, ConfigError> {
    let mut config = config.clone();
    let located = config.world.locate(folder);
    let located = located.map_err(|error| ConfigError::key("world", error.to_string()))?;
    let doubts = located.iter().map(|warning| format!("world: {warning}")).collect();
    let built = match (robot, robots) {
        (Some(robot), _) => one(&config, (robot, follows[0]), folder),
        (None, []) => Err(ConfigError::new("the component simulates a robot, but names no robot")
            .advise("add `robot = \"NAME\"`, or `robots = [\"ONE\", \"OTHER\"]`")),
        (None, robots) => several(&config, (robots, follows), folder),
    };
    Ok(Built { doubts, ..built? })
}

fn one<E: PhysicsEngine>(
    config: &PhysicsConfig,
    (robot, follows): (&RobotReference, bool),
    folder: &Path,
) -> Result<Built<E>, ConfigError> {
    if let Some(name) = config.start.keys().next() {
        let message = format!(
            "`start.{name}` applies to components with several robots, but this component has one robot"
        );
        return Err(ConfigError::key("start", message).advise("use `pose` or `position`"));
    }
    let (mut setup, loaded) = load(config, robot)?;
    setup.actuators =
        actuators::settings(config.actuator.as_ref(), &config.actuators, &loaded.model, folder)?;
    config.set_surfaces(core::slice::from_mut(&mut setup))?;
    config.set_springs(core::slice::from_mut(&mut setup))?;
    let drives = loaded.model.joint_count() + setup.rotors.len();
    let joints = config.start(&loaded)?;
    let base = config.base_start(&loaded, robot.pose.is_some())?;
    // A base without a specified pose starts high above everything else and is then lowered to the ground.
    let above = Translation3::new(0.0, 0.0, 1e3) * loaded.model.base().neutral;
    let q = config::configuration(&loaded.model, &base.unwrap_or(above), &joints);
    let mut simulation =
        Simulation::new(setup, config.world.clone(), &q, config.solver).map_err(config::refused)?;
    let on_ground = if loaded.model.base().floating && base.is_none() { vec![0] } else { Vec::new() };
    E::prepare(&mut simulation, &on_ground);
    config.connect(&mut simulation)?;
    let robot = BuiltRobot { name: None, loaded, articulation: 0, drives: 0..drives, follows };
    Ok(Built { simulation, robots: vec![robot], on_ground, doubts: Vec::new() })
}

/// Builds several robots. Each robot that has a floating base or follows a state is a separate articulation.
/// The remaining robots share one articulation, with their trees side by side in the world.
fn several<E: PhysicsEngine>(
    config: &PhysicsConfig,
    (robots, follows): (&[RobotReference], &[bool]),
    folder: &Path,
) -> Result<Built<E>, ConfigError> {
    if config.position.is_some() || config.base.is_some() {
        return Err(ConfigError::new(
            "`position` and `base` apply to a single robot, but the component has several robots",
        )
        .advise("write `start.NAME.position`, and `base` in `[robot.NAME]`"));
    }
    if let Some(name) = config.start.keys().find(|name| robots.iter().all(|robot| robot.name != **name)) {
        let message = format!("`{name}` is not one of the robots of this component");
        return Err(ConfigError::key(format!("start.{name}"), message));
    }
    let loaded = robots.iter().map(|robot| Placing::load(config, robot)).collect::<Result<Vec<_>, _>>()?;
    let alone = |index: usize| loaded[index].loaded.model.base().floating || follows[index];
    let fixed: Vec<usize> = (0..loaded.len()).filter(|index| !alone(*index)).collect();
    // The shared articulation comes at the index of its first robot.
    let groups: Vec<Vec<usize>> = (0..loaded.len())
        .filter(|index| alone(*index) || fixed.first() == Some(index))
        .map(|index| if alone(index) { vec![index] } else { fixed.clone() })
        .collect();
    if let Some(robot) = robots.iter().zip(follows).find_map(|(robot, follows)| follows.then_some(robot))
        && groups.len() > 1
        && !E::CAPABILITIES.several_articulations
    {
        let message = format!(
            "robot `{}` follows a state, but the {} engine moves all robots of a component together",
            robot.name,
            E::NAME
        );
        return Err(ConfigError::key("robots", message).advise("use `kind = \"physics.articulated\"`"));
    }
    let (mut places, mut drives) = (vec![(0, 0..0); loaded.len()], 0);
    for (articulation, group) in groups.iter().enumerate() {
        for index in group {
            let count = loaded[*index].drives();
            places[*index] = (articulation, drives..drives + count);
            drives += count;
        }
    }
    if drives > MAX_JOINTS {
        let message = format!("the robots have {drives} joints in total, expected at most {MAX_JOINTS}");
        return Err(ConfigError::key("robots", message).advise("simulate some of them in another component"));
    }
    let setups = groups.iter().map(|group| {
        let members: Vec<&Placing> = group.iter().map(|index| &loaded[*index]).collect();
        if alone(group[0]) { Ok(members[0].alone()) } else { together(&members) }
    });
    let mut setups = setups.collect::<Result<Vec<_>, _>>()?;
    set_actuators(config, &mut setups, folder)?;
    config.set_surfaces(&mut setups)?;
    config.set_springs(&mut setups)?;
    let q: Vec<f64> = groups.iter().flatten().flat_map(|index| loaded[*index].q.clone()).collect();
    let mut simulation =
        Simulation::of_robots(setups, config.world.clone(), &q, config.solver).map_err(config::refused)?;
    let anywhere: Vec<usize> =
        (0..loaded.len()).filter(|index| loaded[*index].anywhere).map(|index| places[index].0).collect();
    E::prepare(&mut simulation, &anywhere);
    config.connect(&mut simulation)?;
    let built = loaded.into_iter().zip(robots.iter().zip(follows)).zip(places);
    let built = built.map(|((own, (robot, follows)), (articulation, drives))| BuiltRobot {
        name: Some(robot.name.clone()),
        loaded: own.loaded,
        articulation,
        drives,
        follows: *follows,
    });
    let (robots, doubts) = (built.collect(), Vec::new());
    Ok(Built { simulation, robots, on_ground: anywhere, doubts })
}

/// Assigns each articulation the actuators of its joints.
fn set_actuators(
    config: &PhysicsConfig,
    setups: &mut [RobotSetup],
    folder: &Path,
) -> Result<(), ConfigError> {
    let owner = |name: &String| setups.iter().position(|setup| setup.model.joint_index(name).is_some());
    let mut of_joints = vec![BTreeMap::new(); setups.len()];
    for (name, actuator) in &config.actuators {
        // An unknown name is passed to the first robot, which rejects it.
        of_joints[owner(name).unwrap_or(0)].insert(name.clone(), actuator.clone());
    }
    for (setup, of_joints) in setups.iter_mut().zip(&of_joints) {
        setup.actuators = actuators::settings(config.actuator.as_ref(), of_joints, &setup.model, folder)?;
    }
    Ok(())
}

/// A physics engine that is available as a component kind.
pub trait PhysicsEngine: Engine + Send + 'static {
    /// Name of the kind.
    const KIND: &'static str;
    /// One-line summary of the kind.
    const SUMMARY: &'static str;

    /// Prepares a new simulation for its component. `anywhere` lists the indices of the articulations with a
    /// floating base whose start is not configured.
    fn prepare(simulation: &mut Simulation<Self>, anywhere: &[usize]);
}

impl PhysicsEngine for Articulated {
    const KIND: &'static str = "physics.articulated";
    const SUMMARY: &'static str = "simulates robots in a world of simple objects, with contacts";

    fn prepare(simulation: &mut Simulation<Self>, anywhere: &[usize]) {
        anywhere.iter().for_each(|articulation| simulation.place_one_on_ground(*articulation));
    }
}

impl PhysicsEngine for Rapier {
    const KIND: &'static str = "physics.rapier";
    const SUMMARY: &'static str = "simulates fixed-base robots with the rapier engine";

    fn prepare(simulation: &mut Simulation<Self>, _: &[usize]) {
        simulation.enclose_rapier(|call| set_apart(call));
    }
}

impl PhysicsEngine for Mujoco {
    const KIND: &'static str = "physics.mujoco";
    const SUMMARY: &'static str = "simulates robots with MuJoCo, if its library is installed";

    fn prepare(simulation: &mut Simulation<Self>, anywhere: &[usize]) {
        if anywhere.is_empty() {
            return;
        }
        // A twin in the articulated engine, with the same shapes on the same ground, finds the start poses.
        let (world, options) = (simulation.world.clone(), *simulation.options());
        let robots = simulation.articulations().iter().map(|own| RobotSetup::from(own.model().clone()));
        let (robots, q) = (robots.collect::<Vec<_>>(), simulation.configuration().to_vec());
        if let Ok(mut twin) = ArticulatedSimulator::of_robots(robots, world, &q, options) {
            anywhere.iter().for_each(|articulation| twin.place_one_on_ground(*articulation));
            let placed = simulation.reset(twin.configuration(), twin.velocity());
            placed.expect("the same robots have the same coordinates");
        }
    }
}
