//! The simulation of a robot in a world, generic over the engine.

use motorium_robots::{ActuatorError, ActuatorSettings, FrameId};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::robot::{Articulation, Robot, RobotSetup, RobotState};
use crate::surface::Surface;
use crate::{
    BuildError, BuildWarning, Capabilities, ConnectError, Connection, ConnectionKind, Contact, ForeignState,
    JointSetpoint, ObjectId, Options, RayHit, ResetError, SavedState, Simulator, StepError, StepReport,
    World,
};

/// Interface of a physics engine: integrates the motion and resolves contacts for a [`Simulation`].
///
/// The simulation owns the robot's state, commands and limits, the checks before and after a step, and the
/// description of the world. The engine owns the objects of the world and its working memory.
pub trait Engine: Sized {
    /// Working memory of the engine that affects later steps, such as warm starts.
    type State: Send + Sync + 'static;

    /// Name of the engine in messages.
    const NAME: &'static str;

    /// Optional features that the engine supports.
    const CAPABILITIES: Capabilities;

    /// Builds the engine for `robot`, which has one articulation for each of `setups`, in `world`. The
    /// robot's state is not set yet; the caller calls [`reset`](Self::reset) next. Warnings about doubtful
    /// input are added to `warnings`.
    ///
    /// # Errors
    ///
    /// [`BuildError`] if the engine cannot simulate this robot, or an option does not apply to the engine.
    fn build(
        setups: &[RobotSetup],
        robot: &Robot,
        world: &World,
        options: &Options,
        warnings: &mut Vec<BuildWarning>,
    ) -> Result<Self, BuildError>;

    /// Returns the surfaces of all colliders.
    fn surfaces(&self) -> Vec<Surface>;

    /// Applies the surfaces of all colliders, the inertias and joints of `robot`, and the masses of `world`.
    /// The caller calls [`reset`](Self::reset) next.
    ///
    /// # Errors
    ///
    /// [`ResetError::Refused`] if the engine cannot apply the properties. Nothing is changed in this case.
    fn set_properties(
        &mut self,
        robot: &Robot,
        world: &World,
        surfaces: &[Surface],
    ) -> Result<(), ResetError>;

    /// Returns, for each articulation, the actuator settings of each joint; empty if all actuators are ideal.
    fn actuators(&self) -> Vec<Vec<Option<ActuatorSettings>>> {
        Vec::new()
    }

    /// Changes the settings of the actuators.
    ///
    /// # Errors
    ///
    /// [`ActuatorError`] if a setting is out of range.
    fn set_actuators(&mut self, _: &[Vec<Option<ActuatorSettings>>]) -> Result<(), ActuatorError> {
        Ok(())
    }

    /// Applies a force \[N, world axes\] and a torque \[Nm, world axes\] at `point` \[m, link axes\] of a
    /// link during the next step, in addition to wrenches already applied.
    fn apply_wrench(
        &mut self,
        robot: &Robot,
        link: (usize, FrameId),
        point: &Point3<f64>,
        wrench: [Vector3<f64>; 2],
    );

    /// Starts the placement of an articulation that its drives have moved until now. After this call, no
    /// force moves the articulation. `robot` is already in the placed state.
    fn begin_placement(&mut self, robot: &Robot, articulation: usize);

    /// Ends the placement of an articulation. From the robot's current state on, the drives move the
    /// articulation again.
    fn end_placement(&mut self, robot: &Robot, articulation: usize);

    /// Starts from the robot's current state, with the objects at rest at their poses in the world.
    fn reset(&mut self, robot: &Robot, world: &World);

    /// Disables self-collision between links that start too close to each other, and adds warnings about
    /// links that start inside something. May stop moving objects.
    fn exclude_start_overlaps(&mut self, robot: &Robot, warnings: &mut Vec<BuildWarning>);

    /// Computes the state of the robot and the objects `dt` \[s\] after their current state.
    ///
    /// # Errors
    ///
    /// [`StepError`], after which [`discard`](Self::discard) is called.
    fn advance(&mut self, robot: &mut Robot, dt: f64) -> Result<StepReport, StepError>;

    /// Makes the computed state of the objects their current state. `robot` is already in its state after the
    /// step of `dt` \[s\].
    fn commit(&mut self, robot: &Robot, dt: f64);

