//! A [`QpSolver`] based on Clarabel, an interior-point solver.
//!
//! Goulart and Chen, *Clarabel: An interior-point solver for conic programs with quadratic objectives*, 2024.
//! Clarabel needs about the same time for every active set, finds certificates of infeasibility and cannot be
//! warm-started. The solver object is built once; each update overwrites its numbers. This is safe for three
//! reasons:
//! - Presolve and zero-dropping are off.
//! - The sparsity pattern comes from the [`Structure`] alone, never from values, where an exact zero would
//!   shift every later entry.
//! - Scaling is done here for each problem, because Clarabel's own scaling is fixed by the first problem.

mod layout;
mod scaling;

use clarabel::solver::{DefaultSettings, DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus};

use super::{
    Accuracy, Conflict, Constraint, Problem, QpSolver, Solution, SolveError, Structure, UpdateError,
};
pub use layout::FrictionCone;
use layout::{Layout, Scaling};

/// Stopping criteria of Clarabel, which apply to the problem scaled to numbers around one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClarabelSettings {
    /// Maximum duality gap, absolute or relative. Default 1e-11.
    pub gap: f64,
    /// Maximum relative residual of the constraints and of stationarity. Default 1e-9.
    pub feasibility: f64,
    /// Maximum number of iterations. Default 50.
    pub max_iterations: u32,
    /// `true` refines each linear solve iteratively. Default true. This adds about a third to the time of a
    /// small problem. In return, residuals are up to a thousand times smaller, and nearly singular Hessians
    /// are handled robustly.
    pub refinement: bool,
}

impl Default for ClarabelSettings {
    fn default() -> Self {
        Self { gap: 1e-11, feasibility: 1e-9, max_iterations: 50, refinement: true }
    }
}

impl ClarabelSettings {
    /// Factor by which the tolerances are relaxed if rounding ends progress ([`Accuracy::Reduced`]).
    const REDUCED: f64 = 1e3;

    fn build(&self) -> DefaultSettings<f64> {
        DefaultSettingsBuilder::default()
            .max_iter(self.max_iterations)
            .verbose(false)
            .tol_gap_abs(self.gap)
            .tol_gap_rel(self.gap)
            .tol_feas(self.feasibility)
            .reduced_tol_gap_abs(self.gap * Self::REDUCED)
            .reduced_tol_gap_rel(self.gap * Self::REDUCED)
            .reduced_tol_feas(self.feasibility * Self::REDUCED)
            .equilibrate_enable(false)
            .iterative_refinement_enable(self.refinement)
            .max_threads(1)
            .direct_solve_method("qdldl".to_owned())
            .presolve_enable(false)
            .input_sparse_dropzeros(false)
            .build()
            .expect("every value is one the builder accepts")
    }
}

/// Relative distance to the surface of a cone at which a point counts as being on it.
const ON_CONE: f64 = 1e-4;

/// A [`QpSolver`] based on Clarabel, the only solver with friction cones.
///
/// An update overwrites the problem data in place. A solve makes one allocation: the timer table that
/// Clarabel 0.11 creates for each solve unconditionally.
///
/// ```
/// use motorium_qp::{ClarabelSettings, ClarabelSolver, FrictionCone, Problem, QpSolver, Structure};
///
/// // a force that pulls by (3, 4) along the ground, under 5 N and with a friction of 0.5
/// let structure = Structure::new(3).equalities(1);
/// let cone = FrictionCone { tangents: [0, 1], normal: 2 };
/// let mut problem = Problem::new(&structure);
/// problem.hessian.fill_with_identity();
/// problem.gradient.copy_from_slice(&[-3.0, -4.0, 0.0]);
/// problem.equality_matrix[(0, 2)] = 1.0;
/// problem.equality_value[0] = 5.0;
/// let mut solver = ClarabelSolver::with_cones(structure, vec![cone], ClarabelSettings::default());
/// solver.set_friction(0, Some(0.5));
/// solver.update(&problem)?;
/// // in the same direction, and no longer than 0.5 times 5 N
/// let force = &solver.solve()?.x;
/// assert!((force[0] - 1.5).abs() < 1e-6 && (force[1] - 2.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ClarabelSolver {
    structure: Structure,
    layout: Layout,
    scaling: Scaling,
    solver: DefaultSolver<f64>,
    hessian: Vec<f64>,
    gradient: Vec<f64>,
    constraints: Vec<f64>,
    limits: Vec<f64>,
    /// Coefficient of each friction cone; `None` if disabled.
    friction: Vec<Option<f64>>,
    solution: Solution,
    updated: bool,
}

impl ClarabelSolver {
    /// Builds the solver for `structure` without friction cones, allocates all memory and factors the
    /// sparsity pattern.
    pub fn new(structure: Structure, settings: ClarabelSettings) -> Self {
        Self::with_cones(structure, Vec::new(), settings)
    }

    /// Builds the solver for `structure` with the friction cones `cones`, allocates all memory and factors
    /// the sparsity pattern. Each cone is disabled until [`set_friction`](Self::set_friction) sets its
    /// coefficient.
    ///
    /// # Panics
    /// If a variable index is out of range or used by two cones.
    pub fn with_cones(structure: Structure, cones: Vec<FrictionCone>, settings: ClarabelSettings) -> Self {
        let friction = vec![None; cones.len()];
        let layout = Layout::new(&structure, cones);
        let scaling = Scaling::new(&layout);
        // a valid placeholder problem; the first update replaces it
        let hessian = layout.hessian_pattern();
        let constraints = layout.constraint_pattern();
        let gradient = vec![0.0; structure.variables()];
        let mut limits = vec![1.0; layout.constraint_count()];
        let conic = limits[layout.linear_count()..].chunks_exact_mut(3);
        conic.for_each(|cone| cone.copy_from_slice(&[1.0, 0.0, 0.0]));
        let mut solver =
            DefaultSolver::new(&hessian, &gradient, &constraints, &limits, &layout.cones(), settings.build())
                .expect("the layout is consistent and the settings are valid");
        // the first solve allocates more than any later one (tables of Clarabel's timers)
        solver.solve();
        Self {
            hessian: hessian.nzval,
            constraints: constraints.nzval,
            gradient,
            limits,
            friction,
            solution: Solution::new(&structure),
            solver,
            scaling,
            layout,
            structure,
            updated: false,
        }
    }

