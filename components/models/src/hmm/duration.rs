//! Hidden semi-Markov models, with an explicit distribution of the time spent in a state.

use super::{Hmm, HmmError, check_distribution};

/// A hidden semi-Markov model: a hidden Markov model with an explicit distribution of the duration of each
/// state, in observations.
///
/// `P(d | s)` is a table for each state, from 1 observation to a maximum duration; the remaining probability
/// belongs to longer durations. States are entered by the transitions of the underlying model, without
/// self-transitions. The end of a sequence may truncate the last state. The probability of this state is the
/// probability that it lasts at least as long as observed. Reference: Yu, *Hidden semi-Markov models*,
/// Artificial Intelligence 174, 2010.
#[derive(Clone, Debug)]
pub struct Hsmm {
    model: Hmm,
    /// Transitions between different states, row by row; a state without successors has a row of zeros.
    transitions: Vec<f64>,
    /// One row per state, one column per duration, from 1.
    durations: Vec<f64>,
    longest: usize,
}

/// `ln P(d | s)` and `ln P(at least d | s)`, row by row.
struct Logarithms {
    exactly: Vec<f64>,
    at_least: Vec<f64>,
    transitions: Vec<f64>,
    start: Vec<f64>,
}

/// `ln(e^a + e^b)`.
fn add(a: f64, b: f64) -> f64 {
    let (high, low) = if a > b { (a, b) } else { (b, a) };
    if low == f64::NEG_INFINITY { high } else { high + (low - high).exp().ln_1p() }
}

impl Hsmm {
    /// Creates a model with the states of `model` and a table of duration probabilities, with one row per
    /// state and one column per duration.
    ///
    /// # Errors
    /// [`HmmError`] if the table has the wrong size, or a row contains a negative probability or sums to more
    /// than 1.
    pub fn new(model: &Hmm, durations: &[f64]) -> Result<Self, HmmError> {
        let k = model.states();
        let longest = durations.len() / k;
        if longest == 0 || durations.len() != longest * k {
            let expected = k * longest.max(1);
            return Err(HmmError::Shape {
                what: "probabilities of durations",
                found: durations.len(),
                expected,
            });
        }
        for (state, row) in durations.chunks_exact(longest).enumerate() {
            let sum: f64 = row.iter().sum();
            let mut whole = row.to_vec();
            whole.push((1.0 - sum).max(0.0));
            check_distribution(|| format!("durations of state {state}"), &whole)?;
        }
        let mut transitions = model.transitions().to_vec();
        for (state, row) in transitions.chunks_exact_mut(k).enumerate() {
            row[state] = 0.0;
            let sum: f64 = row.iter().sum();
            if sum > 0.0 {
                row.iter_mut().for_each(|p| *p /= sum);
            }
        }
        Ok(Self { model: model.clone(), transitions, durations: durations.to_vec(), longest })
    }

    /// Creates a model with normally distributed durations, truncated to 1 to `longest` observations.
    ///
    /// # Errors
    /// Same as [`new`](Self::new). Also if a mean or a deviation is not positive and finite.
    pub fn with_normal_durations(
        model: &Hmm,
        means: &[f64],
        deviations: &[f64],
        longest: usize,
    ) -> Result<Self, HmmError> {
        let k = model.states();
        for list in [means, deviations] {
            if list.len() != k {
                return Err(HmmError::Shape { what: "durations", found: list.len(), expected: k });
            }
        }
        let mut table = vec![];
        for (state, (mean, deviation)) in means.iter().zip(deviations).enumerate() {
            let row: Vec<f64> =
                (1..=longest).map(|d| (-0.5 * ((d as f64 - mean) / deviation).powi(2)).exp()).collect();
            let sum: f64 = row.iter().sum();
            if !(sum > 0.0 && sum.is_finite() && *deviation > 0.0) {
                return Err(HmmError::Probability { what: format!("durations of state {state}"), sum });
            }
            table.extend(row.iter().map(|p| p / sum));
        }
        Self::new(model, &table)
    }

    /// Returns the underlying model with the observations and transitions of the states.
    pub fn model(&self) -> &Hmm {
        &self.model
    }

    /// Returns the probabilities of the durations of a state, starting with 1 observation.
    pub fn durations(&self, state: usize) -> &[f64] {
        &self.durations[state * self.longest..(state + 1) * self.longest]
    }

    fn logarithms(&self) -> Logarithms {
        let at_least = self.durations.chunks_exact(self.longest).flat_map(|row| {
            let mut left = 1.0_f64;
            row.iter().map(move |p| {
                let before = left;
                left -= p;
                before.max(0.0).ln()
            })
        });
        Logarithms {
            exactly: self.durations.iter().map(|p| p.ln()).collect(),
            at_least: at_least.collect(),
            transitions: self.transitions.iter().map(|p| p.ln()).collect(),
            start: self.model.start().iter().map(|p| p.ln()).collect(),
        }
    }

    /// Returns the cumulative log densities of each state up to each row, row by row, with a first row of
    /// zeros.
    fn cumulative(&self, sequence: &[f64]) -> Result<Vec<f64>, HmmError> {
        let densities = self.model.densities(sequence)?;
        let k = self.model.states();
        let mut sums = vec![0.0; k];
        for (index, density) in densities.iter().enumerate() {
            sums.push(sums[index] + density);
        }
        Ok(sums)
    }

