//! Physical properties that may change between resets.

use motorium_robots::{ActuatorSettings, Model};
use motorium_worlds::{Appearance, Terrain, World};
use nalgebra::Vector3;

use crate::joint::JointProperties;
use crate::{Engine, ResetError, Simulation, Surface};

/// Physical properties of a simulation that may change at a reset without a rebuild.
///
/// ```
/// use std::path::Path;
/// use motorium_physics::{ArticulatedSimulator, Options, Simulator, World};
/// use motorium_robots::{BodyFactors, load};
///
/// let model = load("pendulum", Path::new("."))?.model;
/// let mut simulation = ArticulatedSimulator::new(model, World::default(), &[0.4], Options::default())?;
/// let nominal = simulation.properties();
/// let speed = |simulation: &mut ArticulatedSimulator| {
///     (0..100).try_for_each(|_| simulation.step(1e-3).map(drop)).map(|()| simulation.velocity()[0].abs())
/// };
/// let on_earth = speed(&mut simulation)?;
///
/// let mut moon = nominal.clone();
/// moon.world.gravity = [0.0, 0.0, -1.62];
/// simulation.reset_with(&moon, &[0.4], &[0.0])?;
/// let on_the_moon = speed(&mut simulation)?;
/// assert!(on_the_moon < 0.2 * on_earth);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Properties {
    /// Model of the robot. The inertias, joint dynamics and effort limits may change; links, joints and
    /// shapes must match the simulation.
    pub model: Model,
    /// Models of all [articulations](crate::Articulation) after the first.
    pub others: Vec<Model>,
    /// The world. Gravity, and the masses and initial states of objects may change. The set of objects, their
    /// shapes, and the ground must match the simulation. Surfaces in the world description are ignored; set
    /// `surfaces` instead.
    pub world: World,
    /// The surfaces of all colliders: robot, objects, and ground or terrain.
    pub surfaces: Vec<Surface>,
    /// Actuator settings of the joints of each articulation; empty if all actuators are ideal. Ideal
    /// actuators remain ideal.
    pub actuators: Vec<Vec<Option<ActuatorSettings>>>,
}

impl<E: Engine> Simulation<E> {
    /// Returns the current physical properties.
    pub fn properties(&self) -> Properties {
        Properties {
            model: self.robot.first().model.clone(),
            others: self.robot.articulations[1..].iter().map(|own| own.model.clone()).collect(),
            world: self.world.clone(),
            surfaces: self.engine.surfaces(),
            actuators: self.engine.actuators(),
        }
    }

    /// [Resets](crate::Simulator::reset) the simulation with these properties, which persist until the next
    /// call. The simulation is not rebuilt: the contact detection keeps its shapes and pairs.
    ///
    /// A [saved state](crate::Simulator::save) contains gravity and the objects' masses, but not the robot's
    /// properties. Restore a state only with the properties with which the state was saved.
    ///
    /// # Errors
    ///
    /// [`ResetError`] if a value is invalid, or the properties do not match the robots and the world. The
    /// simulation is then unchanged.
    pub fn reset_with(&mut self, properties: &Properties, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        // The terrain is checked where its heights are computed, because a second check would take long.
        let appearance = Appearance::default();
        let level = World { terrain: None, appearance, ..properties.world.clone() };
        self.check_properties(properties, &level)?;
        self.robot.check(q, v)?;
        self.take_over(properties, &properties.world)?;
        self.world = properties.world.clone();
        self.engine.set_actuators(&properties.actuators)?;
        crate::Simulator::reset(self, q, v)
    }

    /// Changes physical properties during motion: gravity and the properties of robots, surfaces and
    /// actuators. Objects and terrain keep their properties. May allocate.
    ///
    /// # Errors
    ///
    /// [`ResetError`] if a value is invalid, or the engine [cannot change
    /// properties](crate::Capabilities::changes). The simulation is then unchanged.
    pub fn change(&mut self, properties: &Properties) -> Result<(), ResetError> {
        if !E::CAPABILITIES.changes {
            let reason = format!("the {} engine changes properties only at resets", E::NAME);
            return Err(ResetError::Refused { reason });
        }
        let (objects, connections, appearance) = (Vec::new(), Vec::new(), Appearance::default());
        let level = World { terrain: None, objects, connections, appearance, ..properties.world.clone() };
        self.check_properties(properties, &level)?;
        let world = World { gravity: properties.world.gravity, ..self.world.clone() };
        let others = self.engine.surfaces() != properties.surfaces;
        let state = self.engine.save();
        self.take_over(properties, &world)?;
        // A recompiled engine has lost its state of motion.
        self.engine.restore(&self.robot, &state);
        if others {
            // Friction may no longer hold a sleeping object in place.
            self.engine.wake();
        }
        self.world = world;
        self.engine.set_actuators(&properties.actuators)?;
        Ok(())
    }

