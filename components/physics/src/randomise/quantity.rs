//! The sampled quantities and their effects.

use motorium_robots::ActuatorSettings;
use motorium_worlds::Connection;

use super::config::{Allowed, Interval, RandomiseConfig, TerrainIntervals};
use super::range_error::RangeError;
use super::robot::RandomisedRobot;
use super::share::shares;
use crate::Properties;

/// A physical property that can be sampled from a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Property {
    /// Scale of gravity.
    Gravity,
    /// Scale of the friction of the ground or the terrain.
    GroundFriction,
    /// Restitution of the ground or the terrain.
    GroundRestitution,
    /// Seed of the terrain.
    TerrainSeed,
    /// Scale of the heights of the terrain.
    TerrainScale,
    /// Scale of the mass and inertia of a floating base.
    BaseMass,
    /// Scale of the mass and inertia of a body.
    BodyMass,
    /// Scale of the friction of a robot's surface.
    Friction,
    /// Restitution of a robot's surface.
    Restitution,
    /// Scale of the viscous damping of a joint.
    Damping,
    /// Scale of the Coulomb friction of a joint.
    JointFriction,
    /// Scale of the effort limit of a joint.
    EffortLimit,
    /// Displacement of a joint's initial position, rad or m.
    Start,
    /// Initial displacement of a floating base along the world's x axis, m.
    BaseX,
    /// Initial displacement of a floating base along the world's y axis, m.
    BaseY,
    /// Initial displacement of a floating base along the world's z axis, m.
    BaseZ,
    /// Initial rotation of a floating base about the world's z axis, rad.
    BaseYaw,
    /// Scale of the mass and inertia of an object.
    ObjectMass,
    /// Scale of the friction of an object.
    ObjectFriction,
    /// Restitution of an object.
    ObjectRestitution,
    /// Initial displacement of an object along the world's x axis, m.
    ObjectX,
    /// Initial displacement of an object along the world's y axis, m.
    ObjectY,
    /// Initial displacement of an object along the world's z axis, m.
    ObjectZ,
    /// Initial rotation of an object about the world's z axis, rad.
    ObjectYaw,
    /// Scale of the stiffness and damping commanded to a drive.
    ActuatorGain,
    /// Scale of all efforts of a drive and of its effort limit.
    ActuatorStrength,
    /// Scale of the delay of an actuator.
    ActuatorDelay,
    /// Scale of the lag of an actuator.
    ActuatorLag,
    /// Scale of the rate limit of an actuator.
    ActuatorRateLimit,
    /// Scale of the backlash of a drivetrain.
    ActuatorBacklash,
    /// Scale of the stiffness of a drivetrain.
    ActuatorStiffness,
}

/// One sampled number: a property of a body, joint, object, robot or world.
#[derive(Clone, Debug)]
pub struct Quantity {
    /// Sampled property.
    pub property: Property,
    /// Index of the body, joint or object in its robot or world; 0 for a property of a whole robot or world.
    pub part: usize,
    /// Keys in the `randomise` table and the name of the part, such as `mass` followed by the name of a link.
    pub path: Vec<String>,
    /// Range from which the value is sampled.
    pub interval: Interval,
    /// Index of the robot; `None` for the world.
    pub robot: Option<usize>,
}

impl Quantity {
    /// Returns `true` if the property may change within an episode. Properties of starts, objects and terrain
    /// do not change.
    pub fn varies_in_time(&self) -> bool {
        let once = Property::Start..=Property::ObjectYaw;
        !once.contains(&self.property)
            && ![Property::TerrainSeed, Property::TerrainScale].contains(&self.property)
    }

    /// Returns the value at a fraction from 0 to 1 of the range.
    pub(super) fn value(&self, share: f64) -> f64 {
        if self.property == Property::TerrainSeed {
            self.interval.whole_at(share)
        } else {
            self.interval.interpolate(share)
        }
    }
}

