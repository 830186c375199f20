//! Iterative refinement of a minimum on the working set.

use super::kernels::{Arithmetic, add_scaled, largest};
use super::run::Run;
use super::tolerances::TOLERANCES;

impl Run<'_> {
    /// Corrects the minimum and the multipliers by their residuals in the original, unscaled problem.
    #[inline(always)]
    pub(super) fn refine<F: Arithmetic>(&mut self) {
        let n = self.problem.gradient.len();
        self.work.progress.refined = false;
        for _ in 0..TOLERANCES.refinements {
            self.residuals::<F>(n);
            let work = &mut *self.work;
            work.hessian.solve::<F>(&mut work.residual, 0);
            work.working.correct::<F>(&mut work.residual, &work.gaps);
            work.hessian.solve_transposed::<F>(&mut work.residual);
            add_scaled::<F>(1.0, &work.residual, &mut work.x);
            // the next correction would be smaller by the same factor again
            let (step, size) = (largest(&work.residual), largest(&work.x));
            if step <= TOLERANCES.converged * size {
                work.progress.refined = true;
                break;
            }
        }
    }

    /// Computes the residuals of the minimum and the multipliers in the original problem: of stationarity
    /// into `residual`, of the members into `gaps`.
    #[inline(always)]
    fn residuals<F: Arithmetic>(&mut self, n: usize) {
        let hessian = self.problem.hessian.as_slice();
        let work = &mut *self.work;
        // r = -(P x + q), from the upper triangle.
        for i in 0..n {
            work.residual[i] = -work.gradient[i];
        }
        work.residual[n..].fill(0.0);
        for (j, column) in hessian.chunks_exact(n.max(1)).enumerate() {
            let x = work.x[j];
            let mut sum = F::multiply_add(column[j] + work.shift, x, 0.0);
            for ((p, xi), r) in column[..j].iter().zip(&work.x).zip(&mut work.residual) {
                *r = F::multiply_add(-*p, x, *r);
                sum = F::multiply_add(*p, *xi, sum);
            }
            work.residual[j] -= sum;
        }
        work.working.residuals::<F>(&work.x, &mut work.residual, &mut work.gaps);
    }

    /// Returns `true` if the refined minimum and multipliers satisfy the members and the optimality
    /// conditions. They do not if the Hessian is singular up to rounding: each correction then introduces new
    /// errors.
    #[inline(never)]
    pub(super) fn is_stationary<F: Arithmetic>(&mut self) -> bool {
        let n = self.problem.gradient.len();
        self.residuals::<F>(n);
        let work = &*self.work;
        let size = 1.0 + largest(&work.x);
        let force = size + largest(&work.working.solved[..work.working.len()]);
        let near = |gap: &f64| gap.abs() <= TOLERANCES.exact * size;
        work.gaps[..work.working.len()].iter().all(near)
            && work.residual[..n].iter().all(|residual| residual.abs() <= TOLERANCES.exact * force)
    }
}
