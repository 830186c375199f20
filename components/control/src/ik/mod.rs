//! Differential inverse kinematics: computes one joint velocity from tasks and limits.

mod conflict;
mod constraints;
mod solve;

pub use conflict::IkConflict;

use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, Problem, QpSolver, Sides, SolveError, Structure, UpdateError,
};
use motorium_robots::Model;
use nalgebra::DVector;

use crate::{
    RobotState,
    levels::{self, LevelSolver, LowerLevels, Rows},
    limits::Limit,
    relaxation::{Relaxable, Relaxation},
    tasks::VelocityTask,
};

with_defaults! {
    /// Settings of [`DifferentialIk`].
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct IkSettings;

    /// Tikhonov regularisation: cost of any joint velocity \[1/(rad/s)^2\]. This cost makes the solution
    /// unique if the tasks leave a joint undetermined. Default 1e-7.
    pub damping: f64 = 1e-7;
    /// Weight of held contacts and constraint tasks if constraints are contradictory: cost of violating them
    /// \[1/(m/s) or 1/(rad/s)\]. Limits are never relaxed. With `None`, a tick with contradictory constraints
    /// has no solution. Default `None`.
    pub relaxation: Option<f64> = None;
}

/// Error returned when no joint velocity was found for a tick. The safe reaction is to stop.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IkError {
    /// The state, a target or a setting is not finite, or a lower limit exceeds an upper limit.
    #[error("the inverse kinematics problem is invalid: {0}")]
    Pose(#[from] UpdateError),
    /// The solver found no solution.
    #[error("inverse kinematics has no solution: {0}")]
    Solve(#[from] SolveError),
}

/// Differential inverse kinematics: computes the joint velocity `v` \[rad/s or m/s\] that minimises a
/// weighted sum of task costs within all limits.
///
/// ```text
/// minimise   sum_tasks 1/2 |W (A v - b)|^2 + 1/2 damping |v|^2
/// subject to lower <= v <= upper,   lower <= G v <= upper,   A_c v = b_c
/// ```
///
/// `A_c` contains the rows of [held](Self::hold) contacts, whose frames do not move, and of
/// [constraint](Self::constrain) tasks. Limits may also be [soft](Self::add_soft_limit), as tasks of any
/// level.
///
/// [`levels`](Self::levels) adds strict priorities: each level minimises its own sum over the velocities that
/// preserve `A v` of all higher levels.
///
/// The unknown is the velocity `v` rather than the step `v dt`, because the absolute tolerances of a solver
/// can be larger than the limits of a single step.
#[derive(Debug)]
pub struct DifferentialIk<S = ActiveSetSolver> {
    settings: IkSettings,
    problem: Problem,
    solver: S,
    velocity: Vec<f64>,
    below: Option<LowerLevels<LevelSolver>>,
    /// First unused row for limits.
    next_row: usize,
    /// First unused equality for contacts and tasks.
    next_equality: usize,
    /// Number of velocities; the following unknowns are violations of soft limits.
    motions: usize,
    /// First unused unknown for soft limits.
    next_slack: usize,
    /// Rows of the task that becomes a constraint.
    constrained: Rows,
    relaxed: Option<Relaxation>,
    conflict: Option<IkConflict>,
    /// Bounds without the acceleration limit, and whether it is set.
    wide_bounds: [DVector<f64>; 2],
    is_narrowed: bool,
    /// Velocities of the previous tick, if any.
    before: DVector<f64>,
    /// `true` if the last solution exceeds the acceleration limit.
    exceeds_acceleration: bool,
    /// For each row, `true` if its limit is soft.
    is_soft: Vec<bool>,
    /// Total iterations of the last solution, and the number of undecided levels below the first.
    iterations: u32,
    undecided: u32,
}

/// Row capacity of a [`DifferentialIk`], in addition to the bounds of the joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IkRows {
    /// Number of rows of held contacts and constraint tasks.
    pub held: usize,
    /// Number of rows of limits.
    pub limits: usize,
    /// Number of rows of soft limits.
    pub soft: usize,
}

impl DifferentialIk {
    /// Creates a solver for `model` with default settings and the active-set method.
    pub fn new(model: &Model) -> Self {
        let solver = ActiveSetSolver::new(Self::structure(model), ActiveSetSettings::default());
        Self::with_solver(solver, IkSettings::default())
    }

    /// Creates a solver for `model` with a capacity of `rows` limit rows, default settings and the active-set
    /// method.
    pub fn with_rows(model: &Model, rows: usize) -> Self {
        let structure = Self::structure(model).rows(rows, Sides::Both);
        let solver = ActiveSetSolver::new(structure, ActiveSetSettings::default());
        Self::with_solver(solver, IkSettings::default())
    }

