//! The joint-space integrator: one step of the robot's motion with drives, friction and limit stops, all implicit.

use motorium_robots::{Dynamics, Model};
use nalgebra::{DMatrix, DVector, Quaternion, UnitQuaternion, Vector3};

use super::implicit::{GUESSES, ImplicitSolver, Singular, Start};
use super::laws::Mode;
use crate::JointCommand;
use crate::contact::ImpulseTarget;
use crate::joint::JointProperties;

/// A joint-space integrator: it moves a robot that touches nothing by one integration step at a time.
///
/// Semi-implicit Euler, of first order, in the independent coordinates: mimic joints are exact, since they have no
/// coordinate of their own. A floating base comes first. The end velocity `v+` of a step of length h solves
///
/// ```text
/// M(q) (v+ - v) / h + C(q, v) v + g(q) = tau(q + h v+, v+) - D v+ + friction(v+) + stop(q + h v+)
/// q+ = q + h v+
/// ```
///
/// with the drive law `tau` of [`JointCommand`], viscous damping `D`, Coulomb friction that can hold, and inelastic
/// limit stops. A floating base moves on a straight line and turns about a fixed axis during the step; its velocity
/// is taken in axes that stand still meanwhile, so that its rotation alone changes no velocity.
///
/// Each term is a monotone function of its own `v+_i` and `M` is positive definite, so the solution exists and is
/// unique for any gains (a strictly convex problem). An active set finds it: a joint's drive is linear or saturated,
/// its friction sticks or slips, its stop holds or not; the linear system of the current modes is solved until its
/// solution confirms the modes. The modes of the last step are the first guess and nearly always right.
///
/// The drive acts at the end of the step, which damps it: a drive with Kp and Kd behaves as one with Kd + h Kp. A
/// drive without damping therefore comes to rest.
///
/// Nothing allocates after [`new`](Self::new).
///
/// # Example
///
/// ```
/// use std::path::Path;
/// use motorium_physics::{JointCommand, JointProperties, JointSpaceIntegrator};
/// use motorium_robots::load;
/// use nalgebra::Vector3;
///
/// let model = load("panda", Path::new("."))?.model;
/// let mut integrator = JointSpaceIntegrator::new(&model, JointProperties::of(&model, 0.0));
/// let (mut q, mut v) = (model.neutral(), vec![0.0; model.nv()]);
/// let commands = vec![JointCommand::default(); model.joint_count()];
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
}

/// Counts of joints on a limit at the end of an integration step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointEvents {
    /// Joints whose drive is at its effort limit.
    pub saturated: usize,
    /// Joints held by a limit stop.
    pub at_limit: usize,
}

