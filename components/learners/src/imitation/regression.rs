//! Regression of a network to labelled observations: by least squares, or by cross-entropy for choices.

use motorium_models::networks::{Adam, Perceptron};
use nalgebra::{DMatrix, DVectorViewMut};
use rand::seq::SliceRandom as _;

use super::error::ImitationError;
use super::settings::ImitationSettings;
use crate::learner::{Encoding, Head, Normaliser, TrainedNetwork, layer_sizes, log_sum, numbers_sha256};
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
    /// `true` if a label is the number of a choice, whose logit is an output of the network.
    is_choice: bool,
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
    /// [`TaskError`] with the key of an invalid setting. Convolutions require the images of a task; see
    /// [`Imitation`](super::Imitation).
    pub fn new(
        inputs: usize,
        active: Vec<bool>,
        settings: ImitationSettings,
        seed: u64,
    ) -> Result<Self, TaskError> {
        Self::with_labels((inputs, active, false), &unknown_images(&settings)?, settings, seed)
    }

    /// Creates a network with random weights and one output for each of `choices` choices. The output is the
    /// logarithm of the probability of the choice, up to a constant. A label is the number of a choice.
    ///
    /// # Errors
    ///
    /// [`TaskError`] with the key of an invalid setting; see [`new`](Self::new).
    pub fn of_choices(
        inputs: usize,
        choices: usize,
        settings: ImitationSettings,
        seed: u64,
    ) -> Result<Self, TaskError> {
        let labels = (inputs, vec![true; choices], true);
        Self::with_labels(labels, &unknown_images(&settings)?, settings, seed)
    }

    /// Creates a network of inputs, active outputs, and labels that are choices or values of the outputs.
    pub(super) fn with_labels(
        (inputs, active, is_choice): (usize, Vec<bool>, bool),
        encoding: &Encoding,
        settings: ImitationSettings,
        seed: u64,
    ) -> Result<Self, TaskError> {
        settings.check()?;
        let sizes = layer_sizes(inputs, &settings.hidden, active.len());
        let mut random = Counter { seed, ..Counter::default() }.stream(Purpose::Weights);
        Ok(Self {
            seed,
            network: encoding.network(&sizes, 0.01, &mut random),
            normaliser: encoding.normaliser(inputs),
            active,
            is_choice,
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
        self.labels.len() / self.label_width()
    }

    /// Returns the size of a label.
    fn label_width(&self) -> usize {
        if self.is_choice { 1 } else { self.active.len() }
    }

    /// Adds observations, row by row, and their labels, which are the expected outputs or the numbers of the
    /// choices.
    ///
    /// # Panics
    ///
    /// If a row is incomplete, the numbers of rows differ, or there is no such choice.
    pub fn push(&mut self, observations: &[f32], labels: &[f32]) {
        let rows = observations.len() / self.inputs;
        assert_eq!((rows * self.inputs, rows * self.label_width()), (observations.len(), labels.len()));
        let is_choice = |label: &f32| (0.0..self.active.len() as f32).contains(label);
        assert!(!self.is_choice || labels.iter().all(is_choice), "{} choices", self.active.len());
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

    /// Fits the network to all labels. Returns the mean squared error of the last pass, or the mean
    /// cross-entropy of choices.
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
        let label_width = self.label_width();
        // numbers in a label that contribute to the loss
        let active = match self.is_choice {
            true => 1,
            false => self.active.iter().filter(|active| **active).count().max(1),
        };
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
                    let labels = &self.labels[k * label_width..][..label_width];
                    if self.is_choice {
                        let share = 1.0 / batch.len() as f32;
                        let (outputs, slopes) = (trace.output().column(column), gradient.column_mut(column));
                        loss +=
                            f64::from(cross_entropy(outputs.as_slice(), labels[0] as usize, share, slopes));
                        continue;
                    }
                    for (row, label) in labels.iter().enumerate() {
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

    /// Returns the trained network for raw observations.
    pub fn policy(&self) -> TrainedNetwork {
        TrainedNetwork::new(&self.network, Head::Linear).normalised(&self.normaliser)
    }

    /// Returns the network and the normalisation of its observations.
    pub fn network(&self) -> (&Perceptron, &Normaliser) {
        (&self.network, &self.normaliser)
    }

    /// Returns the SHA-256 digest of all weights as hexadecimal digits.
    pub fn weights_sha256(&self) -> String {
        let TrainedNetwork { images, layers, .. } = self.policy();
        let convolutions = images.iter().flat_map(|input| {
            let layers = input.images.iter().flat_map(|image| &image.layers);
            let weights = layers.flat_map(|layer| [&layer.weights[..], &layer.bias]);
            [&input.means[..], &input.factors].into_iter().chain(weights)
        });
        let layers = layers.iter().flat_map(|(weights, bias)| [&weights[..], &bias[..]]);
        numbers_sha256(convolutions.chain(layers))
    }
}

/// Returns the encoding of observations whose images are unknown; convolutions are an error.
fn unknown_images(settings: &ImitationSettings) -> Result<Encoding, TaskError> {
    match settings.convolutions.len() {
        0 => Ok(Encoding::default()),
        found => Err(TaskError::value(
            "algorithms.dagger.convolutions",
            found,
            "none: the images among the observations are unknown",
        )),
    }
}

/// Returns the cross-entropy of a choice for the logits of all choices, and writes its gradient times
/// `share`.
fn cross_entropy(logits: &[f32], choice: usize, share: f32, mut slopes: DVectorViewMut<'_, f32>) -> f32 {
    let total = log_sum(logits);
    for (k, (slope, logit)) in slopes.iter_mut().zip(logits).enumerate() {
        *slope = share * ((logit - total).exp() - f32::from(k == choice));
    }
    total - logits[choice]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    #[test]
    fn cross_entropy_matches_its_definition_and_differences() {
        let logits = [0.3, -1.2, 2.0, 0.9];
        // in double precision, independent of the code
        let expected = |logits: &[f32]| {
            let sum: f64 = logits.iter().map(|logit| f64::from(*logit).exp()).sum();
            -(f64::from(logits[1]).exp() / sum).ln()
        };
        let mut slopes = DVector::zeros(4);
        let found = cross_entropy(&logits, 1, 0.5, slopes.as_view_mut());
        assert!((f64::from(found) - expected(&logits)).abs() < 1e-6, "{found}");
        for k in 0..4 {
            let moved = |step: f32| {
                let mut moved = logits;
                moved[k] += step;
                expected(&moved)
            };
            let slope = 0.5 * (moved(1e-2) - moved(-1e-2)) / 2e-2;
            assert!((slope - f64::from(slopes[k])).abs() < 1e-4, "{k}: {slope} {}", slopes[k]);
        }
    }
}