    /// Discards the state computed by [`advance`](Self::advance). The robot keeps its current state.
    fn discard(&mut self);

    /// Saves the engine state that affects later steps. The robot's state is not included.
    fn save(&self) -> Self::State;

    /// Restores a saved state. The robot's state has already been restored. Returns `false` and changes
    /// nothing if the state was saved with a different engine, robot or world.
    fn restore(&mut self, robot: &Robot, state: &Self::State) -> bool;

    /// Wakes all sleeping objects.
    fn wake(&mut self) {}

    /// Returns the first surface along a ray in the current state of `robot`. See [`Simulator::cast_ray`].
    fn cast_ray(&self, robot: &Robot, ray: (&Point3<f64>, &Unit<Vector3<f64>>, f64)) -> Option<RayHit<'_>>;

    /// Returns the index of the first object whose next state is not finite.
    fn diverged_object(&self) -> Option<usize>;

    /// Returns the pose in the world of the object with this index in the world description.
    fn object_pose(&self, index: usize) -> Isometry3<f64>;

    /// Moves the object with this index to a pose in the world and stops it.
    fn set_object_pose(&mut self, index: usize, pose: &Isometry3<f64>);

    /// Returns the velocity of the object with this index: linear at its centre of mass \[m/s\] and angular
    /// \[rad/s\], world axes.
    fn object_velocity(&self, index: usize) -> (Vector3<f64>, Vector3<f64>);

    /// Sets the velocity of the object with this index if it is movable: linear at its centre of mass \[m/s\]
    /// and angular \[rad/s\], world axes.
    fn set_object_velocity(&mut self, index: usize, linear: &Vector3<f64>, angular: &Vector3<f64>);

    /// Connects two parts in their current poses. See [`Simulator::connect`]. The last argument is `true` for
    /// a connection that persists across resets.
    ///
    /// # Errors
    ///
    /// [`ConnectError`] if the parts cannot be connected. The default implementation returns
    /// [`ConnectError::Unable`].
    fn connect(&mut self, _: (&Robot, &World), _: &Connection, _lasting: bool) -> Result<(), ConnectError> {
        Err(ConnectError::Unable { engine: Self::NAME })
    }

    /// Removes the connections between two parts. Returns `false` if the parts are not connected.
    fn disconnect(&mut self, _: (&Robot, &World), _: [&str; 2]) -> bool {
        false
    }

