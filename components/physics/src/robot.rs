//! The simulated robots: the part of a simulation that does not depend on the engine.

use core::ops::Range;
use std::collections::BTreeMap;
use std::sync::Arc;

use motorium_robots::{ActuatorSettings, Kinematics, Loaded, Model, Profile, Srdf, UnknownFrame};
use motorium_worlds::{FrictionCombine, Grain, Softness};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::error::BASE_BOUND;
use crate::joint::JointProperties;
use crate::{JointSetpoint, Options, ResetError, RotorDrive, StepError};

/// Description of a simulated robot: its model, rotors, collision rules, surfaces and actuators.
///
/// A bare [`Model`] converts into a setup without rotors and collision rules.
#[derive(Clone, Debug)]
pub struct RobotSetup {
    /// Links, joints, inertias and collision shapes.
    pub model: Model,
    /// Drives that apply thrust to the robot instead of moving a joint.
    pub rotors: Vec<RotorDrive>,
    /// SRDF rules: pairs of links that never touch each other, and exceptions to the engine's built-in rules.
    pub collision_rules: Srdf,
    /// Friction coefficients by link name, for links that differ from the default surface.
    pub friction: BTreeMap<String, f64>,
    /// Friction rules by link name. A rule combines the friction coefficients of the link and of a surface
    /// that touches the link.
    pub friction_combine: BTreeMap<String, FrictionCombine>,
    /// Restitutions by link name, 0 to 1, for links that differ from the default surface.
    pub restitution: BTreeMap<String, f64>,
    /// Softness by link name, for links with a compliant surface.
    pub soft: BTreeMap<String, Softness>,
    /// Direction-dependent friction by link name. Directions are in link axes.
    pub grain: BTreeMap<String, Grain>,
    /// Actuator settings, one per joint. `None` is an ideal actuator. Joints beyond the end of the list also
    /// have ideal actuators.
    pub actuators: Vec<Option<ActuatorSettings>>,
    /// Profile of a loaded robot, for controllers that run alongside the simulation.
    pub profile: Option<Arc<Profile>>,
}

impl From<Model> for RobotSetup {
    fn from(model: Model) -> Self {
        let (rotors, actuators) = (Vec::new(), Vec::new());
        let (friction, restitution) = (BTreeMap::new(), BTreeMap::new());
        let (friction_combine, soft, grain) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        Self {
            model,
            rotors,
            collision_rules: Srdf::default(),
            friction,
            friction_combine,
            restitution,
            soft,
            grain,
            actuators,
            profile: None,
        }
    }
}

impl RobotSetup {
    /// Creates the setup of a loaded robot. The profile provides the friction of the feet and the rotors,
    /// which act only on a floating base.
    ///
    /// # Errors
    ///
    /// [`UnknownFrame`] if the profile names a frame that the robot does not have.
    pub fn from_loaded(robot: &Loaded) -> Result<Self, UnknownFrame> {
        let model = robot.model.clone();
        let rotors = match &robot.profile {
            Some(profile) if model.base().floating => RotorDrive::from_profile(&model, profile)?,
            _ => Vec::new(),
        };
        let feet = robot.profile.iter().flat_map(|profile| profile.feet.values());
        let friction = feet.filter_map(|foot| Some((foot.frame.clone(), foot.friction?))).collect();
        let collision_rules = robot.exclusions.clone();
        let profile = robot.profile.clone().map(Arc::new);
        Ok(Self { rotors, collision_rules, friction, profile, ..Self::from(model) })
    }
}

/// An articulation: a kinematic tree with its own base.
///
/// A robot is one articulation, but several robots with fixed bases may share an articulation
/// ([`Model::world`]). Each articulation owns a range of the vectors of a [`Simulator`](crate::Simulator).
///
/// ```
/// use motorium_physics::{ArticulatedSimulator, Options, RobotSetup, Simulator, World};
/// use motorium_robots::load;
///
/// let model = load("quadruped", std::path::Path::new("."))?.model;
/// let robots = ["one/", "two/"].map(|name| RobotSetup::from(model.prefixed(name)));
/// let mut q = [model.neutral(), model.neutral()].concat();
/// q[model.nq()] += 1.0; // two starts a metre from one
/// let simulation = ArticulatedSimulator::of_robots(robots, World::default(), &q, Options::default())?;
/// let second = &simulation.articulations()[1];
/// assert_eq!(second.q().start, model.nq());
/// assert!(simulation.joint_names()[second.drives()][0].starts_with("two/"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Articulation {
    pub(crate) model: Model,
    pub(crate) rotors: Vec<RotorDrive>,
    profile: Option<Arc<Profile>>,
    /// Poses and velocities of the links in the current state.
    pub(crate) kinematics: Kinematics,
    /// True if it is moved from outside: no force and no drive moves it.
    pub(crate) placed: bool,
    q: Range<usize>,
    v: Range<usize>,
    joints: Range<usize>,
    drives: Range<usize>,
}

