//! The robot alone, touching nothing: joint-space dynamics with drives, friction and limit stops, all implicit.

mod implicit;
mod joint;

use motorium_robots::{Dynamics, Model};
use nalgebra::{DMatrix, DVector, Quaternion, UnitQuaternion, Vector3};

pub use implicit::Singular;
pub(crate) use implicit::{Alone, Coupling};
use implicit::{ImplicitSolver, Start};
pub use joint::JointProperties;

use crate::JointCommand;

/// The motion of a robot that touches nothing, one step at a time.
///
/// Semi-implicit Euler in the independent coordinates (mimic joints are exact: they have no coordinate of their own), after
/// those of the base where it floats.
/// The end velocity `v+` solves
///
/// ```text
/// M(q) (v+ - v) / h + C(q, v) v + g(q) = tau(q + h v+, v+) - D v+ + friction(v+) + stop(q + h v+)
/// q+ = q + h v+
/// ```
///
/// A floating base moves on a straight line and turns about a fixed axis for the step; its velocity is taken in axes that
/// stand still meanwhile, so that turning by itself changes no velocity.
///
/// with the drive law of [`JointCommand`], viscous damping `D`, Coulomb friction that can hold, and inelastic limit
/// stops. Each term is a monotone function of its own `v+_i` and `M` is positive definite, so the solution exists and
/// is unique whatever the gains (a strictly convex problem). It is found by an active set: a joint's drive is linear or
/// saturated, its friction sticks or slips, its stop holds or not; the linear system of the current guess is solved
/// until the guess explains itself, usually at once, since the last step's answer is the first guess.
///
/// Nothing allocates after [`new`](Self::new).
#[derive(Clone, Debug)]
pub struct Articulated {
    joints: Vec<JointProperties>,
    dynamics: Dynamics,
    mass: DMatrix<f64>,
    bias: DVector<f64>,
    v_next: DVector<f64>,
    solver: ImplicitSolver,
}

/// What the step did to the joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointEvents {
    /// Joints whose drive is at its effort limit.
    pub saturated: usize,
    /// Joints held by a limit stop.
    pub at_limit: usize,
}

impl Articulated {
    /// A workspace for `model` with the passive properties `joints`, one per independent joint.
    pub fn new(model: &Model, joints: Vec<JointProperties>) -> Self {
        assert_eq!(joints.len(), model.joint_count(), "one set of properties per independent joint");
        let n = model.nv();
        Self {
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

    /// Forgets the modes of the last step, so that the next depends on its arguments alone.
    pub fn forget(&mut self) {
        self.solver.forget();
    }

    /// Moves `q` (nq) and `v` (nv) on by `h` \[s\] and gives the efforts `tau` the drives apply on the way; commands and
    /// efforts are one per independent joint.
    ///
    /// # Errors
    ///
    /// [`Singular`] when something that moves has no inertia; `q` and `v` are then as before, `tau` unspecified.
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
        self.advance_among(model, (q, v), commands, (gravity, &[]), h, &mut Alone, tau)
    }

    /// [`advance`](Self::advance) among things that push: `outside` is a generalized force besides gravity (nv, or
    /// empty), `coupling` answers the motion.
    #[expect(clippy::too_many_arguments, reason = "as advance")]
    pub(crate) fn advance_among(
        &mut self,
        model: &Model,
        (q, v): (&mut [f64], &mut [f64]),
        commands: &[JointCommand],
        (gravity, outside): (Vector3<f64>, &[f64]),
        h: f64,
        coupling: &mut impl Coupling,
        tau: &mut [f64],
    ) -> Result<JointEvents, Singular> {
        self.dynamics.bias(model, q, v, gravity, self.bias.as_mut_slice());
        for (bias, outside) in self.bias.iter_mut().zip(outside) {
            *bias -= outside;
        }
        self.dynamics.crba(model, q, &mut self.mass);
        let offset = model.nv() - self.joints.len();
        for (index, joint) in self.joints.iter().enumerate() {
            self.mass[(offset + index, offset + index)] += joint.armature;
        }
        if model.base().floating {
            // In axes that stand still the base's velocity does not turn with it: what the body's axes add goes.
            let turning = Vector3::from_column_slice(&v[3..6]).cross(&Vector3::from_column_slice(&v[..3]));
            for (row, bias) in self.bias.iter_mut().enumerate() {
                *bias -= (0..3).map(|column| self.mass[(row, column)] * turning[column]).sum::<f64>();
            }
        }
        let start = Start { q: model.joints_of_q(q), v, h, mass: &self.mass, bias: self.bias.as_slice() };
        let x = self.v_next.as_mut_slice();
        let events = self.solver.solve((&self.joints, commands), &start, coupling, x, tau)?;
        move_on(model, q, x, h);
        v.copy_from_slice(x);
        Ok(events)
    }
}

/// `q` after moving with the end velocity `x` for `h`; `x`, given in the base's axes of the start, comes out in those of the
/// end.
fn move_on(model: &Model, q: &mut [f64], x: &mut [f64], h: f64) {
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