    /// Runs the recursion over stays, in the order of their ends. `combine` accumulates the values of stays
    /// that end in one state, and `enter` the values of entering one, as `(row, from, to, value, total)`.
    /// Returns the value of all stays that end with the sequence.
    fn stays(
        &self,
        sequence: &[f64],
        mut combine: impl FnMut(Stay, &mut f64),
        mut enter: impl FnMut(usize, usize, usize, f64, &mut f64),
    ) -> Result<f64, HmmError> {
        let (k, sums, ln) = (self.model.states(), self.cumulative(sequence)?, self.logarithms());
        let n = sums.len() / k - 1;
        let mut entered = ln.start.clone();
        let mut last = f64::NEG_INFINITY;
        for end in 1..=n {
            let mut ended = vec![f64::NEG_INFINITY; k];
            for (state, ended) in ended.iter_mut().enumerate() {
                for duration in 1..=self.longest.min(end) {
                    let begin = end - duration;
                    let table = if end == n { &ln.at_least } else { &ln.exactly };
                    let value = entered[begin * k + state]
                        + table[state * self.longest + duration - 1]
                        + (sums[end * k + state] - sums[begin * k + state]);
                    let into = if end == n { &mut last } else { &mut *ended };
                    combine(Stay { end, state, begin, value }, into);
                }
            }
            for to in 0..k {
                let mut value = f64::NEG_INFINITY;
                for (from, ended) in ended.iter().enumerate() {
                    enter(end, from, to, ended + ln.transitions[from * k + to], &mut value);
                }
                entered.push(value);
            }
        }
        if last.is_finite() { Ok(last) } else { Err(HmmError::Impossible { row: n - 1 }) }
    }

    /// Returns the log-likelihood of a sequence of observations. Each row of `sequence` is an observation.
    ///
    /// # Errors
    /// [`HmmError`] if the sequence is invalid or impossible.
    pub fn log_likelihood(&self, sequence: &[f64]) -> Result<f64, HmmError> {
        self.stays(
            sequence,
            |stay, sum| *sum = add(*sum, stay.value),
            |_, _, _, value, sum| *sum = add(*sum, value),
        )
    }

    /// Returns the most probable path of states, preceded by the logarithm of the joint probability of path
    /// and sequence.
    ///
    /// # Errors
    /// [`HmmError`] if the sequence is invalid or impossible.
    pub fn viterbi(&self, sequence: &[f64]) -> Result<(f64, Vec<usize>), HmmError> {
        let k = self.model.states();
        let n = sequence.len() / self.model.dimensions().max(1);
        // start of the best stay that ends at a row, and previous state of the best path to an entry
        let mut begins = vec![0; (n + 1) * k];
        let mut origins = vec![0; (n + 1) * k];
        let mut final_state = 0;
        let value = self.stays(
            sequence,
            |stay, best| {
                if stay.value > *best {
                    *best = stay.value;
                    begins[stay.end * k + stay.state] = stay.begin;
                    if stay.end == n {
                        final_state = stay.state;
                    }
                }
            },
            |row, from, to, value, best| {
                if value > *best {
                    *best = value;
                    origins[row * k + to] = from;
                }
            },
        )?;
        let mut path = vec![0; n];
        let (mut end, mut state) = (n, final_state);
        while end > 0 {
            let begin = begins[end * k + state];
            path[begin..end].fill(state);
            (end, state) = (begin, origins[begin * k + state]);
        }
        Ok((value, path))
    }

    /// Fits observations, transitions and normally distributed durations to the most probable paths of the
    /// sequences. Stops when the joint log-probability increases by less than `tolerance`, or decreases,
    /// which is possible because of the floors of variances and durations. Returns the joint log-probability
    /// before each iteration. A last state that the end of a sequence truncates counts with its observed
    /// duration.
    ///
    /// # Errors
    /// [`HmmError`] if a sequence is invalid or impossible, or a covariance is no longer positive definite.
    pub fn train(
        &mut self,
        sequences: &[&[f64]],
        iterations: usize,
        tolerance: f64,
    ) -> Result<Vec<f64>, HmmError> {
        let mut history: Vec<f64> = vec![];
        for _ in 0..iterations {
            let mut paths = vec![];
            let mut total = 0.0;
            for sequence in sequences {
                let (value, path) = self.viterbi(sequence)?;
                total += value;
                paths.push(path);
            }
            let done = history.last().is_some_and(|before| total - before < tolerance);
            history.push(total);
            if done {
                break;
            }
            *self = self.refitted(sequences, &paths)?;
        }
        Ok(history)
    }

    /// Returns the model whose parameters are the moments of segmented sequences.
    fn refitted(&self, sequences: &[&[f64]], paths: &[Vec<usize>]) -> Result<Self, HmmError> {
        let k = self.model.states();
        let mut lengths = vec![vec![]; k];
        for path in paths {
            for run in path.chunk_by(|a, b| a == b) {
                lengths[run[0]].push(run.len() as f64);
            }
        }
        let model = self.model.segmented(sequences, paths)?;
        let mut table = self.durations.clone();
        for (row, lengths) in table.chunks_exact_mut(self.longest).zip(&lengths) {
            if lengths.is_empty() {
                continue;
            }
            let n = lengths.len() as f64;
            let mean = lengths.iter().sum::<f64>() / n;
            let variance = lengths.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>() / n;
            // one movement contains no information about the variation of durations: use a tenth of the mean,
            // at least half an observation
            let deviation = variance.sqrt().max(0.1 * mean).max(0.5);
            row.iter_mut()
                .enumerate()
                .for_each(|(d, p)| *p = (-0.5 * ((d as f64 + 1.0 - mean) / deviation).powi(2)).exp());
            let sum: f64 = row.iter().sum();
            row.iter_mut().for_each(|p| *p /= sum);
        }
        Self::new(&model, &table)
    }
}

/// A stay in a state, from row `begin` to the row before `end`, and the logarithm of its probability.
struct Stay {
    end: usize,
    state: usize,
    begin: usize,
    value: f64,
}
