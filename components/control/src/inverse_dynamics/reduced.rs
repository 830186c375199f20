//! Formulations with fewer unknowns: accelerations only, or contact forces only.

use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, Conflict, Constraint, Problem, QpSolver, Sides, SolveError, Structure,
};
use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use super::order::Order;
use super::outcome::{InverseDynamicsSettings, Unknowns};
use super::solver::FirstLevel;

/// The problem in fewer unknowns `z`, which determine all accelerations and forces: `x = offset + map z`.
///
/// ```text
/// accelerations alone   x = (a, 0)
/// forces alone          x = (a_b, 0, f),   a_b = M_b^-1 (J_b' f - h_b)   M_b: inertia with fixed joints
/// ```
#[derive(Debug)]
pub(super) struct Reduced {
    unknowns: Unknowns,
    /// Index of the first unknown kept.
    first: usize,
    map: DMatrix<f64>,
    offset: DVector<f64>,
    problem: Problem,
    /// `P` times a column of the map, and `P offset + q`.
    product: DVector<f64>,
    slope: DVector<f64>,
    forces: Option<ForcesOf>,
}

impl Reduced {
    /// Creates the reduced problem and its structure; `None` if all unknowns are kept.
    pub(super) fn new(
        order: &Order,
        settings: &InverseDynamicsSettings,
        cones: bool,
    ) -> Option<(Self, Structure)> {
        let forces = 3 * order.points.len();
        let (first, kept, structure) = match settings.unknowns {
            Unknowns::AccelerationsAndForces => return None,
            Unknowns::Accelerations => {
                let mut structure = Structure::new(order.velocities)
                    .equalities(order.motions.len() + order.constrained)
                    .rows(order.limits, Sides::Both);
                for variable in order.base..order.velocities {
                    structure = structure.bound(variable, Sides::Both);
                }
                (0, order.velocities, structure)
            }
            Unknowns::Forces => {
                let structure = Structure::new(forces)
                    .equalities(order.constrained)
                    .rows(order.joints, Sides::Both)
                    .rows(4 * order.points.len(), FirstLevel::faces(cones))
                    .rows(order.wrenches.len() + order.limits, Sides::Both)
                    .bounds(Sides::Both);
                (order.velocities, forces, structure)
            }
        };
        let variables = order.variables();
        let mut map = DMatrix::zeros(variables, kept);
        map.view_mut((first, 0), (kept, kept)).fill_with_identity();
        let distributes = settings.unknowns == Unknowns::Accelerations && forces > 0;
        let reduced = Self {
            unknowns: settings.unknowns,
            first,
            map,
            offset: DVector::zeros(variables),
            problem: Problem::new(&structure),
            product: DVector::zeros(variables),
            slope: DVector::zeros(variables),
            forces: distributes.then(|| ForcesOf::new(order, settings.force_weight)),
        };
        Some((reduced, structure))
    }

    /// The map whose columns span the motions available to all levels.
    pub(super) fn map(&self) -> &DMatrix<f64> {
        &self.map
    }

    /// Evaluates the map at a state: contact forces move the base of a robot whose joints rest.
    pub(super) fn update_map(&mut self, order: &Order, mass: &DMatrix<f64>, posed: &Problem) {
        if self.unknowns != Unknowns::Forces || order.base != 6 {
            return;
        }
        let of_base = Matrix6::from_fn(|row, column| mass[(row, column)]);
        // the inertia of a robot with a mass is positive definite
        let Some(factor) = of_base.cholesky() else { return };
        let response = |entries: &[f64]| factor.solve(&Vector6::from_column_slice(entries));
        for force in 0..self.map.ncols() {
            let equality = posed.equality_matrix.column(order.velocities + force);
            let moved = -response(&equality.as_slice()[..6]);
            self.map.view_mut((0, force), (6, 1)).copy_from(&moved);
        }
        let at_rest = response(&posed.equality_value.as_slice()[..6]);
        self.offset.rows_mut(0, 6).copy_from(&at_rest);
    }

    /// Writes the reduced problem of `posed`, and symmetrises the Hessian of `posed`.
    pub(super) fn pose(&mut self, order: &Order, posed: &mut Problem) -> &Problem {
        let Self { unknowns, first, map, offset, problem, product, slope, .. } = self;
        posed.hessian.fill_lower_triangle_with_upper_triangle();
        slope.copy_from(&posed.gradient);
        slope.gemv(1.0, &posed.hessian, &*offset, 1.0);
        // first equality and row of the reduced problem
        let (equality, row) = first_constraints(order, *unknowns);
        let (equalities, rows) = (problem.equality_matrix.nrows(), problem.row_matrix.nrows());
        for (j, direction) in map.column_iter().enumerate() {
            product.gemv(1.0, &posed.hessian, &direction, 0.0);
            for (i, other) in map.columns(0, j + 1).column_iter().enumerate() {
                problem.hessian[(i, j)] = other.dot(product);
            }
            problem.gradient[j] = direction.dot(slope);
            if equalities > 0 {
                let of = posed.equality_matrix.rows(equality, equalities);
                problem.equality_matrix.column_mut(j).gemv(1.0, &of, &direction, 0.0);
            }
            if rows > 0 {
                let of = posed.row_matrix.rows(row, rows);
                problem.row_matrix.column_mut(j).gemv(1.0, &of, &direction, 0.0);
            }
            problem.lower[j] = posed.lower[*first + j];
            problem.upper[j] = posed.upper[*first + j];
        }
        for place in 0..equalities {
            let moved: f64 =
                posed.equality_matrix.row(equality + place).iter().zip(&*offset).map(product_of).sum();
            problem.equality_value[place] = posed.equality_value[equality + place] - moved;
        }
        for place in 0..rows {
            let moved: f64 = posed.row_matrix.row(row + place).iter().zip(&*offset).map(product_of).sum();
            problem.row_lower[place] = posed.row_lower[row + place] - moved;
            problem.row_upper[place] = posed.row_upper[row + place] - moved;
        }
        problem
    }

