//! Robots whose base moves freely: on legs, on wheels, in the air.
//!
//! The joint-space dynamics of [`crate::articulated`], with drives, friction and stops implicit, and contacts solved with
//! them in the same step: no penalty springs, no second engine. See [`Floating`].

mod rotors;
mod simulate;
mod surroundings;

use motorium_robots::{Dynamics, Kinematics, Model};
use nalgebra::{DMatrix, Point3, Vector3};

use crate::articulated::{Articulated, JointProperties};
use crate::{BuildError, BuildWarning, JointCommand, Options, Simulator, World};
pub use rotors::RotorDrive;
use surroundings::Surroundings;

/// A robot in a world, moved by our own dynamics and contact solver. Its base floats, or is fixed.
///
/// Each integration step finds the end velocity `v+` of
///
/// ```text
/// M(q) (v+ - v) / h + C(q, v) v + g(q) = tau(q + h v+, v+) - D v+ + friction(v+) + stop(q + h v+) + J' lambda / h
/// ```
///
/// with impulses `lambda` that keep surfaces from overlapping and friction in Coulomb's cone, then moves on with `v+`. Free
/// objects of the world are part of the same problem.
///
/// What touches is found at points: spheres, the ends of capsules, the corners of boxes, the rims of cylinders and the
/// outermost points of meshes, each against the surface of the other piece. Edges that cross without a corner near pass
/// through one another, and nothing touches the inside of a mesh's hull but the other way round.
///
/// In the air, linear and angular momentum are conserved to rounding: the base takes up what the integration would lose.
/// Nothing allocates after [`new`](Self::new).
pub struct Floating {
    model: Model,
    options: Options,
    world: World,
    warnings: Vec<BuildWarning>,
    gravity: Vector3<f64>,
    state: State,
    /// Joints, then rotors.
    names: Vec<String>,
    commands: Vec<JointCommand>,
    rotors: Vec<RotorDrive>,
    articulated: Articulated,
    dynamics: Dynamics,
    kinematics: Kinematics,
    surroundings: Surroundings,
    /// Force of the rotors, over the velocity.
    outside: Vec<f64>,
    frame_jacobian: DMatrix<f64>,
    momentum_map: DMatrix<f64>,
    /// Length of the last integration step \[s\].
    h: f64,
}

/// A contact force on a link of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkForce<'a> {
    /// The link.
    pub link: &'a str,
    /// Where it acts, in the world \[m\].
    pub point: Point3<f64>,
    /// The force, friction included, world axes \[N\].
    pub force: Vector3<f64>,
}

/// The state, with room for the next one: a step that fails leaves no trace.
struct State {
    q: Vec<f64>,
    v: Vec<f64>,
    q_next: Vec<f64>,
    v_next: Vec<f64>,
    /// Per drive.
    positions: Vec<f64>,
    velocities: Vec<f64>,
    efforts: Vec<f64>,
    tau_next: Vec<f64>,
}

impl State {
    fn new(model: &Model, drives: usize) -> Self {
        let (q, v, drive) = (vec![0.0; model.nq()], vec![0.0; model.nv()], vec![0.0; drives]);
        Self {
            q_next: q.clone(),
            v_next: v.clone(),
            q,
            v,
            positions: drive.clone(),
            velocities: drive.clone(),
            efforts: drive.clone(),
            tau_next: drive,
        }
    }

    fn begin(&mut self) {
        self.q_next.copy_from_slice(&self.q);
        self.v_next.copy_from_slice(&self.v);
    }

    fn commit(&mut self, model: &Model) {
        std::mem::swap(&mut self.q, &mut self.q_next);
        std::mem::swap(&mut self.v, &mut self.v_next);
        std::mem::swap(&mut self.efforts, &mut self.tau_next);
        self.show(model);
    }

    /// The joints' part, for those who look at drives.
    fn show(&mut self, model: &Model) {
        let (q, v) = (model.joints_of_q(&self.q), model.joints_of_v(&self.v));
        self.positions[..q.len()].copy_from_slice(q);
        self.velocities[..v.len()].copy_from_slice(v);
    }
}

impl Floating {
    /// A simulation of `model` with `rotors` in `world`, at rest at `q` (nq).
    ///
    /// # Errors
    ///
    /// [`BuildError`]. What is merely doubtful is in [`warnings`](Simulator::warnings).
    pub fn new(
        model: Model,
        rotors: Vec<RotorDrive>,
        world: World,
        q: &[f64],
        options: Options,
    ) -> Result<Self, BuildError> {
        options.check()?;
        world.check(model.frames().iter().map(|frame| frame.name.as_str()))?;
        let (n, drives) = (model.nv(), model.joint_count() + rotors.len());
        let mut warnings = Vec::new();
        let surroundings = Surroundings::new(&model, &world, &options, &mut warnings);
        let names = model.joint_names().iter().chain(rotors.iter().map(|rotor| &rotor.name));
        let mut simulation = Self {
            names: names.cloned().collect(),
            gravity: Vector3::from(world.gravity),
            state: State::new(&model, drives),
            commands: vec![JointCommand::default(); drives],
            articulated: Articulated::new(&model, JointProperties::of(&model, options.armature)),
            dynamics: Dynamics::new(&model),
            kinematics: Kinematics::new(&model),
            surroundings,
            outside: vec![0.0; n],
            frame_jacobian: DMatrix::zeros(6, n),
            momentum_map: DMatrix::zeros(6, n),
            h: 1e-3,
            rotors,
            model,
            options,
            world,
            warnings,
        };
        simulation.reset(q, &vec![0.0; n])?;
        while simulation.surroundings.settle(&simulation.model, &mut simulation.warnings) {
            simulation.surroundings.place(&simulation.kinematics, q);
        }
        let joints = simulation.articulated.joints();
        let q = simulation.model.joints_of_q(&simulation.state.q);
        BuildWarning::of_joints(&simulation.model, joints, q, &mut simulation.warnings);
        Ok(simulation)
    }

    /// Moves the base up or down until the robot stands on the ground plane, or the plane z = 0 if there is none, and
    /// stops it. Without collision shapes nothing happens.
    pub fn set_down(&mut self) {
        let height = self.world.ground.map_or(0.0, |ground| ground.height);
        let lowest = self.surroundings.lowest();
        if self.model.base().floating && lowest.is_finite() {
            self.state.q[2] += height - lowest;
            self.state.v.fill(0.0);
            self.kinematics.update(&self.model, &self.state.q);
            self.surroundings.place(&self.kinematics, &self.state.q);
        }
    }

    /// The settings.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Sum of the contact forces on the robot from all that is not part of it during the last integration step \[N\],
    /// world axes.
    pub fn contact_force(&self) -> Vector3<f64> {
        self.surroundings.force_on_robot(self.h)
    }

    /// Shows each contact force on a link of the robot, friction included, of the last integration step. Forces between its
    /// own links appear twice, once for each.
    pub fn visit_forces(&self, visit: &mut dyn FnMut(&LinkForce<'_>)) {
        for (index, touch, first, second) in self.surroundings.touches() {
            let (point, force) = (touch.point, self.surroundings.impulses.vector(index) / self.h);
            if touch.owners.0.is_robot() {
                visit(&LinkForce { link: &first.name, point, force });
            }
            if touch.owners.1.is_robot() {
                visit(&LinkForce { link: &second.name, point, force: -force });
            }
        }
    }
}
