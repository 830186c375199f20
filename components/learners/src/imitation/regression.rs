//! Least-squares regression of a network to labelled observations.

use motorium_models::networks::{Adam, Perceptron};
use nalgebra::DMatrix;
use rand::seq::SliceRandom as _;

use super::error::ImitationError;
use super::settings::ImitationSettings;
use crate::learner::{Head, Normaliser, TrainedNetwork, layer_sizes, numbers_sha256};
use crate::random::{Counter, Purpose};
use crate::task::TaskError;

/// A regression of a network on labelled observations: the network, the normalisation of its observations,
/// and all labels so far.
///
/// [`Imitation`](super::Imitation) labels observations in the worlds of a task. Programs with other sources
/// of labels, such as sessions of a graph, use the regression directly.
///
/// ```
/// use motorium_learners::imitation::{ImitationSettings, Regression};
///
/// let settings = ImitationSettings { hidden: vec![8], epochs: 200, minibatch: 8, ..Default::default() };
/// let mut regression = Regression::new(1, vec![true], settings, 1)?;
/// for k in 0..32 {
///     let x = f32::from(k as u8) / 16.0 - 1.0;
///     regression.push(&[x], &[0.5 * x]);
/// }
/// assert!(regression.fit()? < 1e-3);
/// assert!((regression.predict(&[0.5])[0] - 0.25).abs() < 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Regression {
    settings: ImitationSettings,
    seed: u64,
    network: Perceptron,
    normaliser: Normaliser,
    /// Outputs that contribute to the loss.
    active: Vec<bool>,
    inputs: usize,
    observations: Vec<f32>,
    labels: Vec<f32>,
    /// Count of observation numbers already included in the normaliser.
    normalised: usize,
    fits: u64,
}

impl Regression {
    /// Creates a network with random weights and `inputs` inputs. `active` contains one flag per output;
    /// outputs that are not active do not affect the loss.
    ///
    /// # Errors
    ///
    /// [`TaskError`] with the key of an invalid setting.
    pub fn new(
        inputs: usize,
        active: Vec<bool>,
        settings: ImitationSettings,
        seed: u64,
    ) -> Result<Self, TaskError> {
        settings.check()?;
        let sizes = layer_sizes(inputs, &settings.hidden, active.len());
        let mut random = Counter { seed, ..Counter::default() }.stream(Purpose::Weights);
        Ok(Self {
            seed,
            network: Perceptron::random(&sizes, 0.01, &mut random),
            normaliser: Normaliser::new(inputs),
            active,
            inputs,
            observations: Vec::new(),
            labels: Vec::new(),
            normalised: 0,
            fits: 0,
            settings,
        })
    }

    /// Returns the settings.
    pub fn settings(&self) -> &ImitationSettings {
        &self.settings
    }

    /// Returns the number of fits so far.
    pub fn fits(&self) -> u64 {
        self.fits
    }

    /// Returns the number of labels so far.
    pub fn labels(&self) -> usize {
        self.labels.len() / self.active.len()
    }

    /// Adds observations, row by row, with their labels, which are the desired outputs.
    ///
    /// # Panics
    ///
    /// If a row is incomplete or the numbers of rows differ.
    pub fn push(&mut self, observations: &[f32], labels: &[f32]) {
        let rows = observations.len() / self.inputs;
        assert_eq!((rows * self.inputs, rows * self.active.len()), (observations.len(), labels.len()));
        self.observations.extend_from_slice(observations);
        self.labels.extend_from_slice(labels);
    }

    /// Returns the outputs for observations, row by row.
    pub fn predict(&self, observations: &[f32]) -> Vec<f32> {
        let mut scaled = vec![0.0; observations.len()];
        self.normaliser.apply(observations, &mut scaled);
        let rows = observations.len() / self.inputs;
        let trace = self.network.forward(DMatrix::from_column_slice(self.inputs, rows, &scaled));
        trace.output().as_slice().to_vec()
    }

    /// Fits the network to all labels. Returns the mean squared error of the last pass over them.
    ///
    /// # Errors
    ///
    /// [`ImitationError::NotFinite`] if the loss is not finite.
    pub fn fit(&mut self) -> Result<f64, ImitationError> {
        self.normaliser.update(&self.observations[self.normalised..]);
        self.normalised = self.observations.len();
        let (inputs, width) = (self.inputs, self.active.len());
        let mut scaled = vec![0.0; self.observations.len()];
        self.normaliser.apply(&self.observations, &mut scaled);
        let mut adam = Adam::new(&[self.network.parameters()]);
        let mut order: Vec<usize> = (0..self.labels()).collect();
        let active = self.active.iter().filter(|active| **active).count().max(1);
        let mut loss = 0.0;
        for epoch in 0..self.settings.epochs as u64 {
            let counter = Counter { seed: self.seed, world: 0, episode: self.fits, step: epoch };
            order.shuffle(&mut counter.stream(Purpose::Shuffle));
            let rate = self.settings.rate_in(epoch) as f32;
            loss = 0.0;
            for batch in order.chunks(self.settings.minibatch) {
                let mut input = DMatrix::zeros(inputs, batch.len());
                for (mut column, k) in input.column_iter_mut().zip(batch) {
                    column.copy_from_slice(&scaled[k * inputs..][..inputs]);
                }
                let trace = self.network.forward(input);
                let mut gradient = DMatrix::zeros(width, batch.len());
                for (column, k) in batch.iter().enumerate() {
                    for (row, label) in self.labels[k * width..][..width].iter().enumerate() {
                        if self.active[row] {
                            let error = trace.output()[(row, column)] - label;
                            loss += f64::from(error * error);
                            gradient[(row, column)] = 2.0 * error / (batch.len() * active) as f32;
                        }
                    }
                }
                let gradient = self.network.gradients(&trace, gradient);
                let mut parameters = self.network.to_vec();
                adam.step([&mut parameters[..]], [&gradient[..]], rate, 0.0);
                self.network.set(&parameters);
            }
            loss /= (order.len() * active) as f64;
        }
        if !loss.is_finite() {
            return Err(ImitationError::NotFinite { iteration: self.fits, loss });
        }
        self.fits += 1;
        Ok(loss)
    }

    /// Returns the trained network for raw observations, with the normalisation merged into its first layer.
    pub fn policy(&self) -> TrainedNetwork {
        let layers = self.network.rows();
        TrainedNetwork { memory: None, layers, head: Head::Linear }.normalised(&self.normaliser)
    }

    /// Returns the network and the normalisation of its observations.
    pub fn network(&self) -> (&Perceptron, &Normaliser) {
        (&self.network, &self.normaliser)
    }

    /// Returns the SHA-256 digest of all weights, in hexadecimal.
    pub fn weights_sha256(&self) -> String {
        let layers = self.policy().layers;
        numbers_sha256(layers.iter().flat_map(|(weights, bias)| [&weights[..], &bias[..]]))
    }
}
