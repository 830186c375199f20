//! Working memory of a solve.

use super::kernels::{Lower, padded};
use super::progress::Progress;
use super::working_set::{Member, WorkingSet};
use crate::Structure;

/// Working memory of a solve, except for the problem.
#[derive(Debug)]
pub(super) struct Work {
    /// Cholesky factor of the Hessian.
    pub(super) hessian: Lower,
    pub(super) working: WorkingSet,
    /// Number added to each diagonal entry of the Hessian; 0 if the Hessian is well conditioned.
    pub(super) shift: f64,
    /// Centre of the proximal term `shift / 2 |x - centre|^2`.
    pub(super) centre: Vec<f64>,
    /// `q - shift centre`.
    pub(super) gradient: Vec<f64>,
    /// `L^-1 gradient`.
    pub(super) g: Vec<f64>,
    pub(super) x: Vec<f64>,
    pub(super) residual: Vec<f64>,
    pub(super) gaps: Vec<f64>,
    /// `G x`.
    pub(super) rows: Vec<f64>,
    /// For each constraint, `true` if it is a member of the working set or implied by the members.
    pub(super) is_member: Vec<bool>,
    /// Constraints that the members imply.
    pub(super) implied: Vec<usize>,
    /// Members of the previous solve.
    pub(super) previous: Vec<Member>,
    pub(super) progress: Progress,
}

impl Work {
    /// Allocates the memory for problems of this structure.
    pub(super) fn new(structure: &Structure) -> Self {
        let n = structure.variables();
        let all = structure.equality_count() + structure.row_sides().len() + n;
        let row = || vec![0.0; padded(n)];
        Self {
            hessian: Lower::new(n),
            working: WorkingSet::new(n),
            shift: 0.0,
            centre: row(),
            gradient: row(),
            g: row(),
            x: row(),
            residual: row(),
            gaps: row(),
            rows: vec![0.0; structure.row_sides().len()],
            is_member: vec![false; all],
            implied: Vec::with_capacity(all),
            previous: Vec::with_capacity(n),
            progress: Progress::default(),
        }
    }
}
