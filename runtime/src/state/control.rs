//! Messages of controllers: diagnostics of one optimisation step.

#![allow(unsafe_code)] // a `Field` implementation that looks only at the used part of its arrays

use super::{Defect, Digest, Field, FieldLayout};

/// Maximum number of tasks in [`ControlDiagnostics`].
pub const MAX_TASKS: usize = 32;
/// Maximum number of active constraints listed in [`ControlDiagnostics`].
pub const MAX_ACTIVE: usize = 96;

crate::state_buffer! {
    @layout
    /// Diagnostics of one step of an optimisation-based controller: task residuals, active constraints,
    /// relaxations and solver statistics.
    ///
    /// `residual` has one entry per task, in the order of the configuration. `constraint`, `index` and `side`
    /// have one entry per active constraint: the kind of the constraint, the index of the limited joint or
    /// contact point, and the side of the limit.
    ///
    /// ```
    /// use motorium::state::ControlDiagnostics;
    ///
    /// let mut step = ControlDiagnostics::default();
    /// step.status = ControlDiagnostics::SOLVED;
    /// step.set_count(2);
    /// step.residual_mut()[0] = 0.02;
    /// step.push_active(ControlDiagnostics::TORQUE, 3, ControlDiagnostics::UPPER);
    /// assert_eq!((step.constraints, step.index()), (1, &[3][..]));
    /// ```
    pub struct ControlDiagnostics as "motorium.ControlDiagnostics" {
        count: u32,
        active: u32,
        /// Outcome of the step: `SOLVED`, `RELAXED` or `UNSOLVED`.
        pub status: u32,
        /// Number of solver iterations in the first priority level.
        pub iterations: u32,
        /// Number of priority levels, apart from the first, that the solver left unsolved.
        pub undecided: u32,
        /// Number of active constraints, including those that do not fit in the lists.
        pub constraints: u32,
        /// Solver time, ns; 0 in lockstep, where repeated runs must publish identical values.
        pub solve_time: u64,
        /// Largest violation of a contact's acceleration constraint, m/s^2 or rad/s^2; 0 without relaxation.
        pub contact_slack: f64,
        /// Largest violation of a joint's acceleration limits, rad/s^2 or m/s^2; 0 without relaxation.
        pub joint_slack: f64,
        residual: [f64; MAX_TASKS],
        constraint: [u32; MAX_ACTIVE],
        index: [u32; MAX_ACTIVE],
        side: [i32; MAX_ACTIVE],
    }
}

impl ControlDiagnostics {
    /// Status: all constraints are satisfied at minimum cost.
    pub const SOLVED: u32 = 1;
    /// Status: constraints contradict one another, and some were relaxed. The lists contain the conflicting
    /// constraints.
    pub const RELAXED: u32 = 2;
    /// Status: there is no solution. The lists contain the conflicting constraints, if any.
    pub const UNSOLVED: u32 = 3;

    /// Constraint: torque limit of the joint `index`.
    pub const TORQUE: u32 = 1;
    /// Constraint: friction of the contact point `index`, counted over all contacts. A sole has four points;
    /// each other contact has one point.
    pub const FRICTION: u32 = 2;
    /// Constraint: normal force of the contact point `index`, counted as in [`FRICTION`](Self::FRICTION). The
    /// force is at zero (`LOWER`) or at its maximum (`UPPER`).
    pub const FORCE: u32 = 3;
    /// Constraint: position, velocity or acceleration limit of the joint `index`.
    pub const JOINT: u32 = 4;
    /// Constraint: equation of motion of a floating base. `index` 0 to 2 is the force along x, y, z, and 3 to
    /// 5 the torque about them.
    pub const BASE: u32 = 5;
    /// Constraint: a contact that must not accelerate. `index` is six times the contact's index, plus 0 to 2
    /// for motion along x, y, z, or 3 to 5 for rotation about them.
    pub const MOTION: u32 = 6;
    /// Constraint: row `index` of the limits on linear combinations of velocities, in the order of the
    /// configuration.
    pub const ROW: u32 = 7;

    /// Side: the lower limit.
    pub const LOWER: i32 = -1;
    /// Side: the upper limit.
    pub const UPPER: i32 = 1;

    /// Returns the number of tasks, at most [`MAX_TASKS`].
    pub fn count(&self) -> usize {
        (self.count as usize).min(MAX_TASKS)
    }

