//! The iterations of the dual active-set method.

use pulp::{Simd, WithSimd};

use super::constraints::Violated;
use super::kernels::{Arithmetic, Fused, Separate, largest};
use super::progress::Progress;
use super::rounds::Next;
use super::run::Run;
use super::tolerances::TOLERANCES;
use super::working_set::Member;
use crate::{Accuracy, Problem, SolveError};

impl WithSimd for Run<'_> {
    type Output = Result<(), SolveError>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Self::Output {
        if S::F64_LANES > 2 { self.solve::<Fused>() } else { self.solve::<Separate>() }
    }
}

impl Run<'_> {
    /// Solves the problem. A problem with a singular Hessian is solved as a sequence of problems that
    /// penalise the distance to the previous solution.
    #[inline(always)]
    fn solve<F: Arithmetic>(&mut self) -> Result<(), SolveError> {
        let (most, all) =
            (self.settings.max_iterations, self.work.is_member.len() + self.problem.gradient.len());
        // without an explicit limit, half of the iterations are reserved for a second attempt
        self.work.progress =
            Progress { limit: most.unwrap_or(5 * all as u32 + 25), refined: true, ..Progress::default() };
        self.work.shift = 0.0;
        self.work.centre.fill(0.0);
        let mut factorize = true;
        let mut round = 0;
        loop {
            if factorize && let Some(variable) = self.factorize::<F>() {
                self.shift_singular::<F>(variable)?;
                continue;
            }
            for (i, q) in self.problem.gradient.iter().enumerate() {
                self.work.gradient[i] = q - self.work.shift * self.work.centre[i];
            }
            // Not in a closure, which would not be compiled for these instructions.
            let outcome = match self.start::<F>() {
                Ok(()) => self.iterate::<F>(),
                Err(error) => Err(error),
            };
            if outcome.is_ok() && self.work.shift == 0.0 {
                self.write();
                return Ok(());
            }
            match self.next_round(outcome, round)? {
                Next::Done(accuracy) => {
                    self.write();
                    if accuracy == Accuracy::Reduced {
                        self.solution.accuracy = accuracy;
                    }
                    return Ok(());
                }
                Next::Solve { factorize: again } => factorize = again,
            }
            round += 1;
        }
    }

    /// Factorises the shifted Hessian; returns the variable at which it is singular.
    #[inline(always)]
    pub(super) fn factorize<F: Arithmetic>(&mut self) -> Option<usize> {
        let n = self.problem.gradient.len();
        let hessian = self.problem.hessian.as_slice();
        let lower = &mut self.work.hessian;
        for (i, column) in hessian.chunks_exact(n.max(1)).enumerate() {
            let row = lower.row_mut(i);
            row[..i].copy_from_slice(&column[..i]);
            row[i..].fill(0.0);
            lower.set_diagonal(i, column[i] + self.work.shift);
        }
        Some(lower.factorize::<F>(n, TOLERANCES.singular)).filter(|rows| *rows < n)
    }

    /// Computes `g = L^-1 q` and starts with the previous working set, or with the equalities alone.
    #[inline(always)]
    fn start<F: Arithmetic>(&mut self) -> Result<(), SolveError> {
        let m = self.equalities();
        let n = self.problem.gradient.len();
        let warm = self.settings.warm_start;
        let work = &mut *self.work;
        work.g[..n].copy_from_slice(&work.gradient[..n]);
        work.g[n..].fill(0.0);
        work.hessian.solve::<F>(&mut work.g, 0);

        work.previous.clear();
        if warm {
            work.previous.extend(work.working.members.iter().filter(|member| member.constraint >= m));
        }
        work.working.clear();
        work.is_member.fill(false);
        work.implied.clear();
        // A zero row, such as a lifted contact's, would end the bulk adoption.
        for constraint in 0..self.work.is_member.len() {
            let held = if constraint < m { !self.is_empty(constraint) } else { self.is_fixed(constraint) };
            if held && self.work.working.len() < n {
                let value = self.value(constraint, 0.0);
                let member = Member { constraint, sign: 0.0, value, multiplier: 0.0, pinned: false };
                self.work.working.members.push(member);
            }
        }
        for i in 0..self.work.previous.len() {
            if let Some(member) = self.kept(i) {
                self.work.working.members.push(member);
            }
        }
        for i in 0..self.work.working.len() {
            let constraint = self.work.working.members[i].constraint;
            self.write_normal(i, constraint);
        }
        let requested = self.work.working.len();
        let work = &mut *self.work;
        let taken = work.working.adopt::<F>(&work.hessian, &work.g);
        for member in &work.working.members {
            work.is_member[member.constraint] = true;
        }
        // equalities that are (nearly) combinations of others
        for constraint in 0..m {
            let holds = self.work.is_member[constraint]
                || self.is_empty(constraint) && self.problem.equality_value[constraint] == 0.0;
            if !holds {
                self.add_equality::<F>(constraint)?;
            }
        }
        // The bulk adoption stops at the first dependent member; later ones are adopted one by one.
        if taken < requested {
            for i in 0..self.work.previous.len() {
                if let Some(member) = self.kept(i)
                    && !self.work.is_member[member.constraint]
                {
                    self.take_normal(member.constraint);
                    let work = &mut *self.work;
                    if work.working.examine::<F>(&work.hessian) {
                        work.working.push::<F>(member, &work.g);
                        work.is_member[member.constraint] = true;
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns a member of the previous solve unless it is an equality or its side is infinite.
    #[inline(always)]
    fn kept(&self, i: usize) -> Option<Member> {
        let before = self.work.previous[i];
        // a former equality is held on the side against which it pressed
        let sign = if before.sign == 0.0 { before.multiplier.signum() } else { before.sign };
        let value = self.value(before.constraint, sign);
        let has_room = self.work.working.len() < self.problem.gradient.len();
        (has_room && value.abs() < Problem::INFINITE && !self.is_fixed(before.constraint)).then_some(Member {
            sign,
            value,
            pinned: false,
            ..before
        })
    }

    /// Adds an equality that may depend on the members: it must agree with them, or some of them must leave.
    #[inline(always)]
    fn add_equality<F: Arithmetic>(&mut self, constraint: usize) -> Result<(), SolveError> {
        loop {
            self.take_normal(constraint);
            let work = &mut *self.work;
            let independent = work.working.examine::<F>(&work.hessian);
            let value = self.problem.equality_value[constraint];
            let work = &mut *self.work;
            if independent {
                let member = Member { constraint, sign: 0.0, value, multiplier: 0.0, pinned: false };
                work.working.push::<F>(member, &work.g);
                work.is_member[constraint] = true;
                return Ok(());
            }
            // inequalities on which it depends leave; they return if violated
            let members = &work.working.members;
            let projection = &work.working.projection;
            let blocking = (0..members.len())
                .filter(|i| members[*i].sign != 0.0)
                .max_by(|a, b| projection[*a].abs().total_cmp(&projection[*b].abs()));
            let largest = largest(&projection[..members.len()]);
            if let Some(i) = blocking.filter(|i| projection[*i].abs() > TOLERANCES.no_rate * (1.0 + largest))
            {
                self.remove::<F>(i);
                continue;
            }
            if work.working.contradicts(1.0, value) || work.working.contradicts(-1.0, value) {
                return Err(self.infeasible::<F>(constraint, 0.0, value));
            }
            return Ok(());
        }
    }

    /// Changes the working set until all multipliers have the right sign and no constraint is violated.
    #[inline(always)]
    fn iterate<F: Arithmetic>(&mut self) -> Result<(), SolveError> {
        let n = self.problem.gradient.len();
        let all = self.work.is_member.len() + n;
        // From here on ties are broken by index, so no working set recurs forever.
        let careful = self.work.progress.iterations + 3 * all as u32;
        loop {
            let iterations = self.work.progress.iterations;
            let at_limit = iterations >= self.work.progress.limit;
            let by_number = self.work.progress.iterations >= careful;
            if self.has_broken_down() {
                return Err(SolveError::Numerical { iterations });
            }
            self.work.working.solve::<F>();
            // When ties are broken by index, decisions use refined values only.
            if !by_number && self.drop_wrong::<F>(by_number) {
                if at_limit {
                    return Err(SolveError::MaxIterations { iterations });
                }
                self.work.progress.iterations += 1;
                continue;
            }
            let work = &mut *self.work;
            work.working.scaled_minimum::<F>(&work.g, &mut work.x);
            work.hessian.solve_transposed::<F>(&mut work.x);
            if self.work.progress.first_size == 0.0 {
                self.work.progress.first_size = 1.0 + largest(&self.work.x);
            }
            let mut violated = None;
            if !by_number {
                self.work.working.keep_multipliers();
                violated = self.violated::<F>(by_number);
            }
            self.work.progress.size = largest(&self.work.x);
            // A small violation may be an error of an unrefined `x`: the constraint would join and leave
            // forever.
            if violated
                .as_ref()
                .is_none_or(|violated| violated.excess <= TOLERANCES.unsure * (1.0 + violated.value.abs()))
            {
                self.refine::<F>();
                if self.drop_wrong::<F>(by_number) {
                    if at_limit {
                        return Err(SolveError::MaxIterations { iterations });
                    }
                    self.work.progress.iterations += 1;
                    continue;
                }
                self.work.working.keep_multipliers();
                violated = self.violated::<F>(by_number);
            }
            let Some(violated) = violated else {
                let found = self.is_feasible() && (self.work.progress.refined || self.is_stationary::<F>());
                return if found { Ok(()) } else { Err(SolveError::Numerical { iterations }) };
            };
            if at_limit {
                return Err(SolveError::MaxIterations { iterations });
            }
            self.add::<F>(&violated)?;
            self.work.progress.iterations += 1;
        }
    }

    /// Moves the multipliers towards the minimum; removes the first member whose multiplier would change its
    /// sign.
    #[inline(always)]
    fn drop_wrong<F: Arithmetic>(&mut self, by_number: bool) -> bool {
        let working = &mut self.work.working;
        let largest = working.solved[..working.members.len()].iter().fold(0.0_f64, |l, s| l.max(s.abs()));
        let (mut step, mut which, mut worst) = (f64::INFINITY, usize::MAX, 0.0);
        for (i, (member, solved)) in working.members.iter().zip(&working.solved).enumerate() {
            let (from, to) = (member.sign * member.multiplier, member.sign * solved);
            if member.sign == 0.0 || member.pinned || to >= -TOLERANCES.sign * largest {
                continue;
            }
            let fraction = from.max(0.0) / (from.max(0.0) - to);
            let better = match () {
                () if fraction < step => true,
                () if fraction > step => false,
                () if by_number => member.constraint < working.members[which].constraint,
                () => to < worst,
            };
            if better {
                (step, which, worst) = (fraction, i, to);
            }
        }
        if which == usize::MAX {
            return false;
        }
        let constraint = working.members[which].constraint;
        let at_once = self.work.progress.last_added == Some(constraint);
        if at_once
            && self.work.progress.last_dropped == Some(constraint)
            && worst >= -TOLERANCES.noise * (largest + self.work.progress.size)
        {
            working.members[which].pinned = true;
            (
                self.work.progress.last_added,
                self.work.progress.last_added_in_doubt,
                self.work.progress.within_rounding,
            ) = (None, None, true);
            return true;
        }
        self.work.progress.last_dropped = at_once.then_some(constraint);
        self.work.progress.degenerate_steps += u32::from(at_once && step == 0.0);
        self.work.progress.last_added = None;
        for (member, solved) in working.members.iter_mut().zip(&working.solved) {
            member.multiplier += step * (solved - member.multiplier);
        }
        // A constraint that joins and leaves without a step is violated by rounding only; it counts as
        // implied.
        if step == 0.0 && self.work.progress.last_added_in_doubt == Some(constraint) {
            working.remove::<F>(which);
            self.work.implied.push(constraint);
            self.work.progress.within_rounding = true;
        } else {
            self.remove::<F>(which);
        }
        self.work.progress.last_added_in_doubt = None;
        true
    }

    /// Adds a violated constraint. If it depends on members, one of them leaves.
    #[inline(always)]
    fn add<F: Arithmetic>(&mut self, violated: &Violated) -> Result<(), SolveError> {
        self.take_normal(violated.constraint);
        let mut multiplier = 0.0;
        loop {
            let work = &mut *self.work;
            if work.working.examine::<F>(&work.hessian) && !self.is_out_of_reach::<F>(violated.excess) {
                let Violated { constraint, value, .. } = *violated;
                let sign = if self.is_fixed(constraint) { 0.0 } else { violated.sign };
                let work = &mut *self.work;
                let member = Member { constraint, sign, value, multiplier, pinned: false };
                work.working.push::<F>(member, &work.g);
                work.is_member[constraint] = true;
                work.progress.last_added = Some(constraint);
                work.progress.last_added_in_doubt =
                    (violated.excess <= TOLERANCES.tie * (1.0 + value.abs())).then_some(constraint);
                return Ok(());
            }
            let work = &mut *self.work;
            // a = N r: the members decide, not the x computed from them.
            if !work.working.contradicts(violated.sign, violated.value) {
                work.implied.push(violated.constraint);
                work.is_member[violated.constraint] = true;
                return Ok(());
            }
            // When its multiplier grows by s, only the members' multipliers change, by -r s.
            let working = &mut work.working;
            let largest =
                working.projection[..working.members.len()].iter().fold(0.0_f64, |l, r| l.max(r.abs()));
            let (mut step, mut which) = (f64::INFINITY, None);
            for (i, (member, r)) in working.members.iter().zip(&working.projection).enumerate() {
                let rate = -violated.sign * r * member.sign;
                if member.sign == 0.0 || rate >= -TOLERANCES.no_rate * largest {
                    continue;
                }
                let length = (member.sign * member.multiplier).max(0.0) / -rate;
                if length < step {
                    (step, which) = (length, Some(i));
                }
            }
            let Some(which) = which else {
                return Err(self.infeasible::<F>(violated.constraint, violated.sign, violated.value));
            };
            for (member, r) in working.members.iter_mut().zip(&working.projection) {
                member.multiplier -= violated.sign * step * r;
            }
            multiplier += violated.sign * step;
            self.remove::<F>(which);
            self.work.progress.iterations += 1;
        }
    }

    /// Removes a member and clears the set of implied constraints.
    #[inline(always)]
    fn remove<F: Arithmetic>(&mut self, which: usize) {
        let work = &mut *self.work;
        work.is_member[work.working.members[which].constraint] = false;
        work.working.remove::<F>(which);
        for constraint in work.implied.drain(..) {
            work.is_member[constraint] = false;
        }
    }
}