impl Articulation {
    /// Returns the model of the articulation: links, joints, inertias and collision shapes.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Returns the profile of the robot, if the robot was [loaded](RobotSetup::from_loaded) with a profile.
    pub fn profile(&self) -> Option<&Profile> {
        self.profile.as_deref()
    }

    /// Returns the articulation's range in the configuration vector.
    pub fn q(&self) -> Range<usize> {
        self.q.clone()
    }

    /// Returns the articulation's range in the velocity vector.
    pub fn v(&self) -> Range<usize> {
        self.v.clone()
    }

    /// Returns the articulation's range in the vectors with one entry per drive: commands, positions,
    /// velocities and efforts.
    pub fn drives(&self) -> Range<usize> {
        self.drives.clone()
    }

    /// Returns its range of all joints.
    pub(crate) fn joints(&self) -> Range<usize> {
        self.joints.clone()
    }

    /// Returns the pose of the base in the world for the whole configuration `q`.
    pub(crate) fn base_pose(&self, q: &[f64]) -> Isometry3<f64> {
        if self.model.base().floating { base_pose(&q[self.q()]) } else { Isometry3::identity() }
    }

    /// Recomputes everything that depends on the whole state.
    pub(crate) fn refresh(&mut self, state: &mut State) {
        let (q, v) = (&state.q[self.q.clone()], &state.v[self.v.clone()]);
        let joints = self.drives.start..self.drives.start + self.joints.len();
        state.positions[joints.clone()].copy_from_slice(self.model.joints_of_q(q));
        state.velocities[joints].copy_from_slice(self.model.joints_of_v(v));
        self.kinematics.update_with_velocity(&self.model, q, v);
    }
}

/// State, commands and articulations of a simulation, shared by all engines.
pub struct Robot {
    pub(crate) articulations: Vec<Articulation>,
    /// One entry per independent joint.
    pub(crate) joints: Vec<JointProperties>,
    /// Names of the drives of each articulation: joints, then rotors.
    pub(crate) names: Vec<String>,
    /// One entry per drive.
    pub(crate) commands: Vec<JointSetpoint>,
    pub(crate) state: State,
    /// Acceleration of free fall \[m/s2\].
    pub(crate) gravity: Vector3<f64>,
}

/// The state of all articulations, with space for the next state so that a failed step leaves no trace.
pub(crate) struct State {
    /// Configuration (nq).
    pub(crate) q: Vec<f64>,
    /// Velocity (nv).
    pub(crate) v: Vec<f64>,
    pub(crate) q_next: Vec<f64>,
    pub(crate) v_next: Vec<f64>,
    /// Configuration at the end of the last step (nq), from which placed articulations continue.
    pub(crate) q_last: Vec<f64>,
    /// One entry per drive, as for velocities and efforts. A rotor has neither position nor velocity: both
    /// are zero.
    positions: Vec<f64>,
    velocities: Vec<f64>,
    efforts: Vec<f64>,
    pub(crate) tau_next: Vec<f64>,
    /// One entry per drive: true if its acceleration limit changed its effort in the last step.
    pub(crate) restrained: Vec<bool>,
}

/// The saved state of a robot.
#[derive(Clone, Debug)]
pub(crate) struct RobotState {
    q: Vec<f64>,
    v: Vec<f64>,
    q_last: Vec<f64>,
    efforts: Vec<f64>,
    commands: Vec<JointSetpoint>,
    /// One entry per articulation.
    placed: Vec<bool>,
    gravity: Vector3<f64>,
}

impl State {
    fn new(q: Vec<f64>, nv: usize, drives: usize) -> Self {
        let (v, drive) = (vec![0.0; nv], vec![0.0; drives]);
        Self {
            q_next: q.clone(),
            v_next: v.clone(),
            q_last: q.clone(),
            q,
            v,
            positions: drive.clone(),
            velocities: drive.clone(),
            efforts: drive.clone(),
            tau_next: drive,
            restrained: vec![false; drives],
        }
    }