    /// Expands a solution to all accelerations and forces.
    pub(super) fn expand(&self, found: &DVector<f64>, x: &mut DVector<f64>) {
        x.copy_from(&self.offset);
        x.gemv(1.0, &self.map, found, 1.0);
    }

    /// Iterations for the forces of the last tick, if they are not unknowns.
    pub(super) fn iterations(&self) -> u32 {
        self.forces.as_ref().map_or(0, |forces| forces.solver.iterations())
    }

    /// Computes the forces for the accelerations of `x`, if they are not unknowns, within `most` iterations.
    ///
    /// # Errors
    /// If the solver reached its limit.
    pub(super) fn distribute(
        &mut self,
        order: &Order,
        posed: &Problem,
        x: &mut DVector<f64>,
        most: u32,
    ) -> Result<(), SolveError> {
        match &mut self.forces {
            Some(forces) => {
                forces.solver.set_max_iterations(Some(most));
                forces.solve(order, posed, x)
            }
            None => Ok(()),
        }
    }

    /// Maps a constraint of the reduced problem to the full problem.
    pub(super) fn of_whole(&self, order: &Order, constraint: Constraint) -> Constraint {
        let (equality, row) = first_constraints(order, self.unknowns);
        match constraint {
            Constraint::Equality(number) => Constraint::Equality(number + equality),
            Constraint::Row(number, side) => Constraint::Row(number + row, side),
            Constraint::Bound(variable, side) => Constraint::Bound(variable + self.first, side),
            Constraint::Cone(point) => Constraint::Cone(point),
        }
    }

    /// Maps a conflict of the reduced problem to the full problem.
    pub(super) fn conflict(&self, order: &Order, conflict: &Conflict) -> Conflict {
        Conflict::new(conflict.constraints().map(|constraint| self.of_whole(order, constraint)))
    }

    pub(super) fn reset(&mut self) {
        if let Some(forces) = &mut self.forces {
            forces.solver.reset();
        }
    }
}

fn product_of((one, other): (&f64, &f64)) -> f64 {
    one * other
}

/// First equality and first row of the full problem that are in the reduced one.
fn first_constraints(order: &Order, unknowns: Unknowns) -> (usize, usize) {
    match unknowns {
        Unknowns::AccelerationsAndForces => (0, 0),
        Unknowns::Accelerations => (order.base, order.first_limit()),
        Unknowns::Forces => (order.base + order.motions.len(), 0),
    }
}

/// Contact forces for given accelerations:
///
/// ```text
/// minimise   1/2 |J_u' f - M_u a - h_u|^2 + 1/2 weight^2 |f|^2
/// subject to friction pyramids, wrenches of soles, forces that only push
/// ```
///
/// Zero force is always feasible, so there is always a solution.
#[derive(Debug)]
struct ForcesOf {
    weight: f64,
    problem: Problem,
    solver: ActiveSetSolver,
    /// `-M_u a - h_u`.
    missing: DVector<f64>,
}

impl ForcesOf {
    fn new(order: &Order, weight: f64) -> Self {
        let structure = Structure::new(3 * order.points.len())
            .rows(4 * order.points.len(), Sides::Upper)
            .rows(order.wrenches.len(), Sides::Both)
            .bounds(Sides::Both);
        Self {
            weight,
            problem: Problem::new(&structure),
            solver: ActiveSetSolver::new(structure, ActiveSetSettings::default()),
            missing: DVector::zeros(order.base),
        }
    }

    fn solve(&mut self, order: &Order, posed: &Problem, x: &mut DVector<f64>) -> Result<(), SolveError> {
        let Self { weight, problem, solver, missing } = self;
        let (first, forces, faces) = (order.velocities, 3 * order.points.len(), 4 * order.points.len());
        missing.copy_from(&posed.equality_value.rows(0, order.base));
        for (column, a) in posed.equality_matrix.column_iter().zip(x.iter()).take(first) {
            missing.axpy(-a, &column.rows(0, order.base), 1.0);
        }
        for j in 0..forces {
            let column = posed.equality_matrix.column(first + j);
            let column = column.rows(0, order.base);
            for i in 0..=j {
                let other = posed.equality_matrix.column(first + i);
                problem.hessian[(i, j)] = other.rows(0, order.base).dot(&column);
            }
            // a robot with a fixed base needs no contact forces
            problem.hessian[(j, j)] += weight.powi(2).max(1e-12);
            problem.gradient[j] = -column.dot(missing);
            problem.lower[j] = posed.lower[first + j];
            problem.upper[j] = posed.upper[first + j];
        }
        let rows = faces + order.wrenches.len();
        problem.row_matrix.copy_from(&posed.row_matrix.view((order.joints, first), (rows, forces)));
        for row in 0..rows {
            let lower = posed.row_lower[order.joints + row];
            problem.row_lower[row] = if row < faces { f64::NEG_INFINITY } else { lower.min(0.0) };
            problem.row_upper[row] = posed.row_upper[order.joints + row];
        }
        solver.update(problem).map_err(|_| SolveError::NotUpdated)?;
        x.rows_mut(first, forces).copy_from(&solver.solve()?.x);
        Ok(())
    }
}
