//! The quantities that are drawn: which there are, and what each changes.

use motorium::declare::ConfigError;
use motorium::state::{MAX_DRAWN, Randomisation as Message};
use motorium_robots::{BodyFactors, Model};

use super::super::build::BuiltRobot;
use super::config::{Allowed, Interval, RandomiseConfig, TerrainIntervals};
use crate::{Properties, Surface};

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
    /// Its value at a share from 0 to 1 of its range.
    pub(super) fn at(&self, share: f64) -> f64 {
        if self.property == Message::TERRAIN_SEED {
            self.interval.whole_at(share)
        } else {
            self.interval.at(share)
        }
    }
}

/// The part of the simulation's models that one robot is.
#[derive(Clone, Debug)]
pub(super) struct Share {
    /// The articulation that it is, or is part of.
    articulation: usize,
    /// Its first body.
    bodies: usize,
    /// Its first joint.
    joints: usize,
    /// Prefix of the names of its links.
    prefix: String,
}

/// Nominal properties and start of an episode, and what draws make of them.
pub(super) struct Scene<'a> {
    pub(super) nominal: &'a Properties,
    pub(super) shares: &'a [Share],
    /// Start of the configuration (nq).
    pub(super) q: &'a [f64],
}

/// The start of an episode.
pub(super) struct Start {
    pub(super) properties: Properties,
    pub(super) q: Vec<f64>,
    /// Displacement of the base of each articulation upwards \[m\].
    pub(super) lifts: Vec<f64>,
    /// The posture or the place of a base differs from the nominal one.
    pub(super) moved: bool,
}

