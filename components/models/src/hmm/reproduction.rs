//! Reproduction of movements: conditional means of the observations, and tracking by a linear quadratic
//! regulator.

use motorium_algebra::Cholesky;
use nalgebra::{DMatrix, DVector};

use super::{Hmm, HmmError};

/// A Gaussian mixture regression that predicts some columns of an observation from the other columns, with
/// one Gaussian per state of a hidden Markov model.
///
/// `h_i ~ P(s_t = i | inputs so far)` comes from the forward recursion on the input columns, and `y = sum_i
/// h_i (m_i^o + C_i^oi (C_i^ii)^-1 (x - m_i^i))`. Reference: Calinon and others, *Learning and reproduction
/// of gestures by imitation*, IEEE RAM 17, 2010.
#[derive(Clone, Debug)]
pub struct Regression {
    inputs: Vec<usize>,
    outputs: Vec<usize>,
    /// The model of the input columns.
    marginal: Hmm,
    /// Gain and offset of each state.
    gains: Vec<(DMatrix<f64>, DVector<f64>)>,
}

impl Regression {
    /// Creates a regression that predicts all other columns from the columns `inputs`.
    ///
    /// # Errors
    /// [`HmmError`] if `inputs` is empty, contains a duplicate or unknown column, or leaves no output, or if
    /// a covariance of the inputs is not positive definite.
    pub fn new(model: &Hmm, inputs: &[usize]) -> Result<Self, HmmError> {
        let (k, d) = (model.states(), model.dimensions());
        let outputs: Vec<usize> = (0..d).filter(|column| !inputs.contains(column)).collect();
        if inputs.is_empty() || outputs.len() + inputs.len() != d || outputs.is_empty() {
            let expected = d.saturating_sub(1);
            return Err(HmmError::Shape { what: "different input columns", found: inputs.len(), expected });
        }
        let (mut means, mut covariances, mut gains) = (vec![], vec![], vec![]);
        for state in 0..k {
            let (mean, covariance) = (model.mean(state), model.covariance(state));
            let n = inputs.len();
            let own: Vec<f64> =
                inputs.iter().flat_map(|i| inputs.iter().map(move |j| covariance[i * d + j])).collect();
            let mut factor = Cholesky::with_capacity(n);
            let fill = |i: usize, out: &mut [f64]| out.copy_from_slice(&own[i * n + i..(i + 1) * n]);
            factor.factorise(n, fill).map_err(|_| HmmError::Covariance { state })?;
            let mut gain = DMatrix::zeros(outputs.len(), n);
            for (row, output) in outputs.iter().enumerate() {
                let mut solved: Vec<f64> = inputs.iter().map(|i| covariance[output * d + i]).collect();
                factor.solve(&mut solved);
                solved.iter().enumerate().for_each(|(column, value)| gain[(row, column)] = *value);
            }
            let from = DVector::from_iterator(n, inputs.iter().map(|i| mean[*i]));
            let to = DVector::from_iterator(outputs.len(), outputs.iter().map(|i| mean[*i]));
            gains.push((gain.clone(), to - &gain * &from));
            means.extend_from_slice(from.as_slice());
            covariances.extend(own);
        }
        let marginal =
            Hmm::new(model.start(), model.transitions(), &means, &covariances, super::Shape::Full)?;
        Ok(Self { inputs: inputs.to_vec(), outputs, marginal, gains })
    }

    /// Returns the indices of the input columns.
    pub fn inputs(&self) -> &[usize] {
        &self.inputs
    }

    /// Returns the indices of the output columns.
    pub fn outputs(&self) -> &[usize] {
        &self.outputs
    }

    /// Returns the outputs for a sequence of inputs. Inputs and outputs are stored row by row, one row per
    /// step.
    ///
    /// # Errors
    /// [`HmmError`] if the sequence is invalid or impossible.
    pub fn predict(&self, inputs: &[f64]) -> Result<Vec<f64>, HmmError> {
        let (n, k) = (self.inputs.len(), self.gains.len());
        let shares = self.marginal.forward(&self.marginal.densities(inputs)?)?.1;
        let mut made = vec![];
        for (x, shares) in inputs.chunks_exact(n).zip(shares.chunks_exact(k)) {
            let x = DVector::from_column_slice(x);
            let mut y = DVector::zeros(self.outputs.len());
            for (share, (gain, offset)) in shares.iter().zip(&self.gains) {
                y += (gain * &x + offset) * *share;
            }
            made.extend_from_slice(y.as_slice());
        }
        Ok(made)
    }
}

