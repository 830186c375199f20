//! The joint-space integrator: one step of the robot's motion with drives, friction and limit stops, all
//! implicit.

use motorium_robots::{Dynamics, Model};
use nalgebra::{DMatrix, DVector, Quaternion, UnitQuaternion, Vector3};

use super::events::JointEvents;
use super::implicit::{GUESSES, ImplicitSolver, Singular, Start};
use super::laws::Mode;
use crate::contact::ImpulseTarget;
use crate::joint::JointProperties;
use crate::{Integrator, JointSetpoint};

/// A joint-space integrator: advances a robot without contacts by one integration step at a time.
///
/// The default method is semi-implicit Euler, of first order, in the independent coordinates, floating base
/// first. Mimic joints are exact because they have no independent coordinate. The end velocity `v+` of a step
/// of length h solves
///
/// ```text
/// M(q) (v+ - v) / h + C(q, v) v + g(q) = tau(q + h v+, v+) - D v+ + friction(v+) + stop(q + h v+)
/// q+ = q + h v+
/// ```
///
/// with the drive law `tau` of [`JointSetpoint`] without its acceleration limit, viscous damping `D`, Coulomb
/// friction that can stick, and inelastic limit stops. During the step, a floating base translates along a
/// straight line and rotates about a fixed axis. The velocity of the base is expressed in axes that do not
/// rotate during the step, so rotation alone does not change it.
///
/// Each term is a monotone function of its own `v+_i`, and `M` is positive definite. The problem is therefore
/// strictly convex and has a unique solution for any gains. An active set finds the solution. A joint's drive
/// is linear or saturated, its friction sticks or slips, and its stop is active or inactive. The linear
/// system of the current modes is solved repeatedly until its solution confirms the modes. The initial guess
/// is the modes of the last step, which are nearly always correct.
///
/// The drive law is evaluated at the end of the step, which adds damping: a drive with the gains Kp and Kd
/// behaves like a drive with the damping gain Kd + h Kp. A drive without damping therefore comes to rest.
///
/// [`Integrator::Midpoint`] is of second order. This method evaluates the inertia and the bias at the
/// midpoint of the step. The bias uses the mean of the velocities before and after the step:
///
/// ```text
/// q_m = q + h/2 v
/// M(q_m) (v+ - v) / h + C(q_m, v_m) v_m + g(q_m) = tau(q + h v+, v+) - D v+ + friction(v+)
/// v_m = (v + v+) / 2
/// q+ = q_m + h/2 v+
/// ```
///
/// with `v_m` from a first solution of the same step. Drives are still evaluated at the end of the step, so
/// gains of any size are stable. The effects of drives, damping and friction are therefore of first order. A
/// step in which a joint may reach its stop uses Euler's method for the whole robot.
///
/// Nothing allocates after [`new`](Self::new).
///
/// # Example
///
/// ```
/// use std::path::Path;
/// use motorium_physics::{JointSetpoint, JointProperties, JointSpaceIntegrator};
/// use motorium_robots::load;
/// use nalgebra::Vector3;
///
/// let model = load("panda", Path::new("."))?.model;
/// let mut integrator = JointSpaceIntegrator::new(&model, JointProperties::from_model(&model, 0.0));
/// let (mut q, mut v) = (model.neutral(), vec![0.0; model.nv()]);
/// let commands = vec![JointSetpoint::default(); model.joint_count()];
/// let mut tau = vec![0.0; model.joint_count()];
/// let gravity = Vector3::new(0.0, 0.0, -9.81);
/// integrator.advance(&model, &mut q, &mut v, &commands, gravity, 1e-3, &mut tau)?;
/// assert!(v.iter().any(|v| v.abs() > 1e-3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct JointSpaceIntegrator {
    joints: Vec<JointProperties>,
    /// Lowest and highest effort of each drive in the next step.
    bounds: Vec<[f64; 2]>,
    dynamics: Dynamics,
    mass: DMatrix<f64>,
    bias: DVector<f64>,
    v_next: DVector<f64>,
    solver: ImplicitSolver,
    /// Integration method of [`advance`](Self::advance).
    method: Integrator,
    /// True if the current step uses the midpoint rule, with the positions `q_middle` at its midpoint and the
    /// start velocities `v_middle`; a base's velocity is expressed in its axes at the midpoint.
    midway: bool,
    q_middle: Vec<f64>,
    v_middle: Vec<f64>,
    v_mean: Vec<f64>,
}

