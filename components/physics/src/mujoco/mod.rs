//! The MuJoCo engine: DeepMind's MuJoCo library, loaded at run time.
//!
//! The library comes with the Python package `mujoco`. The library is not needed to build motorium, and
//! programs that do not use this engine do not load it. The library is [found and checked](library) once per
//! process; the [layout](layout) of its structures applies to one version. [MJCF](mjcf) is written from
//! motorium's model and world and [compiled](compile), [native] holds the result, and [step] advances it.

mod compile;
mod contact;
mod layout;
mod library;
mod mjcf;
mod native;
mod placed;
mod places;
mod step;

use motorium_robots::{FrameId, Reference};
use nalgebra::{DMatrix, Isometry3, Point3, Unit, Vector3};

use crate::articulated::{Drive, Laws};
use crate::contact::{Colliders, ImpulseSums};
use crate::rays::Rays;
use crate::robot::{Robot, RobotSetup};
use crate::simulation::{Engine, Simulation};
use crate::surface::Surface;
use crate::{
    BuildError, BuildWarning, Capabilities, Contact, LibraryError, Options, RayHit, ResetError, StepError,
    StepReport, World,
};
use contact::{Seen, Touch};
use library::Library;
use native::{Native, Parts};
use places::{ObjectPlace, Places, pose_at};

/// Simulates robots with fixed or floating bases in a world with the [`Mujoco`] engine.
///
/// ```
/// use motorium_physics::{Mujoco, MujocoSimulator, Options, Simulator, World};
/// use motorium_robots::load;
///
/// if let Err(error) = Mujoco::find() {
///     println!("not run: {error}");
///     return Ok(());
/// }
/// let pendulum = load("pendulum", std::path::Path::new("."))?.model;
/// let mut simulation = MujocoSimulator::new(pendulum, World::default(), &[0.4], Options::default())?;
/// for _ in 0..100 {
///     simulation.step(1e-3)?;
/// }
/// assert!(simulation.velocities()[0] < -0.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type MujocoSimulator = Simulation<Mujoco>;

/// The MuJoCo engine, based on the library of MuJoCo 3.17.0.
///
/// The library is searched for where `pip install mujoco==3.17.0` installs it: in the Python of
/// `MOTORIUM_PYTHON`, of `VIRTUAL_ENV`, of every folder of `PATH` and of `~/.local`. The folders
/// `/usr/local/lib` and `/usr/lib` are also searched. If the environment variable `MOTORIUM_MUJOCO` is set,
/// only its value, the path of the library or its folder, is used.
///
/// The method is semi-implicit Euler. Drives and damping are implicit: they are added to the mass matrix, so
/// MuJoCo's solver (Newton, elliptic cones) treats them as inertia. The solver covers contacts, joint stops,
/// joint friction and mimic joints. Effort limits hold in every step: a step in which a drive exceeds its
/// limit is solved again. Contacts are MuJoCo's soft contacts, as stiff as a step of a millisecond allows.
/// The friction of a contact is the mean friction of both surfaces, and its damping is chosen to match their
/// mean restitution.
///
/// A terrain is a MuJoCo height field, which ends at the edge of its grid. Rays are cast by motorium against
/// the same shapes.
pub struct Mujoco {
    options: Options,
    library: &'static Library,
    world: World,
    colliders: Colliders,
    rays: Rays,
    native: Native,
    places: Places,
    /// The collider of each MuJoCo geometry.
    geometries: Vec<usize>,
    /// Inertia of drive and rotor on the joint of each body of each articulation.
    armatures: Vec<Vec<f64>>,
    laws: Vec<Laws>,
    drives: Vec<Drive>,
    seen: Seen,
    seen_next: Seen,
    /// Generalized external force during the next step (nv), in motorium's order.
    external: Vec<f64>,
    generalized: Vec<f64>,
    /// Generalized force in MuJoCo's order.
    forces: Vec<f64>,
    /// One entry per articulation.
    jacobians: Vec<DMatrix<f64>>,
    sums: ImpulseSums,
    /// MuJoCo's state before a step, and before an attempt at an integration step.
    before: Vec<f64>,
    motion: Vec<f64>,
}

/// Factor of the yield of joint constraints: MuJoCo's friction, stops and couplings of joints are soft,
/// motorium's are not.
const YIELD: f64 = 1e-4;

/// Snapshot of all [`Mujoco`] engine state that affects later steps.
pub struct MujocoState {
    numbers: Vec<f64>,
    objects: usize,
    drives: Vec<Drive>,
    seen: Seen,
    external: Vec<f64>,
}

impl Mujoco {
    /// Locates MuJoCo's library and loads it.
    ///
    /// # Errors
    ///
    /// [`LibraryError`] if the library cannot be loaded. The message contains what to install.
    pub fn find() -> Result<(), LibraryError> {
        Library::get().map(|_| ())
    }
}

impl Engine for Mujoco {
    type State = MujocoState;

    const NAME: &'static str = "MuJoCo";

