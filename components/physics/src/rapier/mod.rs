//! The rapier engine: `rapier3d` in its f64 form, the robot a reduced-coordinate multibody built from our own model.
//!
//! While the robot touches nothing and nothing is near, its multibody is switched off and the joint-space integrator of
//! [`crate::articulated`] moves it (see [`Contacts`]): the same equations without rapier's heap allocations. Rapier's
//! multibody allocates at every integration step, in the LU factorisation of its mass matrix and in its solver vectors,
//! and there is no setting that avoids it. Objects are always rapier's; once all have come to rest, away from the robot,
//! they are left alone.
//!
//! The same program on the same machine gives the same bits, in every process: rapier's feature `enhanced-determinism`
//! adds agreement between kinds of machines, at the price of slower trigonometry for everybody, and is not enabled.
//!
//! What it does not do: collision meshes are ignored (with a warning), the robot's base stands at the origin of the world,
//! and continuous collision detection is off (nothing slower than 5 m/s passes through 5 mm at 1 kHz).

mod arm;
mod build;
mod convert;
mod inertia;
mod proximity;
mod scene;
mod shapes;
mod surfaces;

use motorium_robots::{FrameId, Kinematics, Model};
use nalgebra::{Isometry3, Vector3};

use crate::articulated::{Articulated, Singular};
use crate::{
    BuildWarning, Contact, Contacts, JointCommand, ObjectId, Options, ResetError, Simulator, StepError,
    StepReport, World,
};
use arm::{Arm, DriveAction};
use proximity::{ENTER, LEAVE, Proximity};
pub use scene::Enclose;
use scene::Scene;
use surfaces::{Owner, PairTable, Surface};

/// A robot in a world, simulated by rapier.
pub struct Rapier {
    model: Model,
    options: Options,
    world: World,
    warnings: Vec<BuildWarning>,
    gravity: Vector3<f64>,
    state: State,
    commands: Vec<JointCommand>,
    articulated: Articulated,
    kinematics: Kinematics,
    surfaces: Vec<Surface>,
    pairs: PairTable,
    proximity: Proximity,
    scene: Scene,
    arm: Arm,
    /// The contact solver moves the robot.
    near: bool,
    /// The multibody does not stand where the state says.
    stale: bool,
    /// Joints whose drive the last contact step pushed beyond its limit: next, the limit itself acts.
    overdriven: Vec<bool>,
    /// Length of the last step \[s\].
    dt: f64,
}

/// Positions, velocities and efforts, with room for the next ones: a step that fails leaves no trace.
struct State {
    q: Vec<f64>,
    v: Vec<f64>,
    tau: Vec<f64>,
    q_next: Vec<f64>,
    v_next: Vec<f64>,
    tau_next: Vec<f64>,
}

impl State {
    fn new(n: usize) -> Self {
        let zero = || vec![0.0; n];
        Self { q: zero(), v: zero(), tau: zero(), q_next: zero(), v_next: zero(), tau_next: zero() }
    }

    fn begin(&mut self) {
        self.q_next.copy_from_slice(&self.q);
        self.v_next.copy_from_slice(&self.v);
    }

    fn commit(&mut self) {
        std::mem::swap(&mut self.q, &mut self.q_next);
        std::mem::swap(&mut self.v, &mut self.v_next);
        std::mem::swap(&mut self.tau, &mut self.tau_next);
    }
}

impl Rapier {
    /// The settings.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Has every call of rapier's pipeline made inside `enclose`, which must make it: to count its allocations apart,
    /// for one. The pipeline runs while the robot is near a contact, or an object moves.
    pub fn enclose_rapier(&mut self, enclose: Enclose) {
        self.scene.set_enclosure(enclose);
    }

    fn step_free(&mut self, dt: f64) -> Result<StepReport, StepError> {
        let h = dt / self.options.substeps as f64;
        let mut report = StepReport::default();
        for _ in 0..self.options.substeps {
            let State { q_next: q, v_next: v, tau_next: tau, .. } = &mut self.state;
            let events = self.articulated.advance(&self.model, q, v, &self.commands, self.gravity, h, tau);
            let events = events.map_err(|Singular(joint)| StepError::singular(&self.model, joint))?;
            report.saturated = report.saturated.max(events.saturated);
            report.at_limit = events.at_limit;
        }
        self.stale = true;
        Ok(report)
    }