impl JointSpaceIntegrator {
    /// Creates an integrator for `model`. `joints` contains the passive properties of each independent joint.
    pub fn new(model: &Model, joints: Vec<JointProperties>) -> Self {
        assert_eq!(joints.len(), model.joint_count(), "one set of properties per independent joint");
        let n = model.nv();
        Self {
            bounds: joints.iter().map(limits).collect(),
            joints,
            dynamics: Dynamics::new(model),
            mass: DMatrix::zeros(n, n),
            bias: DVector::zeros(n),
            v_next: DVector::zeros(n),
            solver: ImplicitSolver::new(model),
            method: Integrator::Euler,
            midway: false,
            q_middle: vec![0.0; model.nq()],
            v_middle: vec![0.0; n],
            v_mean: vec![0.0; n],
        }
    }

    /// Sets the integration method of [`advance`](Self::advance).
    pub fn with_method(self, method: Integrator) -> Self {
        Self { method, ..self }
    }

    /// Returns the passive properties of the joints.
    pub fn joints(&self) -> &[JointProperties] {
        &self.joints
    }

    /// Replaces the passive properties, one set per independent joint.
    pub(crate) fn set_joints(&mut self, joints: &[JointProperties]) {
        self.joints.copy_from_slice(joints);
        self.bounds.iter_mut().zip(joints).for_each(|(bounds, joint)| *bounds = limits(joint));
    }

    /// Sets the lowest and the highest effort of a joint's drive for the following steps.
    pub(super) fn set_bounds(&mut self, joint: usize, bounds: [f64; 2]) {
        self.bounds[joint] = bounds;
    }

    /// Forgets the modes of the last step, which would be the initial guess for the next step. The next step
    /// then depends only on its arguments.
    pub fn forget(&mut self) {
        self.solver.forget();
    }

    /// Returns one entry per joint: true if its acceleration limit changed its effort in the last step.
    pub(super) fn restrained(&self) -> &[bool] {
        self.solver.restrained()
    }

    /// Returns the modes of the last step, which start the next one.
    pub(crate) fn modes(&self) -> &[Mode] {
        self.solver.modes()
    }

    /// Restores earlier modes. Returns `false` if they are from a different robot.
    pub(crate) fn set_modes(&mut self, modes: &[Mode]) -> bool {
        self.solver.set_modes(modes)
    }

    /// Advances `q` (nq) and `v` (nv) by `h` \[s\]. Writes to `tau` the efforts that the drives apply during
    /// the step. `commands` and `tau` have one entry per independent joint.
    ///
    /// # Errors
    ///
    /// [`Singular`] if a joint moves no inertia. `q` and `v` are then unchanged, and `tau` is unspecified.
    pub fn advance(
        &mut self,
        model: &Model,
        q: &mut [f64],
        v: &mut [f64],
        commands: &[JointSetpoint],
        gravity: Vector3<f64>,
        h: f64,
        tau: &mut [f64],
    ) -> Result<JointEvents, Singular> {
        self.begin(model, (&*q, &*v), commands, (gravity, &[]), (h, self.method, false));
        let mut settled = false;
        for _ in 0..GUESSES {
            self.find_free(model, (&*q, &*v), h)?;
            settled = self.confirm(model, (&*q, &*v), h, false);
            if settled {
                break;
            }
        }
        Ok(self.finish(model, (q, v), (h, settled), tau))
    }

    /// Begins a step. `force` is a generalized force in addition to gravity (nv, or empty). For each guess of
    /// the modes, the caller runs [`find_free`](Self::find_free), applies contact impulses and runs
    /// [`confirm`](Self::confirm). It then calls [`finish`](Self::finish). The acceleration limits of
    /// `commands` apply if the step is `restrained`.
    pub(super) fn begin(
        &mut self,
        model: &Model,
        (q, v): (&[f64], &[f64]),
        commands: &[JointSetpoint],
        forces: (Vector3<f64>, &[f64]),
        (h, method, restrained): (f64, Integrator, bool),
    ) {
        self.midway = method == Integrator::Midpoint && self.is_far_from_stops(model, (q, v), h);
        if self.midway {
            self.begin_midway(model, (q, v), commands, forces, (h, restrained));
            return;
        }
        self.assemble_mass(model, q);
        self.assemble_bias(model, (q, v), forces);
        let start = Start { q: model.joints_of_q(q), v, h, mass: &self.mass, bias: self.bias.as_slice() };
        self.solver.begin((&self.joints, commands, &self.bounds), (&start, restrained), None);
    }