/// A tracker that follows a path of states with a double integrator: closely where the variance of the state
/// is small, and loosely where the variance is large.
///
/// The tracker minimises `sum_t (y_t - m_s)^T C_s^-1 (y_t - m_s) + r |u_t|^2` with `y'' = u`, sampled at
/// `dt`, by the backward Riccati recursion. Reference: Calinon, *A tutorial on task-parameterized movement
/// learning and retrieval*, Intelligent Service Robotics 9, 2016.
#[derive(Clone, Debug)]
pub struct Tracker {
    dimensions: usize,
    dt: f64,
    /// Gains on position and velocity, and the feed-forward, of each row.
    steps: Vec<(DMatrix<f64>, DVector<f64>)>,
}

impl Tracker {
    /// Creates a tracker for a path of states with the sample period `dt` \[s\]. `effort` is the weight `r`
    /// of squared accelerations, in s^4 per squared unit of the data.
    ///
    /// # Errors
    /// [`HmmError`] if the path is empty or contains an unknown state, or `dt` or `effort` is not positive
    /// and finite.
    pub fn new(model: &Hmm, path: &[usize], dt: f64, effort: f64) -> Result<Self, HmmError> {
        let d = model.dimensions();
        if let Some(state) = path.iter().find(|state| **state >= model.states()) {
            return Err(HmmError::Shape { what: "states", found: *state + 1, expected: model.states() });
        }
        let positive = |value: f64| value > 0.0 && value.is_finite();
        if path.is_empty() || !positive(dt) || !positive(effort) {
            return Err(HmmError::Shape {
                what: "states, positive periods or weights",
                found: 0,
                expected: 1,
            });
        }
        let mut precisions = vec![];
        for state in 0..model.states() {
            let covariance = DMatrix::from_row_slice(d, d, model.covariance(state));
            precisions.push(covariance.cholesky().ok_or(HmmError::Covariance { state })?.inverse());
        }
        let one = DMatrix::identity(d, d);
        let mut a = DMatrix::identity(2 * d, 2 * d);
        a.view_mut((0, d), (d, d)).copy_from(&(&one * dt));
        let mut b = DMatrix::zeros(2 * d, d);
        b.view_mut((0, 0), (d, d)).copy_from(&(&one * (0.5 * dt * dt)));
        b.view_mut((d, 0), (d, d)).copy_from(&(&one * dt));
        // the cost to go is z^T P z - 2 p^T z
        let cost = |state: usize| {
            let mut q = DMatrix::zeros(2 * d, 2 * d);
            q.view_mut((0, 0), (d, d)).copy_from(&precisions[state]);
            let mut linear = DVector::zeros(2 * d);
            let mean = DVector::from_column_slice(model.mean(state));
            linear.rows_mut(0, d).copy_from(&(&precisions[state] * mean));
            (q, linear)
        };
        let (mut p, mut linear) = cost(path[path.len() - 1]);
        let mut steps = vec![];
        for state in path.iter().rev().skip(1) {
            let weight = b.transpose() * &p * &b + &one * effort;
            let factor = weight.cholesky().ok_or(HmmError::Covariance { state: *state })?;
            let gain = factor.solve(&(b.transpose() * &p * &a));
            let forward = factor.solve(&(b.transpose() * &linear));
            let (q, own) = cost(*state);
            let closed = &a - &b * &gain;
            linear = own + closed.transpose() * &linear;
            p = q + a.transpose() * &p * &closed;
            p = 0.5 * (&p + p.transpose());
            steps.push((gain, forward));
        }
        steps.reverse();
        Ok(Self { dimensions: d, dt, steps })
    }

    /// Returns the movement that starts at rest at the position `start`. The movement has one row per state
    /// of the path.
    ///
    /// # Errors
    /// [`HmmError`] if the position has the wrong number of columns.
    pub fn movement(&self, start: &[f64]) -> Result<Vec<f64>, HmmError> {
        let d = self.dimensions;
        if start.len() != d {
            return Err(HmmError::Shape { what: "columns of the start", found: start.len(), expected: d });
        }
        let mut z = DVector::zeros(2 * d);
        z.rows_mut(0, d).copy_from_slice(start);
        let mut made = start.to_vec();
        for (gain, forward) in &self.steps {
            let u = forward - gain * &z;
            for i in 0..d {
                z[i] += self.dt * (z[d + i] + 0.5 * self.dt * u[i]);
                z[d + i] += self.dt * u[i];
            }
            made.extend_from_slice(&z.as_slice()[..d]);
        }
        Ok(made)
    }
}