    fn step_contact(&mut self, dt: f64) -> Result<StepReport, StepError> {
        let mut report = StepReport { near_contact: true, ..StepReport::default() };
        self.scene.disturb();
        self.arm.set_enabled(&mut self.scene, true);
        if self.stale {
            self.arm.place(&self.model, &mut self.scene, &self.state.q);
            self.overdriven.fill(false);
        }
        self.stale = true;
        self.arm.set_velocity(&self.model, &mut self.scene, &self.state.v);
        let h = self.scene.substep(dt);
        self.drive(h)?;
        self.scene.step(dt, &self.gravity, &self.pairs);
        let State { q_next, v_next, tau_next, .. } = &mut self.state;
        self.arm.read(&self.model, &self.scene, q_next, v_next);
        for (i, joint) in self.articulated.joints().iter().enumerate() {
            let c = &self.commands[i];
            let law = c.kp * (c.position - q_next[i]) + c.kd * (c.velocity - v_next[i]) + c.effort;
            let beyond = law.abs() > joint.effort_limit;
            // A drive that was already at its limit applied what `drive` left in `tau_next`.
            let constant = self.overdriven[i];
            if !constant {
                tau_next[i] = law;
            }
            self.overdriven[i] = beyond;
            report.saturated += usize::from(constant || beyond);
            report.at_limit += usize::from(q_next[i] <= joint.lower || q_next[i] >= joint.upper);
        }
        self.stale = false;
        Ok(report)
    }

    /// Decides for each drive whether its law or its limit acts. `overdriven` then marks the latter, and `tau_next` holds
    /// its effort.
    ///
    /// The contact solver knows no effort limits. A drive is taken to be saturated when it would be without contacts,
    /// or when the last step, contacts included, pushed it beyond: then an impact may exceed the limit for one step,
    /// and what is reported is what acted.
    fn drive(&mut self, h: f64) -> Result<(), StepError> {
        let State { q, v, q_next, v_next, tau_next, .. } = &mut self.state;
        q_next.copy_from_slice(q);
        v_next.copy_from_slice(v);
        let free =
            self.articulated.advance(&self.model, q_next, v_next, &self.commands, self.gravity, h, tau_next);
        free.map_err(|Singular(joint)| StepError::singular(&self.model, joint))?;
        for (i, joint) in self.articulated.joints().iter().enumerate() {
            let c = self.commands[i];
            let limit = joint.effort_limit;
            let law = c.kp * (c.position - q[i]) + c.kd * (c.velocity - v[i]) + c.effort;
            if self.overdriven[i] && law.abs() > limit {
                tau_next[i] = limit.copysign(law);
            }
            self.overdriven[i] = tau_next[i].abs() >= limit;
            let action =
                if self.overdriven[i] { DriveAction::Constant(tau_next[i]) } else { DriveAction::Law(c) };
            self.arm.drive(&self.model, &mut self.scene, (i, q[i]), action);
        }
        Ok(())
    }

    /// Looks around and decides who moves the robot.
    fn look(&mut self) {
        self.near = match self.options.contacts {
            Contacts::Always => true,
            Contacts::WhenNear => {
                self.place_surfaces();
                self.proximity.any_within(&self.surfaces, if self.near { LEAVE } else { ENTER })
            }
        };
    }

    /// Refuses the end of a step of `dt` that means nothing any more.
    fn verify(&self, dt: f64) -> Result<(), StepError> {
        for (i, joint) in self.articulated.joints().iter().enumerate() {
            let (v, bound) = (self.state.v_next[i], joint.divergence_bound());
            // The way travelled too: the contact solver may stop a joint that has already jumped.
            let travel = (self.state.q_next[i] - self.state.q[i]) / dt;
            // Written so that NaN fails.
            if !(v.abs() < bound && travel.abs() < bound && self.state.tau_next[i].is_finite()) {
                let name = self.model.joint_names()[i].clone();
                let velocity = if travel.abs() < bound { v } else { travel };
                return Err(StepError::Diverged { joint: i, name, velocity, bound });
            }
        }
        Ok(())
    }
}

