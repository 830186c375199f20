//! Likelihoods and expectation maximisation.

use super::gaussian::{Gaussian, restrict};
use super::{Hmm, HmmError};

/// Sums of the E-step.
struct Sums {
    start: Vec<f64>,
    transitions: Vec<f64>,
    occupancy: Vec<f64>,
    first: Vec<f64>,
    /// Second moments about the current mean, to avoid cancellation.
    second: Vec<f64>,
}

impl Hmm {
    /// Returns the log-likelihood, scaled forward variables, and scales, computed from log densities.
    pub(super) fn forward(&self, densities: &[f64]) -> Result<(f64, Vec<f64>, Vec<f64>), HmmError> {
        let k = self.states();
        let mut forward: Vec<f64> = Vec::with_capacity(densities.len());
        let mut scales = vec![];
        let mut likelihood = 0.0;
        for (row, densities) in densities.chunks_exact(k).enumerate() {
            let largest = densities.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let before = row.checked_sub(1).map(|row| forward[row * k..(row + 1) * k].to_vec());
            let reached: Vec<f64> = (0..k)
                .map(|j| match &before {
                    None => self.start[j],
                    Some(before) => {
                        before.iter().enumerate().map(|(i, p)| p * self.transitions[i * k + j]).sum()
                    }
                })
                .collect();
            // the largest density among the reachable states
            let reachable = reached.iter().zip(densities).filter(|(p, _)| **p > 0.0).map(|(_, b)| *b);
            let shift = reachable.fold(f64::NEG_INFINITY, f64::max).min(largest);
            let values: Vec<f64> = reached
                .iter()
                .zip(densities)
                .map(|(p, b)| if *p > 0.0 { p * (b - shift).exp() } else { 0.0 })
                .collect();
            let scale: f64 = values.iter().sum();
            if !(scale > 0.0 && scale.is_finite() && shift.is_finite()) {
                return Err(HmmError::Impossible { row });
            }
            forward.extend(values.iter().map(|value| value / scale));
            likelihood += scale.ln() + shift;
            scales.push(scale.ln() + shift);
        }
        Ok((likelihood, forward, scales))
    }

    /// Adds the expectations of a sequence; returns its log-likelihood.
    fn expect(&self, sequence: &[f64], sums: &mut Sums) -> Result<f64, HmmError> {
        let (k, d) = (self.states(), self.dimensions());
        let densities = self.densities(sequence)?;
        let (likelihood, forward, scales) = self.forward(&densities)?;
        let n = scales.len();
        let mut backward = vec![1.0; k];
        for t in (0..n).rev() {
            let alpha = &forward[t * k..(t + 1) * k];
            if t + 1 < n {
                let ahead: Vec<f64> = (0..k)
                    .map(|j| match backward[j] {
                        0.0 => 0.0,
                        beta => beta * (densities[(t + 1) * k + j] - scales[t + 1]).exp(),
                    })
                    .collect();
                for i in 0..k {
                    let row = &self.transitions[i * k..(i + 1) * k];
                    for j in 0..k {
                        if alpha[i] > 0.0 && row[j] > 0.0 {
                            sums.transitions[i * k + j] += alpha[i] * row[j] * ahead[j];
                        }
                    }
                    backward[i] = row
                        .iter()
                        .zip(&ahead)
                        .map(|(p, b)| if alpha[i] > 0.0 && *p > 0.0 { p * b } else { 0.0 })
                        .sum();
                }
            }
            let y = &sequence[t * d..(t + 1) * d];
            for (state, gaussian) in self.gaussians.iter().enumerate() {
                let share = alpha[state] * backward[state];
                if t == 0 {
                    sums.start[state] += share;
                }
                sums.occupancy[state] += share;
                for i in 0..d {
                    let a = y[i] - gaussian.mean[i];
                    sums.first[state * d + i] += share * a;
                    let row = &mut sums.second[(state * d + i) * d..][..d];
                    for ((sum, y), mean) in row.iter_mut().zip(y).zip(&gaussian.mean) {
                        *sum += share * a * (y - mean);
                    }
                }
            }
        }
        Ok(likelihood)
    }

