//! Differential inverse kinematics: tasks and limits into one joint velocity.

use motorium_robots::Model;

use crate::{
    RobotState,
    limits::Limit,
    solver::{
        ActiveSetSettings, ActiveSetSolver, Problem, QpSolver, Sides, Solution, SolveError, Structure,
        UpdateError,
    },
    tasks::Task,
};

/// Settings of [`DifferentialIk`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkSettings {
    /// Tikhonov regularisation: cost of any joint velocity \[1/(rad/s)^2\]. Keeps the solution unique where the
    /// tasks leave a joint open.
    pub damping: f64,
}

impl Default for IkSettings {
    fn default() -> Self {
        Self { damping: 1e-7 }
    }
}

/// A tick without a joint velocity. The safe answer is to stand still.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IkError {
    /// The state, a target or a setting is not a number, or the limits cross.
    #[error("inverse kinematics cannot be posed: {0}")]
    Pose(#[from] UpdateError),
    /// The solver found no solution.
    #[error("inverse kinematics has no solution: {0}")]
    Solve(#[from] SolveError),
}

/// A differential inverse kinematics: the joint velocity `v` \[rad/s or m/s\] that minimises a weighted sum of task
/// costs within all limits.
///
/// ```text
/// minimise   sum_tasks 1/2 |W (A v - b)|^2 + 1/2 damping |v|^2
/// subject to lower <= v <= upper
/// ```
///
/// The unknown is the velocity, not the step `v dt`: steps are so small that a solver's absolute tolerances would be
/// as large as the limits.
#[derive(Debug)]
pub struct DifferentialIk<S = ActiveSetSolver> {
    settings: IkSettings,
    problem: Problem,
    solver: S,
    velocity: Vec<f64>,
}

impl DifferentialIk {
    /// For `model`, with default settings and the active-set solver.
    pub fn new(model: &Model) -> Self {
        let solver = ActiveSetSolver::new(Self::structure(model), ActiveSetSettings::default());
        Self::with_solver(solver, IkSettings::default())
    }

    /// The structure of the problem for `model`: one bounded unknown per independent joint.
    pub fn structure(model: &Model) -> Structure {
        Structure::new(model.nv()).bounds(Sides::Both)
    }
}

impl<S: QpSolver> DifferentialIk<S> {
    /// With a solver built for [`DifferentialIk::structure`].
    pub fn with_solver(solver: S, settings: IkSettings) -> Self {
        let problem = Problem::new(solver.structure());
        let velocity = vec![0.0; solver.structure().variables()];
        Self { settings, problem, solver, velocity }
    }

    /// Poses the problem of one tick of `dt` seconds: [`begin`](Self::begin), every task, every limit.
    pub fn assemble(
        &mut self,
        state: &RobotState<'_>,
        tasks: &mut [&mut dyn Task],
        limits: &[&dyn Limit],
        dt: f64,
    ) {
        self.begin();
        for task in tasks {
            self.add_task(state, *task);
        }
        for limit in limits {
            self.add_limit(state, *limit, dt);
        }
    }

    /// Starts a tick with no task and no limit.
    pub fn begin(&mut self) {
        self.problem.hessian.fill(0.0);
        self.problem.hessian.fill_diagonal(self.settings.damping);
        self.problem.gradient.fill(0.0);
        self.problem.lower.fill(f64::NEG_INFINITY);
        self.problem.upper.fill(f64::INFINITY);
    }

    /// Updates `task` at `state` and adds its cost.
    pub fn add_task(&mut self, state: &RobotState<'_>, task: &mut dyn Task) {
        task.update(state);
        task.add_to(&mut self.problem);
    }

    /// Intersects the bounds with those of `limit` for a tick of `dt` seconds.
    pub fn add_limit(&mut self, state: &RobotState<'_>, limit: &dyn Limit, dt: f64) {
        limit.intersect(state, dt, &mut self.problem);
    }

    /// Solves the posed problem and returns the joint velocity, exactly within its bounds.
    ///
    /// # Errors
    /// [`IkError`]; [`velocity`](Self::velocity) is zero then.
    pub fn solve(&mut self) -> Result<&[f64], IkError> {
        self.velocity.fill(0.0);
        self.solver.update(&self.problem)?;
        let Solution { x, .. } = self.solver.solve()?;
        for (joint, (v, x)) in self.velocity.iter_mut().zip(x.iter()).enumerate() {
            // an interior-point solution may touch a bound from outside by its tolerance
            *v = x.clamp(self.problem.lower[joint], self.problem.upper[joint]);
        }
        Ok(&self.velocity)
    }

    /// Forgets the tick before, at the beginning of an episode.
    pub fn reset(&mut self) {
        self.solver.reset();
        self.velocity.fill(0.0);
    }

    /// Joint velocity of the last [`solve`](Self::solve) \[rad/s or m/s\].
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// The problem as posed.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// The solver.
    pub fn solver(&self) -> &S {
        &self.solver
    }
}