impl Simulator for Rapier {
    fn model(&self) -> &Model {
        &self.model
    }

    fn warnings(&self) -> &[BuildWarning] {
        &self.warnings
    }

    fn configuration(&self) -> &[f64] {
        &self.state.q
    }

    fn velocity(&self) -> &[f64] {
        &self.state.v
    }

    fn joint_names(&self) -> &[String] {
        self.model.joint_names()
    }

    fn positions(&self) -> &[f64] {
        &self.state.q
    }

    fn velocities(&self) -> &[f64] {
        &self.state.v
    }

    fn efforts(&self) -> &[f64] {
        &self.state.tau
    }

    fn commands_mut(&mut self) -> &mut [JointCommand] {
        &mut self.commands
    }

    fn step(&mut self, dt: f64) -> Result<StepReport, StepError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(StepError::InvalidStep(dt));
        }
        StepError::of_commands(&self.commands, self.model.joint_names())?;
        self.look();
        self.state.begin();
        self.dt = dt;
        let mut report = if self.near {
            self.step_contact(dt)?
        } else {
            let report = self.step_free(dt)?;
            self.arm.set_enabled(&mut self.scene, false);
            if !self.scene.is_at_rest() {
                self.scene.step(dt, &self.gravity, &self.pairs);
            }
            report
        };
        if let Err(error) = self.verify(dt) {
            self.stale = true;
            return Err(error);
        }
        if let Some(object) = self.scene.broken_object() {
            self.stale = true;
            return Err(StepError::ObjectDiverged { object: self.world.objects[object].name.clone() });
        }
        self.state.commit();
        self.kinematics.update(&self.model, &self.state.q);
        let limits = self.articulated.joints().iter().map(|joint| joint.velocity_limit);
        report.overspeed = self.state.v.iter().zip(limits).filter(|(v, limit)| v.abs() > *limit).count();
        Ok(report)
    }

    fn reset(&mut self, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        ResetError::of_state(&self.model, q, v)?;
        self.state.q.copy_from_slice(q);
        self.state.v.copy_from_slice(v);
        self.state.tau.fill(0.0);
        self.commands.fill(JointCommand::default());
        self.kinematics.update(&self.model, q);
        self.articulated.forget();
        // A fresh scene: rapier warm-starts from old contacts, and a run must depend on its start alone.
        let enclose = self.scene.enclosure();
        (self.scene, self.arm) =
            build::populate(&self.model, &self.world, &self.options, &self.surfaces, enclose);
        self.near = false;
        self.stale = true;
        Ok(())
    }

    fn gravity(&self) -> Vector3<f64> {
        self.gravity
    }

    fn set_gravity(&mut self, gravity: Vector3<f64>) {
        self.gravity = gravity;
        self.scene.disturb();
    }

    fn frame_pose(&self, frame: FrameId) -> Isometry3<f64> {
        self.kinematics.pose(&self.model, frame)
    }

    fn object(&self, name: &str) -> Option<ObjectId> {
        self.world.objects.iter().position(|object| object.name == name).map(ObjectId)
    }

    fn object_pose(&self, object: ObjectId) -> Isometry3<f64> {
        self.scene.object_pose(object.0)
    }

    fn set_object_pose(&mut self, object: ObjectId, pose: Isometry3<f64>) {
        self.scene.set_object_pose(object.0, &pose);
    }

    fn object_velocity(&self, object: ObjectId) -> (Vector3<f64>, Vector3<f64>) {
        self.scene.object_velocity(object.0)
    }

    fn visit_contacts(&self, visit: &mut dyn FnMut(&Contact<'_>)) {
        let robot = |index: usize| matches!(self.surfaces[index].owner, Owner::Body(_));
        // Away from everything, what rapier remembers of the robot is of an earlier step.
        let current = |first: usize, second: usize| self.near || !(robot(first) || robot(second));
        self.scene.visit_contacts(&self.surfaces, self.dt, current, visit);
    }
}