    const CAPABILITIES: Capabilities = Capabilities {
        floating_bases: true,
        several_articulations: true,
        allocation_free: true,
        rolling_friction: true,
        conveyors: false,
        textures: false,
        triangles: false,
        changes: true,
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
        if setups.iter().any(|setup| setup.actuators.iter().any(Option::is_some)) {
            return Err(BuildError::IdealDrives);
        }
        let library = Library::get()?;
        let colliders = Colliders::new(setups, world, options, warnings);
        for collider in colliders.colliders.iter().filter(|collider| !mjcf::is_usable(&collider.shape)) {
            let reason = "its mesh has no volume, which MuJoCo needs".to_owned();
            warnings.push(BuildWarning::ShapeIgnored { link: collider.name.clone(), reason });
        }
        let (native, places, geometries) = Self::compile(library, robot, world, &colliders)?;
        let nv = robot.nv();
        Ok(Self {
            rays: Rays::new(&colliders),
            sums: ImpulseSums::new(&colliders.colliders, &robot.articulations),
            armatures: mjcf::armatures(robot),
            laws: vec![Laws::FREE; robot.joints.len()],
            drives: vec![Drive::Linear; robot.joints.len()],
            seen: Seen::new(),
            seen_next: Seen::new(),
            external: vec![0.0; nv],
            generalized: vec![0.0; nv],
            forces: vec![0.0; native.qvel().len()],
            jacobians: robot.articulations.iter().map(|own| DMatrix::zeros(6, own.v().len())).collect(),
            before: vec![0.0; native.state_size(Parts::INTEGRATION)],
            motion: vec![0.0; native.state_size(Parts::MOTION)],
            options: *options,
            library,
            world: world.clone(),
            colliders,
            native,
            places,
            geometries,
        })
    }

    fn surfaces(&self) -> Vec<Surface> {
        self.colliders.surfaces()
    }

    fn set_properties(
        &mut self,
        robot: &Robot,
        world: &World,
        surfaces: &[Surface],
    ) -> Result<(), ResetError> {
        let before = self.colliders.surfaces();
        let terrain = self.world.terrain.clone();
        if self.colliders.set_terrain(world.terrain.as_ref()).map_err(ResetError::terrain)? {
            self.rays = Rays::new(&self.colliders);
        }
        self.colliders.set_surfaces(surfaces);
        match Self::compile(self.library, robot, world, &self.colliders) {
            Ok(compiled) => (self.native, self.places, self.geometries) = compiled,
            Err(error) => {
                self.colliders.set_surfaces(&before);
                if self.colliders.set_terrain(terrain.as_ref()).map_err(ResetError::terrain)? {
                    self.rays = Rays::new(&self.colliders);
                }
                return Err(ResetError::Refused { reason: error.to_string() });
            }
        }
        self.world = world.clone();
        self.armatures = mjcf::armatures(robot);
        Ok(())
    }

    fn apply_wrench(
        &mut self,
        robot: &Robot,
        (of, link): (usize, FrameId),
        point: &Point3<f64>,
        [force, torque]: [Vector3<f64>; 2],
    ) {
        let (own, jacobian) = (&robot.articulations[of], &mut self.jacobians[of]);
        own.kinematics.jacobian(&own.model, link, Reference::LocalWorldAligned, jacobian);
        let arm = own.kinematics.pose(&own.model, link).rotation * point.coords;
        let torque = torque + arm.cross(&force);
        for (external, column) in self.external[own.v()].iter_mut().zip(jacobian.column_iter()) {
            *external += column.fixed_rows::<3>(0).dot(&force) + column.fixed_rows::<3>(3).dot(&torque);
        }
    }

    fn begin_placement(&mut self, robot: &Robot, articulation: usize) {
        self.forget_drives(&robot.articulations[articulation]);
    }

    fn end_placement(&mut self, robot: &Robot, articulation: usize) {
        self.forget_drives(&robot.articulations[articulation]);
    }

    fn reset(&mut self, _: &Robot, _: &World) {
        self.native.reset();
        self.drives.fill(Drive::Linear);
        self.external.fill(0.0);
        self.seen.touches.clear();
        self.seen.near = true;
    }

    fn exclude_start_overlaps(&mut self, robot: &Robot, warnings: &mut Vec<BuildWarning>) {
        if self.colliders.exclude_close(robot, warnings) {
            (self.native, self.places, self.geometries) =
                Self::compile(self.library, robot, &self.world, &self.colliders)
                    .expect("it was compiled with more pairs");
        }
    }

    fn advance(&mut self, robot: &mut Robot, dt: f64) -> Result<StepReport, StepError> {
        self.advance_by(robot, dt)
    }

    fn commit(&mut self, _: &Robot, _: f64) {
        self.external.fill(0.0);
        core::mem::swap(&mut self.seen, &mut self.seen_next);
    }

    fn discard(&mut self) {
        self.external.fill(0.0);
        self.native.set_state(Parts::INTEGRATION, &self.before);
    }