    /// Sets the coefficient of a friction cone (at least 0), effective from the next update. `None` disables
    /// the cone.
    ///
    /// # Panics
    /// If `cone` is out of range.
    pub fn set_friction(&mut self, cone: usize, friction: Option<f64>) {
        self.friction[cone] = friction.map(|friction| friction.max(0.0));
    }

    /// Returns the last solution found by [`solve`](QpSolver::solve).
    pub fn solution(&self) -> &Solution {
        &self.solution
    }

    /// Calls `visit` with each active inequality and cone. A constraint is active if its scaled multiplier
    /// exceeds its scaled distance to `x`. An interior-point method leaves neither quantity at exactly zero.
    pub fn visit_active(&self, visit: &mut dyn FnMut(Constraint)) {
        let found = &self.solver.solution;
        let (first, linear) = (self.structure.equality_count(), self.layout.linear_count());
        for row in (first..linear).filter(|row| found.z[*row] > found.s[*row]) {
            visit(self.layout.name(row));
        }
        for (cone, slack) in found.s[linear..].chunks_exact(3).enumerate() {
            let left = slack[0] - slack[1].hypot(slack[2]);
            if left < ON_CONE * slack[0] && found.z[linear + 3 * cone] > left {
                visit(Constraint::Cone(cone));
            }
        }
    }

    fn conflict(&self) -> Conflict {
        let certificate = &self.solver.solution.z;
        let mut taken = [usize::MAX; Conflict::CAPACITY];
        let mut strongest = 0.0;
        for slot in 0..taken.len() {
            // the first row of a cone has the largest multiplier
            let linear = self.layout.linear_count();
            let next = (0..certificate.len())
                .filter(|row| *row < linear || (row - linear).is_multiple_of(3))
                .filter(|row| !taken[..slot].contains(row))
                .max_by(|&a, &b| certificate[a].abs().total_cmp(&certificate[b].abs()));
            let Some(row) = next else { break };
            let weight = certificate[row].abs();
            strongest = f64::max(strongest, weight);
            // a multiplier below a hundredth is rounding or belongs to an irrelevant constraint
            if weight < 1e-2 * strongest {
                break;
            }
            taken[slot] = row;
        }
        Conflict::new(taken.into_iter().filter(|&row| row != usize::MAX).map(|row| self.layout.name(row)))
    }

    fn steepest(&self) -> usize {
        let direction = &self.solver.solution.x;
        (0..direction.len())
            .max_by(|&a, &b| direction[a].abs().total_cmp(&direction[b].abs()))
            .unwrap_or_default()
    }
}

impl QpSolver for ClarabelSolver {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn update(&mut self, problem: &Problem) -> Result<(), UpdateError> {
        self.updated = false;
        problem.check(&self.structure)?;
        self.scaling.fit(&self.layout, problem, &self.friction);
        self.layout.fill_hessian(problem, &self.scaling, &mut self.hessian);
        self.layout.fill_constraints(problem, &self.scaling, &mut self.constraints);
        self.layout.fill_limits(problem, &self.scaling, &mut self.limits);
        self.scaling.scale_gradient(problem, &mut self.gradient);
        self.solver
            .update_data(&self.hessian, &self.gradient, &self.constraints, &self.limits)
            .expect("presolve and zero-dropping are off and the vectors have the lengths of the pattern");
        self.updated = true;
        Ok(())
    }

    fn iterations(&self) -> u32 {
        self.solution.iterations
    }

    // No effect: no solve uses the previous solution.
    fn reset(&mut self) {}

    fn solve(&mut self) -> Result<&Solution, SolveError> {
        if !self.updated {
            return Err(SolveError::NotUpdated);
        }
        self.solver.solve();
        let found = &self.solver.solution;
        let iterations = found.iterations;
        self.solution.iterations = iterations;
        self.solution.accuracy = match found.status {
            SolverStatus::Solved => Accuracy::Full,
            SolverStatus::AlmostSolved => Accuracy::Reduced,
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                return Err(SolveError::Infeasible { conflict: self.conflict() });
            }
            SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => {
                return Err(SolveError::Unbounded { variable: self.steepest() });
            }
            SolverStatus::MaxIterations => return Err(SolveError::MaxIterations { iterations }),
            SolverStatus::Unsolved
            | SolverStatus::MaxTime
            | SolverStatus::NumericalError
            | SolverStatus::InsufficientProgress
            | SolverStatus::CallbackTerminated => return Err(SolveError::Numerical { iterations }),
        };
        self.layout.read(found, &self.scaling, &mut self.solution);
        if !self.solution.x.iter().all(|x| x.is_finite()) {
            return Err(SolveError::Numerical { iterations });
        }
        Ok(&self.solution)
    }
}

impl std::fmt::Debug for ClarabelSolver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ClarabelSolver")
            .field("structure", &self.structure)
            .field("solution", &self.solution)
            .finish_non_exhaustive()
    }
}
