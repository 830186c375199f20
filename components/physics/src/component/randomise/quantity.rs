//! The quantities that are drawn: which there are, and what each changes.

use motorium::declare::ConfigError;
use motorium::state::{MAX_DRAWN, Randomisation as Message};
use motorium_robots::{ActuatorSettings, Connection};

use super::super::build::BuiltRobot;
use super::config::{Allowed, Interval, RandomiseConfig, TerrainIntervals};
use super::varied::{shares, vary};
use crate::Properties;

/// One quantity that is drawn.
#[derive(Clone, Debug)]
pub(super) struct Quantity {
    /// Its property and part, as the message has them.
    pub(super) property: u32,
    pub(super) part: u32,
    /// Its place in the report, such as `mass`, `link`.
    pub(super) path: Vec<String>,
    pub(super) interval: Interval,
    /// The robot that it belongs to; `None` for the world.
    pub(super) robot: Option<usize>,
}

impl Quantity {
    /// True for what may change within an episode: no start, no object, no terrain.
    pub(super) fn changes(&self) -> bool {
        let once = Message::START..=Message::OBJECT_YAW;
        !once.contains(&self.property)
            && ![Message::TERRAIN_SEED, Message::TERRAIN_SCALE].contains(&self.property)
    }

    /// Its value at a share from 0 to 1 of its range.
    pub(super) fn at(&self, share: f64) -> f64 {
        if self.property == Message::TERRAIN_SEED {
            self.interval.whole_at(share)
        } else {
            self.interval.at(share)
        }
    }
}

/// Checks the ranges and lists all quantities, in the order of the message.
pub(super) fn quantities(
    config: &RandomiseConfig,
    robots: &[BuiltRobot],
    nominal: &Properties,
) -> Result<Vec<Quantity>, ConfigError> {
    let mut list = List(Vec::new());
    list.add((Message::GRAVITY, 0), &["gravity"], (config.gravity, Allowed::Factor), None)?;
    of_ground(config, nominal, &mut list)?;
    of_terrain(config, nominal, &mut list)?;
    of_objects(config, nominal, &mut list)?;
    let names: Vec<&str> = robots.iter().filter_map(|robot| robot.name.as_deref()).collect();
    if let Some(name) = config.robots.keys().find(|name| !names.contains(&name.as_str())) {
        let message = format!("`{name}` is not one of several robots of this component");
        return Err(ConfigError::key(format!("randomise.robots.{name}"), message));
    }
    let shares = shares(robots);
    for (index, robot) in robots.iter().enumerate() {
        let of_all = nominal.actuators.get(robot.articulation).map_or(&[][..], Vec::as_slice);
        let actuators = of_all.get(shares[index].joints..).unwrap_or(&[]);
        of_robot(config, (index, robot), actuators, &mut list)?;
        of_base(config, (index, robots), &mut list)?;
        let world = list.0.iter().filter(|quantity| quantity.robot.is_none()).count();
        let own = list.0.iter().filter(|quantity| quantity.robot == Some(index)).count();
        if world + own > MAX_DRAWN {
            let message =
                format!("{} numbers are drawn, at most {MAX_DRAWN} fit into a message", world + own);
            return Err(ConfigError::key("randomise", message).advise("draw fewer properties"));
        }
    }
    if let Some(every) = config.every {
        if every.ns == 0 {
            return Err(ConfigError::key("randomise.every", "0 s, expected a time above 0"));
        }
        if !list.0.iter().any(Quantity::changes) {
            let message = "nothing is drawn that may change within an episode";
            return Err(ConfigError::key("randomise.every", message)
                .advise("starts, objects and the terrain are drawn once an episode: leave it out"));
        }
    }
    Ok(list.0)
}

struct List(Vec<Quantity>);