/// Checks the ranges and lists all quantities, in the order of the message.
pub(super) fn quantities(
    config: &RandomiseConfig,
    robots: &[RandomisedRobot],
    nominal: &Properties,
) -> Result<Vec<Quantity>, RangeError> {
    let mut list = List(Vec::new());
    list.add((Property::Gravity, 0), &["gravity"], (config.gravity, Allowed::Factor), None)?;
    of_ground(config, nominal, &mut list)?;
    of_terrain(config, nominal, &mut list)?;
    of_objects(config, nominal, &mut list)?;
    let names: Vec<&str> = robots.iter().filter_map(|robot| robot.name.as_deref()).collect();
    if let Some(name) = config.robots.keys().find(|name| !names.contains(&name.as_str())) {
        let message = format!("`{name}` is not one of several robots of this component");
        return Err(RangeError::new(format!("robots.{name}"), message));
    }
    let shares = shares(robots);
    for (index, robot) in robots.iter().enumerate() {
        let of_all = nominal.actuators.get(robot.articulation).map_or(&[][..], Vec::as_slice);
        let actuators = of_all.get(shares[index].joints..).unwrap_or(&[]);
        of_robot(config, (index, robot), actuators, &mut list)?;
        of_base(config, (index, robots), &mut list)?;
    }
    if let Some(every) = config.every {
        if every.ns == 0 {
            return Err(RangeError::new("every", "0 s, expected a time above 0"));
        }
        if !list.0.iter().any(Quantity::varies_in_time) {
            let message = "no sampled property may change within an episode";
            return Err(RangeError::new("every", message)
                .advise("starts, objects and the terrain are sampled once per episode; remove `every`"));
        }
    }
    Ok(list.0)
}

struct List(Vec<Quantity>);

impl List {
    /// Adds a quantity if it has a range. `path` is its key.
    fn add(
        &mut self,
        (property, part): (Property, usize),
        path: &[&str],
        (interval, allowed): (Option<Interval>, Allowed),
        robot: Option<usize>,
    ) -> Result<(), RangeError> {
        let Some(interval) = interval else { return Ok(()) };
        interval.check(&path.join("."), allowed)?;
        let path = path.iter().map(|part| (*part).to_owned()).collect();
        self.0.push(Quantity { property, part, path, interval, robot });
        Ok(())
    }
}

fn of_ground(config: &RandomiseConfig, nominal: &Properties, list: &mut List) -> Result<(), RangeError> {
    let ground = &config.ground;
    let there = nominal.world.ground.is_some() || nominal.world.terrain.is_some();
    if !there && (ground.friction.is_some() || ground.restitution.is_some()) {
        return Err(RangeError::new("ground", "the world has no ground and no terrain")
            .advise("add `ground = {}` to the world"));
    }
    let friction = (ground.friction, Allowed::Factor);
    list.add((Property::GroundFriction, 0), &["ground", "friction"], friction, None)?;
    let restitution = (ground.restitution, Allowed::Share);
    list.add((Property::GroundRestitution, 0), &["ground", "restitution"], restitution, None)
}

fn of_terrain(config: &RandomiseConfig, nominal: &Properties, list: &mut List) -> Result<(), RangeError> {
    let TerrainIntervals { seed, scale } = config.terrain;
    if nominal.world.terrain.is_none() && (seed.is_some() || scale.is_some()) {
        return Err(RangeError::new("terrain", "the world has no terrain")
            .advise("add `terrain = { size = [8.0, 8.0], layers = [...] }` to the world"));
    }
    list.add((Property::TerrainSeed, 0), &["terrain", "seed"], (seed, Allowed::Seed), None)?;
    list.add((Property::TerrainScale, 0), &["terrain", "scale"], (scale, Allowed::Factor), None)
}

fn of_objects(config: &RandomiseConfig, nominal: &Properties, list: &mut List) -> Result<(), RangeError> {
    for (name, ranges) in &config.objects {
        let objects = &nominal.world.objects;
        let key = format!("objects.{name}");
        let Some(index) = objects.iter().position(|object| object.name == *name) else {
            let names: Vec<_> = objects.iter().map(|object| object.name.as_str()).collect();
            let message = format!("the world has no object `{name}`");
            let advice = match names.as_slice() {
                [] => "add `objects` to the world, which has none".to_owned(),
                names => format!("use an object of the world: {}", names.join(", ")),
            };
            return Err(RangeError::new(key, message).advise(advice));
        };
        let places = [ranges.x, ranges.y, ranges.z, ranges.yaw];
        if !objects[index].is_dynamic() && (ranges.mass.is_some() || places.iter().any(Option::is_some)) {
            let message = format!("`{name}` has no mass and stays at its pose in the graph");
            return Err(
                RangeError::new(key, message).advise("sample its friction or restitution, or give it a mass")
            );
        }
        for (property, own, interval, allowed) in [
            (Property::ObjectMass, "mass", ranges.mass, Allowed::Positive),
            (Property::ObjectFriction, "friction", ranges.friction, Allowed::Factor),
            (Property::ObjectRestitution, "restitution", ranges.restitution, Allowed::Share),
            (Property::ObjectX, "x", ranges.x, Allowed::Displacement),
            (Property::ObjectY, "y", ranges.y, Allowed::Displacement),
            (Property::ObjectZ, "z", ranges.z, Allowed::Displacement),
            (Property::ObjectYaw, "yaw", ranges.yaw, Allowed::Displacement),
        ] {
            list.add((property, index), &["objects", name, own], (interval, allowed), None)?;
        }
    }
    Ok(())
}

