//! Report of contradictory constraints of inverse kinematics.

use motorium_qp::{Conflict, Constraint, QpSolver};

use super::DifferentialIk;
use crate::conflict::{Conflicting, ConstraintName};

/// A set of contradictory constraints, and the violation in the relaxed solution of the tick.
///
/// ```
/// use motorium_control::{DifferentialIk, IkRows, IkSettings, RobotState, tasks::{PostureSettings, PostureTask, VelocityTask}};
/// use motorium_control::{inverse_dynamics::ConstraintName, limits::VelocityLimit};
/// use motorium_robots::{Kinematics, load};
///
/// let panda = load("panda", std::path::Path::new("."))?;
/// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
/// let mut kinematics = Kinematics::new(model);
/// kinematics.update(model, home.as_slice());
/// let state = RobotState { model, kinematics: &kinematics, q: home.as_slice() };
/// // far away within a tick: no joint is as fast
/// let stiff = PostureSettings { gain: 500.0, weight: 1.0 };
/// let mut jump = PostureTask::new(model, &vec![-2.0; model.nv()]).with(stiff);
///
/// let rows = IkRows { held: jump.rows(), ..IkRows::default() };
/// let mut ik = DifferentialIk::with_room(model, rows, IkSettings { relaxation: Some(100.0), ..IkSettings::default() });
/// ik.begin();
/// ik.constrain(&state, &mut jump);
/// ik.add_limit(&state, &VelocityLimit::default(), 1e-3);
/// let fastest = ik.solve()?.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
/// assert!(fastest > 1.0 && fastest < 3.0, "as fast as the joints may");
/// let conflict = ik.conflict().expect("joints as fast as that are no robot's");
/// assert!(conflict.slack > 100.0);
/// assert!(conflict.constraints().any(|found| matches!(found, ConstraintName::Velocity { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkConflict {
    /// The constraints that contribute most to the conflict.
    pub names: Conflicting,
    /// Largest weighted violation of a relaxed row \[m/s or rad/s\]; 0 if the tick has no solution.
    pub slack: f64,
}

impl IkConflict {
    pub(super) fn new(conflict: &Conflict, motions: usize) -> Self {
        Self { names: conflict.constraints().filter_map(|found| name(found, motions)).collect(), slack: 0.0 }
    }

    /// Returns the constraints that contribute most to the conflict, strongest first.
    pub fn constraints(&self) -> impl Iterator<Item = ConstraintName> + '_ {
        self.names.names()
    }
}

/// Returns the name of a constraint in a problem with this number of velocities.
fn name(constraint: Constraint, motions: usize) -> Option<ConstraintName> {
    match constraint {
        Constraint::Equality(row) => Some(ConstraintName::Task { row }),
        Constraint::Row(row, side) => Some(ConstraintName::Limit { row, side }),
        Constraint::Bound(velocity, side) if velocity < motions => {
            Some(ConstraintName::Velocity { velocity, side })
        }
        Constraint::Bound(..) | Constraint::Cone(_) => None,
    }
}

impl<S: QpSolver> DifferentialIk<S> {
    /// Returns the contradictory constraints of the last [`solve`](Self::solve), or `None` if there was no
    /// conflict. The conflict is reported whether or not it was relaxed.
    pub fn conflict(&self) -> Option<&IkConflict> {
        self.conflict.as_ref()
    }
}

impl DifferentialIk {
    /// Calls `visit` with each limit that is active in the solution of the first level, except relaxed
    /// limits.
    pub fn visit_active(&self, visit: &mut dyn FnMut(ConstraintName)) {
        if self.conflict.is_some() {
            return;
        }
        self.solver.solution().visit_active(&mut |constraint| {
            if let Some(name) = name(constraint, self.motions) {
                visit(name);
            }
        });
    }
}