impl List {
    /// Adds a quantity if it has a range. `path` is its key.
    fn add(
        &mut self,
        (property, part): (u32, u32),
        path: &[&str],
        (interval, allowed): (Option<Interval>, Allowed),
        robot: Option<usize>,
    ) -> Result<(), ConfigError> {
        let Some(interval) = interval else { return Ok(()) };
        interval.check(&path.join("."), allowed)?;
        let path = path.iter().map(|part| (*part).to_owned()).collect();
        self.0.push(Quantity { property, part, path, interval, robot });
        Ok(())
    }
}

fn of_ground(config: &RandomiseConfig, nominal: &Properties, list: &mut List) -> Result<(), ConfigError> {
    let ground = &config.ground;
    let there = nominal.world.ground.is_some() || nominal.world.terrain.is_some();
    if !there && (ground.friction.is_some() || ground.restitution.is_some()) {
        return Err(ConfigError::key("randomise.ground", "the world has no ground and no terrain")
            .advise("add `ground = {}` to the world"));
    }
    let friction = (ground.friction, Allowed::Factor);
    list.add((Message::GROUND_FRICTION, 0), &["ground", "friction"], friction, None)?;
    let restitution = (ground.restitution, Allowed::Share);
    list.add((Message::GROUND_RESTITUTION, 0), &["ground", "restitution"], restitution, None)
}

fn of_terrain(config: &RandomiseConfig, nominal: &Properties, list: &mut List) -> Result<(), ConfigError> {
    let TerrainIntervals { seed, scale } = config.terrain;
    if nominal.world.terrain.is_none() && (seed.is_some() || scale.is_some()) {
        return Err(ConfigError::key("randomise.terrain", "the world has no terrain")
            .advise("add `terrain = { size = [8.0, 8.0], layers = [...] }` to the world"));
    }
    list.add((Message::TERRAIN_SEED, 0), &["terrain", "seed"], (seed, Allowed::Seed), None)?;
    list.add((Message::TERRAIN_SCALE, 0), &["terrain", "scale"], (scale, Allowed::Factor), None)
}

fn of_objects(config: &RandomiseConfig, nominal: &Properties, list: &mut List) -> Result<(), ConfigError> {
    for (name, ranges) in &config.objects {
        let objects = &nominal.world.objects;
        let key = format!("randomise.objects.{name}");
        let Some(index) = objects.iter().position(|object| object.name == *name) else {
            let names: Vec<_> = objects.iter().map(|object| object.name.as_str()).collect();
            let message = format!("the world has no object `{name}`");
            let advice = match names.as_slice() {
                [] => "it has none: add `objects` to the world".to_owned(),
                names => format!("it has: {}", names.join(", ")),
            };
            return Err(ConfigError::key(key, message).advise(advice));
        };
        let places = [ranges.x, ranges.y, ranges.z, ranges.yaw];
        if !objects[index].is_dynamic() && (ranges.mass.is_some() || places.iter().any(Option::is_some)) {
            let message = format!("`{name}` has no mass and stays where the graph has it");
            return Err(
                ConfigError::key(key, message).advise("draw its friction or restitution, or give it a mass")
            );
        }
        for (property, own, interval, allowed) in [
            (Message::OBJECT_MASS, "mass", ranges.mass, Allowed::Positive),
            (Message::OBJECT_FRICTION, "friction", ranges.friction, Allowed::Factor),
            (Message::OBJECT_RESTITUTION, "restitution", ranges.restitution, Allowed::Share),
            (Message::OBJECT_X, "x", ranges.x, Allowed::Displacement),
            (Message::OBJECT_Y, "y", ranges.y, Allowed::Displacement),
            (Message::OBJECT_Z, "z", ranges.z, Allowed::Displacement),
            (Message::OBJECT_YAW, "yaw", ranges.yaw, Allowed::Displacement),
        ] {
            list.add((property, index as u32), &["objects", name, own], (interval, allowed), None)?;
        }
    }
    Ok(())
}