/// Returns an error if the start of a connected object is sampled: the connection is made once, in the
/// nominal poses.
pub(crate) fn check_ties<'c>(
    config: &RandomiseConfig,
    connections: impl Iterator<Item = &'c Connection>,
) -> Result<(), RangeError> {
    for connection in connections {
        let drawn = connection.parts.iter().find(|part| {
            let ranges = config.objects.get(*part);
            ranges.is_some_and(|own| [own.x, own.y, own.z, own.yaw].iter().any(Option::is_some))
        });
        if let Some(name) = drawn {
            let [first, second] = &connection.parts;
            let message = format!(
                "the initial pose cannot be sampled, because a connection holds `{first}` and `{second}` in their initial poses"
            );
            return Err(RangeError::new(format!("objects.{name}"), message)
                .advise("sample its mass, friction or restitution instead"));
        }
    }
    Ok(())
}

fn of_robot(
    config: &RandomiseConfig,
    (index, robot): (usize, &RandomisedRobot),
    actuators: &[Option<ActuatorSettings>],
    list: &mut List,
) -> Result<(), RangeError> {
    let (name, model) = (robot.name.as_deref(), &robot.model);
    let ranges = config.of_robot(name);
    let mut add =
        |property: Property, key: &str, parts: Vec<(usize, &str)>, interval: Option<Interval>, allowed| {
            let Some(interval) = interval else { return Ok(()) };
            let written = config.key_of_robot(name, key);
            interval.check(&written, allowed)?;
            if parts.is_empty() {
                let message = format!("robot `{}` has no part with this property", model.name());
                return Err(RangeError::new(written, message).advise("remove the range"));
            }
            if property > Property::ActuatorStrength {
                check_ends(&written, (property, interval), &parts, actuators)?;
            }
            for (part, of) in parts {
                let mut path: Vec<String> =
                    name.map_or_else(Vec::new, |name| vec!["robots".into(), name.into()]);
                path.extend(key.split('.').map(str::to_owned));
                if !of.is_empty() {
                    path.push(of.to_owned());
                }
                list.0.push(Quantity { property, part, path, interval, robot: Some(index) });
            }
            Ok(())
        };
    let bodies = model.bodies().iter().enumerate().filter(|(_, body)| body.inertia.mass > 0.0);
    let bodies: Vec<_> = bodies.map(|(index, body)| (index, body.name.as_str())).collect();
    let floats = model.base().floating;
    if floats {
        let base = vec![(0, model.frames()[0].name.as_str())];
        add(Property::BaseMass, "mass", base, ranges.mass, Allowed::Positive)?;
    }
    if !(floats && bodies.is_empty()) {
        add(Property::BodyMass, "mass", bodies, ranges.mass, Allowed::Positive)?;
    }
    let whole = || vec![(0, "")];
    add(Property::Friction, "friction", whole(), ranges.friction, Allowed::Factor)?;
    add(Property::Restitution, "restitution", whole(), ranges.restitution, Allowed::Share)?;
    let joints = |has: &dyn Fn(usize) -> bool| -> Vec<(usize, &str)> {
        let names = model.joint_names().iter().enumerate().filter(|(joint, _)| has(*joint));
        names.map(|(joint, name)| (joint, name.as_str())).collect()
    };
    let dynamics = |joint: usize| {
        let moved = model.bodies().iter().filter(move |body| body.joint.coordinate.index() == joint);
        moved.map(|body| body.joint.dynamics)
    };
    let damped = joints(&|joint| dynamics(joint).any(|dynamics| dynamics.damping > 0.0));
    add(Property::Damping, "damping", damped, ranges.damping, Allowed::Factor)?;
    let rubbing = joints(&|joint| dynamics(joint).any(|dynamics| dynamics.friction > 0.0));
    add(Property::JointFriction, "joint_friction", rubbing, ranges.joint_friction, Allowed::Factor)?;
    let limited = joints(&|joint| model.effort_limit()[joint].is_finite());
    add(Property::EffortLimit, "effort_limit", limited, ranges.effort_limit, Allowed::Factor)?;
    add(Property::Start, "start", joints(&|_| true), ranges.start, Allowed::Displacement)?;
    let settings = |joint: usize| actuators.get(joint)?.as_ref();
    let own = &ranges.actuator;
    // A network computes its efforts independently of the commanded gains.
    let driven = joints(&|joint| settings(joint).is_none_or(|own| own.network.is_none()));
    add(Property::ActuatorGain, "actuator.gain", driven.clone(), own.gain, Allowed::Factor)?;
    add(Property::ActuatorStrength, "actuator.strength", driven, own.strength, Allowed::Factor)?;
    let with = |has: fn(&ActuatorSettings) -> bool| joints(&|joint| settings(joint).is_some_and(has));
    let delayed = with(|own| own.delay > 0.0);
    add(Property::ActuatorDelay, "actuator.delay", delayed, own.delay, Allowed::Positive)?;
    let lagging = with(|own| own.lag > 0.0);
    add(Property::ActuatorLag, "actuator.lag", lagging, own.lag, Allowed::Factor)?;
    let limited = with(|own| own.rate_limit.is_some());
    add(Property::ActuatorRateLimit, "actuator.rate_limit", limited, own.rate_limit, Allowed::Positive)?;
    let loose = with(|own| own.drivetrain.is_some_and(|drivetrain| drivetrain.backlash > 0.0));
    add(Property::ActuatorBacklash, "actuator.backlash", loose, own.backlash, Allowed::Factor)?;
    let elastic = with(|own| own.drivetrain.is_some());
    add(Property::ActuatorStiffness, "actuator.stiffness", elastic, own.stiffness, Allowed::Positive)
}

