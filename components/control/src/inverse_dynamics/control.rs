//! Assembly and solution of one tick of inverse dynamics.

use motorium_qp::{Problem, Sides, Structure};
use motorium_robots::{Dynamics, Model};
use nalgebra::{DMatrix, DVector};

use super::cone_level::LowerSolver;
use super::contact::ContactPlace;
use super::order::Order;
use super::outcome::{FrictionModel, InverseDynamicsSettings, InverseDynamicsSolution, Unknowns};
use super::predicted::{DynamicsRows, Predicted};
use super::reduced::Reduced;
use super::solver::FirstLevel;
use super::{JointAccelerationLimits, MotionState};
use crate::contact::{Contact, ContactShape, WrenchCone};
use crate::cost::Cost;
use crate::formulation::Task;
use crate::levels::{self, LowerLevels, Rows};
use crate::relaxation::{Relaxable, Relaxation};

/// Whole-body inverse dynamics: computes the accelerations and contact forces that minimise a weighted sum of
/// task costs within all constraints, and the resulting torques; see the [module](super). Only construction
/// allocates.
#[derive(Debug)]
pub struct InverseDynamics {
    pub(crate) settings: InverseDynamicsSettings,
    pub(crate) order: Order,
    pub(crate) contacts: Vec<ContactPlace>,
    pub(super) torque_limit: DVector<f64>,
    /// Largest acceleration of each joint.
    pub(super) acceleration_limit: DVector<f64>,
    pub(super) dynamics: Dynamics,
    pub(super) mass: DMatrix<f64>,
    pub(crate) bias: DVector<f64>,
    pub(super) weight: DVector<f64>,
    pub(crate) problem: Problem,
    structure: Structure,
    pub(super) solver: FirstLevel,
    pub(super) reduced: Option<Reduced>,
    pub(super) relaxed: Option<Relaxation>,
    pub(super) below: Option<LowerLevels<LowerSolver>>,
    /// Robot state at the next tick, if velocities are limited.
    pub(super) predicted: Option<Predicted>,
    /// Number of used rows of limits and constraint tasks.
    pub(super) next_limit: usize,
    pub(super) next_constrained: usize,
    /// Rows of the task that becomes a constraint.
    pub(super) constrained: Rows,
    /// Accelerations, then forces.
    pub(super) x: DVector<f64>,
    pub(super) solution: InverseDynamicsSolution,
}

impl InverseDynamics {
    /// Creates inverse dynamics for `model` on `contacts`, with default settings. All contacts are active.
    pub fn new(model: &Model, contacts: Vec<Contact>) -> Self {
        Self::with_settings(model, contacts, InverseDynamicsSettings::default())
    }

    /// Creates inverse dynamics for `model` on `contacts` with these settings. All contacts are active.
    pub fn with_settings(model: &Model, contacts: Vec<Contact>, settings: InverseDynamicsSettings) -> Self {
        Self::with_room(model, contacts, settings, DynamicsRows::default())
    }

    /// Creates inverse dynamics for `model` on `contacts` with these settings, and with row capacity for
    /// limits and constraint tasks.
    pub fn with_room(
        model: &Model,
        contacts: Vec<Contact>,
        settings: InverseDynamicsSettings,
        rows: DynamicsRows,
    ) -> Self {
        let (mut motions, mut points, mut places, mut wrenches) = (vec![], vec![], vec![], vec![]);
        for (index, mut contact) in contacts.into_iter().enumerate() {
            contact.wrench = contact.wrench.filter(|_| matches!(contact.shape, ContactShape::Sole { .. }));
            wrenches.extend(contact.wrench.iter().flat_map(|_| [index; WrenchCone::ROWS]));
            let (first_point, first_row) = (points.len(), motions.len());
            motions.extend((0..contact.rows()).map(|axis| (index, axis)));
            points.extend((0..contact.points()).map(|point| (index, point)));
            places.push(ContactPlace::new(contact, model, first_point, first_row));
        }
        let (nv, joints) = (model.nv(), model.joint_count());
        let DynamicsRows { constrained, limits } = rows;
        let base = nv - joints;
        let order = Order { base, velocities: nv, joints, motions, points, constrained, wrenches, limits };
        let cones = has_cones(&settings);
        let structure = |faces| {
            let mut structure = Structure::new(order.variables())
                .equalities(order.equalities())
                .rows(joints, Sides::Both)
                .rows(4 * order.points.len(), faces)
                .rows(order.wrenches.len() + order.limits, Sides::Both);
            for variable in order.base..order.variables() {
                structure = structure.bound(variable, Sides::Both);
            }
            structure
        };
        let relaxed = settings.relaxation.map(|weight| {
            let (bounds, rows) = (order.base..order.velocities, order.first_limit()..order.rows());
            let relaxable = Relaxable { first_equality: order.base, bounds, rows };
            Relaxation::new(&structure(Sides::Upper), relaxable, weight)
        });
        let structure = structure(FirstLevel::faces(cones));
        let (reduced, solved) = match Reduced::new(&order, &settings, cones) {
            Some((reduced, structure)) => (Some(reduced), structure),
            None => (None, structure.clone()),
        };
        let forces = if reduced.is_some() { 0 } else { order.velocities };
        Self {
            relaxed,
            torque_limit: model.effort_limit() * settings.torque_fraction,
            acceleration_limit: DVector::from_element(joints, f64::INFINITY),
            dynamics: Dynamics::new(model),
            mass: DMatrix::zeros(nv, nv),
            bias: DVector::zeros(nv),
            weight: DVector::zeros(nv),
            problem: Problem::new(&structure),
            structure,
            solver: match cones {
                true => FirstLevel::cones(solved, &order, forces),
                false => FirstLevel::pyramids(solved),
            },
            reduced,
            below: None,
            predicted: (limits > 0).then(|| Predicted::new(model, limits)),
            next_limit: 0,
            next_constrained: 0,
            constrained: Rows::new(order.variables(), constrained),
            x: DVector::zeros(order.variables()),
            solution: InverseDynamicsSolution {
                acceleration: DVector::zeros(nv),
                torque: DVector::zeros(joints),
                forces: DVector::zeros(3 * order.points.len()),
                slack: None,
                iterations: 0,
                undecided: 0,
                active: 0,
            },
            contacts: places,
            order,
            settings,
        }
    }

