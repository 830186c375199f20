//! Problems with a singular or nearly singular Hessian, as a sequence of well-conditioned ones.

use super::kernels::{Arithmetic, largest};
use super::run::Run;
use super::tolerances::TOLERANCES;
use crate::problem::ROUNDING;
use crate::{Accuracy, Problem, SolveError};

/// Next action after a round of the proximal point method.
pub(super) enum Next {
    /// Stop: this round was the last.
    Done(Accuracy),
    /// Solve another round.
    Solve {
        /// `true` if the shift changed and the Hessian must be factored again.
        factorize: bool,
    },
}

/// A direction in which the cost decreases linearly.
pub(super) struct Recession {
    /// The variable that moves most.
    variable: usize,
    /// Multiple of the direction up to the first constraint; infinite if none blocks it.
    length: f64,
}

impl Run<'_> {
    /// Decides how to continue after a round without a solution.
    #[inline(never)]
    pub(super) fn next_round(
        &mut self,
        outcome: Result<(), SolveError>,
        round: usize,
    ) -> Result<Next, SolveError> {
        let n = self.problem.gradient.len();
        if let Err(error) = outcome {
            let (curvature, slope) = (self.largest_curvature(), self.problem.gradient.amax());
            let poor = self.work.hessian.weakest() <= TOLERANCES.poor
                || curvature <= TOLERANCES.poor * TOLERANCES.poor * slope;
            let at_limit = matches!(error, SolveError::MaxIterations { .. });
            let is_last = self.work.shift > 0.0 || at_limit && self.settings.max_iterations.is_some();
            if is_last || !poor || self.work.progress.is_certain {
                return Err(error);
            }
            self.work.progress.limit = self.settings.max_iterations.unwrap_or(2 * self.work.progress.limit);
            self.work.progress.iterations += 1;
            // A poor condition may be the reason: the same problem, solved in well-conditioned steps,
            // decides.
            self.work.working.clear();
            self.shift();
            return Ok(Next::Solve { factorize: true });
        }
        for i in 0..n {
            self.work.residual[i] = self.work.x[i] - self.work.centre[i];
        }
        self.work.centre[..n].copy_from_slice(&self.work.x[..n]);
        let (step, size) = (largest(&self.work.residual[..n]), largest(&self.work.centre[..n]));
        // On a nearly flat cost, `x` may drift in small steps forever, so the optimality conditions are
        // checked too.
        let force = self.work.shift * step;
        let slope = self.problem.gradient.amax() + self.largest_curvature() * size;
        if step <= TOLERANCES.close * (1.0 + size) || force <= TOLERANCES.no_force * slope {
            return Ok(Next::Done(Accuracy::Full));
        }
        if let Some(Recession { variable, length }) = self.recession() {
            if length.is_infinite() {
                return Err(SolveError::Unbounded { variable });
            }
            // The shift limits the length of a step, so a bound that is 10^10 away would not be reached.
            if length > TOLERANCES.rounds_per_shift as f64 {
                for i in 0..n {
                    self.work.centre[i] += length * self.work.residual[i];
                }
            }
        }
        if round >= TOLERANCES.rounds && force <= TOLERANCES.little_force * slope {
            return Ok(Next::Done(Accuracy::Reduced));
        }
        if round >= TOLERANCES.rounds || self.work.progress.iterations >= self.work.progress.limit {
            return Err(SolveError::MaxIterations { iterations: self.work.progress.iterations });
        }
        let factorize = round % TOLERANCES.rounds_per_shift == TOLERANCES.rounds_per_shift - 1;
        if factorize {
            self.work.shift *= TOLERANCES.lower_shift;
        }
        self.work.progress.iterations += 1;
        Ok(Next::Solve { factorize })
    }

    /// Returns `true` if violated constraints repeatedly joined and left immediately. For a badly conditioned
    /// Hessian, a second attempt in well-conditioned steps decides.
    #[inline(always)]
    pub(super) fn has_broken_down(&self) -> bool {
        self.work.progress.degenerate_steps > TOLERANCES.degenerate_steps
            && self.work.shift == 0.0
            && self.work.hessian.weakest() <= TOLERANCES.poor
    }

    /// Shifts a singular Hessian so that it can be factored.
    ///
    /// # Errors
    /// Fails on negative curvature beyond rounding, that is if there is no Cholesky factor after adding
    /// [`ROUNDING`] times the largest entry to the diagonal.
    #[inline(never)]
    pub(super) fn shift_singular<F: Arithmetic>(&mut self, variable: usize) -> Result<(), SolveError> {
        let before = self.work.shift;
        if before == 0.0 {
            let largest = self.largest_curvature();
            self.work.shift = ROUNDING * if largest > 0.0 { largest } else { 1.0 };
            if let Some(variable) = self.factorize::<F>() {
                return Err(SolveError::NotConvex { variable });
            }
        }
        self.shift();
        // an unchanged shift would repeat the previous round
        if self.work.shift <= before { Err(SolveError::NotConvex { variable }) } else { Ok(()) }
    }

    pub(super) fn largest_curvature(&self) -> f64 {
        let hessian = &self.problem.hessian;
        (0..hessian.nrows()).fold(0.0_f64, |largest, i| largest.max(hessian[(i, i)].abs()))
    }

    /// Sets the shift of the Hessian's diagonal, a fraction of the largest numbers of the problem.
    pub(super) fn shift(&mut self) {
        let largest = self.largest_curvature().max(self.problem.gradient.amax());
        self.work.shift =
            if largest > 0.0 { TOLERANCES.first_shift * largest } else { TOLERANCES.first_shift };
    }

    /// Returns how far the cost decreases along `residual`, the last step, or `None` if the cost is curved in
    /// that direction, does not decrease, or an equality forbids the direction.
    pub(super) fn recession(&self) -> Option<Recession> {
        let problem = self.problem;
        let n = problem.gradient.len();
        let d = &self.work.residual[..n];
        let size = largest(d);
        let nothing = |value: f64, scale: f64| value.abs() <= TOLERANCES.recession * scale * size;
        let product = |matrix: &nalgebra::DMatrix<f64>, row: usize| {
            let entries = (0..n).map(|j| (matrix[(row, j)], d[j]));
            entries.fold((0.0, 0.0_f64), |(sum, most), (a, d)| (sum + a * d, most.max(a.abs())))
        };
        let largest_curvature = self.largest_curvature();
        let (mut along, mut before) = (0.0, 0.0);
        for i in 0..n {
            let curvature: f64 = (0..n).map(|j| problem.hessian[(i.min(j), i.max(j))] * d[j]).sum();
            if !nothing(curvature, largest_curvature) {
                return None;
            }
            along += curvature * d[i];
            before += curvature * self.work.x[i];
        }
        let slope: f64 = problem.gradient.iter().zip(d).map(|(q, d)| q * d).sum();
        if slope >= -TOLERANCES.recession * size * problem.gradient.amax() {
            return None;
        }
        let room = |rate: f64, scale: f64, value: f64, lower: f64, upper: f64| {
            let side = if rate > 0.0 { upper } else { lower };
            match side.abs() >= Problem::INFINITE || nothing(rate, scale) {
                true => f64::INFINITY,
                false => ((side - value) / rate).max(0.0),
            }
        };
        let mut length = f64::INFINITY;
        for i in 0..self.equalities() {
            let (rate, scale) = product(&problem.equality_matrix, i);
            if !nothing(rate, scale) {
                return None;
            }
        }
        for i in 0..problem.row_lower.len() {
            let (rate, scale) = product(&problem.row_matrix, i);
            let value = self.work.rows[i];
            length = length.min(room(rate, scale, value, problem.row_lower[i], problem.row_upper[i]));
        }
        for (i, d) in d.iter().enumerate() {
            let value = self.work.x[i];
            length = length.min(room(*d, 1.0, value, problem.lower[i], problem.upper[i]));
        }
        // a curvature within rounding may still end the descent before a distant constraint
        if length.is_finite() && along > 0.0 {
            length = length.min((-(slope + before) / along).max(0.0));
        }
        let variable = (0..n).max_by(|a, b| d[*a].abs().total_cmp(&d[*b].abs()))?;
        Some(Recession { variable, length })
    }

    /// Returns `true` if `x`, whose rows `G x` were computed last, satisfies all rows and bounds within
    /// `gross`.
    pub(super) fn is_feasible(&self) -> bool {
        let problem = self.problem;
        let within = |value: f64, lower: f64, upper: f64| {
            value >= lower - TOLERANCES.gross * (1.0 + lower.abs())
                && value <= upper + TOLERANCES.gross * (1.0 + upper.abs())
        };
        let all_within = |values: &[f64], lower: &[f64], upper: &[f64]| {
            values
                .iter()
                .zip(lower.iter().zip(upper))
                .all(|(value, (lower, upper))| within(*value, *lower, *upper))
        };
        all_within(&self.work.rows, problem.row_lower.as_slice(), problem.row_upper.as_slice())
            && all_within(&self.work.x, problem.lower.as_slice(), problem.upper.as_slice())
    }
}