/// Checks the actuator settings of these joints at both ends of a range.
fn check_ends(
    key: &str,
    (property, interval): (Property, Interval),
    joints: &[(usize, &str)],
    actuators: &[Option<ActuatorSettings>],
) -> Result<(), RangeError> {
    for (joint, name) in joints {
        let Some(Some(settings)) = actuators.get(*joint) else { continue };
        for factor in interval.0 {
            let mut settings = settings.clone();
            vary(&mut settings, property, factor);
            settings.check().map_err(|error| {
                let message = format!("with the factor {factor}, the actuator of joint `{name}` has {error}");
                RangeError::new(key, message).advise("change the range, or the setting of the actuator")
            })?;
        }
    }
    Ok(())
}

/// Adds the start of a robot's floating base. Ranges that do not apply to any robot are rejected.
fn of_base(
    config: &RandomiseConfig,
    (index, robots): (usize, &[RandomisedRobot]),
    list: &mut List,
) -> Result<(), RangeError> {
    let floats = |robot: &RandomisedRobot| robot.model.base().floating;
    let place = &config.base;
    for (property, key, interval) in [
        (Property::BaseX, "x", place.x),
        (Property::BaseY, "y", place.y),
        (Property::BaseZ, "z", place.z),
        (Property::BaseYaw, "yaw", place.yaw),
    ] {
        let Some(interval) = interval else { continue };
        let written = format!("base.{key}");
        if !robots.iter().any(floats) {
            let message = "no robot has a floating base, so no base can be displaced";
            return Err(RangeError::new(written, message).advise("remove the range"));
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

/// Multiplies a setting of an actuator.
pub(super) fn vary(settings: &mut ActuatorSettings, property: Property, value: f64) {
    match property {
        Property::ActuatorDelay => settings.delay *= value,
        Property::ActuatorLag => settings.lag *= value,
        Property::ActuatorRateLimit => settings.rate_limit = settings.rate_limit.map(|rate| rate * value),
        Property::ActuatorBacklash => {
            settings.drivetrain.iter_mut().for_each(|drivetrain| drivetrain.backlash *= value);
        }
        _ => settings.drivetrain.iter_mut().for_each(|drivetrain| drivetrain.stiffness *= value),
    }
}