    /// Sets the efforts of these drives to zero.
    pub(crate) fn clear_efforts(&mut self, drives: Range<usize>) {
        self.efforts[drives.clone()].fill(0.0);
        self.restrained[drives].fill(false);
    }
}

impl Robot {
    pub(crate) fn new(setups: &[RobotSetup], options: &Options, gravity: Vector3<f64>) -> Self {
        let (mut articulations, mut joints, mut names, mut q) =
            (Vec::<Articulation>::new(), Vec::new(), Vec::new(), Vec::new());
        for RobotSetup { model, rotors, profile, .. } in setups {
            let v = articulations.last().map_or(0, |last| last.v.end);
            let (joint, drive) = (joints.len(), names.len());
            names.extend(model.joint_names().iter().chain(rotors.iter().map(|rotor| &rotor.name)).cloned());
            joints.extend(JointProperties::from_model(model, options.armature));
            articulations.push(Articulation {
                kinematics: Kinematics::new(model),
                placed: false,
                q: q.len()..q.len() + model.nq(),
                v: v..v + model.nv(),
                joints: joint..joints.len(),
                drives: drive..names.len(),
                model: model.clone(),
                rotors: rotors.clone(),
                profile: profile.clone(),
            });
            q.extend(model.neutral());
        }
        let nv = articulations.last().map_or(0, |last| last.v.end);
        Self {
            state: State::new(q, nv, names.len()),
            commands: vec![JointSetpoint::default(); names.len()],
            articulations,
            joints,
            names,
            gravity,
        }
    }

    /// Returns the first articulation, which is the whole robot in engines that simulate only one.
    pub(crate) fn first(&self) -> &Articulation {
        &self.articulations[0]
    }

    /// Returns the number of velocities.
    pub(crate) fn nv(&self) -> usize {
        self.state.v.len()
    }

    pub(crate) fn positions(&self) -> &[f64] {
        &self.state.positions
    }

    pub(crate) fn velocities(&self) -> &[f64] {
        &self.state.velocities
    }

    pub(crate) fn efforts(&self) -> &[f64] {
        &self.state.efforts
    }

    /// Returns the pose of an articulation's base in the world.
    pub(crate) fn base_pose(&self, articulation: usize) -> Isometry3<f64> {
        self.articulations[articulation].base_pose(&self.state.q)
    }

    /// Initialises the next state with the current one.
    pub(crate) fn begin(&mut self) {
        let State { q, v, q_next, v_next, .. } = &mut self.state;
        q_next.copy_from_slice(q);
        v_next.copy_from_slice(v);
    }

    /// Makes the next state the current one.
    pub(crate) fn commit(&mut self) {
        let state = &mut self.state;
        std::mem::swap(&mut state.q, &mut state.q_next);
        std::mem::swap(&mut state.v, &mut state.v_next);
        std::mem::swap(&mut state.efforts, &mut state.tau_next);
        state.q_last.copy_from_slice(&state.q);
        self.refresh();
    }

    /// Sets the current state; efforts and commands become zero. No articulation is placed any more.
    pub(crate) fn reset(&mut self, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        self.check(q, v)?;
        self.articulations.iter_mut().for_each(|own| own.placed = false);
        self.state.q.copy_from_slice(q);
        self.state.q_last.copy_from_slice(q);
        self.state.v.copy_from_slice(v);
        self.state.efforts.fill(0.0);
        self.state.restrained.fill(false);
        self.commands.fill(JointSetpoint::default());
        self.refresh();
        Ok(())
    }

    /// Checks the length and the numbers of a state of all articulations.
    pub(crate) fn check(&self, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        let expected = (self.state.q.len(), self.state.v.len());
        if (q.len(), v.len()) != expected {
            return Err(ResetError::Length { positions: q.len(), velocities: v.len(), expected });
        }
        self.articulations
            .iter()
            .try_for_each(|own| ResetError::check(&own.model, &q[own.q()], &v[own.v()], own.joints.start))
    }