    /// Defines levels of strict priority, highest first. Each entry of `rows` is the row capacity of one
    /// level: the maximum total number of rows of its tasks ([`AccelerationTask::rows`]). A relaxed tick
    /// solves the first level only.
    #[must_use]
    pub fn levels(mut self, rows: &[usize]) -> Self {
        let cones = has_cones(&self.settings);
        let (order, structure, damping) = (&self.order, &self.structure, self.settings.damping);
        let solver = || LowerSolver::new(order, structure, cones);
        self.below = LowerLevels::new(order.variables(), order.equalities(), rows, damping, solver);
        self
    }

    /// Sets a separate regularisation per level, highest level first: the cost of accelerations and forces.
    /// Replaces [`InverseDynamicsSettings::damping`].
    ///
    /// # Panics
    /// If the number of entries differs from the number of levels.
    #[must_use]
    pub fn level_damping(mut self, damping: &[f64]) -> Self {
        self.settings.damping = levels::set_damping(&mut self.below, damping);
        self
    }

    /// Starts a tick of `dt` seconds without tasks: writes the equations of motion, contacts and limits at
    /// `state`.
    pub fn begin(&mut self, state: &MotionState<'_>, dt: f64) {
        self.pose(state, dt);
        let damping = self.settings.damping;
        let (forces, squared) = (self.order.velocities, self.settings.force_weight.powi(2));
        let regularise = |cost: &mut Problem| {
            for variable in forces..cost.gradient.len() {
                cost.hessian[(variable, variable)] += squared;
            }
        };
        self.problem.hessian.fill(0.0);
        self.problem.hessian.fill_diagonal(damping);
        self.problem.gradient.fill(0.0);
        regularise(&mut self.problem);
        if let Some(below) = &mut self.below {
            below.begin();
            let held = self.order.equalities() - self.order.constrained;
            // accelerations alone do not involve the equations of motion
            let first = if self.settings.unknowns == Unknowns::Accelerations { self.order.base } else { 0 };
            for row in self.problem.equality_matrix.rows(first, held - first).row_iter() {
                below.first.push(0.0).iter_mut().zip(row.iter()).for_each(|(to, from)| *to = *from);
            }
            below.costs_mut().for_each(regularise);
        }
    }

    /// Updates `task` at `state` and adds its cost to a level; level 0 has the highest priority.
    ///
    /// # Panics
    /// If the level does not exist, or the rows of its tasks exceed the capacity of the level.
    pub fn add_task(&mut self, state: &MotionState<'_>, level: usize, task: &mut dyn AccelerationTask) {
        task.update(state, self);
        let (cost, rows) = levels::level(&mut self.below, &mut self.problem, level);
        task.cost().add_to(cost);
        if let Some(rows) = rows {
            task.cost().write_rows(rows);
        }
    }

