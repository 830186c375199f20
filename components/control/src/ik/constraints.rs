//! Constraints of one tick: held contacts, constraint tasks, limits and soft limits.

use motorium_qp::QpSolver;

use super::DifferentialIk;
use crate::{
    RobotState, levels,
    limits::{AccelerationLimit, Limit, LimitRows, RowLimit},
    tasks::{ContactTask, VelocityTask},
};

impl<S: QpSolver> DifferentialIk<S> {
    /// Updates `contact` at `state` and holds its frame still, as a constraint above all levels; the weight
    /// of the contact is ignored.
    ///
    /// # Panics
    /// If the total number of contact rows exceeds the capacity.
    pub fn hold(&mut self, state: &RobotState<'_>, contact: &mut ContactTask) {
        contact.update(state);
        let (first, count) = (self.next_equality, contact.rows());
        let held = self.problem.equality_value.len();
        assert!(first + count <= held, "contacts with more rows than the solver was built for");
        for (to, from) in (self.problem.equality_matrix.as_mut_slice().chunks_exact_mut(held))
            .zip(contact.cost().matrix().as_slice().chunks_exact(6))
        {
            to[first..first + count].copy_from_slice(&from[..count]);
        }
        if let Some(below) = &mut self.below {
            for row in 0..count {
                let entries = contact.cost().matrix().row(row);
                below.first.push(0.0).iter_mut().zip(entries.iter()).for_each(|(to, from)| *to = *from);
            }
        }
        self.next_equality += count;
    }

    /// Updates `task` at `state` and makes it a constraint above all levels: `A v = b` holds exactly for the
    /// rows with nonzero weight. If no velocity within the limits satisfies the task, the tick has no
    /// solution.
    ///
    /// ```
    /// use motorium_control::{DifferentialIk, IkRows, IkSettings, RobotState, tasks::{CartesianTask, PostureTask, VelocityTask}};
    /// use motorium_robots::{Kinematics, load};
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update(model, home.as_slice());
    /// let mut hand = CartesianTask::new(model, model.frame("panda_hand_tcp")?);
    /// hand.set_target(kinematics.pose(model, hand.frame()));
    /// let mut posture = PostureTask::new(model, &vec![0.1; model.nv()]);
    ///
    /// let rows = IkRows { held: hand.rows(), ..IkRows::default() };
    /// let mut ik = DifferentialIk::with_room(model, rows, IkSettings::default());
    /// let state = RobotState { model, kinematics: &kinematics, q: home.as_slice() };
    /// ik.begin();
    /// ik.constrain(&state, &mut hand);
    /// ik.add_task(&state, 0, &mut posture);
    /// let velocity = nalgebra::DVector::from_column_slice(ik.solve()?);
    /// assert!((hand.jacobian() * velocity).norm() < 1e-12, "the hand stays where it is");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    /// If the total number of rows of contacts and constraints exceeds the capacity.
    pub fn constrain(&mut self, state: &RobotState<'_>, task: &mut dyn VelocityTask) {
        task.update(state);
        self.constrained.clear();
        task.write_rows(&mut self.constrained);
        let first = self.next_equality;
        self.next_equality += task.rows();
        let held = self.problem.equality_value.len();
        assert!(self.next_equality <= held, "constraints with more rows than the solver was built for");
        levels::write_exact(&self.constrained, &mut self.problem, first, &mut self.below);
    }

    /// Adds the rows of `limit` for a tick of `dt` seconds as a soft limit of a level. Tasks on the same or a
    /// higher level may violate the limit by `s`, at the cost `1/2 weight^2 |s|^2` on its level.
    ///
    /// # Panics
    /// If the level does not exist, or the total number of soft rows exceeds the capacity.
    pub fn add_soft_limit(
        &mut self,
        state: &RobotState<'_>,
        level: usize,
        limit: &mut dyn RowLimit,
        weight: f64,
        dt: f64,
    ) {
        let (first, count) = (self.next_row, limit.rows());
        self.add_row_limit(state, limit, dt);
        self.is_soft[first..first + count].fill(true);
        let slack = self.next_slack;
        self.next_slack += count;
        assert!(
            self.next_slack <= self.velocity.len(),
            "soft limits with more rows than the solver was built for"
        );
        for place in 0..count {
            let variable = slack + place;
            self.problem.row_matrix[(first + place, variable)] = 1.0;
            let (cost, rows) = levels::level(&mut self.below, &mut self.problem, level);
            cost.hessian[(variable, variable)] += weight * weight;
            if let Some(rows) = rows {
                rows.push(0.0)[variable] = weight;
            }
        }
    }

