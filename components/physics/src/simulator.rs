//! The interface of a simulated robot, independent of the engine.

use core::any::Any;

use motorium_robots::{FrameId, Model};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::{
    Articulation, BuildWarning, Capabilities, ConnectError, Connection, JointSetpoint, ResetError, StepError,
};

/// Identifies an object of the world. Look up the identifier once with [`Simulator::object`], outside the
/// control loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ObjectId(pub(crate) usize);

impl ObjectId {
    /// Returns the index of the object in the `objects` of the [`World`](crate::World).
    pub fn index(self) -> usize {
        self.0
    }
}

/// A contact point between two surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<'a> {
    /// First part in contact: the name of a robot link or object, `"ground"` or `"terrain"`.
    pub first: &'a str,
    /// Second part in contact: the name of a robot link or object, `"ground"` or `"terrain"`.
    pub second: &'a str,
    /// Position of the contact point in the world \[m\].
    pub point: Point3<f64>,
    /// Unit normal in the world, pointing from `first` to `second`.
    pub normal: Vector3<f64>,
    /// Penetration depth of the surfaces \[m\], from 0.
    pub depth: f64,
    /// Normal force during the last step \[N\].
    pub force: f64,
    /// Friction force on `second` during the last step, in the world \[N\]; zero with the rapier engine,
    /// which does not report friction forces.
    pub friction: Vector3<f64>,
}

/// The first point hit by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit<'a> {
    /// Part that was hit: the name of a robot link or object, `"ground"` or `"terrain"`.
    pub name: &'a str,
    /// Distance from the origin of the ray \[m\].
    pub distance: f64,
    /// Hit point in the world \[m\].
    pub point: Point3<f64>,
    /// Unit normal of the surface at the hit point, in the world.
    pub normal: Vector3<f64>,
}

/// Snapshot of a simulator with everything that affects its next steps, including warm starts.
///
/// [`Simulator::restore`] restores the snapshot bit for bit: the steps after a restore equal the steps after
/// the [`Simulator::save`].
pub struct SavedState(pub(crate) Box<dyn Any + Send + Sync>);

impl core::fmt::Debug for SavedState {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("SavedState(..)")
    }
}

/// The saved state is from a different engine, robot or world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the saved state is from a different engine, robot or world; restore it into the simulator that saved \
     it, or into a simulator built in the same way"
)]
pub struct ForeignState;

/// Counts of limits and contacts in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Number of joints whose effort was clamped at the limit.
    pub saturated: usize,
    /// Number of joints at a position limit.
    pub at_limit: usize,
    /// Number of joints above their velocity limit. The simulation counts these joints, but does not slow
    /// them down.
    pub overspeed: usize,
    /// `true` if a contact of a robot was close enough for the contact solver to act on it. Always `true`
    /// with the rapier engine.
    pub near_contact: bool,
}