    /// Calls `visit` with every contact point of the last step.
    fn visit_contacts(&self, visit: &mut dyn FnMut(&Contact<'_>));

    /// Calls `visit` for each collider that was in contact during the last step of `dt` \[s\]. The arguments
    /// are the collider's name, the impulse of its contacts \[N s\] and the moment of the impulse about the
    /// world origin \[N m s\], including friction. A collider, or several colliders with one name, may be
    /// passed more than once.
    ///
    /// The default implementation assumes that the forces passed by [`visit_contacts`](Self::visit_contacts)
    /// act during the whole step. Engines with several integration steps per simulation step override this
    /// method and sum the impulses of all integration steps.
    #[expect(clippy::type_complexity, reason = "a visitor of three values")]
    fn visit_impulses(&self, dt: f64, visit: &mut dyn FnMut(&str, &Vector3<f64>, &Vector3<f64>)) {
        self.visit_contacts(&mut |contact| {
            let impulse = (contact.normal * contact.force + contact.friction) * dt;
            let moment = contact.point.coords.cross(&impulse);
            visit(contact.second, &impulse, &moment);
            visit(contact.first, &-impulse, &-moment);
        });
    }
}

/// A simulation of robots in a world with an engine `E`.
///
/// Create a simulation through its aliases [`ArticulatedSimulator`](crate::ArticulatedSimulator),
/// [`RapierSimulator`](crate::RapierSimulator) and [`MujocoSimulator`](crate::MujocoSimulator), and use it
/// through the trait [`Simulator`].
pub struct Simulation<E> {
    pub(crate) robot: Robot,
    pub(crate) engine: E,
    options: Options,
    pub(crate) world: World,
    warnings: Vec<BuildWarning>,
}

impl<E: Engine> Simulation<E> {
    /// Creates a simulation of `robot` in `world`. The robot starts at rest at the configuration `q` (nq).
    ///
    /// # Errors
    ///
    /// [`BuildError`] if the simulation cannot be built. Input that is doubtful but can be simulated causes
    /// [`warnings`](Simulator::warnings).
    pub fn new(
        robot: impl Into<RobotSetup>,
        world: World,
        q: &[f64],
        options: Options,
    ) -> Result<Self, BuildError> {
        Self::of_robots([robot.into()], world, q, options)
    }

    /// Returns the world around the robot.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Creates a simulation of several robots in `world`. Each robot is an [`Articulation`] and starts at
    /// rest. `q` contains the configurations of all robots, one after the other. Names of links and joints
    /// must differ between robots ([`Model::prefixed`](motorium_robots::Model::prefixed)).
    ///
    /// # Errors
    ///
    /// [`BuildError`] if the simulation cannot be built. Input that is doubtful but can be simulated causes
    /// [`warnings`](Simulator::warnings).
    pub fn of_robots(
        robots: impl IntoIterator<Item = RobotSetup>,
        world: World,
        q: &[f64],
        options: Options,
    ) -> Result<Self, BuildError> {
        let setups: Vec<RobotSetup> = robots.into_iter().collect();
        BuildError::check_names(&setups)?;
        options.check()?;
        let frames = setups.iter().flat_map(|setup| setup.model.frames());
        world.check(frames.map(|frame| frame.name.as_str()))?;
        BuildError::check_abilities((E::NAME, E::CAPABILITIES), &setups, &world, &options)?;
        let robot = Robot::new(&setups, &options, Vector3::from(world.gravity));
        let mut warnings = BuildWarning::without_shapes(&setups, &world);
        let engine = E::build(&setups, &robot, &world, &options, &mut warnings)?;
        let nv = robot.nv();
        let mut simulation = Self { robot, engine, options, world, warnings };
        simulation.reset(q, &vec![0.0; nv])?;
        let Self { robot, engine, warnings, .. } = &mut simulation;
        engine.exclude_start_overlaps(robot, warnings);
        // An engine may have rebuilt its scene with everything at rest.
        simulation.start_objects();
        let Self { robot, warnings, .. } = &mut simulation;
        for own in &robot.articulations {
            let q = own.model.joints_of_q(&q[own.q()]);
            BuildWarning::of_joints(&own.model, &robot.joints[own.joints()], q, warnings);
        }
        for connection in simulation.world.connections.clone() {
            simulation.connect(&connection)?;
        }
        Ok(simulation)
    }

    /// Returns one entry per drive, which is `true` if the acceleration limit of the drive's setpoint changed
    /// the effort in the last step ([`max_acceleration`](JointSetpoint::max_acceleration)).
    pub fn restrained(&self) -> &[bool] {
        &self.robot.state.restrained
    }

    /// Returns the engine settings.
    pub fn options(&self) -> &Options {
        &self.options
    }
}

impl<E: Engine> Simulator for Simulation<E> {
    fn articulations(&self) -> &[Articulation] {
        &self.robot.articulations
    }

    fn warnings(&self) -> &[BuildWarning] {
        &self.warnings
    }

    fn configuration(&self) -> &[f64] {
        &self.robot.state.q
    }

    fn velocity(&self) -> &[f64] {
        &self.robot.state.v
    }

    fn joint_names(&self) -> &[String] {
        &self.robot.names
    }

    fn positions(&self) -> &[f64] {
        self.robot.positions()
    }

    fn velocities(&self) -> &[f64] {
        self.robot.velocities()
    }

    fn efforts(&self) -> &[f64] {
        self.robot.efforts()
    }

    fn commands_mut(&mut self) -> &mut [JointSetpoint] {
        &mut self.robot.commands
    }

    fn step(&mut self, dt: f64) -> Result<StepReport, StepError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(StepError::InvalidStep(dt));
        }
        let Self { robot, engine, world, .. } = self;
        StepError::check_commands(&robot.commands, &robot.names)?;
        robot.begin();
        robot.step_back(dt);
        let result = engine.advance(robot, dt).and_then(|report| {
            robot.arrive();
            robot.verify(dt)?;
            match engine.diverged_object() {
                Some(object) => Err(StepError::ObjectDiverged { object: world.objects[object].name.clone() }),
                None => Ok(report),
            }
        });
        match result {
            Ok(mut report) => {
                robot.commit();
                engine.commit(robot, dt);
                report.overspeed = robot.overspeed();
                Ok(report)
            }
            Err(error) => {
                engine.discard();
                Err(error)
            }
        }
    }

