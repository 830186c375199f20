//! Additional constraints of a tick: velocity limits at acceleration level, and exact tasks.

use motorium_qp::{Conflict, Constraint, SolveError, UpdateError};
use nalgebra::{DVector, Vector3};

use super::MotionState;
use super::control::{AccelerationTask, InverseDynamics};
use super::predicted::Return;
use crate::RobotState;
use crate::contact::WrenchCone;
use crate::levels;
use crate::limits::{LimitRows, RowLimit, are_alike};

/// Maximum number of solutions in which only returns named by a conflict are relaxed. After that, all are.
const NAMED: u32 = 8;

impl InverseDynamics {
    /// Limits the acceleration and deceleration of each joint to `most` \[rad/s2 or m/s2\], above 0, in
    /// addition to [`InverseDynamicsSettings::joints`](super::InverseDynamicsSettings::joints). Default
    /// infinite.
    ///
    /// # Panics
    /// If the length of `most` differs from the number of joints.
    #[must_use]
    pub fn limit_accelerations(mut self, most: DVector<f64>) -> Self {
        assert_eq!(most.len(), self.order.joints, "one acceleration for each joint");
        self.acceleration_limit = most;
        self
    }

    /// Sets the acceleration of a joint to zero for this tick and ignores its limits. Use this for a joint
    /// that is moved by the gains of its drive, such as a finger.
    pub fn coast(&mut self, joint: usize) {
        let variable = self.order.base + joint;
        (self.problem.lower[variable], self.problem.upper[variable]) = (0.0, 0.0);
    }

    /// Adds the rows of `limit`, which bound velocities by `lower(q) <= G(q) v <= upper(q)`. The rows become
    /// bounds on the accelerations of a tick of `dt` seconds.
    ///
    /// This is a second-order control barrier. A limit of a distance `h` requires `h' >= -rate h`, which
    /// defines a second barrier `e = upper - G v`. This barrier may shrink no faster than at
    /// `barrier_rate e`. In discrete time, with the robot at `q' = q + v dt` in the next tick,
    ///
    /// ```text
    /// e = upper(q') - G(q') v
    /// G(q') a <= min(barrier_rate, 1/dt) e     if e >= 0
    /// G(q') a <= e / dt                        else: back within the tick
    /// ```
    ///
    /// so that `e >= 0`, and therefore `h >= 0`, remain true up to `a dt^2 / 2` once they hold. (Nguyen and
    /// Sreenath, *Exponential control barrier functions for enforcing high relative-degree safety-critical
    /// constraints*, 2016.) If constraints contradict each other, the involved row that is least beyond its
    /// limit returns more slowly or stays in place. If torques or contacts do not permit even that, these
    /// limits are relaxed like joint limits.
    ///
    /// ```
    /// use motorium_control::inverse_dynamics::{DynamicsRows, InverseDynamics, InverseDynamicsSettings, MotionState};
    /// use motorium_control::tasks::{PostureSettings, PostureTask};
    /// use motorium_control::limits::{CartesianVelocityLimit, RowLimit};
    /// use motorium_robots::{Kinematics, load};
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
    /// let hand = model.frame("panda_hand_tcp")?;
    /// let (q, v) = (home.as_slice(), vec![0.0; model.nv()]);
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update_with_velocity(model, q, &v);
    /// let state = MotionState { model, kinematics: &kinematics, q, v: &v };
    /// let mut slow = CartesianVelocityLimit::new(model, hand, 0.1, f64::INFINITY);
    /// let settings = PostureSettings { gain: 20.0, weight: 1.0 };
    /// let mut far = PostureTask::new(model, &vec![1.0; model.nv()]).with(settings);
    ///
    /// let rows = DynamicsRows { limits: slow.rows(), ..DynamicsRows::default() };
    /// let mut control = InverseDynamics::with_room(model, Vec::new(), InverseDynamicsSettings::default(), rows);
    /// control.begin(&state, 1e-3);
    /// control.add_task(&state, 0, &mut far);
    /// control.add_row_limit(&state, &mut slow, 1e-3);
    /// let mut jacobian = nalgebra::Matrix6xX::zeros(model.nv());
    /// kinematics.jacobian(model, hand, motorium_robots::Reference::LocalWorldAligned, &mut jacobian);
    /// let acceleration = &control.solve()?.acceleration;
    /// // 100 / s of 0.1 m/s
    /// assert!((jacobian * acceleration).fixed_rows::<3>(0).amax() < 10.0 + 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    /// If the limit rows exceed the capacity.
    pub fn add_row_limit(&mut self, state: &MotionState<'_>, limit: &mut dyn RowLimit, dt: f64) {
        let MotionState { model, q, v, .. } = *state;
        let Self { predicted, problem, order, next_limit, settings, .. } = self;
        let predicted = predicted.as_mut().expect("an inverse dynamics with room for limits");
        if !predicted.ready {
            for (step, v) in predicted.step.iter_mut().zip(v) {
                *step = v * dt;
            }
            model.integrate(q, &predicted.step, &mut predicted.q);
            predicted.kinematics.update(model, &predicted.q);
            predicted.ready = true;
        }
        let count = limit.rows();
        assert!(*next_limit + count <= order.limits, "limits with more rows than there is room for");
        let first = order.first_limit() + *next_limit;
        *next_limit += count;
        let ahead = RobotState { model, kinematics: &predicted.kinematics, q: &predicted.q };
        limit.write(&ahead, dt, &mut LimitRows::new(problem, first, count));
        let rate = settings.barrier_rate.min(dt.recip());
        let shrink = |room: f64| if room >= 0.0 { rate * room } else { room / dt };
        for row in first..first + count {
            let moving: f64 = v.iter().enumerate().map(|(j, v)| problem.row_matrix[(row, j)] * v).sum();
            let (lower, upper) = (problem.row_lower[row], problem.row_upper[row]);
            if lower > 0.0 || upper < 0.0 {
                let stay = (-shrink(moving - lower.min(0.0)), shrink(upper.max(0.0) - moving));
                let back = (-shrink(moving - lower), shrink(upper - moving));
                predicted.returning.push(Return { row, speed: lower.max(-upper), back, stay, share: 1.0 });
            }
            problem.row_upper[row] = shrink(upper - moving);
            problem.row_lower[row] = -shrink(moving - lower);
        }
    }