    /// Begins a step of the midpoint rule. A first solution provides the mean velocity at which the bias of
    /// the step is evaluated.
    fn begin_midway(
        &mut self,
        model: &Model,
        (q, v): (&[f64], &[f64]),
        commands: &[JointSetpoint],
        forces: (Vector3<f64>, &[f64]),
        (h, restrained): (f64, bool),
    ) {
        let mut taken = [&mut self.q_middle, &mut self.v_middle, &mut self.v_mean].map(core::mem::take);
        let [q_middle, v_middle, v_mean] = &mut taken;
        q_middle.copy_from_slice(q);
        v_middle.copy_from_slice(v);
        integrate_position(model, q_middle, v_middle, 0.5 * h);
        self.assemble_mass(model, q_middle);
        self.assemble_bias(model, (q_middle, v_middle), forces);
        let (x, mass, bias) = (self.v_next.as_mut_slice(), &self.mass, self.bias.as_slice());
        let start = Start { q: model.joints_of_q(q), v: v_middle, h, mass, bias };
        let middle = Some(model.joints_of_q(q_middle));
        self.solver.begin((&self.joints, commands, &self.bounds), (&start, restrained), middle);
        for _ in 0..GUESSES {
            // A singular matrix is reported when the end velocity is computed.
            if self.solver.solve_modes(&start, x).is_err() || self.solver.confirm(&start, x) {
                break;
            }
        }
        for ((mean, before), after) in v_mean.iter_mut().zip(&*v_middle).zip(x) {
            *mean = 0.5 * (before + *after);
        }
        self.assemble_bias(model, (q_middle, v_mean), forces);
        [self.q_middle, self.v_middle, self.v_mean] = taken;
    }

    /// Returns `true` if no joint can reach a stop in the next step.
    fn is_far_from_stops(&self, model: &Model, (q, v): (&[f64], &[f64]), h: f64) -> bool {
        let states = model.joints_of_q(q).iter().zip(model.joints_of_v(v));
        self.joints.iter().zip(states).all(|(joint, (q, v))| {
            let reach = 2.0 * h * v.abs();
            q - joint.lower > reach && joint.upper - q > reach
        })
    }

    fn assemble_mass(&mut self, model: &Model, q: &[f64]) {
        self.dynamics.crba(model, q, &mut self.mass);
        let offset = model.nv() - self.joints.len();
        for (index, joint) in self.joints.iter().enumerate() {
            self.mass[(offset + index, offset + index)] += joint.armature;
        }
    }

    /// Computes the bias minus `force`. The mass matrix must already be assembled.
    fn assemble_bias(
        &mut self,
        model: &Model,
        (q, v): (&[f64], &[f64]),
        (gravity, force): (Vector3<f64>, &[f64]),
    ) {
        self.dynamics.bias(model, q, v, gravity, self.bias.as_mut_slice());
        for (bias, force) in self.bias.iter_mut().zip(force) {
            *bias -= force;
        }
        if model.base().floating {
            // In axes that do not rotate, the base's velocity does not turn with the base: remove the term of
            // the rotating axes.
            let turning = Vector3::from_column_slice(&v[3..6]).cross(&Vector3::from_column_slice(&v[..3]));
            for (row, bias) in self.bias.iter_mut().enumerate() {
                *bias -= (0..3).map(|column| self.mass[(row, column)] * turning[column]).sum::<f64>();
            }
        }
    }

    /// Returns the linear momentum, and the angular momentum about the centre of mass, of a floating robot
    /// with the start velocity `v`, in base axes. Both are computed from the base rows of the mass matrix.
    /// Returns `None` in a midpoint step, which has a different mass matrix.
    pub(super) fn start_momentum(&self, v: &[f64]) -> Option<[Vector3<f64>; 2]> {
        if self.midway {
            return None;
        }
        let mut sum = [0.0; 6];
        for (column, v) in self.mass.as_slice().chunks_exact(v.len()).zip(v) {
            for (sum, entry) in sum.iter_mut().zip(column) {
                *sum += entry * v;
            }
        }
        let (linear, angular) = (Vector3::new(sum[0], sum[1], sum[2]), Vector3::new(sum[3], sum[4], sum[5]));
        // The block that couples force and rotation is the first moment of mass.
        let moment = Vector3::new(self.mass[(5, 1)], self.mass[(3, 2)], self.mass[(4, 0)]);
        Some([linear, angular - moment.cross(&linear) / self.mass[(0, 0)]])
    }