    /// Creates a solver for `model` with capacities of `held` contact rows and `rows` limit rows, default
    /// settings and the active-set method.
    ///
    /// ```
    /// use motorium_control::tasks::{CentreOfMassTask, ContactTask, VelocityTask};
    /// use motorium_control::{DifferentialIk, RobotState};
    /// use motorium_robots::{Kinematics, load};
    /// use nalgebra::{DVector, Vector3};
    ///
    /// let humanoid = load("humanoid", std::path::Path::new("."))?;
    /// let (model, profile) = (&humanoid.model, humanoid.profile.unwrap());
    /// let q = profile.configuration(model, "standing")?;
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update(model, q.as_slice());
    /// let mut foot = ContactTask::surface(model, model.frame("left_sole")?);
    /// let mut balance = CentreOfMassTask::new(model);
    /// balance.set_target(kinematics.centre_of_mass(model).position - Vector3::new(0.0, 0.0, 0.05));
    ///
    /// let mut ik = DifferentialIk::with_contacts(model, foot.rows(), 0);
    /// let state = RobotState { model, kinematics: &kinematics, q: q.as_slice() };
    /// ik.begin();
    /// ik.hold(&state, &mut foot);
    /// ik.add_task(&state, 0, &mut balance);
    /// let velocity = DVector::from_column_slice(ik.solve()?);
    /// assert!((balance.jacobian() * &velocity).z < -0.1, "it squats");
    /// assert!(foot.cost().residual(velocity.as_slice()) < 1e-9, "on its foot");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn with_contacts(model: &Model, held: usize, rows: usize) -> Self {
        Self::with_room(model, IkRows { held, limits: rows, soft: 0 }, IkSettings::default())
    }

    /// Creates a solver for `model` with these row capacities and the active-set method.
    pub fn with_room(model: &Model, rows: IkRows, settings: IkSettings) -> Self {
        let IkRows { held, limits, soft } = rows;
        let structure = Structure::new(model.nv() + soft).bounds(Sides::Both);
        let structure = structure.equalities(held).rows(limits + soft, Sides::Both);
        let solver = ActiveSetSolver::new(structure, ActiveSetSettings::default());
        Self { motions: model.nv(), ..Self::with_solver(solver, settings) }
    }

    /// Returns the structure of the quadratic program for `model`: one bounded unknown per velocity,
    /// including the six velocities of a floating base.
    pub fn structure(model: &Model) -> Structure {
        Structure::new(model.nv()).bounds(Sides::Both)
    }
}

impl<S: QpSolver> DifferentialIk<S> {
    /// Creates inverse kinematics with a solver that was built for [`DifferentialIk::structure`].
    pub fn with_solver(solver: S, settings: IkSettings) -> Self {
        let problem = Problem::new(solver.structure());
        let variables = solver.structure().variables();
        Self {
            relaxed: settings.relaxation.map(|weight| {
                let relaxable = Relaxable { first_equality: 0, bounds: 0..0, rows: 0..0 };
                Relaxation::new(solver.structure(), relaxable, weight)
            }),
            conflict: None,
            wide_bounds: [DVector::zeros(variables), DVector::zeros(variables)],
            before: DVector::zeros(variables),
            is_narrowed: false,
            exceeds_acceleration: false,
            is_soft: vec![false; problem.row_lower.len()],
            iterations: 0,
            undecided: 0,
            settings,
            solver,
            velocity: vec![0.0; variables],
            below: None,
            next_row: 0,
            next_equality: 0,
            motions: variables,
            next_slack: variables,
            constrained: Rows::new(variables, problem.equality_value.len()),
            problem,
        }
    }

