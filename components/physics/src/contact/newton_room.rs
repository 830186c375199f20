//! Memory of the Newton steps over all contact points.

/// Largest number of contact points of an island whose Delassus matrix is formed. The first applies to
/// islands with a robot, whose joints couple all of its points. The second applies to islands of free objects
/// only, which couple few. If free objects rest and their sweeps do not settle, the first applies to them,
/// too.
pub(super) const DENSE: usize = 60;
pub(super) const DENSE_FREE: usize = 12;

/// Largest number of unknowns of a Newton step; beyond it, sweeps cost less.
pub(super) const MOST_UNKNOWNS: usize = 3 * DENSE;

/// Workspace of the Newton steps.
#[derive(Clone, Debug)]
pub(super) struct Newton {
    /// Rows of the unknowns.
    pub(super) unknowns: Vec<usize>,
    /// Rows of the normals of points to be opened.
    pub(super) opening: Vec<usize>,
    pub(super) modes: Vec<Mode>,
    pub(super) system: Vec<f64>,
    pub(super) step: Vec<f64>,
    /// Impulses and velocities before the step.
    pub(super) lambda: Vec<f64>,
    pub(super) velocity: Vec<f64>,
}

/// The mode of a contact point under pressure.
#[derive(Clone, Copy, Debug)]
pub(super) enum Mode {
    /// Frictionless: its normal is the only unknown.
    Smooth,
    Stick,
    /// Direction and speed of the slip.
    Slip([f64; 2], f64),
    /// A connection: like a sticking point, but it may also pull.
    Held,
}

impl Newton {
    /// Creates a workspace for up to `most` contact points.
    pub(super) fn new(most: usize) -> Self {
        let rows = 3 * most;
        Self {
            unknowns: Vec::with_capacity(rows),
            opening: Vec::with_capacity(most),
            modes: Vec::with_capacity(most),
            system: vec![0.0; MOST_UNKNOWNS * MOST_UNKNOWNS],
            step: vec![0.0; rows],
            lambda: vec![0.0; rows],
            velocity: vec![0.0; rows],
        }
    }
}
