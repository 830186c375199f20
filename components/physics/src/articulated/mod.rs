//! The articulated engine: motorium's own joint-space dynamics with implicit drives and contacts, for robots
//! with a fixed or a floating base.

mod actuators;
mod connect;
mod events;
mod implicit;
mod integrator;
mod laws;
mod overlaps;
mod part;
mod placed;
mod push;
mod step;

use motorium_robots::{ActuatorError, ActuatorSettings, FrameId};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::contact::{Colliders, ContactScene, ImpulseSums, SceneState};
use crate::rays::Rays;
use crate::robot::{Robot, RobotSetup};
use crate::simulation::{Engine, Simulation};
use crate::surface::Surface;
use crate::{
    BuildError, BuildWarning, Capabilities, ConnectError, Connection, Contact, Options, RayHit, ResetError,
    StepError, StepReport, World,
};
use actuators::ActuatorsState;
pub use events::JointEvents;
pub use implicit::Singular;
pub use integrator::JointSpaceIntegrator;
pub(crate) use laws::{Drive, Laws, Mode};
use part::Part;

/// Simulates robots with fixed or floating bases in a world with the [`Articulated`] engine.
///
/// # Example
///
/// The catalogue's Panda, held by its default gains alone for a second, sags under its weight by less than
/// 0.1 rad:
///
/// ```
/// use std::path::Path;
/// use motorium_physics::{ArticulatedSimulator, JointSetpoint, Options, Simulator, World};
/// use motorium_robots::load;
///
/// let panda = load("panda", Path::new("."))?;
/// let profile = panda.profile.ok_or("no profile")?;
/// let (home, gains) = (profile.home(&panda.model)?, profile.gains(&panda.model)?);
/// let mut simulation =
///     ArticulatedSimulator::new(panda.model, World::default(), home.as_slice(), Options::default())?;
/// for (i, command) in simulation.commands_mut().iter_mut().enumerate() {
///     *command = JointSetpoint::hold(home[i], gains.kp[i], gains.kd[i]);
/// }
/// for _ in 0..1000 {
///     simulation.step(1e-3)?;
/// }
/// let sag = simulation.positions().iter().zip(&home).map(|(q, home)| (q - home).abs()).fold(0.0, f64::max);
/// assert!((0.001..0.1).contains(&sag), "{sag} rad");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type ArticulatedSimulator = Simulation<Articulated>;

/// The articulated engine: joint-space dynamics, drives and contacts, solved together.
///
/// Each integration step of length h finds the end velocity `v+` of
///
/// ```text
/// M(q) (v+ - v) / h + C(q, v) v + g(q)
///     = tau(q + h v+, v+) - D v+ + friction(v+) + stop(q + h v+) + J' lambda / h
/// q+ = q + h v+
/// ```
///
/// with contact impulses `lambda` that prevent penetration, and friction in Coulomb's cone.
/// [`JointSpaceIntegrator`] documents the other terms. Several articulations and the free objects of the
/// world are part of the same problem; groups without contacts between them are solved separately. The method
/// is semi-implicit Euler, of first order in h. Robots and objects without contacts may use the [midpoint
/// rule](crate::Integrator::Midpoint) instead of Euler's method.
///
/// Contacts are found at points: spheres, the ends of capsules, the corners of boxes, the rims of cylinders
/// and the outermost points of meshes, each against the surface of the other collider. If these points miss a
/// contact, as between crossing edges, the nearest points of the two colliders are used. Two boxes touch at
/// the corners of the patch that their faces share, or where two edges cross.
///
/// Torques against spinning about a contact normal and against rolling about its tangents are part of the
/// same problem. Each of these torques is bounded by a coefficient times the normal force. A conveyor surface
/// drags along objects that touch it. The air drag on free objects is evaluated at the end of the step.
///
/// Objects that have been still for half a second fall asleep together with everything they touch. Sleeping
/// objects wake when something reaches them.
///
/// In the air, the linear and angular momentum of a floating robot is conserved up to rounding: after each
/// integration step the velocity of the base is corrected by the momentum lost in the integration.
///
/// Nothing allocates after the simulation has been built.
pub struct Articulated {
    options: Options,
    /// One entry per articulation.
    parts: Vec<Part>,
    scene: ContactScene,
    rays: Rays,
    /// Poses of the bases when the colliders were last placed.
    bases: Vec<Isometry3<f64>>,
    sums: ImpulseSums,
}

/// A contact force on a link of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkForce<'a> {
    /// Name of the link.
    pub link: &'a str,
    /// Point of application on the link, in the world \[m\].
    pub point: Point3<f64>,
    /// Contact force including friction, world axes \[N\].
    pub force: Vector3<f64>,
}

/// Snapshot of all [`Articulated`] engine state that affects later steps.
pub struct ArticulatedState {
    parts: Vec<PartState>,
    scene: SceneState,
}

struct PartState {
    modes: Vec<Mode>,
    external: Vec<f64>,
    actuators: ActuatorsState,
}

impl Engine for Articulated {
    type State = ArticulatedState;

    const NAME: &'static str = "articulated";

