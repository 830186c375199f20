//! A prior on sequences of latent points: a Gaussian process from each point to the next.
//!
//! Reference: Wang, Fleet, Hertzmann, *Gaussian process dynamical models for human motion*, IEEE TPAMI 30,
//! 2008.

use super::LatentError;
use crate::gp::{GpError, Gradient, Marginal, clamp, release};
use crate::kernel::{Kernel, Points, Stationary};

/// The prior and its hyperparameters.
#[derive(Clone, Debug)]
pub(super) struct Dynamics {
    kernel: Kernel,
    noise: f64,
    /// Points at which a movement starts.
    starts: Vec<usize>,
    /// Points with a successor.
    predecessors: Vec<usize>,
    marginal: Marginal,
    inputs: Points,
    /// The successors, dimension by dimension.
    targets: Vec<f64>,
    by_inputs: Vec<f64>,
}

impl Dynamics {
    /// Creates the prior of `points` latent points. `starts` are the points that do not follow the previous
    /// point; the first point always starts a movement.
    ///
    /// # Errors
    /// If a start is out of range, or no point follows another one.
    pub(super) fn new(starts: &[usize], points: usize, latents: usize) -> Result<Self, LatentError> {
        let wrong = |found: String, expected: String| LatentError::Setting {
            setting: "start of a movement",
            found,
            expected,
        };
        if let Some(start) = starts.iter().find(|start| **start >= points) {
            return Err(wrong(start.to_string(), format!("0 to {}", points.saturating_sub(1))));
        }
        let is_start = |point: usize| point == 0 || starts.contains(&point);
        let predecessors: Vec<usize> = (1..points).filter(|i| !is_start(*i)).map(|i| i - 1).collect();
        if predecessors.is_empty() {
            let found = format!("every one of {points} poses");
            return Err(wrong(found, "movements of at least 2 poses".to_string()));
        }
        let count = predecessors.len();
        let linear = Kernel::Linear(vec![1.0; latents]);
        Ok(Self {
            kernel: Kernel::Sum(vec![Kernel::Rbf(Stationary::new(0.1, &vec![1.0; latents])), linear]),
            noise: 0.01,
            starts: (0..points).filter(|i| is_start(*i)).collect(),
            predecessors,
            marginal: Marginal::new(),
            inputs: Points::from_rows(&vec![0.0; count * latents], latents),
            targets: vec![0.0; count * latents],
            by_inputs: vec![0.0; count * latents],
        })
    }

    /// Returns the logarithms of the kernel's parameters and of the noise.
    pub(super) fn parameters(&self) -> Vec<f64> {
        let mut found = self.kernel.parameters();
        found.push(self.noise.ln());
        found
    }

    /// Returns the negative logarithm of the prior at the given parameters, and adds its gradients.
    ///
    /// # Errors
    /// If the covariance is not positive definite.
    pub(super) fn evaluate(
        &mut self,
        parameters: &[f64],
        points: &Points,
        by_points: &mut [f64],
        by_parameters: &mut [f64],
    ) -> Result<f64, GpError> {
        let mut inside = parameters.to_vec();
        clamp(&mut inside);
        self.kernel.set_parameters(&inside);
        self.noise = inside[self.kernel.parameter_count()].exp();
        let (n, count) = (points.len(), self.predecessors.len());
        for d in 0..points.dimensions() {
            let x = points.coordinate(d);
            let pairs = self.inputs.coordinate_mut(d).iter_mut().zip(&mut self.targets[d * count..]);
            for ((input, target), index) in pairs.zip(&self.predecessors) {
                (*input, *target) = (x[*index], x[index + 1]);
            }
        }
        self.by_inputs.fill(0.0);
        let into = Gradient { parameters: by_parameters, by_points: Some(&mut self.by_inputs) };
        let mut energy =
            self.marginal.evaluate(&self.kernel, self.noise, &self.inputs, &self.targets, Some(into))?;
        release(parameters, by_parameters);
        for d in 0..points.dimensions() {
            let (x, by_points) = (points.coordinate(d), &mut by_points[d * n..(d + 1) * n]);
            // the derivative with respect to a target is K^-1 y
            let slopes = self.by_inputs[d * count..].iter().zip(&self.marginal.weights[d * count..]);
            for (index, (by_input, by_target)) in self.predecessors.iter().zip(slopes) {
                by_points[*index] += by_input;
                by_points[index + 1] += by_target;
            }
            for start in &self.starts {
                energy += 0.5 * x[*start] * x[*start];
                by_points[*start] += x[*start];
            }
        }
        Ok(energy)
    }
}
