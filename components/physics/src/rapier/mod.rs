//! The rapier engine: `rapier3d` in its f64 form, with a fixed-base robot as a reduced-coordinate multibody.
//!
//! Rapier's pipeline allocates in every step, in the LU factorisation of the multibody's mass matrix and in
//! its solver vectors; no setting avoids it.
//!
//! The same program on the same machine produces the same bits, in every process. Rapier's feature
//! `enhanced-determinism`, which would produce the same bits on different machines at the price of slower
//! trigonometry, is not enabled.

pub(crate) mod convert;
mod drives;
mod inertia;
mod multibody;
mod placed;
mod scene;
mod shapes;

use motorium_robots::FrameId;
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::articulated::{JointSpaceIntegrator, Mode};
use crate::contact::{Colliders, Owner};
use crate::rays::Rays;
use crate::robot::{Robot, RobotSetup};
use crate::simulation::{Engine, Simulation};
use crate::surface::Surface;
use crate::{
    BuildError, BuildWarning, Capabilities, Contact, Options, RayHit, ResetError, StepError, StepReport,
    World,
};
use multibody::Multibody;
pub use scene::Enclose;
use scene::{Scene, SceneState};
use shapes::PairTable;
use shapes::collider_shape;

/// Simulates robots with fixed bases in a world with the [`Rapier`] engine.
pub type RapierSimulator = Simulation<Rapier>;

/// The rapier engine.
///
/// Every step consists of [`Options::contact_iterations`] integration steps, each with one sweep of rapier's
/// contact solver. The engine cannot distinguish steps near a contact from steps without contacts, so
/// `substeps` must be 1.
///
/// Robots with a floating base are rejected. The robot's base is at the origin of the world. Continuous
/// collision detection is off: at 1 kHz nothing slower than 5 m/s passes through 5 mm. Rapier has no effort
/// limits. A drive counts as saturated if it would exceed its limit without contacts, or if the last step
/// pushed it beyond its limit. An impact may therefore exceed the limit for one step.
pub struct Rapier {
    options: Options,
    colliders: Colliders,
    pairs: PairTable,
    rays: Rays,
    integrator: JointSpaceIntegrator,
    scene: Scene,
    multibody: Multibody,
    /// True if the multibody must be set to the robot's state before the next step.
    stale: bool,
    /// True if an external wrench acts in the next step.
    pushed: bool,
    /// Per joint: true if the last step pushed its drive beyond its limit, so that the limit itself acts in
    /// the next step.
    overdriven: Vec<bool>,
    /// Length of the last step \[s\].
    dt: f64,
}

/// Snapshot of all [`Rapier`] engine state that affects later steps.
pub struct RapierState {
    scene: SceneState,
    modes: Vec<Mode>,
    stale: bool,
    pushed: bool,
    overdriven: Vec<bool>,
    dt: f64,
}

impl Engine for Rapier {
    type State = RapierState;

    const NAME: &'static str = "rapier";

    const CAPABILITIES: Capabilities = Capabilities {
        floating_bases: false,
        several_articulations: false,
        allocation_free: false,
        rolling_friction: false,
        conveyors: false,
        textures: false,
        triangles: true,
        changes: false,
        integrators: false,
        connections: false,
    };

    fn build(
        setups: &[RobotSetup],
        robot: &Robot,
        world: &World,
        options: &Options,
        warnings: &mut Vec<BuildWarning>,
    ) -> Result<Self, BuildError> {
        let model = &robot.first().model;
        if let Some(floating) = setups.iter().find(|setup| setup.model.base().floating) {
            return Err(BuildError::FloatingBase { robot: floating.model.name().to_owned() });
        }
        if setups.len() > 1 {
            return Err(BuildError::SeveralArticulations);
        }
        if world.terrain.is_some() {
            return Err(BuildError::Terrain);
        }
        inertia::check_masses(model, world)?;
        if setups.iter().any(|setup| setup.actuators.iter().any(Option::is_some)) {
            return Err(BuildError::IdealDrives);
        }
        if options.substeps != 1 {
            let (value, expected) =
                (options.substeps as f64, "1, because rapier always runs `contact_iterations` steps");
            return Err(BuildError::Option { name: "substeps", value, expected });
        }
        let colliders = Colliders::new(setups, world, options, warnings);
        for collider in &colliders.colliders {
            if collider_shape(collider).is_none() {
                let reason = "its mesh has no volume, which rapier needs".to_owned();
                warnings.push(BuildWarning::ShapeIgnored { link: collider.name.clone(), reason });
            }
        }
        let (scene, multibody) = populate(robot, world, options, &colliders, |call| call());
        Ok(Self {
            rays: Rays::new(&colliders),
            pairs: PairTable::new(colliders.colliders.len(), colliders.model.pairs()),
            integrator: JointSpaceIntegrator::new(model, robot.joints.clone()),
            overdriven: vec![false; robot.joints.len()],
            stale: true,
            pushed: false,
            dt: 1e-3,
            options: *options,
            colliders,
            scene,
            multibody,
        })
    }

    fn surfaces(&self) -> Vec<Surface> {
        self.colliders.surfaces()
    }

    fn set_properties(&mut self, robot: &Robot, _: &World, surfaces: &[Surface]) -> Result<(), ResetError> {
        self.integrator.set_joints(&robot.joints);
        self.colliders.set_surfaces(surfaces);
        Ok(())
    }

