//! Hidden Markov and semi-Markov models with Gaussian observations.
//!
//! A chain of `K` states: `P(s_1 = i) = pi_i`, `P(s_{t+1} = j | s_t = i) = A_ij`, `y_t | s_t ~ N(m_s, C_s)`.
//! The scaled forward-backward recursion computes the likelihood and the E-step, and
//! [`viterbi`](Hmm::viterbi) computes the most probable path. A **left-right** model starts in the first
//! state and then either stays in its state or moves to the next state; entries of `A` that are 0 stay 0 in
//! training. Reference: Rabiner, *A tutorial on hidden Markov models and selected applications in speech
//! recognition*, Proc. IEEE 77, 1989.
//!
//! [`Hsmm`] adds an explicit distribution of the time spent in a state. Movements are reproduced by
//! [`Regression`] (conditional means of some columns given others) and by [`Tracker`] (a linear quadratic
//! regulator that follows the states as closely as they are precise).
//!
//! ```
//! use motorium_models::hmm::{Hmm, Shape};
//!
//! let movement: Vec<f64> = (0..60).map(|t| f64::from(t / 20) + 0.05 * (f64::from(t) * 2.3).sin()).collect();
//! let mut model = Hmm::left_right(3, &[&movement], 1, Shape::Full)?;
//! model.train(&[&movement], 20, 1e-6)?;
//! let path = model.viterbi(&movement)?.1;
//! assert_eq!((path[0], path[30], path[59]), (0, 1, 2));
//! # Ok::<(), motorium_models::hmm::HmmError>(())
//! ```

mod duration;
mod gaussian;
mod reproduction;
mod train;

pub use duration::Hsmm;
pub use gaussian::Shape;
pub use reproduction::{Regression, Tracker};

use gaussian::Gaussian;

/// Error of a hidden Markov model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HmmError {
    /// A list has the wrong length.
    #[error("found {found} {what}, expected {expected}")]
    Shape {
        /// Name of the counted quantity.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Number expected.
        expected: usize,
    },
    /// A list is not a probability distribution.
    #[error("{what} sums to {sum}, expected nonnegative probabilities with sum 1")]
    Probability {
        /// Description of the distribution.
        what: String,
        /// Sum of its entries.
        sum: f64,
    },
    /// A covariance is not positive definite.
    #[error(
        "the covariance of state {state} is not positive definite\nhelp: use fewer states or a larger floor"
    )]
    Covariance {
        /// Index of the state, from 0.
        state: usize,
    },
    /// A sequence is impossible: its likelihood is zero.
    #[error("observation {row} is impossible in all reachable states, or is not finite")]
    Impossible {
        /// Row of the sequence, from 0.
        row: usize,
    },
}

/// A hidden Markov model with Gaussian observations.
#[derive(Clone, Debug)]
pub struct Hmm {
    start: Vec<f64>,
    /// Transition probabilities, row by row.
    transitions: Vec<f64>,
    gaussians: Vec<Gaussian>,
    shape: Shape,
    dimensions: usize,
    /// Floor added to each variance in training, in units of the data squared.
    floor: f64,
}

fn check_distribution(what: impl Fn() -> String, values: &[f64]) -> Result<(), HmmError> {
    let sum: f64 = values.iter().sum();
    let good = (sum - 1.0).abs() < 1e-6 && values.iter().all(|p| *p >= 0.0);
    if good { Ok(()) } else { Err(HmmError::Probability { what: what(), sum }) }
}

impl Hmm {
    /// Creates a model from its parameters: start probabilities of the states, transition probabilities row
    /// by row, means row by row, and one covariance matrix per state, row by row.
    ///
    /// # Errors
    /// [`HmmError`] if a length is wrong, a distribution is invalid, or a covariance is not positive
    /// definite.
    pub fn new(
        start: &[f64],
        transitions: &[f64],
        means: &[f64],
        covariances: &[f64],
        shape: Shape,
    ) -> Result<Self, HmmError> {
        let k = start.len();
        let wrong = |what, found, expected| Err(HmmError::Shape { what, found, expected });
        if k == 0 {
            return wrong("states", 0, 1);
        }
        if transitions.len() != k * k {
            return wrong("transition probabilities", transitions.len(), k * k);
        }
        let d = means.len() / k;
        if d == 0 || means.len() != k * d {
            return wrong("entries of means", means.len(), k * d.max(1));
        }
        if covariances.len() != k * d * d {
            return wrong("entries of covariances", covariances.len(), k * d * d);
        }
        check_distribution(|| "the start distribution".to_string(), start)?;
        for (i, row) in transitions.chunks_exact(k).enumerate() {
            check_distribution(|| format!("row {i} of the transitions"), row)?;
        }
        let mut gaussians = vec![];
        for (state, (mean, covariance)) in
            means.chunks_exact(d).zip(covariances.chunks_exact(d * d)).enumerate()
        {
            gaussians.push(Gaussian::new(mean, covariance).ok_or(HmmError::Covariance { state })?);
        }
        let (start, transitions) = (start.to_vec(), transitions.to_vec());
        Ok(Self { start, transitions, gaussians, shape, dimensions: d, floor: 0.0 })
    }

