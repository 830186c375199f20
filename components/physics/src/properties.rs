//! Physical properties that may change from one reset to the next.

use motorium_robots::{ActuatorSettings, Appearance, Model, Terrain, World};
use nalgebra::Vector3;

use crate::joint::JointProperties;
use crate::{Engine, ResetError, Simulation};

/// The surface of one collider.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Robot link, object, `ground` or `terrain`. A link of several shapes has as many surfaces.
    pub name: String,
    /// Coefficient of friction. A contact has the mean of both surfaces'.
    pub friction: f64,
    /// Share of the approach speed kept after an impact. A contact has the mean of both surfaces'.
    pub restitution: f64,
}

/// Physical properties of a simulation that may change at a reset without rebuilding it.
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
    /// The robot: its inertias, joint dynamics and effort limits. Links, joints and shapes stay the
    /// simulation's.
    pub model: Model,
    /// Models of the [articulations](crate::Articulation) after the first.
    pub others: Vec<Model>,
    /// The world: gravity, and mass and start of its objects. The set of objects, their shapes and the ground
    /// stay the simulation's; the surfaces given here are ignored.
    pub world: World,
    /// The surfaces of all colliders: the robot's, the objects', and the ground's or the terrain's.
    pub surfaces: Vec<Surface>,
    /// The actuators of each articulation, one per joint; empty where all are ideal. Those that are ideal
    /// stay so.
    pub actuators: Vec<Vec<Option<ActuatorSettings>>>,
}

impl<E: Engine> Simulation<E> {
    /// Returns the present properties.
    pub fn properties(&self) -> Properties {
        Properties {
            model: self.robot.first().model.clone(),
            others: self.robot.articulations[1..].iter().map(|own| own.model.clone()).collect(),
            world: self.world.clone(),
            surfaces: self.engine.surfaces(),
            actuators: self.engine.actuators(),
        }
    }

    /// [`reset`](crate::Simulator::reset) with these properties, which stay until the next call. Nothing is
    /// rebuilt: the shapes and pairs of the contact detection stay.
    ///
    /// A [saved state](crate::Simulator::save) holds gravity and the objects' masses, but not the robot's
    /// properties: restore it with the same properties.
    ///
    /// # Errors
    ///
    /// [`ResetError`], also for the properties of another robot or world; nothing has changed then.
    pub fn reset_with(&mut self, properties: &Properties, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        // The terrain is checked where its heights are computed: to do so twice would take long.
        let appearance = Appearance::default();
        let level = World { terrain: None, appearance, ..properties.world.clone() };
        self.check_properties(properties, &level)?;
        self.robot.check(q, v)?;
        self.take_over(properties, &properties.world)?;
        self.world = properties.world.clone();
        self.engine.set_actuators(&properties.actuators)?;
        crate::Simulator::reset(self, q, v)
    }

    /// Applies properties during motion: gravity, robots, surfaces and actuators. Objects and terrain are
    /// unchanged. May allocate.
    ///
    /// # Errors
    ///
    /// [`ResetError`], also for an engine that [cannot](crate::Capabilities::changes); nothing has changed
    /// then.
    pub fn change(&mut self, properties: &Properties) -> Result<(), ResetError> {
        if !E::CAPABILITIES.changes {
            let reason = format!("the {} engine takes other properties at resets alone", E::NAME);
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
            // An object that sleeps because friction held it may slide now.
            self.engine.wake();
        }
        self.world = world;
        self.engine.set_actuators(&properties.actuators)?;
        Ok(())
    }

    /// Gives the objects the velocities of their start.
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

    /// Takes over the robot's properties, the gravity of `world`, and surfaces.
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

/// True for two models of the same links and joints.
fn same_robot(a: &Model, b: &Model) -> bool {
    a.nq() == b.nq()
        && a.bodies().len() == b.bodies().len()
        && a.joint_names() == b.joint_names()
        && a.frames().len() == b.frames().len()
        && a.frames().iter().zip(b.frames()).all(|(a, b)| a.name == b.name && a.placement == b.placement)
}

/// True for two terrains of the same size and the same layers, whatever is drawn for them and however high
/// they are.
fn same_terrain(a: Option<&Terrain>, b: Option<&Terrain>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => *a == Terrain { seed: a.seed, scale: a.scale, ..b.clone() },
        (a, b) => a.is_none() && b.is_none(),
    }
}

/// True for two worlds of the same ground and the same objects, fixed ones where they are.
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