/// The part that each robot has in the model of its articulation.
pub(super) fn shares(robots: &[BuiltRobot]) -> Vec<Share> {
    let share = |(index, robot): (usize, &BuiltRobot)| {
        // Robots of one articulation stand in it in their order.
        let before = || robots[..index].iter().filter(|other| other.articulation == robot.articulation);
        Share {
            articulation: robot.articulation,
            bodies: before().map(|other| other.loaded.model.bodies().len()).sum(),
            joints: before().map(|other| other.loaded.model.joint_count()).sum(),
            prefix: robot.prefix(),
        }
    };
    robots.iter().enumerate().map(share).collect()
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
    for (index, robot) in robots.iter().enumerate() {
        of_robot(config, (index, robot), &mut list)?;
        of_base(config, (index, robots), &mut list)?;
        let world = list.0.iter().filter(|quantity| quantity.robot.is_none()).count();
        let own = list.0.iter().filter(|quantity| quantity.robot == Some(index)).count();
        if world + own > MAX_DRAWN {
            let message =
                format!("{} numbers are drawn, at most {MAX_DRAWN} fit into a message", world + own);
            return Err(ConfigError::key("randomise", message).advise("draw fewer properties"));
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
            return Err(ConfigError::key(key, message).advise(format!("it has: {}", names.join(", "))));
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

fn of_robot(
    config: &RandomiseConfig,
    (index, robot): (usize, &BuiltRobot),
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
        for (part, of) in parts {
            let mut path: Vec<String> = name.map_or_else(Vec::new, |name| vec!["robots".into(), name.into()]);
            path.push(key.to_owned());
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
    add(Message::START, "start", joints(&|_| true), ranges.start, Allowed::Displacement)
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

impl Scene<'_> {
    /// The start of an episode with `values`, one for each quantity.
    pub(super) fn varied(&self, quantities: &[Quantity], values: &[f64]) -> Start {
        let mut world = self.nominal.world.clone();
        let mut surfaces = self.nominal.surfaces.clone();
        let models: Vec<&Model> = core::iter::once(&self.nominal.model).chain(&self.nominal.others).collect();
        let mut bases = vec![1.0; models.len()];
        let mut of_bodies: Vec<Vec<BodyFactors>> =
            models.iter().map(|model| vec![BodyFactors::default(); model.bodies().len()]).collect();
        let (mut q, mut lifts, mut moved) = (self.q.to_vec(), vec![0.0; models.len()], false);
        for (quantity, &value) in quantities.iter().zip(values) {
            let part = quantity.part as usize;
            let share = quantity.robot.map(|robot| &self.shares[robot]);
            let (articulation, bodies, joints) =
                share.map_or((0, 0, 0), |share| (share.articulation, share.bodies, share.joints));
            let (model, joint) = (models[articulation], joints + part);
            let factors = &mut of_bodies[articulation];
            let start: usize = models[..articulation].iter().map(|model| model.nq()).sum();
            match quantity.property {
                Message::GRAVITY => world.gravity.iter_mut().for_each(|g| *g *= value),
                Message::BODY_MASS if quantity.part == Message::BASE => bases[articulation] = value,
                Message::BODY_MASS => factors[bodies + part].mass = value,
                Message::DAMPING => {
                    of_joint(model, joint).for_each(|body| factors[body].damping = value);
                }
                Message::JOINT_FRICTION => {
                    of_joint(model, joint).for_each(|body| factors[body].friction = value);
                }
                Message::EFFORT_LIMIT => factors[model.joint_body(joint)].effort_limit = value,
                Message::START => {
                    let (lower, upper) = (model.lower()[joint], model.upper()[joint]);
                    let at = start + model.nq() - model.joint_count() + joint;
                    q[at] = (q[at] + value).clamp(lower.min(q[at]), upper.max(q[at]));
                    moved = true;
                }
                Message::BASE_X | Message::BASE_Y => {
                    q[start + (quantity.property - Message::BASE_X) as usize] += value;
                    moved = true;
                }
                Message::BASE_Z => lifts[articulation] = value,
                Message::BASE_YAW => {
                    turn(&mut q[start + 3..start + 7], value);
                    moved = true;
                }
                Message::TERRAIN_SEED | Message::TERRAIN_SCALE => {
                    if let Some(terrain) = &mut world.terrain {
                        match quantity.property {
                            Message::TERRAIN_SEED => terrain.seed = value as u64,
                            _ => terrain.scale *= value,
                        }
                    }
                    moved = true;
                }
                Message::OBJECT_MASS => {
                    let mass = &mut world.objects[part].mass;
                    *mass = mass.map(|mass| mass * value);
                }
                Message::OBJECT_X | Message::OBJECT_Y | Message::OBJECT_Z => {
                    world.objects[part].position[(quantity.property - Message::OBJECT_X) as usize] += value;
                }
                Message::OBJECT_YAW => world.objects[part].rpy[2] += value,
                _ => self.set_surfaces(&mut surfaces, quantity, value),
            }
        }
        let varied = models.iter().zip(&bases).zip(&of_bodies);
        let mut varied = varied.map(|((model, base), factors)| model.with_factors(*base, factors));
        let model = varied.next().unwrap_or_else(|| self.nominal.model.clone());
        let others = varied.collect();
        Start { properties: Properties { model, others, world, surfaces }, q, lifts, moved }
    }

    /// Sets the friction or the restitution of the surfaces that a quantity is about.
    fn set_surfaces(&self, surfaces: &mut [Surface], quantity: &Quantity, value: f64) {
        let world = &self.nominal.world;
        let is_object = |name: &str| world.objects.iter().any(|object| object.name == name);
        let of_world = |name: &str| name == "ground" || name == "terrain";
        let own = |name: &str| match (quantity.property, quantity.robot) {
            (Message::GROUND_FRICTION | Message::GROUND_RESTITUTION, _) => of_world(name),
            (_, None) => name == world.objects[quantity.part as usize].name,
            (_, Some(robot)) => {
                !is_object(name) && !of_world(name) && name.starts_with(&self.shares[robot].prefix)
            }
        };
        let friction = [Message::GROUND_FRICTION, Message::OBJECT_FRICTION, Message::FRICTION]
            .contains(&quantity.property);
        for surface in surfaces.iter_mut().filter(|surface| own(&surface.name)) {
            if friction {
                surface.friction *= value;
            } else {
                surface.restitution = value;
            }
        }
    }
}

/// The bodies that an independent joint moves, itself or by a joint that follows it.
fn of_joint(model: &Model, joint: usize) -> impl Iterator<Item = usize> {
    let bodies = model.bodies().iter().enumerate();
    bodies.filter(move |(_, body)| body.joint.coordinate.index() == joint).map(|(index, _)| index)
}

/// Turns an orientation x y z w about z of the world.
fn turn(orientation: &mut [f64], angle: f64) {
    let [x, y, z, w] = [orientation[0], orientation[1], orientation[2], orientation[3]];
    let (sin, cos) = (0.5 * angle).sin_cos();
    let turned = [cos * x - sin * y, cos * y + sin * x, cos * z + sin * w, cos * w - sin * z];
    orientation.copy_from_slice(&turned);
}