impl JointSpaceIntegrator {
    /// A workspace for `model` with the passive properties `joints`, one per independent joint.
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
        }
    }

    /// Passive properties of the joints.
    pub fn joints(&self) -> &[JointProperties] {
        &self.joints
    }

    /// Takes over other passive properties, one set per independent joint.
    pub(crate) fn set_joints(&mut self, joints: &[JointProperties]) {
        self.joints.copy_from_slice(joints);
        self.bounds.iter_mut().zip(joints).for_each(|(bounds, joint)| *bounds = limits(joint));
    }

    /// Sets the lowest and the highest effort of the drive of a joint in the steps to come.
    pub(super) fn set_bounds(&mut self, joint: usize, bounds: [f64; 2]) {
        self.bounds[joint] = bounds;
    }

    /// Resets the modes of the last step, so that the next step depends on its arguments alone.
    pub fn forget(&mut self) {
        self.solver.forget();
    }

    /// The modes of the last step, with which the next begins.
    pub(crate) fn modes(&self) -> &[Mode] {
        self.solver.modes()
    }

    /// Goes back to earlier modes; `false` where they are those of another robot.
    pub(crate) fn set_modes(&mut self, modes: &[Mode]) -> bool {
        self.solver.set_modes(modes)
    }

    /// Advances `q` (nq) and `v` (nv) by `h` \[s\] and writes the efforts that the drives apply meanwhile to `tau`.
    /// `commands` and `tau` have one entry per independent joint.
    ///
    /// # Errors
    ///
    /// [`Singular`] when a joint moves no inertia; `q` and `v` are then as before, `tau` is unspecified.
    #[expect(
        clippy::too_many_arguments,
        reason = "a step maps (q, v, command) to (q, v, tau); bundling hides that"
    )]
    pub fn advance(
        &mut self,
        model: &Model,
        q: &mut [f64],
        v: &mut [f64],
        commands: &[JointCommand],
        gravity: Vector3<f64>,
        h: f64,
        tau: &mut [f64],
    ) -> Result<JointEvents, Singular> {
        self.begin(model, (&*q, &*v), commands, (gravity, &[]), h);
        let mut settled = false;
        for _ in 0..GUESSES {
            self.find_free(model, (&*q, &*v), h)?;
            settled = self.confirm(model, (&*q, &*v), h);
            if settled {
                break;
            }
        }
        Ok(self.finish(model, (q, v), (h, settled), tau))
    }

    /// Begins a step; `force` is a generalized force besides gravity (nv, or empty). Guesses follow, each
    /// [`find_free`](Self::find_free), impulses of contacts and [`confirm`](Self::confirm), then [`finish`](Self::finish).
    pub(super) fn begin(
        &mut self,
        model: &Model,
        (q, v): (&[f64], &[f64]),
        commands: &[JointCommand],
        (gravity, force): (Vector3<f64>, &[f64]),
        h: f64,
    ) {
        self.dynamics.bias(model, q, v, gravity, self.bias.as_mut_slice());
        for (bias, force) in self.bias.iter_mut().zip(force) {
            *bias -= force;
        }
        self.dynamics.crba(model, q, &mut self.mass);
        let offset = model.nv() - self.joints.len();
        for (index, joint) in self.joints.iter().enumerate() {
            self.mass[(offset + index, offset + index)] += joint.armature;
        }
        if model.base().floating {
            // In axes that stand still the base's velocity does not turn with it: remove the term of the turning axes.
            let turning = Vector3::from_column_slice(&v[3..6]).cross(&Vector3::from_column_slice(&v[..3]));
            for (row, bias) in self.bias.iter_mut().enumerate() {
                *bias -= (0..3).map(|column| self.mass[(row, column)] * turning[column]).sum::<f64>();
            }
        }
        let start = Start { q: model.joints_of_q(q), v, h, mass: &self.mass, bias: self.bias.as_slice() };
        self.solver.begin((&self.joints, commands, &self.bounds), &start);
    }

    /// The end velocity of the present modes without impulses of contacts.
    pub(super) fn find_free(
        &mut self,
        model: &Model,
        (q, v): (&[f64], &[f64]),
        h: f64,
    ) -> Result<(), Singular> {
        let start = Start { q: model.joints_of_q(q), v, h, mass: &self.mass, bias: self.bias.as_slice() };
        self.solver.solve_modes(&start, self.v_next.as_mut_slice())
    }

    /// True where the end velocity confirms the modes; otherwise the next guess has others.
    pub(super) fn confirm(&mut self, model: &Model, (q, v): (&[f64], &[f64]), h: f64) -> bool {
        let start = Start { q: model.joints_of_q(q), v, h, mass: &self.mass, bias: self.bias.as_slice() };
        self.solver.confirm(&start, self.v_next.as_mut_slice())
    }

    /// Ends a step: advances `q` and `v`, and writes the efforts of the drives. Modes that no guess confirmed
    /// (`settled` is false) are found by relaxation.
    pub(super) fn finish(
        &mut self,
        model: &Model,
        (q, v): (&mut [f64], &mut [f64]),
        (h, settled): (f64, bool),
        tau: &mut [f64],
    ) -> JointEvents {
        let x = self.v_next.as_mut_slice();
        if !settled {
            let start = Start { q: model.joints_of_q(q), v, h, mass: &self.mass, bias: self.bias.as_slice() };
            self.solver.relax(&start, x);
        }
        let events = self.solver.finish(x, tau);
        integrate_position(model, q, x, h);
        v.copy_from_slice(x);
        events
    }

    /// The end velocity as impulses of contacts move it.
    pub(super) fn target(&mut self) -> ImpulseTarget<'_> {
        let ImplicitSolver { factor, held, impulse, .. } = &mut self.solver;
        ImpulseTarget { factor, held, x: self.v_next.as_mut_slice(), impulse }
    }
}

/// Lowest and highest effort of the drive of a joint.
fn limits(joint: &JointProperties) -> [f64; 2] {
    let limit = joint.effort_limit.abs();
    [-limit, limit]
}

/// Advances `q` with the end velocity `x` by `h`. The base's part of `x` is turned from its axes at the start into
/// those at the end.
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
