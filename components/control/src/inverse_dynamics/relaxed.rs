//! A tick with contradictory constraints: contacts and joint limits are relaxed.

use super::order::Order;
use super::outcome::{InverseDynamicsError, Slack};
use crate::solver::{
    ActiveSetSettings, ActiveSetSolver, Constraint, Problem, QpSolver, Sides, Solution, Structure,
};

/// The relaxed problem: contact motion and constraint tasks become costs, and limits of joints and velocities
/// get a slack `s` with the same cost.
///
/// ```text
/// minimise   (cost of the tasks) + 1/2 weight^2 |J_c a - b|^2 + 1/2 weight^2 |s|^2,   x = (a, f, s)
/// subject to M_u a - J_u' f = -h_u,  torque limits, friction, unilateral contact,  a_min <= a + s <= a_max
/// ```
///
/// Zero torques and forces are always feasible, since no sole has to be loaded. There is always a solution.
#[derive(Debug)]
pub(super) struct Relaxed {
    weight: f64,
    problem: Problem,
    solver: ActiveSetSolver,
    /// `true` if the previous tick was relaxed as well: its working set is the best initial guess.
    goes_on: bool,
}

impl Relaxed {
    pub(super) fn new(order: &Order, weight: f64) -> Self {
        let variables = order.variables();
        let mut structure = Structure::new(variables + order.joints + order.limits)
            .equalities(order.base)
            .rows(order.joints, Sides::Both)
            .rows(4 * order.points.len(), Sides::Upper)
            .rows(order.wrenches.len() + order.limits, Sides::Both)
            .rows(order.joints, Sides::Both);
        for variable in order.velocities..variables {
            structure = structure.bound(variable, Sides::Both);
        }
        let mut problem = Problem::new(&structure);
        for joint in 0..order.joints {
            problem.row_matrix[(order.rows() + joint, order.base + joint)] = 1.0;
            problem.row_matrix[(order.rows() + joint, variables + joint)] = 1.0;
            problem.hessian[(variables + joint, variables + joint)] = weight * weight;
        }
        for limit in 0..order.limits {
            let slack = variables + order.joints + limit;
            problem.row_matrix[(order.first_limit() + limit, slack)] = 1.0;
            problem.hessian[(slack, slack)] = weight * weight;
        }
        let solver = ActiveSetSolver::new(structure, ActiveSetSettings::default());
        Self { weight, problem, solver, goes_on: false }
    }

    /// Starts the solution of a tick within `most` iterations. After an unrelaxed tick, the initial working
    /// set is the one at which the contradiction was found.
    pub(super) fn begin(
        &mut self,
        order: &Order,
        active: impl Iterator<Item = (Constraint, f64)>,
        most: u32,
    ) {
        self.solver.set_max_iterations(Some(most));
        if std::mem::replace(&mut self.goes_on, true) {
            return;
        }
        let here = |constraint| match constraint {
            Constraint::Bound(variable, side) if variable < order.velocities => {
                Constraint::Row(order.rows() + variable - order.base, side)
            }
            constraint => constraint,
        };
        self.solver.warm_start(active.map(|(constraint, multiplier)| (here(constraint), multiplier)));
    }

    /// Records a tick without relaxation.
    pub(super) fn leave(&mut self) {
        self.goes_on = false;
    }

    /// The last solution: accelerations, forces, slacks.
    pub(super) fn solution(&self) -> &Solution {
        self.solver.solution()
    }

    /// Iterations of the last solve.
    pub(super) fn iterations(&self) -> u32 {
        self.solver.iterations()
    }

    /// Solves the relaxed form of `posed` and returns the violation, without the conflict.
    ///
    /// # Errors
    /// The numbers of the problem are of no use, or the solver reached its limit.
    pub(super) fn solve(&mut self, order: &Order, posed: &Problem) -> Result<Slack, InverseDynamicsError> {
        let (variables, rows, joints) = (order.variables(), order.rows(), order.joints);
        let problem = &mut self.problem;
        problem.hessian.view_mut((0, 0), (variables, variables)).copy_from(&posed.hessian);
        problem.gradient.rows_mut(0, variables).copy_from(&posed.gradient);
        problem
            .equality_matrix
            .columns_mut(0, variables)
            .copy_from(&posed.equality_matrix.rows(0, order.base));
        problem.equality_value.copy_from(&posed.equality_value.rows(0, order.base));
        problem.row_matrix.view_mut((0, 0), (rows, variables)).copy_from(&posed.row_matrix);
        problem.row_lower.rows_mut(0, rows).copy_from(&posed.row_lower);
        problem.row_upper.rows_mut(0, rows).copy_from(&posed.row_upper);
        for wrench in order.first_limit() - order.wrenches.len()..order.first_limit() {
            problem.row_lower[wrench] = problem.row_lower[wrench].min(0.0);
        }
        // friction cones become the inscribed pyramids that this solver supports
        for point in 0..order.points.len() {
            let normal = order.velocities + 3 * point + 2;
            if posed.upper[normal] > 0.0 {
                problem.row_upper.rows_mut(joints + 4 * point, 4).fill(0.0);
            }
        }
        problem.row_lower.rows_mut(rows, joints).copy_from(&posed.lower.rows(order.base, joints));
        problem.row_upper.rows_mut(rows, joints).copy_from(&posed.upper.rows(order.base, joints));
        for variable in order.velocities..variables {
            problem.lower[variable] = posed.lower[variable];
            problem.upper[variable] = posed.upper[variable];
        }
        // contact motion as a cost
        let squared = self.weight * self.weight;
        for row in order.base..order.equalities() {
            let (matrix, value) = (&posed.equality_matrix, posed.equality_value[row]);
            for j in 0..variables {
                let weighted = squared * matrix[(row, j)];
                if weighted == 0.0 {
                    continue;
                }
                problem.gradient[j] -= weighted * value;
                for i in 0..=j {
                    problem.hessian[(i, j)] += weighted * matrix[(row, i)];
                }
            }
        }
        self.solver.update(problem)?;
        let found = self.solver.solve().map_err(InverseDynamicsError::Solve)?;
        let mut slack = Slack::default();
        let tasks = order.equalities() - order.constrained;
        for row in order.base..order.equalities() {
            let entries = (0..variables).map(|j| posed.equality_matrix[(row, j)] * found.x[j]);
            let missed = (entries.sum::<f64>() - posed.equality_value[row]).abs();
            let of = if row < tasks { &mut slack.contact } else { &mut slack.task };
            *of = of.max(missed);
        }
        for joint in 0..joints {
            slack.joint = slack.joint.max(found.x[variables + joint].abs());
        }
        for limit in 0..order.limits {
            slack.limit = slack.limit.max(found.x[variables + joints + limit].abs());
        }
        Ok(slack)
    }

    pub(super) fn reset(&mut self) {
        self.solver.reset();
        self.goes_on = false;
    }
}
