//! The discrete algebraic Riccati equation and the linear-quadratic regulator.
//!
//! The regulator minimises the cost `sum x' Q x + u' R u` of the system `x_(k+1) = A x_k + B u_k`, with `Q`
//! positive semi-definite and `R` positive definite:
//!
//! ```text
//! P = A' P A - A' P B (R + B' P B)^-1 B' P A + Q        K = (R + B' P B)^-1 B' P A        u = -K x
//! ```
//!
//! The cost from the state `x` to the end is `x' P x`. The steady-state Kalman filter is the dual problem:
//! call [`solve`] with `A'`, `H'`, and the covariances of the process noise and the measurement noise.
//!
//! ```
//! use motorium_algebra::riccati::lqr;
//! use nalgebra::dmatrix;
//!
//! // A mass of 1 kg pushed by a force, 10 ms steps.
//! let (a, b) = (dmatrix![1.0, 0.01; 0.0, 1.0], dmatrix![5e-5; 0.01]);
//! let regulator = lqr(&a, &b, &dmatrix![1.0, 0.0; 0.0, 0.0], &dmatrix![0.01])?;
//! let closed = &a - &b * &regulator.gain;
//! assert!(closed.complex_eigenvalues().iter().all(|value| value.norm() < 1.0));
//! # Ok::<(), motorium_algebra::riccati::RiccatiError>(())
//! ```

use nalgebra::DMatrix;

/// Error returned when a Riccati equation is invalid or has no stabilising solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RiccatiError {
    /// A matrix has the wrong size.
    #[error("matrix `{name}` has the size {found:?} (rows, columns), expected {expected:?}")]
    Size {
        /// Name of the matrix.
        name: &'static str,
        /// Rows and columns found.
        found: (usize, usize),
        /// Rows and columns expected.
        expected: (usize, usize),
    },
    /// A number is not finite.
    #[error("matrix `{0}` contains a number that is not finite")]
    NotFinite(&'static str),
    /// A matrix is not symmetric and positive (semi-)definite.
    #[error("`{0}` is not symmetric and positive {definite}", definite = if *.0 == "r" { "definite" } else { "semi-definite" })]
    NotPositive(&'static str),
    /// No stabilising solution was found.
    #[error(
        "no stabilising solution was found: a mode that does not decay is not controllable, or has no cost"
    )]
    NotStabilisable,
}

/// A linear-quadratic regulator `u = -K x`.
#[derive(Clone, Debug, PartialEq)]
pub struct Regulator {
    /// Gain `K`, inputs x states.
    pub gain: DMatrix<f64>,
    /// Matrix `P` of the cost-to-go `x' P x`, where `x` is the state before this step's input.
    pub cost: DMatrix<f64>,
}

/// Maximum number of doublings of the horizon: 2^60 steps.
const DOUBLINGS: usize = 60;

/// Change, relative to the solution, below which the doubling ends.
const CONVERGED: f64 = 1e-15;

/// Largest residual, relative to the solution, of an accepted solution.
const RESIDUAL: f64 = 1e-8;