    /// Writes the accelerations, forces and torques of `x` to the solution.
    pub(super) fn write(&mut self) {
        let Self { order, x, solution, problem, bias, torque_limit, .. } = self;
        solution.acceleration.copy_from(&x.rows(0, order.velocities));
        solution.forces.copy_from(&x.rows(order.velocities, 3 * order.points.len()));
        solution.torque.copy_from(&bias.rows(order.base, order.joints));
        for (column, x) in problem.row_matrix.column_iter().zip(x.iter()).filter(|(_, x)| **x != 0.0) {
            for (torque, entry) in solution.torque.iter_mut().zip(column.iter()) {
                *torque += entry * x;
            }
        }
        for (torque, limit) in solution.torque.iter_mut().zip(torque_limit.iter()) {
            *torque = torque.max(-limit).min(*limit);
        }
    }

    /// Returns the solution of the last [`solve`](Self::solve).
    pub fn solution(&self) -> &InverseDynamicsSolution {
        &self.solution
    }

    /// Returns the residual `|A x - b|` of a task in the last solution, over the rows with nonzero weight, in
    /// the units of the task \[m/s2, rad/s2, N\].
    pub fn residual(&self, task: &dyn AccelerationTask) -> f64 {
        task.cost().residual(self.x.as_slice())
    }

    /// Returns the unknowns of the last solution: accelerations, then contact forces.
    pub fn unknowns(&self) -> &[f64] {
        self.x.as_slice()
    }

    /// Replaces the [`solution`](Self::solution) by `unknowns`, such as a [mixture](crate::Mixture) of
    /// solutions, and updates the torques.
    pub fn set_unknowns(&mut self, unknowns: &[f64]) {
        self.x.copy_from_slice(unknowns);
        self.write();
    }

    /// Returns the number of unknowns: accelerations, then three numbers for each contact point.
    pub fn variables(&self) -> usize {
        self.order.variables()
    }

    /// Returns the mass matrix at the last [`begin`](Self::begin), nv x nv.
    pub fn mass(&self) -> &DMatrix<f64> {
        &self.mass
    }

    /// Returns the bias `C(q, v) v + g(q)` at the last [`begin`](Self::begin), of length nv. The bias
    /// includes the joint damping selected by the settings.
    pub fn bias(&self) -> &DVector<f64> {
        &self.bias
    }

    /// Returns the current quadratic program.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Returns the settings.
    pub fn settings(&self) -> &InverseDynamicsSettings {
        &self.settings
    }

    /// Changes the joint limits from the next [`begin`](Self::begin).
    pub fn set_joint_limits(&mut self, limits: JointAccelerationLimits) {
        self.settings.joints = limits;
    }

    /// Calls `visit` with each inequality constraint that is active in the solution of the first level.
    pub fn visit_active(&self, visit: &mut dyn FnMut(super::ConstraintName)) {
        self.solver.visit_active(&mut |constraint| {
            let constraint = match &self.reduced {
                Some(reduced) => reduced.of_whole(&self.order, constraint),
                None => constraint,
            };
            if let Some(name) = self.order.name(constraint) {
                visit(name);
            }
        });
    }

    /// Clears the state of the previous tick. Call this at the start of an episode.
    pub fn reset(&mut self) {
        self.solver.reset();
        self.reduced.iter_mut().for_each(Reduced::reset);
        self.relaxed.iter_mut().for_each(Relaxation::reset);
        self.below.iter_mut().for_each(LowerLevels::reset);
    }
}

/// A cost on the unknowns `x = (a, f)` of [`InverseDynamics`]: `1/2 |W (A x - b)|^2`.
///
/// Every [`Task`] implements this trait as a cost on the accelerations:
///
/// ```text
/// A = J,   b = kp e + kd e' + nu' - J' v          kp e: no faster than the largest speeds
/// ```
pub trait AccelerationTask {
    /// Evaluates the error, `A` and `b` at `state`. [`begin`](InverseDynamics::begin) of `dynamics` must
    /// already have been called with the same state.
    fn update(&mut self, state: &MotionState<'_>, dynamics: &InverseDynamics);

    /// Returns the cost of the last update.
    fn cost(&self) -> &Cost;

    /// Returns the number of rows of `A`.
    fn rows(&self) -> usize {
        self.cost().rows()
    }
}

impl<T: Task + ?Sized> AccelerationTask for T {
    fn update(&mut self, state: &MotionState<'_>, dynamics: &InverseDynamics) {
        self.evaluate(&state.robot());
        self.differentiate(state);
        self.equation_mut().request_acceleration(dynamics.mass());
    }

    fn cost(&self) -> &Cost {
        self.equation().cost()
    }
}

/// Returns `true` if the first level has friction cones; accelerations alone have no forces.
fn has_cones(settings: &InverseDynamicsSettings) -> bool {
    settings.friction_model == FrictionModel::Cone && settings.unknowns != Unknowns::Accelerations
}