/// Refuses a drawn start of an object that is connected: the connection is made once, where all stands without a draw.
pub(super) fn check_ties<'c>(
    config: &RandomiseConfig,
    connections: impl Iterator<Item = &'c Connection>,
) -> Result<(), ConfigError> {
    for connection in connections {
        let drawn = connection.parts.iter().find(|part| {
            let ranges = config.objects.get(*part);
            ranges.is_some_and(|own| [own.x, own.y, own.z, own.yaw].iter().any(Option::is_some))
        });
        if let Some(name) = drawn {
            let [first, second] = &connection.parts;
            let message = format!("a connection ties `{first}` to `{second}` where they stand at the start");
            return Err(ConfigError::key(format!("randomise.objects.{name}"), message)
                .advise("draw its mass, friction or restitution, and leave its start where it is"));
        }
    }
    Ok(())
}

fn of_robot(
    config: &RandomiseConfig,
    (index, robot): (usize, &BuiltRobot),
    actuators: &[Option<ActuatorSettings>],
    list: &mut List,
) -> Result<(), ConfigError> {
    let (name, model) = (robot.name.as_deref(), &robot.loaded.model);
    let ranges = config.of_robot(name);
    let mut add = |property: u32, key: &str, parts: Vec<(u32, &str)>, interval: Option<Interval>, allowed| {
        let Some(interval) = interval else { return Ok(()) };
        let written = config.key_of_robot(name, key);
        interval.check(&written, allowed)?;
        if parts.is_empty() {
            let message = format!("nothing to draw: no part of robot `{}` has it", model.name());
            return Err(ConfigError::key(format!("randomise.{written}"), message).advise("leave it out"));
        }
        if property > Message::ACTUATOR_STRENGTH {
            check_ends(&written, (property, interval), &parts, actuators)?;
        }
        for (part, of) in parts {
            let mut path: Vec<String> = name.map_or_else(Vec::new, |name| vec!["robots".into(), name.into()]);
            path.extend(key.split('.').map(str::to_owned));
            if !of.is_empty() {
                path.push(of.to_owned());
            }
            list.0.push(Quantity { property, part, path, interval, robot: Some(index) });
        }
        Ok(())
    };
    let bodies = model.bodies().iter().enumerate().filter(|(_, body)| body.inertia.mass > 0.0);
    let base = model.base().floating.then(|| (Message::BASE, model.frames()[0].name.as_str()));
    let bodies = base.into_iter().chain(bodies.map(|(index, body)| (index as u32, body.name.as_str())));
    add(Message::BODY_MASS, "mass", bodies.collect(), ranges.mass, Allowed::Positive)?;
    let whole = || vec![(0, "")];
    add(Message::FRICTION, "friction", whole(), ranges.friction, Allowed::Factor)?;
    add(Message::RESTITUTION, "restitution", whole(), ranges.restitution, Allowed::Share)?;
    let joints = |has: &dyn Fn(usize) -> bool| -> Vec<(u32, &str)> {
        let names = model.joint_names().iter().enumerate().filter(|(joint, _)| has(*joint));
        names.map(|(joint, name)| (joint as u32, name.as_str())).collect()
    };
    let dynamics = |joint: usize| {
        let moved = model.bodies().iter().filter(move |body| body.joint.coordinate.index() == joint);
        moved.map(|body| body.joint.dynamics)
    };
    let damped = joints(&|joint| dynamics(joint).any(|dynamics| dynamics.damping > 0.0));
    add(Message::DAMPING, "damping", damped, ranges.damping, Allowed::Factor)?;
    let rubbing = joints(&|joint| dynamics(joint).any(|dynamics| dynamics.friction > 0.0));
    add(Message::JOINT_FRICTION, "joint_friction", rubbing, ranges.joint_friction, Allowed::Factor)?;
    let limited = joints(&|joint| model.effort_limit()[joint].is_finite());
    add(Message::EFFORT_LIMIT, "effort_limit", limited, ranges.effort_limit, Allowed::Factor)?;
    add(Message::START, "start", joints(&|_| true), ranges.start, Allowed::Displacement)?;
    let settings = |joint: usize| actuators.get(joint)?.as_ref();
    let own = &ranges.actuator;
    // A network gives its efforts itself, whatever the drive is commanded.
    let driven = joints(&|joint| settings(joint).is_none_or(|own| own.network.is_none()));
    add(Message::ACTUATOR_GAIN, "actuator.gain", driven.clone(), own.gain, Allowed::Factor)?;
    add(Message::ACTUATOR_STRENGTH, "actuator.strength", driven, own.strength, Allowed::Factor)?;
    let with = |has: fn(&ActuatorSettings) -> bool| joints(&|joint| settings(joint).is_some_and(has));
    let delayed = with(|own| own.delay > 0.0);
    add(Message::ACTUATOR_DELAY, "actuator.delay", delayed, own.delay, Allowed::Positive)?;
    let lagging = with(|own| own.lag > 0.0);
    add(Message::ACTUATOR_LAG, "actuator.lag", lagging, own.lag, Allowed::Factor)?;
    let limited = with(|own| own.rate_limit.is_some());
    add(Message::ACTUATOR_RATE_LIMIT, "actuator.rate_limit", limited, own.rate_limit, Allowed::Positive)?;
    let loose = with(|own| own.drivetrain.is_some_and(|drivetrain| drivetrain.backlash > 0.0));
    add(Message::ACTUATOR_BACKLASH, "actuator.backlash", loose, own.backlash, Allowed::Factor)?;
    let elastic = with(|own| own.drivetrain.is_some());
    add(Message::ACTUATOR_STIFFNESS, "actuator.stiffness", elastic, own.stiffness, Allowed::Positive)
}