    const CAPABILITIES: Capabilities = Capabilities {
        floating_bases: true,
        several_articulations: true,
        allocation_free: true,
        rolling_friction: true,
        conveyors: true,
        textures: true,
        triangles: true,
        changes: true,
        integrators: true,
        connections: true,
    };

    fn build(
        setups: &[RobotSetup],
        robot: &Robot,
        world: &World,
        options: &Options,
        warnings: &mut Vec<BuildWarning>,
    ) -> Result<Self, BuildError> {
        let articulations = robot.articulations.iter().zip(setups);
        let parts = articulations
            .map(|(own, setup)| Part::new(own, setup, &robot.joints[own.joints()], options.integrator));
        let parts = parts.collect::<Result<Vec<_>, _>>()?;
        let colliders = Colliders::new(setups, world, options, warnings);
        Ok(Self {
            sums: ImpulseSums::new(&colliders.colliders, &robot.articulations),
            rays: Rays::new(&colliders),
            options: *options,
            bases: vec![Isometry3::identity(); parts.len()],
            parts,
            scene: ContactScene::new(robot, colliders, world, options),
        })
    }

    fn surfaces(&self) -> Vec<Surface> {
        self.scene.colliders().surfaces()
    }

    fn set_properties(
        &mut self,
        robot: &Robot,
        world: &World,
        surfaces: &[Surface],
    ) -> Result<(), ResetError> {
        if self.scene.set_terrain(world.terrain.as_ref()).map_err(ResetError::terrain)? {
            self.rays = Rays::new(self.scene.colliders());
        }
        for (part, own) in self.parts.iter_mut().zip(&robot.articulations) {
            part.integrator.set_joints(&robot.joints[own.joints()]);
            part.actuators.set_limits(&robot.joints[own.joints()]);
        }
        self.scene.set_properties(surfaces, robot);
        Ok(())
    }

    fn actuators(&self) -> Vec<Vec<Option<ActuatorSettings>>> {
        self.parts.iter().map(|part| part.actuators.settings()).collect()
    }

    fn set_actuators(&mut self, settings: &[Vec<Option<ActuatorSettings>>]) -> Result<(), ActuatorError> {
        self.parts.iter_mut().zip(settings).try_for_each(|(part, own)| part.actuators.set_settings(own))
    }

    fn apply_wrench(
        &mut self,
        robot: &Robot,
        (of, link): (usize, FrameId),
        point: &Point3<f64>,
        wrench: [Vector3<f64>; 2],
    ) {
        self.parts[of].add_wrench(&robot.articulations[of], link, point, wrench);
    }

    fn begin_placement(&mut self, _: &Robot, articulation: usize) {
        self.parts[articulation].forget_drives();
    }

    fn end_placement(&mut self, _: &Robot, articulation: usize) {
        self.parts[articulation].forget_drives();
    }

    fn reset(&mut self, robot: &Robot, world: &World) {
        self.parts.iter_mut().for_each(Part::forget_drives);
        self.scene.restart(world);
        self.place_colliders(robot);
    }

    fn exclude_start_overlaps(&mut self, robot: &Robot, warnings: &mut Vec<BuildWarning>) {
        // The detection keeps a limited number of points, so excluding some pairs may reveal more.
        loop {
            let close = self.close_links(warnings);
            if close.is_empty() {
                return;
            }
            self.scene.exclude(robot, &close);
            self.place_colliders(robot);
        }
    }

    fn advance(&mut self, robot: &mut Robot, dt: f64) -> Result<StepReport, StepError> {
        self.advance_by(robot, dt)
    }

    fn commit(&mut self, robot: &Robot, dt: f64) {
        let driven = self.parts.iter_mut().zip(&robot.articulations).filter(|(_, own)| !own.placed);
        for (part, own) in driven {
            part.actuators.commit(&robot.commands[own.drives()], dt);
        }
        self.discard();
        self.scene.objects.commit();
    }

    fn discard(&mut self) {
        self.parts.iter_mut().for_each(|part| part.external.fill(0.0));
    }

    fn save(&self) -> ArticulatedState {
        let part = |part: &Part| PartState {
            modes: part.integrator.modes().to_vec(),
            external: part.external.clone(),
            actuators: part.actuators.save(),
        };
        ArticulatedState { parts: self.parts.iter().map(part).collect(), scene: self.scene.save() }
    }

    fn restore(&mut self, _: &Robot, state: &ArticulatedState) -> bool {
        if !self.scene.fits(&state.scene) || self.parts.len() != state.parts.len() {
            return false;
        }
        for (part, saved) in self.parts.iter_mut().zip(&state.parts) {
            if !part.actuators.restore(&saved.actuators) || !part.integrator.set_modes(&saved.modes) {
                return false;
            }
            part.external.copy_from_slice(&saved.external);
        }
        self.scene.restore(&state.scene);
        true
    }

    fn wake(&mut self) {
        self.scene.objects.wake();
    }