    /// Computes the end velocity for the current modes without contact impulses.
    pub(super) fn find_free(
        &mut self,
        model: &Model,
        (q, v): (&[f64], &[f64]),
        h: f64,
    ) -> Result<(), Singular> {
        let v = if self.midway { &self.v_middle } else { v };
        let start = Start { q: model.joints_of_q(q), v, h, mass: &self.mass, bias: self.bias.as_slice() };
        self.solver.solve_modes(&start, self.v_next.as_mut_slice())
    }

    /// Returns `true` if the end velocity confirms the modes; otherwise the next guess uses different ones,
    /// with `secants` of the drives.
    pub(super) fn confirm(&mut self, model: &Model, (q, v): (&[f64], &[f64]), h: f64, secants: bool) -> bool {
        let v = if self.midway { &self.v_middle } else { v };
        let start = Start { q: model.joints_of_q(q), v, h, mass: &self.mass, bias: self.bias.as_slice() };
        let x = self.v_next.as_mut_slice();
        if secants { self.solver.confirm_secants(&start, x) } else { self.solver.confirm(&start, x) }
    }

    /// Ends a step: advances `q` and `v`, and writes the efforts of the drives. If no guess confirmed its
    /// modes (`settled` is false), relaxation finds them.
    pub(super) fn finish(
        &mut self,
        model: &Model,
        (q, v): (&mut [f64], &mut [f64]),
        (h, settled): (f64, bool),
        tau: &mut [f64],
    ) -> JointEvents {
        let x = self.v_next.as_mut_slice();
        let before = if self.midway { self.v_middle.as_slice() } else { &*v };
        let (mass, bias) = (&self.mass, self.bias.as_slice());
        let start = Start { q: model.joints_of_q(q), v: before, h, mass, bias };
        if !settled {
            self.solver.relax(&start, x);
        }
        self.solver.leave_secants(x);
        let events = self.solver.finish(&start, x, tau);
        if self.midway {
            q.copy_from_slice(&self.q_middle);
            integrate_position(model, q, x, 0.5 * h);
        } else {
            integrate_position(model, q, x, h);
        }
        v.copy_from_slice(x);
        events
    }

    /// Begins a step in which the robot keeps its velocity `v` regardless of all forces.
    pub(super) fn hold(&mut self, v: &[f64]) {
        self.v_next.as_mut_slice().copy_from_slice(v);
        self.solver.hold();
    }

    /// Ends a step begun by [`hold`](Self::hold): advances `q` along `v`.
    pub(super) fn finish_held(model: &Model, (q, v): (&mut [f64], &mut [f64]), h: f64) {
        integrate_position(model, q, v, h);
    }

    /// Returns the end velocity as a target of contact impulses.
    pub(super) fn target(&mut self) -> ImpulseTarget<'_> {
        let ImplicitSolver { factor, held, impulse, .. } = &mut self.solver;
        ImpulseTarget { factor, held, x: self.v_next.as_mut_slice(), impulse }
    }
}

/// Returns the lowest and highest effort of a joint's drive.
fn limits(joint: &JointProperties) -> [f64; 2] {
    let limit = joint.effort_limit.abs();
    [-limit, limit]
}

/// Advances `q` with the end velocity `x` by `h`. Rotates the base's part of `x` from its axes at the start
/// into its axes at the end.
fn integrate_position(model: &Model, q: &mut [f64], x: &mut [f64], h: f64) {
    let (offset, base) = (model.nq() - model.joint_count(), model.nv() - model.joint_count());
    for (q, x) in q[offset..].iter_mut().zip(&x[base..]) {
        *q += h * x;
    }
    if !model.base().floating {
        return;
    }
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[6], q[3], q[4], q[5]));
    let linear = Vector3::from_column_slice(&x[..3]);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::from_column_slice(&x[3..6]) * h);
    for (q, moved) in q.iter_mut().zip((rotation * linear).iter()) {
        *q += h * moved;
    }
    let rotation = UnitQuaternion::new_normalize((rotation * turn).into_inner());
    q[3..7].copy_from_slice(rotation.coords.as_slice());
    x[..3].copy_from_slice((turn.inverse() * linear).as_slice());
}