    /// Solves the first level. If constraints contradict each other, the slowest involved return is reduced
    /// first and then dropped; the others continue.
    pub(super) fn solve_returning(&mut self) -> Result<Result<(), SolveError>, UpdateError> {
        let mut decided = self.solve_first()?;
        let mut named = NAMED;
        while let Err(SolveError::Infeasible { conflict }) = &decided {
            let conflict = match &self.reduced {
                Some(reduced) => reduced.conflict(&self.order, conflict),
                None => *conflict,
            };
            if !(named > 0 && self.give_up_named(&conflict) || self.give_up_return()) {
                break;
            }
            named = named.saturating_sub(1);
            decided = self.solve_first()?;
        }
        Ok(decided)
    }

    /// Reduces the slowest return named by a conflict, with equal rows. Returns `false` if the conflict names
    /// none.
    fn give_up_named(&mut self, conflict: &Conflict) -> bool {
        let Some(predicted) = &mut self.predicted else { return false };
        let problem = &mut self.problem;
        let named =
            |row| conflict.constraints().any(|found| matches!(found, Constraint::Row(of, _) if of == row));
        let asking = predicted.returning.iter().filter(|way| way.share > 0.0 && named(way.row));
        // among equally fast rows, the nearest pairs return; they come first
        let Some(slowest) = asking.rev().min_by(|a, b| a.speed.total_cmp(&b.speed)).map(|way| way.row) else {
            return false;
        };
        // contradictory distance limits conflict at any acceleration
        let first = self.order.first_limit();
        let eases =
            !conflict.constraints().all(|found| matches!(found, Constraint::Row(row, _) if row >= first));
        for way in predicted.returning.iter_mut().filter(|way| way.share > 0.0) {
            if way.row == slowest || are_alike(&problem.row_matrix, slowest, way.row) {
                way.give_way(eases);
                (problem.row_lower[way.row], problem.row_upper[way.row]) = way.bounds();
            }
        }
        true
    }

    /// Lets every row beyond its limit stay there. Returns `false` if no row has to return.
    fn give_up_return(&mut self) -> bool {
        let Some(predicted) = &mut self.predicted else { return false };
        let mut gave_up = false;
        for way in predicted.returning.iter_mut().filter(|way| way.share > 0.0) {
            way.share = 0.0;
            (self.problem.row_lower[way.row], self.problem.row_upper[way.row]) = way.stay;
            gave_up = true;
        }
        gave_up
    }