    /// Creates a left-right model whose states are equal parts of each movement. Variances are at least 1e-6
    /// times the mean variance of the data.
    ///
    /// # Errors
    /// [`HmmError`] if a movement is shorter than the number of states, or its length is not a multiple of
    /// `dimensions`.
    pub fn left_right(
        states: usize,
        movements: &[&[f64]],
        dimensions: usize,
        shape: Shape,
    ) -> Result<Self, HmmError> {
        if states == 0 || dimensions == 0 || movements.is_empty() {
            return Err(HmmError::Shape { what: "states, columns or movements", found: 0, expected: 1 });
        }
        let mut parts: Vec<Vec<f64>> = vec![vec![]; states];
        for movement in movements {
            let n = movement.len() / dimensions;
            if n < states || movement.len() != n * dimensions {
                let expected = states.max(n) * dimensions;
                return Err(HmmError::Shape {
                    what: "values of a movement",
                    found: movement.len(),
                    expected,
                });
            }
            for (t, row) in movement.chunks_exact(dimensions).enumerate() {
                parts[t * states / n].extend_from_slice(row);
            }
        }
        let whole = gaussian::moments(&parts.concat(), dimensions).1;
        let mean_variance =
            (0..dimensions).map(|i| whole[i * dimensions + i]).sum::<f64>() / dimensions as f64;
        let floor = 1e-6 * mean_variance.max(1e-12);
        let (mut means, mut covariances) = (vec![], vec![]);
        for part in &parts {
            let (mean, mut covariance) = gaussian::moments(part, dimensions);
            gaussian::restrict(&mut covariance, dimensions, shape, floor);
            means.extend(mean);
            covariances.extend(covariance);
        }
        let mut transitions = vec![0.0; states * states];
        let stay = 1.0 - (states * movements.len()) as f64 / (parts.concat().len() / dimensions) as f64;
        let stay = stay.clamp(0.1, 0.99);
        for i in 0..states {
            transitions[i * states + i] = if i + 1 < states { stay } else { 1.0 };
            if i + 1 < states {
                transitions[i * states + i + 1] = 1.0 - stay;
            }
        }
        let mut start = vec![0.0; states];
        start[0] = 1.0;
        let mut made = Self::new(&start, &transitions, &means, &covariances, shape)?;
        made.floor = floor;
        Ok(made)
    }

    /// Returns the number of states.
    pub fn states(&self) -> usize {
        self.start.len()
    }

    /// Returns the number of columns of an observation.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Returns the start probability of each state.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// Returns the transition probabilities. Row `i` contains the probabilities of all states after state
    /// `i`.
    pub fn transitions(&self) -> &[f64] {
        &self.transitions
    }

    /// Returns the mean observation of a state.
    pub fn mean(&self, state: usize) -> &[f64] {
        &self.gaussians[state].mean
    }

    /// Returns the covariance matrix of the observations of a state, stored row by row.
    pub fn covariance(&self, state: usize) -> &[f64] {
        &self.gaussians[state].covariance
    }

    /// Returns the log densities of a sequence, row by row, or an error if the sequence is empty, not finite,
    /// or has the wrong length.
    fn densities(&self, sequence: &[f64]) -> Result<Vec<f64>, HmmError> {
        let d = self.dimensions;
        if sequence.is_empty() || !sequence.len().is_multiple_of(d) {
            let expected = (sequence.len() / d).max(1) * d;
            return Err(HmmError::Shape { what: "values of a sequence", found: sequence.len(), expected });
        }
        if let Some(index) = sequence.iter().position(|value| !value.is_finite()) {
            return Err(HmmError::Impossible { row: index / d });
        }
        let mut scratch = vec![0.0; d];
        let rows = sequence.chunks_exact(d);
        Ok(rows
            .flat_map(|y| self.gaussians.iter().map(|g| g.log_density(y, &mut scratch)).collect::<Vec<_>>())
            .collect())
    }

    /// Returns the log-likelihood of a sequence of observations. Each row of `sequence` is an observation.
    ///
    /// # Errors
    /// [`HmmError`] if the sequence is invalid or impossible.
    pub fn log_likelihood(&self, sequence: &[f64]) -> Result<f64, HmmError> {
        Ok(self.forward(&self.densities(sequence)?)?.0)
    }

    /// Returns the most probable path of states, preceded by the logarithm of the joint probability of path
    /// and sequence.
    ///
    /// # Errors
    /// [`HmmError`] if the sequence is invalid or impossible.
    pub fn viterbi(&self, sequence: &[f64]) -> Result<(f64, Vec<usize>), HmmError> {
        let densities = self.densities(sequence)?;
        let k = self.states();
        let logarithms: Vec<f64> = self.transitions.iter().map(|p| p.ln()).collect();
        let mut best: Vec<f64> = self.start.iter().zip(&densities).map(|(p, b)| p.ln() + b).collect();
        let mut from = vec![];
        for densities in densities.chunks_exact(k).skip(1) {
            let mut next = vec![f64::NEG_INFINITY; k];
            let mut origins = vec![0; k];
            for j in 0..k {
                for i in 0..k {
                    let value = best[i] + logarithms[i * k + j];
                    if value > next[j] {
                        (next[j], origins[j]) = (value, i);
                    }
                }
                next[j] += densities[j];
            }
            best = next;
            from.push(origins);
        }
        let mut state = (0..k).fold(0, |a, b| if best[b] > best[a] { b } else { a });
        let value = best[state];
        if value == f64::NEG_INFINITY {
            return Err(HmmError::Impossible { row: from.len() });
        }
        let mut path = vec![state];
        for origins in from.iter().rev() {
            state = origins[state];
            path.push(state);
        }
        path.reverse();
        Ok((value, path))
    }
}