    /// Sets the number of tasks. Added entries keep the content that the buffer had there before.
    ///
    /// # Panics
    /// If `count` exceeds [`MAX_TASKS`].
    pub fn set_count(&mut self, count: usize) {
        assert!(count <= MAX_TASKS, "{count} tasks, but a buffer holds {MAX_TASKS}");
        self.count = count as u32;
    }

    /// Returns the residual `|A x - b|` of each task, in the units of the task.
    pub fn residual(&self) -> &[f64] {
        &self.residual[..self.count()]
    }

    /// Returns mutable access to the residual `|A x - b|` of each task, in the units of the task.
    pub fn residual_mut(&mut self) -> &mut [f64] {
        let count = self.count();
        &mut self.residual[..count]
    }

    /// Appends an active constraint. Beyond [`MAX_ACTIVE`], constraints are counted but not listed.
    pub fn push_active(&mut self, constraint: u32, index: usize, side: i32) {
        self.constraints = self.constraints.saturating_add(1);
        let place = self.active as usize;
        if place < MAX_ACTIVE {
            self.constraint[place] = constraint;
            self.index[place] = index as u32;
            self.side[place] = side;
            self.active += 1;
        }
    }

    /// Removes all active constraints.
    pub fn clear_active(&mut self) {
        (self.active, self.constraints) = (0, 0);
    }

    /// Returns the number of listed constraints.
    fn listed(&self) -> usize {
        (self.active as usize).min(MAX_ACTIVE)
    }

    /// Returns the kind of each active constraint, such as [`TORQUE`](Self::TORQUE).
    pub fn constraint(&self) -> &[u32] {
        &self.constraint[..self.listed()]
    }

    /// Returns the index of the joint, contact point or row that each active constraint limits.
    pub fn index(&self) -> &[u32] {
        &self.index[..self.listed()]
    }

    /// Returns the side of each active constraint: `LOWER`, `UPPER`, or 0 for one-sided constraints.
    pub fn side(&self) -> &[i32] {
        &self.side[..self.listed()]
    }
}

// SAFETY: `repr(C)`, and every field is itself a `Field`.
unsafe impl Field for ControlDiagnostics {
    const ZERO: Self = Self {
        count: 0,
        active: 0,
        status: 0,
        iterations: 0,
        undecided: 0,
        constraints: 0,
        solve_time: 0,
        contact_slack: 0.0,
        joint_slack: 0.0,
        residual: [0.0; MAX_TASKS],
        constraint: [0; MAX_ACTIVE],
        index: [0; MAX_ACTIVE],
        side: [0; MAX_ACTIVE],
    };

    fn describe(prefix: &str, offset: usize, out: &mut Vec<FieldLayout>) {
        let first = out.len();
        crate::state_buffer!(@describe ControlDiagnostics, prefix, offset, out,
            count: u32, active: u32, status: u32, iterations: u32, undecided: u32, constraints: u32, solve_time: u64,
            contact_slack: f64, joint_slack: f64, residual: [f64; MAX_TASKS], constraint: [u32; MAX_ACTIVE],
            index: [u32; MAX_ACTIVE], side: [i32; MAX_ACTIVE]);
        let path = |name: &str| match prefix {
            "" => name.to_string(),
            prefix => format!("{prefix}.{name}"),
        };
        for (array, count) in
            [("residual", "count"), ("constraint", "active"), ("index", "active"), ("side", "active")]
        {
            for field in out[first..].iter_mut().filter(|field| field.name == path(array)) {
                field.count = Some(path(count));
            }
        }
    }

    fn check(&self) -> Result<(), Defect> {
        for (field, found, capacity) in
            [("count", self.count, MAX_TASKS), ("active", self.active, MAX_ACTIVE)]
        {
            let found = found as usize;
            if found > capacity {
                return Err(Defect::Count { field, found, capacity });
            }
        }
        self.contact_slack.check().map_err(|defect| defect.inside("contact_slack"))?;
        self.joint_slack.check().map_err(|defect| defect.inside("joint_slack"))?;
        f64::check_all(self.residual()).map_err(|defect| defect.inside("residual"))
    }

    fn digest(&self, digest: &mut Digest) {
        let words = [self.count, self.active, self.status, self.iterations, self.undecided, self.constraints];
        words.iter().for_each(|word| digest.write_u64(u64::from(*word)));
        digest.write_u64(self.solve_time);
        self.contact_slack.digest(digest);
        self.joint_slack.digest(digest);
        f64::digest_all(self.residual(), digest);
        u32::digest_all(self.constraint(), digest);
        u32::digest_all(self.index(), digest);
        i32::digest_all(self.side(), digest);
    }
}
