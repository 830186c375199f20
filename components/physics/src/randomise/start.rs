//! The start of an episode with sampled properties.

use motorium_robots::{BodyFactors, Model};

use super::quantity::{Property, Quantity, vary};
use super::share::Share;
use crate::{Properties, Surface};

/// Nominal properties and start, to which samples are applied.
pub(super) struct Scene<'a> {
    pub(super) nominal: &'a Properties,
    pub(super) shares: &'a [Share],
    /// Start configuration (nq).
    pub(super) q: &'a [f64],
}

/// Sampled start of an episode: physical properties and initial configuration.
#[derive(Clone, Debug)]
pub struct Start {
    /// Physical properties, for [`reset_with`](crate::Simulator::reset_with).
    pub properties: Properties,
    /// Initial configuration (nq), to which `lifts` have not been applied.
    pub q: Vec<f64>,
    /// Vertical displacement \[m\] of the floating base of each articulation. This displacement is applied
    /// after the base has been placed on the ground.
    pub lifts: Vec<f64>,
    /// `true` if the posture, the pose of a base or the terrain differs from its nominal value. A base on the
    /// ground must then be placed on the ground again.
    pub moved: bool,
    /// For each articulation and drive, the scale of the commanded gains and the scale of the strength.
    pub drives: Vec<Vec<[f64; 2]>>,
}

impl Scene<'_> {
    /// Returns the start of an episode with `values`, one for each quantity.
    pub(super) fn varied(&self, quantities: &[Quantity], values: &[f64]) -> Start {
        let mut world = self.nominal.world.clone();
        let mut surfaces = self.nominal.surfaces.clone();
        let models: Vec<&Model> = core::iter::once(&self.nominal.model).chain(&self.nominal.others).collect();
        let mut bases = vec![1.0; models.len()];
        let mut of_bodies: Vec<Vec<BodyFactors>> =
            models.iter().map(|model| vec![BodyFactors::default(); model.bodies().len()]).collect();
        let mut actuators = self.nominal.actuators.clone();
        let mut drives: Vec<Vec<[f64; 2]>> =
            models.iter().map(|model| vec![[1.0; 2]; model.joint_count()]).collect();
        let (mut q, mut lifts, mut moved) = (self.q.to_vec(), vec![0.0; models.len()], false);
        for (quantity, &value) in quantities.iter().zip(values) {
            let part = quantity.part;
            let share = quantity.robot.map(|robot| &self.shares[robot]);
            let (articulation, bodies, joints) =
                share.map_or((0, 0, 0), |share| (share.articulation, share.bodies, share.joints));
            let (model, joint) = (models[articulation], joints + part);
            let factors = &mut of_bodies[articulation];
            let start: usize = models[..articulation].iter().map(|model| model.nq()).sum();
            match quantity.property {
                Property::Gravity => world.gravity.iter_mut().for_each(|g| *g *= value),
                Property::BaseMass => bases[articulation] = value,
                Property::BodyMass => factors[bodies + part].mass = value,
                Property::Damping => {
                    of_joint(model, joint).for_each(|body| factors[body].damping = value);
                }
                Property::JointFriction => {
                    of_joint(model, joint).for_each(|body| factors[body].friction = value);
                }
                Property::EffortLimit => factors[model.joint_body(joint)].effort_limit *= value,
                Property::Start => {
                    let (lower, upper) = (model.lower()[joint], model.upper()[joint]);
                    let at = start + model.nq() - model.joint_count() + joint;
                    q[at] = (q[at] + value).clamp(lower.min(q[at]), upper.max(q[at]));
                    moved = true;
                }
                Property::BaseX | Property::BaseY => {
                    q[start + usize::from(quantity.property == Property::BaseY)] += value;
                    moved = true;
                }
                Property::BaseZ => lifts[articulation] = value,
                Property::BaseYaw => {
                    turn(&mut q[start + 3..start + 7], value);
                    moved = true;
                }
                Property::TerrainSeed | Property::TerrainScale => {
                    if let Some(terrain) = &mut world.terrain {
                        match quantity.property {
                            Property::TerrainSeed => terrain.seed = value as u64,
                            _ => terrain.scale *= value,
                        }
                    }
                    moved = true;
                }
                Property::ObjectMass => {
                    let object = &mut world.objects[part];
                    let mass = object.mass_properties().map(|own| own.mass * value);
                    (object.mass, object.density) = (mass, None);
                }
                Property::ObjectX => world.objects[part].position[0] += value,
                Property::ObjectY => world.objects[part].position[1] += value,
                Property::ObjectZ => world.objects[part].position[2] += value,
                Property::ObjectYaw => world.objects[part].rpy[2] += value,
                Property::ActuatorGain => drives[articulation][joint][0] = value,
                Property::ActuatorStrength => {
                    drives[articulation][joint][1] = value;
                    factors[model.joint_body(joint)].effort_limit *= value;
                }
                property if property > Property::ActuatorStrength => {
                    if let Some(Some(settings)) = actuators[articulation].get_mut(joint) {
                        vary(settings, property, value);
                    }
                }
                _ => self.set_surfaces(&mut surfaces, quantity, value),
            }
        }
        let varied = models.iter().zip(&bases).zip(&of_bodies);
        let mut varied = varied.map(|((model, base), factors)| model.with_factors(*base, factors));
        let model = varied.next().unwrap_or_else(|| self.nominal.model.clone());
        let others = varied.collect();
        let properties = Properties { model, others, world, surfaces, actuators };
        Start { properties, q, lifts, moved, drives }
    }

    /// Sets the friction or the restitution of the surfaces that a quantity applies to.
    fn set_surfaces(&self, surfaces: &mut [Surface], quantity: &Quantity, value: f64) {
        let world = &self.nominal.world;
        let is_object = |name: &str| world.objects.iter().any(|object| object.name == name);
        let of_world = |name: &str| name == "ground" || name == "terrain";
        let own = |name: &str| match (quantity.property, quantity.robot) {
            (Property::GroundFriction | Property::GroundRestitution, _) => of_world(name),
            (_, None) => name == world.objects[quantity.part].name,
            (_, Some(robot)) => {
                !is_object(name) && !of_world(name) && name.starts_with(&self.shares[robot].prefix)
            }
        };
        let friction = [Property::GroundFriction, Property::ObjectFriction, Property::Friction]
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

/// Returns the bodies that an independent joint moves, directly or through a mimic joint.
fn of_joint(model: &Model, joint: usize) -> impl Iterator<Item = usize> {
    let bodies = model.bodies().iter().enumerate();
    bodies.filter(move |(_, body)| body.joint.coordinate.index() == joint).map(|(index, _)| index)
}

/// Rotates an orientation x y z w about z of the world.
fn turn(orientation: &mut [f64], angle: f64) {
    let [x, y, z, w] = [orientation[0], orientation[1], orientation[2], orientation[3]];
    let (sin, cos) = (0.5 * angle).sin_cos();
    let turned = [cos * x - sin * y, cos * y + sin * x, cos * z + sin * w, cos * w - sin * z];
    orientation.copy_from_slice(&turned);
}