    fn reset(&mut self, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        self.robot.reset(q, v)?;
        self.engine.reset(&self.robot, &self.world);
        self.start_objects();
        Ok(())
    }

    fn place_at(&mut self, articulation: usize, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        if self.robot.place_at(articulation, q, v)? {
            self.engine.begin_placement(&self.robot, articulation);
        }
        Ok(())
    }

    fn release(&mut self, articulation: usize) {
        if self.robot.release(articulation) {
            self.engine.end_placement(&self.robot, articulation);
        }
    }

    fn capabilities(&self) -> Capabilities {
        E::CAPABILITIES
    }

    fn save(&self) -> SavedState {
        SavedState(Box::new((self.robot.save(), self.engine.save())))
    }

    fn restore(&mut self, state: &SavedState) -> Result<(), ForeignState> {
        let (robot, engine) = state.0.downcast_ref::<(RobotState, E::State)>().ok_or(ForeignState)?;
        let before = self.robot.save();
        if !self.robot.restore(robot) {
            return Err(ForeignState);
        }
        if !self.engine.restore(&self.robot, engine) {
            self.robot.restore(&before);
            return Err(ForeignState);
        }
        Ok(())
    }

    fn cast_ray(&self, origin: Point3<f64>, direction: Vector3<f64>, range: f64) -> Option<RayHit<'_>> {
        let direction = Unit::try_new(direction, f64::MIN_POSITIVE)?;
        self.engine.cast_ray(&self.robot, (&origin, &direction, range))
    }

    fn gravity(&self) -> Vector3<f64> {
        self.robot.gravity
    }

    fn set_gravity(&mut self, gravity: Vector3<f64>) {
        self.robot.gravity = gravity;
    }

    fn base_pose_of(&self, articulation: usize) -> Isometry3<f64> {
        self.robot.base_pose(articulation)
    }

    fn frame_pose_of(&self, (articulation, frame): (usize, FrameId)) -> Isometry3<f64> {
        let own = &self.robot.articulations[articulation];
        own.kinematics.pose(&own.model, frame)
    }

    fn object(&self, name: &str) -> Option<ObjectId> {
        self.world.objects.iter().position(|object| object.name == name).map(ObjectId)
    }

    fn object_pose(&self, object: ObjectId) -> Isometry3<f64> {
        self.engine.object_pose(object.0)
    }

    fn set_object_pose(&mut self, object: ObjectId, pose: Isometry3<f64>) {
        self.engine.set_object_pose(object.0, &pose);
    }

    fn object_velocity(&self, object: ObjectId) -> (Vector3<f64>, Vector3<f64>) {
        self.engine.object_velocity(object.0)
    }

    fn visit_contacts(&self, visit: &mut dyn FnMut(&Contact<'_>)) {
        self.engine.visit_contacts(visit);
    }

    fn set_object_velocity(&mut self, object: ObjectId, linear: Vector3<f64>, angular: Vector3<f64>) {
        self.engine.set_object_velocity(object.0, &linear, &angular);
    }

    fn connect(&mut self, connection: &Connection) -> Result<(), ConnectError> {
        self.engine.connect((&self.robot, &self.world), connection, true)
    }

    fn attach(&mut self, first: &str, second: &str) -> Result<(), ConnectError> {
        let parts = [first, second].map(str::to_owned);
        let connection = Connection { parts, kind: ConnectionKind::Fixed, point: [0.0; 3] };
        self.engine.connect((&self.robot, &self.world), &connection, false)
    }

    fn detach(&mut self, first: &str, second: &str) -> bool {
        self.engine.disconnect((&self.robot, &self.world), [first, second])
    }

    fn apply_wrench_to(
        &mut self,
        link: (usize, FrameId),
        point: Point3<f64>,
        force: Vector3<f64>,
        torque: Vector3<f64>,
    ) {
        self.engine.apply_wrench(&self.robot, link, &point, [force, torque]);
    }
}