/// Returns the stabilising solution `P` of the discrete algebraic Riccati equation.
///
/// Uses the structure-preserving doubling algorithm (Chu, Fan, Lin and Wang, *Int. J. Control* 77(8), 2004):
/// each iteration doubles the horizon of the cost, so the algorithm converges quadratically. The function
/// allocates; call it outside the control loop. Modes that do not decay must be controllable and have a cost.
/// Otherwise the cost of a longer horizon does not converge to the stabilising solution.
///
/// # Errors
/// [`RiccatiError`] if the matrices are invalid or no stabilising solution was found.
pub fn solve(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>, RiccatiError> {
    check(a, b, q, r)?;
    let n = a.nrows();
    let r = r.clone().cholesky().ok_or(RiccatiError::NotPositive("r"))?;
    let identity = DMatrix::<f64>::identity(n, n);
    let (mut a_k, mut g, mut h) = (a.clone(), b * r.solve(&b.transpose()), q.clone());
    for _ in 0..DOUBLINGS {
        // (1 + G H)^-1 exists for positive semi-definite G and H.
        let factor = (&identity + &g * &h).lu();
        let (Some(wa), Some(wg)) = (factor.solve(&a_k), factor.solve(&g)) else { break };
        let step = a_k.transpose() * &h * &wa;
        g += &a_k * wg * a_k.transpose();
        a_k = &a_k * wa;
        h += &step;
        // Prevents accumulation of rounding into an asymmetry.
        h = (&h + h.transpose()) * 0.5;
        g = (&g + g.transpose()) * 0.5;
        if !h.iter().chain(a_k.iter()).all(|number| number.is_finite()) {
            break;
        }
        if step.norm() <= CONVERGED * h.norm().max(f64::MIN_POSITIVE) && a_k.norm() < 1.0 {
            let residual = residual(a, b, q, &r.unpack_dirty(), &h);
            return if residual <= RESIDUAL * h.norm().max(1.0) {
                Ok(h)
            } else {
                Err(RiccatiError::NotStabilisable)
            };
        }
    }
    Err(RiccatiError::NotStabilisable)
}

/// Returns the optimal infinite-horizon regulator of a discrete-time linear system.
///
/// # Errors
/// [`RiccatiError`] if the matrices are invalid or no stabilising solution was found.
pub fn lqr(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<Regulator, RiccatiError> {
    let cost = solve(a, b, q, r)?;
    let gain = gain(a, b, r, &cost).ok_or(RiccatiError::NotPositive("r"))?;
    Ok(Regulator { gain, cost })
}

/// Returns one optimal regulator for each of `steps` steps, in time order. They are computed by the backward
/// Riccati recursion. `last` is the matrix of the terminal cost.
///
/// # Errors
/// [`RiccatiError`] if a size differs, a number is not finite, or a matrix is not positive (semi-)definite.
pub fn finite_horizon(
    (a, b): (&DMatrix<f64>, &DMatrix<f64>),
    (q, r): (&DMatrix<f64>, &DMatrix<f64>),
    last: &DMatrix<f64>,
    steps: usize,
) -> Result<Vec<Regulator>, RiccatiError> {
    check(a, b, q, r)?;
    symmetric("last", last, a.nrows())?;
    let mut cost = last.clone();
    let mut regulators = Vec::with_capacity(steps);
    for _ in 0..steps {
        let gain = gain(a, b, r, &cost).ok_or(RiccatiError::NotPositive("r"))?;
        let closed = a - b * &gain;
        cost = closed.transpose() * &cost * closed + gain.transpose() * r * &gain + q;
        regulators.push(Regulator { gain, cost: cost.clone() });
    }
    regulators.reverse();
    Ok(regulators)
}

fn gain(a: &DMatrix<f64>, b: &DMatrix<f64>, r: &DMatrix<f64>, cost: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let weight = r + b.transpose() * cost * b;
    Some(weight.cholesky()?.solve(&(b.transpose() * cost * a)))
}

/// Returns the norm of the residual; `factor` is the lower triangular `L` of `r = L L'`.
fn residual(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    factor: &DMatrix<f64>,
    p: &DMatrix<f64>,
) -> f64 {
    let lower = factor.lower_triangle();
    let r = &lower * lower.transpose();
    let Some(gain) = gain(a, b, &r, p) else { return f64::INFINITY };
    (a.transpose() * p * (a - b * gain) + q - p).norm()
}

fn check(a: &DMatrix<f64>, b: &DMatrix<f64>, q: &DMatrix<f64>, r: &DMatrix<f64>) -> Result<(), RiccatiError> {
    let n = a.nrows();
    let sizes = [("a", a, (n, n)), ("b", b, (n, b.ncols()))];
    for (name, matrix, expected) in sizes {
        if matrix.shape() != expected {
            return Err(RiccatiError::Size { name, found: matrix.shape(), expected });
        }
        if !matrix.iter().all(|number| number.is_finite()) {
            return Err(RiccatiError::NotFinite(name));
        }
    }
    symmetric("q", q, n)?;
    symmetric("r", r, b.ncols())
}

fn symmetric(name: &'static str, matrix: &DMatrix<f64>, n: usize) -> Result<(), RiccatiError> {
    if matrix.shape() != (n, n) {
        return Err(RiccatiError::Size { name, found: matrix.shape(), expected: (n, n) });
    }
    if !matrix.iter().all(|number| number.is_finite()) {
        return Err(RiccatiError::NotFinite(name));
    }
    let size = matrix.norm();
    let is_symmetric = (matrix - matrix.transpose()).norm() <= 1e-12 * size;
    let least = if is_symmetric { matrix.symmetric_eigenvalues().min() } else { f64::NEG_INFINITY };
    if n > 0 && least < -1e-12 * size { Err(RiccatiError::NotPositive(name)) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use nalgebra::{dmatrix, dvector};

    use super::*;

    fn close(found: &DMatrix<f64>, expected: &DMatrix<f64>, tolerance: f64) {
        assert!((found - expected).amax() <= tolerance * expected.amax().max(1.0), "{found} {expected}");
    }

    /// `P = scipy.linalg.solve_discrete_are(A, B, Q, R)` and `K = solve(R + B.T @ P @ B, B.T @ P @ A)`, scipy
    /// 1.17.1.
    #[test]
    fn costs_and_gains_match_scipy() {
        let (a, b) = (dmatrix![1.0, 0.01; 0.0, 1.0], dmatrix![5e-5; 0.01]);
        let found = lqr(&a, &b, &dmatrix![1.0, 0.0; 0.0, 0.1], &dmatrix![0.01]).unwrap();
        let cost = dmatrix![55.27681977239338, 10.00124992188527; 10.00124992188527, 5.528366644697321];
        close(&found.cost, &cost, 1e-11);
        close(&found.gain, &dmatrix![9.72986582302329, 5.378360395087888], 1e-11);

        let a = dmatrix![1.1, 0.2, -0.3; 0.0, 0.9, 0.4; 0.1, -0.2, 1.05];
        let b = dmatrix![1.0, 0.0; 0.5, -1.0; 0.0, 0.3];
        let q = dmatrix![2.0, 0.5, 0.0; 0.5, 1.0, 0.0; 0.0, 0.0, 0.3];
        let found = lqr(&a, &b, &q, &dmatrix![1.0, 0.2; 0.2, 0.5]).unwrap();
        let cost = dmatrix![
            2.9901688143274066, 0.489026406363297, 0.07224158602496145;
            0.489026406363297, 1.2196923780545228, -0.05873402742142472;
            0.07224158602496145, -0.05873402742142472, 6.171407924786238
        ];
        let gain = dmatrix![
            0.7736901419971882, 0.22904243242379604, 0.03314132212993994;
            0.15686895976275755, -0.5999713262395165, 0.7272932694503024
        ];
        close(&found.cost, &cost, 1e-11);
        close(&found.gain, &gain, 1e-11);
    }

    /// `p = (a^2 p r) / (r + b^2 p) + q`, a quadratic in `p`.
    #[test]
    fn one_state_has_the_closed_form() {
        for (a, b, q, r) in
            [(1.2_f64, 0.5_f64, 2.0_f64, 0.3_f64), (0.5, 1.0, 0.1, 10.0), (3.0, 0.2, 0.01, 1.0)]
        {
            let linear = r * (1.0 - a * a) - q * b * b;
            let p = (-linear + (linear * linear + 4.0 * b * b * q * r).sqrt()) / (2.0 * b * b);
            let found = solve(&dmatrix![a], &dmatrix![b], &dmatrix![q], &dmatrix![r]).unwrap();
            close(&found, &dmatrix![p], 1e-10);
        }
    }

    #[test]
    fn cost_equals_the_simulated_cost() {
        let (a, b) = (dmatrix![1.0, 0.1; 0.2, 1.1], dmatrix![0.0; 0.1]);
        let (q, r) = (dmatrix![1.0, 0.0; 0.0, 0.5], dmatrix![0.2]);
        let regulator = lqr(&a, &b, &q, &r).unwrap();
        let (start, mut cost) = (dvector![1.0, -0.5], 0.0);
        let mut x = start.clone();
        for _ in 0..5000 {
            let u = -&regulator.gain * &x;
            cost += (x.transpose() * &q * &x + u.transpose() * &r * &u)[0];
            x = &a * x + &b * u;
        }
        let expected = (start.transpose() * &regulator.cost * start)[0];
        assert!((cost / expected - 1.0).abs() < 1e-10, "{cost} {expected}");
    }

    #[test]
    fn long_horizon_starts_with_the_stationary_gain() {
        let (a, b) = (dmatrix![1.0, 0.1; 0.2, 1.1], dmatrix![0.0; 0.1]);
        let (q, r) = (dmatrix![1.0, 0.0; 0.0, 0.5], dmatrix![0.2]);
        let regulators = finite_horizon((&a, &b), (&q, &r), &q, 1000).unwrap();
        let infinite = lqr(&a, &b, &q, &r).unwrap();
        close(&regulators[0].gain, &infinite.gain, 1e-12);
        close(&regulators[0].cost, &infinite.cost, 1e-12);
        // gain of the last step: (R + B' Q B)^-1 B' Q A
        let last = (&r + b.transpose() * &q * &b).try_inverse().unwrap() * b.transpose() * &q * &a;
        close(&regulators[999].gain, &last, 1e-14);
    }

    #[test]
    fn unstabilisable_and_invalid_problems_are_rejected() {
        let solve = |a: DMatrix<f64>, b: DMatrix<f64>, q: DMatrix<f64>, r: DMatrix<f64>| {
            solve(&a, &b, &q, &r).unwrap_err()
        };
        let one = || dmatrix![1.0];
        assert_eq!(solve(dmatrix![1.5], dmatrix![0.0], one(), one()), RiccatiError::NotStabilisable);
        assert_eq!(solve(dmatrix![1.5], one(), dmatrix![0.0], one()), RiccatiError::NotStabilisable);
        assert_eq!(solve(one(), one(), dmatrix![-1.0], one()), RiccatiError::NotPositive("q"));
        assert_eq!(solve(one(), one(), one(), dmatrix![0.0]), RiccatiError::NotPositive("r"));
        assert_eq!(solve(dmatrix![f64::NAN], one(), one(), one()), RiccatiError::NotFinite("a"));
        let size = RiccatiError::Size { name: "b", found: (2, 1), expected: (1, 1) };
        assert_eq!(solve(one(), dmatrix![1.0; 2.0], one(), one()), size);
    }
}