    /// Replaces inertias, joints and gravity; the robots must have the same structure.
    pub(crate) fn set_properties<'a>(
        &mut self,
        models: impl IntoIterator<Item = &'a Model>,
        joints: Vec<JointProperties>,
        gravity: Vector3<f64>,
    ) {
        for (own, model) in self.articulations.iter_mut().zip(models) {
            own.model = model.clone();
        }
        (self.joints, self.gravity) = (joints, gravity);
    }

    /// Saves the current state, commands and gravity.
    pub(crate) fn save(&self) -> RobotState {
        RobotState {
            q: self.state.q.clone(),
            v: self.state.v.clone(),
            q_last: self.state.q_last.clone(),
            efforts: self.state.efforts.clone(),
            commands: self.commands.clone(),
            placed: self.articulations.iter().map(|own| own.placed).collect(),
            gravity: self.gravity,
        }
    }

    /// Restores a saved state. Returns `false` and changes nothing if the state belongs to another robot.
    pub(crate) fn restore(&mut self, saved: &RobotState) -> bool {
        let lengths = |q: &[f64], v: &[f64], commands: &[JointSetpoint]| [q.len(), v.len(), commands.len()];
        if lengths(&saved.q, &saved.v, &saved.commands)
            != lengths(&self.state.q, &self.state.v, &self.commands)
            || saved.placed.len() != self.articulations.len()
        {
            return false;
        }
        self.state.q.copy_from_slice(&saved.q);
        self.state.v.copy_from_slice(&saved.v);
        self.state.q_last.copy_from_slice(&saved.q_last);
        self.state.efforts.copy_from_slice(&saved.efforts);
        self.commands.copy_from_slice(&saved.commands);
        self.articulations.iter_mut().zip(&saved.placed).for_each(|(own, placed)| own.placed = *placed);
        self.gravity = saved.gravity;
        self.refresh();
        true
    }

    /// Recomputes everything that depends on the current q and v.
    pub(crate) fn refresh(&mut self) {
        let Self { articulations, state, .. } = self;
        articulations.iter_mut().for_each(|articulation| articulation.refresh(state));
    }

    /// Returns the number of joints above their velocity limit in the current state.
    pub(crate) fn overspeed(&self) -> usize {
        let above = |own: &Articulation| {
            let speeds = own.model.joints_of_v(&self.state.v[own.v()]).iter();
            let limits = self.joints[own.joints()].iter().map(|joint| joint.velocity_limit);
            speeds.zip(limits).filter(|(v, limit)| v.abs() > *limit).count()
        };
        self.articulations.iter().map(above).sum()
    }

    /// Returns an error if the next state, at the end of a step of `dt` \[s\], is no longer meaningful.
    pub(crate) fn verify(&self, dt: f64) -> Result<(), StepError> {
        self.articulations.iter().try_for_each(|own| self.verify_one(own, dt))
    }

    fn verify_one(&self, own: &Articulation, dt: f64) -> Result<(), StepError> {
        let State { q, q_next, v_next, tau_next, .. } = &self.state;
        let (v_next, first) = (&v_next[own.v()], own.drives.start);
        let (before, after) = (own.model.joints_of_q(&q[own.q()]), own.model.joints_of_q(&q_next[own.q()]));
        let v = own.model.joints_of_v(v_next);
        for (i, joint) in self.joints[own.joints()].iter().enumerate() {
            let bound = joint.divergence_bound();
            // Check the distance travelled as well: an engine may stop a joint that has already jumped.
            let travel = (after[i] - before[i]) / dt;
            // Written so that NaN fails the check.
            if !(v[i].abs() < bound && travel.abs() < bound && tau_next[first + i].is_finite()) {
                let velocity = if travel.abs() < bound { v[i] } else { travel };
                let (joint, name) = (own.joints.start + i, self.names[first + i].clone());
                return Err(StepError::Diverged { joint, name, velocity, bound });
            }
        }
        if own.model.base().floating {
            let linear = Vector3::from_column_slice(&v_next[..3]).norm();
            let angular = Vector3::from_column_slice(&v_next[3..6]).norm();
            if !(linear < BASE_BOUND.0 && angular < BASE_BOUND.1) {
                let mut frames = own.model.frames().iter();
                let base = frames.find(|frame| frame.body.is_none() && !frame.in_world);
                let base = base.map_or("base", |frame| &frame.name).to_owned();
                return Err(StepError::BaseDiverged { base, linear, angular });
            }
        }
        Ok(())
    }
}

/// Returns the pose of a floating base in the world.
pub(crate) fn base_pose(q: &[f64]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(q[6], q[3], q[4], q[5]));
    Isometry3::from_parts(Translation3::new(q[0], q[1], q[2]), rotation)
}

impl StepError {
    /// Creates the error for entry `index` of an articulation's velocity, which moves no inertia.
    pub(crate) fn singular(own: &Articulation, index: usize) -> Self {
        let model = own.model();
        let joint = index.saturating_sub(model.nv() - model.joint_count());
        let name = model.joint_names().get(joint).map_or("the base", String::as_str).to_owned();
        let joint = own.joints().start + joint;
        Self::SingularMassMatrix { joint, name }
    }
}
