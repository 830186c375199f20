//! Names of the constraints of inverse kinematics, and the outcome of contradictory ones.

use super::DifferentialIk;
use crate::solver::{Conflict, Constraint, QpSolver, Side};

/// One scalar constraint of inverse kinematics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum IkConstraint {
    /// Row of a held contact or of a constraint task.
    Held {
        /// Index among the rows of all of them, in order of addition.
        row: usize,
    },
    /// Row of a limit of velocities.
    Limit {
        /// Index among the rows of all limits, in order of addition.
        row: usize,
        /// Which side.
        side: Side,
    },
    /// Position or velocity limit of a joint, or a bound of the velocity of the base.
    Joint {
        /// Index of the velocity.
        velocity: usize,
        /// Which limit.
        side: Side,
    },
}

/// Contradictory constraints that no velocity satisfies, and the relaxed solution of the tick.
///
/// ```
/// use motorium_control::{DifferentialIk, IkConstraint, IkRows, IkSettings, RobotState, tasks::{PostureSettings, PostureTask, VelocityTask}};
/// use motorium_control::limits::VelocityLimit;
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
/// assert!(conflict.constraints().any(|found| matches!(found, IkConstraint::Joint { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkConflict {
    conflict: Conflict,
    motions: usize,
    /// Largest weighted violation of an exact row \[m/s or rad/s\]; 0 if the tick has no solution.
    pub slack: f64,
}

impl IkConflict {
    pub(super) fn new(conflict: Conflict, motions: usize) -> Self {
        Self { conflict, motions, slack: 0.0 }
    }

    /// Iterates over the constraints that contribute most to the conflict, strongest first.
    pub fn constraints(&self) -> impl Iterator<Item = IkConstraint> + '_ {
        self.conflict.constraints().filter_map(|constraint| match constraint {
            Constraint::Equality(row) => Some(IkConstraint::Held { row }),
            Constraint::Row(row, side) => Some(IkConstraint::Limit { row, side }),
            Constraint::Bound(velocity, side) if velocity < self.motions => {
                Some(IkConstraint::Joint { velocity, side })
            }
            Constraint::Bound(..) | Constraint::Cone(_) => None,
        })
    }
}

impl<S: QpSolver> DifferentialIk<S> {
    /// Returns the contradictory constraints of the last [`solve`](Self::solve), relaxed or not.
    pub fn conflict(&self) -> Option<&IkConflict> {
        self.conflict.as_ref()
    }
}