    /// Solves for the unknowns with the first level alone.
    fn solve_first(&mut self) -> Result<Result<(), SolveError>, UpdateError> {
        let posed = match &mut self.reduced {
            Some(reduced) => reduced.pose(&self.order, &mut self.problem),
            None => &self.problem,
        };
        self.solver.update(posed, &self.contacts)?;
        let most = self.settings.max_iterations / if self.relaxed.is_some() { 2 } else { 1 };
        self.solver.set_max_iterations(most.saturating_sub(self.solution.iterations));
        let solved = self.solver.solve().map(|_| ());
        self.solution.iterations += self.solver.iterations();
        if let Err(error) = solved {
            return Ok(Err(error));
        }
        let found = self.solver.solution();
        match &self.reduced {
            Some(reduced) => reduced.expand(&found.x, &mut self.x),
            None => self.x.copy_from(&found.x),
        }
        Ok(Ok(()))
    }

    /// Updates `task` at `state` and makes it a constraint above all levels: `A x = b` holds exactly for the
    /// rows with nonzero weight. If constraints contradict each other, the task is relaxed like contacts at
    /// rest.
    ///
    /// # Panics
    /// If the constraint rows exceed the capacity.
    pub fn constrain(&mut self, state: &MotionState<'_>, task: &mut dyn AccelerationTask) {
        task.update(state, self);
        self.constrained.clear();
        task.cost().write_rows(&mut self.constrained);
        let first = self.order.base + self.order.motions.len() + self.next_constrained;
        self.skip_constraint(task.rows());
        levels::write_exact(&self.constrained, &mut self.problem, first, &mut self.below);
    }

    /// Skips the constraint rows of an inactive task in this tick, so that the rows of later tasks keep their
    /// indices.
    ///
    /// # Panics
    /// If the constraint rows exceed the capacity.
    pub fn skip_constraint(&mut self, rows: usize) {
        self.next_constrained += rows;
        assert!(
            self.next_constrained <= self.order.constrained,
            "constraints with more rows than there is room for"
        );
    }

    /// Calls `visit` with the world position \[m\] of each point of the active contacts at the last
    /// [`begin`](Self::begin), which must have been called with `state`.
    pub fn visit_support(&self, state: &MotionState<'_>, visit: &mut dyn FnMut(Vector3<f64>)) {
        for place in self.contacts.iter().filter(|place| place.active) {
            let origin = state.kinematics.pose(state.model, place.contact.frame).translation.vector;
            place.arms.iter().for_each(|arm| visit(origin + arm));
        }
    }

    /// Starts a tick without limits and constrained tasks.
    pub(super) fn clear_rows(&mut self) {
        (self.next_limit, self.next_constrained) = (0, 0);
        let Self { predicted, problem, order, .. } = self;
        if let Some(predicted) = predicted {
            predicted.ready = false;
            predicted.returning.clear();
        }
        let (first, held) = (order.first_limit(), order.base + order.motions.len());
        if order.limits > 0 {
            problem.row_matrix.rows_mut(first, order.limits).fill(0.0);
            problem.row_lower.rows_mut(first, order.limits).fill(f64::NEG_INFINITY);
            problem.row_upper.rows_mut(first, order.limits).fill(f64::INFINITY);
        }
        if order.constrained > 0 {
            problem.equality_matrix.rows_mut(held, order.constrained).fill(0.0);
            problem.equality_value.rows_mut(held, order.constrained).fill(0.0);
        }
    }

    /// Writes the rows of the soles' wrench cones.
    pub(super) fn pose_wrenches(&mut self) {
        let Self { order, problem, contacts, .. } = self;
        let mut row = order.joints + 4 * order.points.len();
        for place in contacts.iter() {
            let Some(cone) = place.contact.wrench else { continue };
            let force = place.contact.max_force.max(0.0) * place.contact.points() as f64;
            for number in 0..WrenchCone::ROWS {
                let (c, least, largest) = cone.row(number);
                for (point, arm) in place.arms.iter().enumerate() {
                    let [x, y, _] = *place.axes.tr_mul(arm).as_ref();
                    let first = order.velocities + 3 * (place.first_point + point);
                    problem.row_matrix[(row, first)] = c[0] - y * c[5];
                    problem.row_matrix[(row, first + 1)] = c[1] + x * c[5];
                    problem.row_matrix[(row, first + 2)] = c[2] + y * c[3] - x * c[4];
                }
                let (least, largest) = match place.active {
                    // a contact being lifted has no minimum load
                    true => (if force < least { 0.0 } else { least }, largest),
                    false => (f64::NEG_INFINITY, f64::INFINITY),
                };
                (problem.row_lower[row], problem.row_upper[row]) = (least, largest);
                row += 1;
            }
        }
    }
}