    /// Runs expectation maximisation over the sequences, at most `iterations` times, until an iteration
    /// increases the log-likelihood by less than `tolerance`. Returns the log-likelihood before each
    /// iteration.
    ///
    /// # Errors
    /// [`HmmError`] if a sequence is invalid or impossible, or a covariance is not positive definite after an
    /// iteration. The model then contains the result of the last complete iteration.
    pub fn train(
        &mut self,
        sequences: &[&[f64]],
        iterations: usize,
        tolerance: f64,
    ) -> Result<Vec<f64>, HmmError> {
        let (k, d) = (self.states(), self.dimensions());
        let mut history: Vec<f64> = vec![];
        for _ in 0..iterations {
            let mut sums = Sums {
                start: vec![0.0; k],
                transitions: vec![0.0; k * k],
                occupancy: vec![0.0; k],
                first: vec![0.0; k * d],
                second: vec![0.0; k * d * d],
            };
            let mut likelihood = 0.0;
            for sequence in sequences {
                likelihood += self.expect(sequence, &mut sums)?;
            }
            let done = history.last().is_some_and(|before| likelihood - before < tolerance);
            history.push(likelihood);
            if done {
                break;
            }
            self.maximise(&sums)?;
        }
        Ok(history)
    }

    /// Returns the model whose observations, transitions and start probabilities are the moments of sequences
    /// with known states. Unvisited states, and transitions from them, are unchanged.
    pub(super) fn segmented(&self, sequences: &[&[f64]], paths: &[Vec<usize>]) -> Result<Self, HmmError> {
        let (k, d) = (self.states(), self.dimensions());
        let mut made = self.clone();
        let mut rows = vec![vec![]; k];
        let mut counts = vec![0.0; k * k];
        made.start.fill(0.0);
        for (sequence, path) in sequences.iter().zip(paths) {
            for (y, state) in sequence.chunks_exact(d).zip(path) {
                rows[*state].extend_from_slice(y);
            }
            for pair in path.windows(2) {
                counts[pair[0] * k + pair[1]] += 1.0;
            }
            made.start[path[0]] += 1.0 / paths.len() as f64;
        }
        for (state, rows) in rows.iter().enumerate().filter(|(_, rows)| !rows.is_empty()) {
            let (mean, mut covariance) = super::gaussian::moments(rows, d);
            restrict(&mut covariance, d, self.shape, self.floor.max(1e-12));
            made.gaussians[state] =
                Gaussian::new(&mean, &covariance).ok_or(HmmError::Covariance { state })?;
        }
        for (row, counts) in made.transitions.chunks_exact_mut(k).zip(counts.chunks_exact(k)) {
            let total: f64 = counts.iter().sum();
            if total > 0.0 {
                row.iter_mut().zip(counts).for_each(|(p, count)| *p = count / total);
            }
        }
        Ok(made)
    }

    fn maximise(&mut self, sums: &Sums) -> Result<(), HmmError> {
        let (k, d) = (self.states(), self.dimensions());
        let mut gaussians = vec![];
        for (state, gaussian) in self.gaussians.iter().enumerate() {
            let occupancy = sums.occupancy[state];
            // an unvisited state keeps its observations
            if occupancy <= 1e-12 {
                gaussians.push(gaussian.clone());
                continue;
            }
            let shift: Vec<f64> =
                sums.first[state * d..(state + 1) * d].iter().map(|v| v / occupancy).collect();
            let mean: Vec<f64> = gaussian.mean.iter().zip(&shift).map(|(m, s)| m + s).collect();
            let mut covariance: Vec<f64> = (0..d * d)
                .map(|i| sums.second[state * d * d + i] / occupancy - shift[i / d] * shift[i % d])
                .collect();
            restrict(&mut covariance, d, self.shape, self.floor);
            gaussians.push(Gaussian::new(&mean, &covariance).ok_or(HmmError::Covariance { state })?);
        }
        let total: f64 = sums.start.iter().sum();
        self.start.iter_mut().zip(&sums.start).for_each(|(p, s)| *p = s / total);
        for (row, counts) in self.transitions.chunks_exact_mut(k).zip(sums.transitions.chunks_exact(k)) {
            let total: f64 = counts.iter().sum();
            if total > 1e-300 {
                row.iter_mut().zip(counts).for_each(|(p, count)| *p = count / total);
            }
        }
        self.gaussians = gaussians;
        Ok(())
    }
}