/// Interface of a simulation of one or more robots in a world, independent of the engine.
///
/// Vectors have one entry per drive: the independent joints of the robot, in the order of
/// [`motorium_robots::Model::joint_names`], then its rotors, if any. The entries of several
/// [articulations](Simulator::articulations) follow one another. Poses are in the world, which is the base
/// frame of a robot with a fixed base. Nothing allocates after construction and the first step unless the
/// engine's documentation says otherwise.
///
/// # Example
///
/// Code that works with every engine:
///
/// ```
/// use std::path::Path;
/// use motorium_physics::{
///     ArticulatedSimulator, JointSetpoint, Options, RapierSimulator, Simulator, StepError, World,
/// };
/// use motorium_robots::load;
///
/// /// Largest speed of a joint after `seconds` of free swing.
/// fn swing(simulator: &mut dyn Simulator, seconds: f64) -> Result<f64, StepError> {
///     simulator.commands_mut().fill(JointSetpoint::default());
///     for _ in 0..(seconds * 1e3) as usize {
///         simulator.step(1e-3)?;
///     }
///     Ok(simulator.velocities().iter().fold(0.0, |most, v| most.max(v.abs())))
/// }
///
/// let model = load("pendulum", Path::new("."))?.model;
/// let (world, q) = (World::default(), vec![0.4; model.nq()]);
/// let mut ours = ArticulatedSimulator::new(model.clone(), world.clone(), &q, Options::default())?;
/// let mut rapier = RapierSimulator::new(model, world, &q, Options::default())?;
/// let (a, b) = (swing(&mut ours, 0.2)?, swing(&mut rapier, 0.2)?);
/// assert!(a > 0.1 && (a - b).abs() < 0.01 * a);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Simulator {
    /// Returns the articulations. There are several articulations if several robots are simulated and at
    /// least one robot has a floating base.
    fn articulations(&self) -> &[Articulation];

    /// Returns the model of the first articulation.
    fn model(&self) -> &Model {
        self.articulations()[0].model()
    }

    /// Returns warnings about the model or the world, in the order of detection. The simulator does not print
    /// warnings.
    fn warnings(&self) -> &[BuildWarning];

    /// Returns the configuration of all articulations (nq). A floating base comes first, as in
    /// [`motorium_robots`].
    fn configuration(&self) -> &[f64];

    /// Returns the velocity vector of all articulations (nv).
    fn velocity(&self) -> &[f64];

    /// Returns the names of the drives: joints, then rotors.
    fn joint_names(&self) -> &[String];

    /// Returns the positions q of the drives \[rad or m\].
    fn positions(&self) -> &[f64];

    /// Returns the velocities v of the drives \[rad/s or m/s\].
    fn velocities(&self) -> &[f64];

    /// Returns the efforts tau that the drives applied during the last step, after clamping \[Nm or N\].
    /// Joint friction, damping and limit stops are not included. With substeps, these are the efforts of the
    /// last substep.
    fn efforts(&self) -> &[f64];

    /// Returns the commands of all drives for modification. Commands persist until changed.
    fn commands_mut(&mut self) -> &mut [JointSetpoint];

    /// Advances robots and objects by `dt` \[s\].
    ///
    /// # Errors
    ///
    /// [`StepError`] if the step fails. The simulation then keeps its state from before the step. The state
    /// never contains NaN.
    fn step(&mut self, dt: f64) -> Result<StepReport, StepError>;

    /// Resets the robots to `q` (nq) and `v` (nv), and the objects to the poses and velocities of the world
    /// description. All commands become zero efforts, and all [placements](Self::place_at) end.
    ///
    /// # Errors
    ///
    /// [`ResetError`] if the state is invalid. The simulation is then unchanged.
    fn reset(&mut self, q: &[f64], v: &[f64]) -> Result<(), ResetError>;

    /// Places one articulation at the configuration `q` (nq) and the velocity `v` (nv). All other
    /// articulations and the objects continue their motion. For them, the placed articulation moves with `v`,
    /// and nothing deflects it.
    ///
    /// The articulation stays placed until [`release`](Self::release) or a [reset](Self::reset): forces,
    /// commands, limits and contacts do not move it. During each step, its links move from their poses at the
    /// end of the last step to `q`; after the step, its state is exactly `q` and `v`. To move the
    /// articulation, place it before every step. To stop the articulation, place it with zero velocity. The
    /// drives of a placed articulation apply no effort.
    ///
    /// After a discontinuity, or in a step without a new placement, `v` may differ from the mean velocity of
    /// the step. If the difference exceeds half of the norm of `v`, the links arrive at `q` along `v`, so
    /// that the discontinuity does not throw objects away.
    ///
    /// # Errors
    ///
    /// [`ResetError`] if the state is invalid. The simulation is then unchanged.
    ///
    /// # Panics
    ///
    /// If there is no articulation with this index.
    ///
    /// # Example
    ///
    /// A rod sweeps a ball away at 1 rad/s without losing speed:
    ///
    /// ```
    /// use motorium_physics::{ArticulatedSimulator, Object, ObjectShape, Options, Simulator, World};
    /// use motorium_robots::load;
    ///
    /// let rod = load("pendulum", std::path::Path::new("."))?.model;
    /// let ball = Object {
    ///     name: "ball".to_owned(),
    ///     shape: ObjectShape::Sphere { radius: 0.05 },
    ///     mass: Some(0.5),
    ///     position: [0.1, 0.0, -0.4],
    ///     ..Object::default()
    /// };
    /// let world = World { objects: vec![ball], gravity: [0.0; 3], ..World::default() };
    /// let mut simulation = ArticulatedSimulator::new(rod, world, &[0.3], Options::default())?;
    /// let ball = simulation.object("ball").ok_or("no ball")?;
    /// for step in 0..600 {
    ///     simulation.place_at(0, &[0.3 - 1e-3 * f64::from(step)], &[-1.0])?;
    ///     simulation.step(1e-3)?;
    /// }
    /// assert_eq!(simulation.velocities(), [-1.0]);
    /// assert!(simulation.object_velocity(ball).0.norm() > 0.3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    fn place_at(&mut self, articulation: usize, q: &[f64], v: &[f64]) -> Result<(), ResetError>;

    /// Returns a placed articulation to its drives, which start with commands of zero effort. The
    /// articulation continues from its current state. No effect on an articulation that is not placed.
    ///
    /// # Panics
    ///
    /// If there is no articulation with this index.
    fn release(&mut self, articulation: usize);

    /// Returns the optional features that the engine supports.
    fn capabilities(&self) -> Capabilities;

    /// Saves the whole state, including everything that affects the next steps. Allocates.
    fn save(&self) -> SavedState;

    /// Restores a saved state, including commands and gravity. May allocate.
    ///
    /// # Errors
    ///
    /// [`ForeignState`] if the state was saved with a different engine, robot or world. The simulation is
    /// then unchanged.
    fn restore(&mut self, state: &SavedState) -> Result<(), ForeignState>;

    /// Applies `force` \[N\] and `torque` \[Nm\], both in world axes, at `point` \[m, link axes\] of a link
    /// of the first articulation during the next step. Wrenches add up. A link that is fixed to the world
    /// does not move.
    fn apply_wrench(&mut self, link: FrameId, point: Point3<f64>, force: Vector3<f64>, torque: Vector3<f64>) {
        self.apply_wrench_to((0, link), point, force, torque);
    }

    /// Applies a wrench to a link of the articulation with this index. See
    /// [`apply_wrench`](Self::apply_wrench).
    fn apply_wrench_to(
        &mut self,
        link: (usize, FrameId),
        point: Point3<f64>,
        force: Vector3<f64>,
        torque: Vector3<f64>,
    );

    /// Returns the first surface of a robot, an object or the ground within `range` \[m\] along a ray from
    /// `origin` in `direction` (of any nonzero length). A ray that starts inside a collider does not hit that
    /// collider.
    fn cast_ray(&self, origin: Point3<f64>, direction: Vector3<f64>, range: f64) -> Option<RayHit<'_>>;

    /// Returns the gravitational acceleration in the world \[m/s2\].
    fn gravity(&self) -> Vector3<f64>;

    /// Sets the gravitational acceleration \[m/s2\].
    fn set_gravity(&mut self, gravity: Vector3<f64>);

    /// Returns the pose of the first articulation's base in the world.
    fn base_pose(&self) -> Isometry3<f64> {
        self.base_pose_of(0)
    }

    /// Returns the pose in the world of the base of the articulation with this index.
    fn base_pose_of(&self, articulation: usize) -> Isometry3<f64>;

    /// Returns the pose of a link of the first articulation in the world.
    fn frame_pose(&self, frame: FrameId) -> Isometry3<f64> {
        self.frame_pose_of((0, frame))
    }

    /// Returns the pose in the world of a link of the articulation with this index.
    fn frame_pose_of(&self, frame: (usize, FrameId)) -> Isometry3<f64>;

    /// Returns the object with this name, or `None` if there is no such object.
    fn object(&self, name: &str) -> Option<ObjectId>;

    /// Returns the pose of an object in the world.
    fn object_pose(&self, object: ObjectId) -> Isometry3<f64>;

    /// Moves an object to a pose in the world and stops it. Fixed objects can be moved as well.
    fn set_object_pose(&mut self, object: ObjectId, pose: Isometry3<f64>);

    /// Returns the velocity of an object: linear at its centre of mass \[m/s\] and angular \[rad/s\], world
    /// axes.
    fn object_velocity(&self, object: ObjectId) -> (Vector3<f64>, Vector3<f64>);

    /// Sets the velocity of a movable object: linear at its centre of mass \[m/s\] and angular \[rad/s\],
    /// world axes. A fixed object stays at rest.
    fn set_object_velocity(&mut self, object: ObjectId, linear: Vector3<f64>, angular: Vector3<f64>);

    /// Connects two parts in their current poses, either by a ball joint or rigidly. The connection persists
    /// until [`detach`](Self::detach). A reset does not remove it. Connected parts do not collide with each
    /// other. Only this call allocates memory; later steps do not.
    ///
    /// # Errors
    ///
    /// [`ConnectError`] if the parts cannot be connected. Only the engine of `physics.articulated` supports
    /// connections.
    ///
    /// # Example
    ///
    /// ```
    /// use std::path::Path;
    /// use motorium_physics::{ArticulatedSimulator, Object, Options, Simulator, World};
    /// use motorium_robots::load;
    ///
    /// let rod = load("pendulum", Path::new("."))?.model;
    /// let link = rod.frames().last().ok_or("no links")?.name.clone();
    /// let weight = Object { name: "weight".to_owned(), mass: Some(0.2), position: [0.0, 0.0, -0.6], ..Object::default() };
    /// let world = World { objects: vec![weight], ..World::default() };
    /// let mut simulation = ArticulatedSimulator::new(rod, world, &[0.3], Options::default())?;
    /// simulation.attach(&link, "weight")?;
    /// let weight = simulation.object("weight").ok_or("no weight")?;
    /// let start = simulation.object_pose(weight).translation.vector;
    /// for _ in 0..200 {
    ///     simulation.step(1e-3)?;
    /// }
    /// let end = simulation.object_pose(weight).translation.vector;
    /// assert!((end - start).norm() > 0.01, "it swings with the rod");
    /// assert!((end.norm() - start.norm()).abs() < 1e-4, "about its hinge");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    fn connect(&mut self, connection: &Connection) -> Result<(), ConnectError>;

    /// Fixes one part to another part in their current poses, such as an object to a hand, until
    /// [`detach`](Self::detach) or the next reset.
    ///
    /// # Errors
    ///
    /// [`ConnectError`] if the parts cannot be connected. Only the engine of `physics.articulated` supports
    /// connections.
    fn attach(&mut self, first: &str, second: &str) -> Result<(), ConnectError>;

    /// Removes all connections between two parts. Returns `false` if the parts are not connected.
    fn detach(&mut self, first: &str, second: &str) -> bool;

    /// Calls `visit` with every contact point of the last step.
    fn visit_contacts(&self, visit: &mut dyn FnMut(&Contact<'_>));

    /// Returns `true` if the two parts (robot link, object, `"ground"` or `"terrain"`) touched in the last
    /// step.
    fn touching(&self, first: &str, second: &str) -> bool {
        let mut found = false;
        self.visit_contacts(&mut |contact| {
            found |= (contact.first == first && contact.second == second)
                || (contact.first == second && contact.second == first);
        });
        found
    }
}