    fn cast_ray(&self, robot: &Robot, ray: (&Point3<f64>, &Unit<Vector3<f64>>, f64)) -> Option<RayHit<'_>> {
        self.rays.cast(self.scene.colliders(), (robot, |index| self.object_pose(index)), ray)
    }

    fn diverged_object(&self) -> Option<usize> {
        self.scene.objects.diverged()
    }

    fn object_pose(&self, index: usize) -> Isometry3<f64> {
        self.scene.object_pose(index)
    }

    fn set_object_pose(&mut self, index: usize, pose: &Isometry3<f64>) {
        self.scene.set_object_pose(index, pose);
    }

    fn object_velocity(&self, index: usize) -> (Vector3<f64>, Vector3<f64>) {
        self.scene.object_velocity(index)
    }

    fn set_object_velocity(&mut self, index: usize, linear: &Vector3<f64>, angular: &Vector3<f64>) {
        self.scene.set_object_velocity(index, linear, angular);
    }

    fn connect(
        &mut self,
        place: (&Robot, &World),
        connection: &Connection,
        lasting: bool,
    ) -> Result<(), ConnectError> {
        self.connect_parts(place, connection, lasting)
    }

    fn disconnect(&mut self, (robot, world): (&Robot, &World), parts: [&str; 2]) -> bool {
        self.disconnect_parts(robot, world, parts)
    }

    fn visit_impulses(&self, _: f64, visit: &mut dyn FnMut(&str, &Vector3<f64>, &Vector3<f64>)) {
        self.sums.visit(&self.scene.colliders().colliders, visit);
    }

    fn visit_contacts(&self, visit: &mut dyn FnMut(&Contact<'_>)) {
        for (index, point, first, second) in self.scene.points() {
            let force = self.scene.impulses.normal(index) / point.h;
            if point.distance > 0.0 && force <= 0.0 {
                continue;
            }
            visit(&Contact {
                first: &second.name,
                second: &first.name,
                point: point.point,
                normal: point.normal,
                depth: (-point.distance).max(0.0),
                force,
                friction: self.scene.force(index, point) - point.normal * force,
            });
        }
    }
}

impl Articulated {
    /// Places all colliders according to the robots' current state and the objects' next state.
    fn place_colliders(&mut self, robot: &Robot) {
        for (of, base) in self.bases.iter_mut().enumerate() {
            *base = robot.base_pose(of);
        }
        self.scene.set_poses(|of| &robot.articulations[of].kinematics, &self.bases);
    }

    /// Places all colliders according to the state at the start of a step.
    fn place_start(&mut self, robot: &Robot) {
        for (base, own) in self.bases.iter_mut().zip(&robot.articulations) {
            *base = own.base_pose(&robot.state.q_next);
        }
        let parts = &self.parts;
        self.scene.set_poses(|of| parts[of].start(&robot.articulations[of]), &self.bases);
    }

    /// Places all colliders according to the next state of robots and objects.
    fn place_next(&mut self, robot: &Robot) {
        let parts = &self.parts;
        // An articulation that has not been stepped yet is still in its state at the start of the step.
        let of = |of: usize| {
            if parts[of].h > 0.0 { &parts[of].kinematics } else { parts[of].start(&robot.articulations[of]) }
        };
        self.scene.set_poses(of, &self.bases);
    }
}

impl Simulation<Articulated> {
    /// Moves the floating base of each robot vertically until the robot stands on the ground plane or the
    /// terrain, and stops the robot. In a world without ground and terrain, the robot stands on the plane
    /// `z = 0`. A robot without collision shapes is not moved.
    pub fn place_on_ground(&mut self) {
        (0..self.engine.parts.len()).for_each(|of| self.place_one_on_ground(of));
    }

    /// Places the articulation with this index on the ground. See [`place_on_ground`](Self::place_on_ground).
    pub fn place_one_on_ground(&mut self, articulation: usize) {
        let height = self.world.ground.map_or(0.0, |ground| ground.height);
        // Steps in which nothing can touch do not move the colliders.
        self.engine.place_colliders(&self.robot);
        let lowest = self.engine.scene.lowest(articulation);
        let lowest = self.engine.scene.above_terrain(articulation).unwrap_or(lowest);
        let robot = &mut self.robot;
        let own = &robot.articulations[articulation];
        if own.model.base().floating && lowest.is_finite() {
            robot.state.q[own.q().start + 2] += height - lowest;
            robot.state.v[own.v()].fill(0.0);
            robot.refresh();
            self.engine.place_colliders(&self.robot);
        }
    }

    /// Returns the sum of all contact forces on the robots during the last integration step \[N\], world
    /// axes. Forces between links of robots are excluded.
    pub fn contact_force(&self) -> Vector3<f64> {
        self.engine.scene.force_on_robot()
    }

    /// Calls `visit` with each contact force on a moving link of a robot during the last integration step. A
    /// force between two links is passed twice, once for each link.
    pub fn visit_forces(&self, visit: &mut dyn FnMut(&LinkForce<'_>)) {
        let scene = &self.engine.scene;
        for (index, contact, first, second) in scene.points() {
            let (point, force) = (contact.point, scene.force(index, contact));
            if contact.owners.0.is_robot() {
                visit(&LinkForce { link: &first.name, point, force });
            }
            if contact.owners.1.is_robot() {
                visit(&LinkForce { link: &second.name, point, force: -force });
            }
        }
    }
}