    /// Sets the objects' velocities to their start velocities.
    pub(crate) fn start_objects(&mut self) {
        for (index, object) in self.world.objects.iter().enumerate() {
            let (linear, angular) = (object.velocity.into(), object.angular_velocity.into());
            if object.is_dynamic() && (linear, angular) != (Vector3::zeros(), Vector3::zeros()) {
                self.engine.set_object_velocity(index, &linear, &angular);
            }
        }
    }

    fn check_properties(&self, properties: &Properties, level: &World) -> Result<(), ResetError> {
        let Properties { model, others, world, surfaces, .. } = properties;
        let models: Vec<&Model> = core::iter::once(model).chain(others).collect();
        let articulations = &self.robot.articulations;
        let fits = models.len() == articulations.len()
            && articulations.iter().zip(&models).all(|(own, model)| same_robot(&own.model, model))
            && same_world(&self.world, world)
            && surfaces.len() == self.engine.surfaces().len();
        if !fits {
            return Err(ResetError::Properties);
        }
        let frames = models.iter().flat_map(|model| model.frames());
        let links = frames.map(|frame| frame.name.as_str());
        level.check(links).map_err(ResetError::World)?;
        let sound = |surface: &&Surface| {
            surface.friction.is_finite()
                && surface.friction >= 0.0
                && (0.0..=1.0).contains(&surface.restitution)
        };
        if let Some(surface) = surfaces.iter().find(|surface| !sound(surface)) {
            return Err(ResetError::Surface(surface.clone()));
        }
        properties.actuators.iter().flatten().flatten().try_for_each(ActuatorSettings::check)?;
        Ok(())
    }

    /// Applies the robot's properties, the gravity of `world`, and surfaces.
    fn take_over(&mut self, properties: &Properties, world: &World) -> Result<(), ResetError> {
        let Properties { model, others, surfaces, .. } = properties;
        let models: Vec<&Model> = core::iter::once(model).chain(others).collect();
        let articulations = &self.robot.articulations;
        let armature = self.options().armature;
        let joints = models.iter().flat_map(|model| JointProperties::from_model(model, armature)).collect();
        let of_all: Vec<Model> = articulations.iter().map(|own| own.model.clone()).collect();
        let before = (of_all, self.robot.joints.clone(), self.robot.gravity);
        self.robot.set_properties(models, joints, world.gravity.into());
        if let Err(refused) = self.engine.set_properties(&self.robot, world, surfaces) {
            self.robot.set_properties(&before.0, before.1, before.2);
            return Err(refused);
        }
        Ok(())
    }
}

/// Returns `true` if both models have the same links and joints.
fn same_robot(a: &Model, b: &Model) -> bool {
    a.nq() == b.nq()
        && a.bodies().len() == b.bodies().len()
        && a.joint_names() == b.joint_names()
        && a.frames().len() == b.frames().len()
        && a.frames().iter().zip(b.frames()).all(|(a, b)| a.name == b.name && a.placement == b.placement)
}

/// Returns `true` if both terrains have the same size and layers; sampled values and heights may differ.
fn same_terrain(a: Option<&Terrain>, b: Option<&Terrain>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => *a == Terrain { seed: a.seed, scale: a.scale, ..b.clone() },
        (a, b) => a.is_none() && b.is_none(),
    }
}

/// Returns `true` if both worlds have the same ground and the same objects, with fixed objects at the same
/// poses.
fn same_world(a: &World, b: &World) -> bool {
    let ground = a.ground.map(|ground| ground.height) == b.ground.map(|ground| ground.height);
    ground
        && same_terrain(a.terrain.as_ref(), b.terrain.as_ref())
        && a.connections == b.connections
        && a.objects.len() == b.objects.len()
        && a.objects
            .iter()
            .zip(&b.objects)
            .all(|(a, b)| a.name == b.name && a.shape == b.shape && a.is_dynamic() == b.is_dynamic())
}