    /// Returns the violations of the soft limits in the last [`solve`](Self::solve), one per row, in order of
    /// addition \[m/s or rad/s\].
    pub fn slack(&self) -> &[f64] {
        &self.velocity[self.motions..]
    }

    /// Narrows the bounds on the joint velocities to satisfy `limit` for a tick of `dt` seconds.
    pub fn add_limit(&mut self, state: &RobotState<'_>, limit: &dyn Limit, dt: f64) {
        limit.intersect(state, dt, &mut self.problem);
    }

    /// Narrows the bounds on the joint velocities by `limit` for a tick of `dt` seconds. Call this after
    /// adding all limits of positions and velocities. `before` are the velocities of the previous tick
    /// \[rad/s or m/s\]. If other constraints contradict this limit, it is dropped first, for this tick only.
    /// It is always dropped for braking joints, and for accelerating joints only if a contact or an exact
    /// task requires more acceleration.
    ///
    /// ```
    /// use motorium_control::tasks::{PostureSettings, PostureTask};
    /// use motorium_control::{DifferentialIk, SetpointIntegrator, RobotState};
    /// use motorium_control::limits::{AccelerationLimit, PositionLimit, VelocityLimit};
    /// use motorium_robots::{Kinematics, load};
    /// use nalgebra::DVector;
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update(model, home.as_slice());
    /// let state = RobotState { model, kinematics: &kinematics, q: home.as_slice() };
    /// let settings = PostureSettings { gain: 50.0, weight: 1.0 };
    /// let mut away = PostureTask::new(model, &vec![0.0; model.nv()]).with(settings);
    /// let limit = AccelerationLimit::new(model, DVector::repeat(model.nv(), 10.0), PositionLimit::default());
    ///
    /// let mut ik = DifferentialIk::new(model);
    /// ik.begin();
    /// ik.add_task(&state, 0, &mut away);
    /// ik.add_limit(&state, &VelocityLimit::default(), 1e-3);
    /// ik.add_acceleration_limit(&state, &limit, &vec![0.0; model.nv()], 1e-3);
    /// let fastest = ik.solve()?.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    /// assert!((fastest - 0.01).abs() < 1e-12, "10 rad/s2 for a millisecond");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    /// If the length of `before` differs from the number of velocities.
    pub fn add_acceleration_limit(
        &mut self,
        state: &RobotState<'_>,
        limit: &AccelerationLimit,
        before: &[f64],
        dt: f64,
    ) {
        assert_eq!(before.len(), self.motions, "velocities of the tick before");
        self.wide_bounds[0].copy_from(&self.problem.lower);
        self.wide_bounds[1].copy_from(&self.problem.upper);
        self.is_narrowed = true;
        self.before.rows_mut(0, self.motions).copy_from_slice(before);
        limit.narrow(state, before, dt, &mut self.problem);
    }

    /// Prescribes the velocity \[rad/s or m/s\] at `index` of `v`. This velocity replaces the limits already
    /// added for `index`.
    pub fn prescribe(&mut self, index: usize, velocity: f64) {
        let Self { problem, wide_bounds: [lower, upper], .. } = self;
        for bounds in [&mut problem.lower, &mut problem.upper, lower, upper] {
            bounds[index] = velocity;
        }
    }

    /// Returns `true` if the solution of the last [`solve`](Self::solve) exceeds the acceleration limit.
    pub fn exceeds_acceleration(&self) -> bool {
        self.exceeds_acceleration
    }

    /// Adds the rows of `limit` for a tick of `dt` seconds.
    ///
    /// # Panics
    /// If the total number of limit rows exceeds the capacity.
    pub fn add_row_limit(&mut self, state: &RobotState<'_>, limit: &mut dyn RowLimit, dt: f64) {
        let (first, count) = (self.next_row, limit.rows());
        assert!(
            first + count <= self.problem.row_lower.len(),
            "limits with more rows than the solver was built for"
        );
        limit.write(state, dt, &mut LimitRows::new(&mut self.problem, first, count));
        self.next_row += count;
    }
}
