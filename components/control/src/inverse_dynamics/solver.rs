//! The solver of the first level: active-set for friction pyramids, Clarabel for friction cones.

use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, ClarabelSettings, ClarabelSolver, Constraint, FrictionCone, Problem,
    QpSolver, Sides, Solution, SolveError, Structure, UpdateError,
};

use super::contact::ContactPlace;
use super::order::Order;

/// A solver for one friction model.
#[derive(Debug)]
pub(super) enum FirstLevel {
    Pyramids(Box<ActiveSetSolver>),
    Cones(Box<ClarabelSolver>),
}

/// Friction cones of the contact points; forces start at index `forces` of the unknowns.
pub(super) fn friction_cones(order: &Order, forces: usize) -> Vec<FrictionCone> {
    let cone = |point: usize| {
        let first = forces + 3 * point;
        FrictionCone { tangents: [first, first + 1], normal: first + 2 }
    };
    (0..order.points.len()).map(cone).collect()
}

/// Sets the coefficients of the cones; cones of inactive contacts are disabled.
pub(super) fn set_friction(solver: &mut ClarabelSolver, contacts: &[ContactPlace]) {
    for place in contacts {
        for point in 0..place.contact.points() {
            let friction = place.active.then_some(place.contact.friction);
            solver.set_friction(place.first_point + point, friction);
        }
    }
}

impl FirstLevel {
    /// Creates a solver for a problem with a four-sided pyramid for each contact point.
    pub(super) fn pyramids(structure: Structure) -> Self {
        Self::Pyramids(Box::new(ActiveSetSolver::new(structure, ActiveSetSettings::default())))
    }

    /// Creates a solver for the same problem with inactive pyramids and a cone for each contact point; forces
    /// start at index `forces` of the unknowns.
    pub(super) fn cones(structure: Structure, order: &Order, forces: usize) -> Self {
        let cones = friction_cones(order, forces);
        let solver = ClarabelSolver::with_cones(structure, cones, ClarabelSettings::default());
        Self::Cones(Box::new(solver))
    }

    /// Sides on which the faces of pyramids are bounded.
    pub(super) fn faces(cones: bool) -> Sides {
        if cones { Sides::Neither } else { Sides::Upper }
    }

    pub(super) fn update(&mut self, problem: &Problem, contacts: &[ContactPlace]) -> Result<(), UpdateError> {
        match self {
            Self::Pyramids(solver) => solver.update(problem),
            Self::Cones(solver) => {
                set_friction(solver, contacts);
                solver.update(problem)
            }
        }
    }

    /// The last solution.
    pub(super) fn solution(&self) -> &Solution {
        match self {
            Self::Pyramids(solver) => solver.solution(),
            Self::Cones(solver) => solver.solution(),
        }
    }

    /// Iterations of the last solve, with or without a solution.
    pub(super) fn iterations(&self) -> u32 {
        match self {
            Self::Pyramids(solver) => solver.iterations(),
            Self::Cones(solver) => solver.iterations(),
        }
    }

    /// Limits the iterations of the next solve. Clarabel has a separate limit.
    pub(super) fn set_max_iterations(&mut self, most: u32) {
        if let Self::Pyramids(solver) = self {
            solver.set_max_iterations(Some(most));
        }
    }

    /// Rows and bounds in the working set after the last solve, with their multipliers.
    pub(super) fn working_set(&self) -> impl Iterator<Item = (Constraint, f64)> {
        let solver = match self {
            Self::Pyramids(solver) => Some(solver),
            Self::Cones(_) => None,
        };
        solver.into_iter().flat_map(|solver| solver.working_set())
    }

    pub(super) fn solve(&mut self) -> Result<&Solution, SolveError> {
        match self {
            Self::Pyramids(solver) => solver.solve(),
            Self::Cones(solver) => solver.solve(),
        }
    }

    /// Calls `visit` with each inequality and cone that acts on the last solution.
    pub(super) fn visit_active(&self, visit: &mut dyn FnMut(Constraint)) {
        match self {
            Self::Pyramids(solver) => solver.solution().visit_active(visit),
            Self::Cones(solver) => solver.visit_active(visit),
        }
    }

    pub(super) fn reset(&mut self) {
        match self {
            Self::Pyramids(solver) => solver.reset(),
            Self::Cones(solver) => solver.reset(),
        }
    }
}