/// Checks the settings that both ends of a range make of the actuators of these joints.
fn check_ends(
    key: &str,
    (property, interval): (u32, Interval),
    joints: &[(u32, &str)],
    actuators: &[Option<ActuatorSettings>],
) -> Result<(), ConfigError> {
    for (joint, name) in joints {
        let Some(Some(settings)) = actuators.get(*joint as usize) else { continue };
        for factor in interval.0 {
            let mut settings = settings.clone();
            vary(&mut settings, property, factor);
            settings.check().map_err(|error| {
                let message = format!("the factor {factor} makes of the actuator of joint `{name}` {error}");
                ConfigError::key(format!("randomise.{key}"), message)
                    .advise("choose a smaller factor, or another value of the actuator")
            })?;
        }
    }
    Ok(())
}

/// The place of the base of a robot that floats. Ranges that no robot can use are refused.
fn of_base(
    config: &RandomiseConfig,
    (index, robots): (usize, &[BuiltRobot]),
    list: &mut List,
) -> Result<(), ConfigError> {
    let floats = |robot: &BuiltRobot| robot.loaded.model.base().floating;
    let place = &config.base;
    for (property, key, interval) in [
        (Message::BASE_X, "x", place.x),
        (Message::BASE_Y, "y", place.y),
        (Message::BASE_Z, "z", place.z),
        (Message::BASE_YAW, "yaw", place.yaw),
    ] {
        let Some(interval) = interval else { continue };
        let written = format!("base.{key}");
        if !robots.iter().any(floats) {
            let message = "a displacement of a base that is fixed to the world";
            return Err(ConfigError::key(format!("randomise.{written}"), message).advise("leave it out"));
        }
        interval.check(&written, Allowed::Displacement)?;
        if !floats(&robots[index]) {
            continue;
        }
        let of_several = robots[index].name.iter().flat_map(|name| ["robots".to_owned(), name.clone()]);
        let path = of_several.chain(["base".to_owned(), key.to_owned()]).collect();
        list.0.push(Quantity { property, part: 0, path, interval, robot: Some(index) });
    }
    Ok(())
}