    fn save(&self) -> MujocoState {
        let mut numbers = vec![0.0; self.before.len()];
        self.native.get_state(Parts::INTEGRATION, &mut numbers);
        MujocoState {
            numbers,
            objects: self.places.objects.len(),
            drives: self.drives.clone(),
            seen: self.seen.clone(),
            external: self.external.clone(),
        }
    }

    fn restore(&mut self, _: &Robot, state: &MujocoState) -> bool {
        if state.numbers.len() != self.before.len() || state.objects != self.places.objects.len() {
            return false;
        }
        self.native.set_state(Parts::INTEGRATION, &state.numbers);
        self.drives.copy_from_slice(&state.drives);
        self.seen.clone_from(&state.seen);
        self.external.copy_from_slice(&state.external);
        true
    }

    fn cast_ray(&self, robot: &Robot, ray: (&Point3<f64>, &Unit<Vector3<f64>>, f64)) -> Option<RayHit<'_>> {
        self.rays.cast(&self.colliders, (robot, |index| self.object_pose(index)), ray)
    }

    fn diverged_object(&self) -> Option<usize> {
        let sound = |numbers: &[f64]| numbers.iter().all(|x| x.abs() < 1e9);
        self.places.objects.iter().position(|place| match *place {
            ObjectPlace::Free(place, dof) => {
                let (qpos, qvel) = (self.native.qpos(), self.native.qvel());
                !sound(&qpos[place..place + 7]) || !sound(&qvel[dof..dof + 6])
            }
            ObjectPlace::Placed(_) => false,
        })
    }

    fn object_pose(&self, index: usize) -> Isometry3<f64> {
        let (position, rotation) = match self.places.objects[index] {
            ObjectPlace::Free(place, _) => pose_at(&self.native.qpos()[place..place + 7]),
            ObjectPlace::Placed(mocap) => {
                let ([x, y, z], [w, i, j, k]) = self.native.mocap(mocap);
                pose_at(&[x, y, z, w, i, j, k])
            }
        };
        Isometry3::from_parts(position.into(), rotation)
    }

    fn set_object_pose(&mut self, index: usize, pose: &Isometry3<f64>) {
        let (p, r) = (pose.translation.vector, pose.rotation);
        match self.places.objects[index] {
            ObjectPlace::Free(place, dof) => {
                self.native.qpos_mut()[place..place + 7]
                    .copy_from_slice(&[p.x, p.y, p.z, r.w, r.i, r.j, r.k]);
                self.native.qvel_mut()[dof..dof + 6].fill(0.0);
            }
            ObjectPlace::Placed(mocap) => self.native.set_mocap(mocap, p.into(), [r.w, r.i, r.j, r.k]),
        }
        // The next step finds contacts near the object.
        self.seen.near = true;
    }

    fn object_velocity(&self, index: usize) -> (Vector3<f64>, Vector3<f64>) {
        match self.places.objects[index] {
            ObjectPlace::Free(place, dof) => {
                let (_, rotation) = pose_at(&self.native.qpos()[place..place + 7]);
                let qvel = &self.native.qvel()[dof..dof + 6];
                let angular = rotation * Vector3::from_column_slice(&qvel[3..]);
                // MuJoCo's velocity is the velocity of the origin.
                let centre = self.places.masses[index].and_then(|own| own.frame);
                let arm = centre.map_or_else(Vector3::zeros, |own| rotation * own.translation.vector);
                (Vector3::from_column_slice(&qvel[..3]) + angular.cross(&arm), angular)
            }
            ObjectPlace::Placed(_) => (Vector3::zeros(), Vector3::zeros()),
        }
    }

    fn set_object_velocity(&mut self, index: usize, linear: &Vector3<f64>, angular: &Vector3<f64>) {
        if let ObjectPlace::Free(place, dof) = self.places.objects[index] {
            let (_, rotation) = pose_at(&self.native.qpos()[place..place + 7]);
            let centre = self.places.masses[index].and_then(|own| own.frame);
            let arm = centre.map_or_else(Vector3::zeros, |own| rotation * own.translation.vector);
            let qvel = &mut self.native.qvel_mut()[dof..dof + 6];
            qvel[..3].copy_from_slice((linear - angular.cross(&arm)).as_slice());
            qvel[3..].copy_from_slice((rotation.inverse() * angular).as_slice());
            self.seen.near = true;
        }
    }

    fn visit_contacts(&self, visit: &mut dyn FnMut(&Contact<'_>)) {
        for touch in &self.seen.touches {
            let [first, second] = touch.colliders.map(|index| self.colliders.colliders[index].name.as_str());
            let Touch { point, normal, depth, force, friction, .. } = *touch;
            visit(&Contact { first, second, point, normal, depth, force, friction });
        }
    }

    fn visit_impulses(&self, _: f64, visit: &mut dyn FnMut(&str, &Vector3<f64>, &Vector3<f64>)) {
        self.sums.visit(&self.colliders.colliders, visit);
    }
}
