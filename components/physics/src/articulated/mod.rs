//! The robot alone, touching nothing: joint-space dynamics with drives, friction and limit stops, all implicit.

mod cholesky;
mod implicit;
mod joint;

use motorium_robots::{Dynamics, Model};
use nalgebra::{DMatrix, DVector, Vector3};

pub use implicit::Singular;
use implicit::{ImplicitSolver, Start};
pub use joint::JointProperties;

use crate::JointCommand;

/// The motion of a robot that touches nothing, one step at a time.
///
/// Semi-implicit Euler in the independent coordinates (mimic joints are exact: they have no coordinate of their own).
/// The end velocity `v+` solves
///
/// ```text
/// M(q) (v+ - v) / h + C(q, v) v + g(q) = tau(q + h v+, v+) - D v+ + friction(v+) + stop(q + h v+)
/// q+ = q + h v+
/// ```
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
        assert_eq!(joints.len(), model.nv(), "one set of properties per independent joint");
        let n = model.nv();
        Self {
            joints,
            dynamics: Dynamics::new(model),
            mass: DMatrix::zeros(n, n),
            bias: DVector::zeros(n),
            v_next: DVector::zeros(n),
            solver: ImplicitSolver::new(n),
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

    /// Moves `q` and `v` on by `h` \[s\] and gives the efforts `tau` the drives apply on the way. All vectors are nv long.
    ///
    /// # Errors
    ///
    /// [`Singular`] when some joint moves nothing that has inertia; `q` and `v` are then as before, `tau` unspecified.
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
        self.dynamics.bias(model, q, v, gravity, self.bias.as_mut_slice());
        self.dynamics.crba(model, q, &mut self.mass);
        for (index, joint) in self.joints.iter().enumerate() {
            self.mass[(index, index)] += joint.armature;
        }
        let start = Start { q, v, h, mass: &self.mass, bias: self.bias.as_slice() };
        let events = self.solver.solve(&self.joints, commands, &start, self.v_next.as_mut_slice(), tau)?;
        v.copy_from_slice(self.v_next.as_slice());
        for (q, v) in q.iter_mut().zip(v.iter()) {
            *q += h * v;
        }
        Ok(events)
    }
}