    /// Defines levels of strict priority, highest first. Each entry of `rows` is the row capacity of one
    /// level: the maximum total number of [`rows`](VelocityTask::rows) of its tasks and soft limits.
    ///
    /// ```
    /// use motorium_control::{DifferentialIk, RobotState, tasks::{CartesianTask, PostureTask, VelocityTask}};
    /// use motorium_robots::{Kinematics, load};
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update(model, home.as_slice());
    /// let mut hand = CartesianTask::new(model, model.frame("panda_hand_tcp")?);
    /// hand.set_target(kinematics.pose(model, hand.frame()));
    /// let mut posture = PostureTask::new(model, &vec![0.1; model.nv()]);
    ///
    /// let mut ik = DifferentialIk::new(model).levels(&[hand.rows(), posture.rows()]);
    /// let state = RobotState { model, kinematics: &kinematics, q: home.as_slice() };
    /// ik.begin();
    /// ik.add_task(&state, 0, &mut hand);
    /// ik.add_task(&state, 1, &mut posture);
    /// let velocity = nalgebra::DVector::from_column_slice(ik.solve()?);
    /// assert!(velocity.norm() > 0.01, "the elbow moves");
    /// assert!((hand.jacobian() * velocity).norm() < 1e-9, "the hand does not");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn levels(mut self, rows: &[usize]) -> Self {
        let (variables, row_count) = (self.velocity.len(), self.problem.row_lower.len());
        let (held, damping) = (self.problem.equality_value.len(), self.settings.damping);
        let solver = || LevelSolver::new(variables, row_count);
        self.below = LowerLevels::new(variables, held, rows, damping, solver);
        self
    }

    /// Sets a separate regularisation per level, highest level first: the cost of joint velocities
    /// \[1/(rad/s)^2\]. Replaces [`IkSettings::damping`].
    ///
    /// ```
    /// use motorium_control::{DifferentialIk, RobotState, tasks::{CartesianTask, PostureTask, VelocityTask}};
    /// use motorium_robots::{Kinematics, load};
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update(model, home.as_slice());
    /// let state = RobotState { model, kinematics: &kinematics, q: home.as_slice() };
    /// let mut elbow_speed = |damping: f64| {
    ///     let mut hand = CartesianTask::new(model, model.frame("panda_hand_tcp")?);
    ///     hand.set_target(kinematics.pose(model, hand.frame()));
    ///     let mut posture = PostureTask::new(model, &vec![0.1; model.nv()]);
    ///     let levels = [hand.rows(), posture.rows()];
    ///     let mut ik = DifferentialIk::new(model).levels(&levels).level_damping(&[1e-7, damping]);
    ///     ik.begin();
    ///     ik.add_task(&state, 0, &mut hand);
    ///     ik.add_task(&state, 1, &mut posture);
    ///     let speed = nalgebra::DVector::from_column_slice(ik.solve()?).norm();
    ///     Ok::<_, Box<dyn std::error::Error>>(speed)
    /// };
    /// // weight^2 / (weight^2 + damping) of the speed: by a half with as much damping as weight
    /// let weight = motorium_control::tasks::PostureSettings::default().weight;
    /// assert!((elbow_speed(weight * weight)? / elbow_speed(1e-12)? - 0.5).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    /// If the number of entries differs from the number of levels.
    #[must_use]
    pub fn level_damping(mut self, damping: &[f64]) -> Self {
        self.settings.damping = levels::set_damping(&mut self.below, damping);
        self
    }

    /// Builds the problem of one tick of `dt` seconds: calls [`begin`](Self::begin), adds every task to the
    /// first level, then adds every limit.
    pub fn assemble(
        &mut self,
        state: &RobotState<'_>,
        tasks: &mut [&mut dyn VelocityTask],
        limits: &[&dyn Limit],
        dt: f64,
    ) {
        self.begin();
        for task in tasks {
            self.add_task(state, 0, *task);
        }
        for limit in limits {
            self.add_limit(state, *limit, dt);
        }
    }

    /// Starts a tick without tasks or limits.
    pub fn begin(&mut self) {
        self.problem.hessian.fill(0.0);
        self.problem.hessian.fill_diagonal(self.settings.damping);
        self.problem.gradient.fill(0.0);
        self.problem.lower.fill(f64::NEG_INFINITY);
        self.problem.upper.fill(f64::INFINITY);
        self.problem.row_matrix.fill(0.0);
        self.problem.row_lower.fill(f64::NEG_INFINITY);
        self.problem.row_upper.fill(f64::INFINITY);
        self.problem.equality_matrix.fill(0.0);
        self.problem.equality_value.fill(0.0);
        (self.next_row, self.next_equality, self.next_slack) = (0, 0, self.motions);
        self.is_narrowed = false;
        self.is_soft.fill(false);
        if let Some(below) = &mut self.below {
            below.begin();
        }
    }

    /// Updates `task` at `state` and adds its cost to a level; level 0 has the highest priority.
    ///
    /// # Panics
    /// If the level does not exist, or the rows of its tasks exceed the capacity of the level.
    pub fn add_task(&mut self, state: &RobotState<'_>, level: usize, task: &mut dyn VelocityTask) {
        task.update(state);
        let (cost, rows) = levels::level(&mut self.below, &mut self.problem, level);
        task.add_to(cost);
        if let Some(rows) = rows {
            task.write_rows(rows);
        }
    }

    /// Clears the state of the previous tick. Call this at the start of an episode.
    pub fn reset(&mut self) {
        self.solver.reset();
        self.relaxed.iter_mut().for_each(Relaxation::reset);
        (self.conflict, self.exceeds_acceleration) = (None, false);
        (self.iterations, self.undecided) = (0, 0);
        self.below.iter_mut().for_each(LowerLevels::reset);
        self.velocity.fill(0.0);
    }

    /// Returns the joint velocity of the last [`solve`](Self::solve) \[rad/s or m/s\].
    pub fn velocity(&self) -> &[f64] {
        &self.velocity[..self.motions]
    }

    /// Returns the unknowns of the last solution: velocities, then the [`slack`](Self::slack) of soft limits.
    pub fn unknowns(&self) -> &[f64] {
        &self.velocity
    }

    /// Replaces the last solution by `unknowns`, such as a [mixture](crate::Mixture) of solutions.
    pub fn set_unknowns(&mut self, unknowns: &[f64]) {
        self.velocity.copy_from_slice(unknowns);
    }

    /// Returns the total number of iterations of the last [`solve`](Self::solve): all solutions of the first
    /// level, relaxed or not, and of the levels below.
    pub fn iterations(&self) -> u32 {
        self.iterations
    }

    /// Returns the number of levels below the first that the last [`solve`](Self::solve) left undecided
    /// because their solver found no solution. Undecided levels cause no motion; the solution of the levels
    /// above remains valid.
    pub fn undecided(&self) -> u32 {
        self.undecided
    }

    /// Returns the current quadratic program.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Returns the solver.
    pub fn solver(&self) -> &S {
        &self.solver
    }
}