    fn apply_wrench(
        &mut self,
        robot: &Robot,
        (_, link): (usize, FrameId),
        point: &Point3<f64>,
        wrench: [Vector3<f64>; 2],
    ) {
        let robot = robot.first();
        let Some(body) = robot.model.frames()[link.index()].body else { return };
        // Rapier places the links and computes their centres of mass only in its first step.
        let com = robot.kinematics.body_pose(body) * Point3::from(robot.model.bodies()[body].inertia.com);
        let arm = robot.kinematics.pose(&robot.model, link) * point - com;
        let [force, torque] = wrench;
        self.multibody.push(&mut self.scene, body, [force, torque + arm.cross(&force)]);
        self.pushed = true;
    }

    fn begin_placement(&mut self, robot: &Robot, _: usize) {
        self.change_drives(robot, true);
    }

    fn end_placement(&mut self, robot: &Robot, _: usize) {
        self.change_drives(robot, false);
    }

    fn reset(&mut self, robot: &Robot, world: &World) {
        self.integrator.forget();
        // A fresh scene: rapier warm-starts from old contacts, but a run must depend only on its start.
        let enclose = self.scene.enclosure();
        (self.scene, self.multibody) = populate(robot, world, &self.options, &self.colliders, enclose);
        (self.stale, self.pushed) = (true, false);
    }

    fn exclude_start_overlaps(&mut self, robot: &Robot, warnings: &mut Vec<BuildWarning>) {
        self.colliders.exclude_close(robot, warnings);
        self.pairs = PairTable::new(self.colliders.colliders.len(), self.colliders.model.pairs());
    }

    fn advance(&mut self, robot: &mut Robot, dt: f64) -> Result<StepReport, StepError> {
        self.dt = dt;
        let mut report = StepReport { near_contact: true, ..StepReport::default() };
        let placed = robot.first().placed;
        if self.stale {
            let Self { multibody, scene, .. } = self;
            let enclose = scene.enclosure();
            enclose(&mut || multibody.set_positions(&robot.first().model, scene, &robot.state.q_next));
            self.overdriven.fill(false);
        }
        // The next step of a placed robot starts elsewhere.
        self.stale = placed;
        self.multibody.set_velocity(&robot.first().model, &mut self.scene, &robot.state.v_next);
        if placed {
            self.scene.step(dt, &robot.gravity, &self.pairs);
            return Ok(report);
        }
        self.command_drives(robot, self.scene.substep(dt))?;
        self.scene.step(dt, &robot.gravity, &self.pairs);
        self.read_state(robot, &mut report);
        Ok(report)
    }

    fn commit(&mut self, _: &Robot, _: f64) {
        self.let_go();
    }

    fn discard(&mut self) {
        self.let_go();
        self.stale = true;
    }

    fn save(&self) -> RapierState {
        RapierState {
            scene: self.scene.save(),
            modes: self.integrator.modes().to_vec(),
            stale: self.stale,
            pushed: self.pushed,
            overdriven: self.overdriven.clone(),
            dt: self.dt,
        }
    }

    fn restore(&mut self, _: &Robot, state: &RapierState) -> bool {
        if !self.scene.fits(&state.scene) || !self.integrator.set_modes(&state.modes) {
            return false;
        }
        self.scene.restore(&state.scene);
        (self.stale, self.pushed, self.dt) = (state.stale, state.pushed, state.dt);
        self.overdriven.copy_from_slice(&state.overdriven);
        true
    }

    fn cast_ray(&self, robot: &Robot, ray: (&Point3<f64>, &Unit<Vector3<f64>>, f64)) -> Option<RayHit<'_>> {
        self.rays.cast(&self.colliders, (robot, |index| self.object_pose(index)), ray)
    }

    fn diverged_object(&self) -> Option<usize> {
        self.scene.diverged_object()
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

    fn visit_contacts(&self, visit: &mut dyn FnMut(&Contact<'_>)) {
        self.scene.visit_contacts(&self.colliders.colliders, self.dt, visit);
    }
}

impl Rapier {
    /// Removes the external wrenches.
    fn let_go(&mut self) {
        if std::mem::take(&mut self.pushed) {
            self.multibody.let_go(&mut self.scene);
        }
    }
}

impl Simulation<Rapier> {
    /// Runs every call into rapier's pipeline inside `enclose`, which must execute the call it receives. For
    /// example, `enclose` can count the allocations of rapier separately.
    pub fn enclose_rapier(&mut self, enclose: Enclose) {
        self.engine.scene.set_enclosure(enclose);
    }
}

/// Creates rapier's sets with the objects at their start.
fn populate(
    robot: &Robot,
    world: &World,
    options: &Options,
    colliders: &Colliders,
    enclose: Enclose,
) -> (Scene, Multibody) {
    let mut scene = Scene::new(world, options.contact_iterations, enclose);
    let multibody = Multibody::new(&robot.first().model, &robot.joints, &mut scene);
    for (index, collider) in colliders.colliders.iter().enumerate() {
        let Some((shape, frame)) = collider_shape(collider) else { continue };
        let (body, placement) = match (collider.owner, colliders.object_of(index)) {
            (Owner::Body(_, body), _) => (Some(multibody.links[body]), collider.placement),
            (_, Some((object, part))) => {
                let identity = Isometry3::identity();
                (Some(scene.objects[object]), *part.unwrap_or(&identity))
            }
            _ => (None, collider.placement),
        };
        scene.attach(index, collider, (shape, placement * frame), body);
    }
    (scene, multibody)
}
