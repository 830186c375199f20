//! A convolutional network on grey images.

use nalgebra::{DMatrix, DVector};
use rand_pcg::Pcg64;

use super::adam::Adam;
use super::layers::{Gradients, Linear, from_patches, patches, pool, pool_backward, relu, relu_backward};

/// Side length of an input image, px.
pub const IMAGE_SIDE: usize = 28;

const CHANNELS: [usize; 2] = [8, 16];
const HIDDEN: usize = 256;
/// Gain that scales the few dark pixels of an image to a root mean square of about 1.
const GAIN: f32 = 1.0;
/// Sides after the first convolution, its pooling, and the second convolution.
const SIDES: [usize; 3] = [IMAGE_SIDE - 4, (IMAGE_SIDE - 4) / 2, (IMAGE_SIDE - 4) / 2 - 4];

/// A network that maps a square grey image to numbers by two convolutions and two dense layers.
///
/// ```
/// use motorium_models::networks::{ConvolutionalNetwork, IMAGE_SIDE};
/// use nalgebra::DMatrix;
/// use rand_pcg::Pcg64;
///
/// let mut network = ConvolutionalNetwork::random(2, &mut Pcg64::new(1, 2));
/// let mut adam = network.optimiser();
/// // One image of a vertical bar, and the outputs that it should have.
/// let image = DMatrix::from_fn(IMAGE_SIDE * IMAGE_SIDE, 1, |pixel, _| if pixel % IMAGE_SIDE == 9 { 1.0 } else { 0.0 });
/// let target = DMatrix::from_column_slice(2, 1, &[0.5, -0.5]);
/// let losses: Vec<f32> = (0..20).map(|_| network.learn(&mut adam, (&image, &target), 1e-3, 0.0)).collect();
/// assert!(losses[19] < 0.1 * losses[0]);
/// assert!((network.forward(&image) - target).amax() < 0.3);
/// ```
#[derive(Clone, Debug)]
pub struct ConvolutionalNetwork {
    layers: [Linear; 4],
}

/// Intermediate results of the forward pass, for the backward pass.
struct Trace {
    patches: [DMatrix<f32>; 2],
    /// Activations after the ReLU, before pooling.
    convolved: [DMatrix<f32>; 2],
    places: [Vec<u32>; 2],
    flat: DMatrix<f32>,
    hidden: DMatrix<f32>,
    out: DMatrix<f32>,
}

/// Weights (outputs x inputs) and biases of a layer.
pub type Layer = (DMatrix<f32>, DVector<f32>);

/// Returns the number of outputs and inputs of each layer.
fn sizes(outputs: usize) -> [(usize, usize); 4] {
    let flat = CHANNELS[1] * (SIDES[2] / 2) * (SIDES[2] / 2);
    [(CHANNELS[0], 25), (CHANNELS[1], 25 * CHANNELS[0]), (HIDDEN, flat), (outputs, HIDDEN)]
}

impl ConvolutionalNetwork {
    /// Creates a network with random weights and `outputs` outputs.
    pub fn random(outputs: usize, random: &mut Pcg64) -> Self {
        Self { layers: sizes(outputs).map(|(outputs, inputs)| Linear::random(outputs, inputs, random)) }
    }

    /// Returns the weights (outputs x inputs) and the biases of each layer.
    pub fn layers(&self) -> impl Iterator<Item = (&DMatrix<f32>, &DVector<f32>)> {
        self.layers.iter().map(|layer| (&layer.weights, &layer.bias))
    }

    /// Creates a network from its [`layers`](Self::layers); `None` if the sizes of the layers do not match.
    pub fn from_layers(layers: [Layer; 4]) -> Option<Self> {
        let outputs = layers[3].0.nrows();
        let fits =
            |(layer, size): (&Layer, (usize, usize))| layer.0.shape() == size && layer.1.len() == size.0;
        let possible = outputs > 0 && layers.iter().zip(sizes(outputs)).all(fits);
        possible.then(|| Self { layers: layers.map(|(weights, bias)| Linear { weights, bias }) })
    }

    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        self.layers.iter().map(|layer| layer.weights.len() + layer.bias.len()).sum()
    }

    /// Computes the outputs for images. Each column is an image.
    pub fn forward(&self, pictures: &DMatrix<f32>) -> DMatrix<f32> {
        self.trace(pictures).out
    }

    fn trace(&self, pictures: &DMatrix<f32>) -> Trace {
        let [first, second, dense, last] = &self.layers;
        let patches_1 = patches(pictures, 1, IMAGE_SIDE) * GAIN;
        let mut convolved_1 = first.forward(&patches_1);
        relu(&mut convolved_1);
        let (pooled, places_1) = pool(&convolved_1, SIDES[0]);
        let patches_2 = patches(&pooled, CHANNELS[0], SIDES[1]);
        let mut convolved_2 = second.forward(&patches_2);
        relu(&mut convolved_2);
        let (flat, places_2) = pool(&convolved_2, SIDES[2]);
        let mut hidden = dense.forward(&flat);
        relu(&mut hidden);
        let out = last.forward(&hidden);
        let (patches, convolved) = ([patches_1, patches_2], [convolved_1, convolved_2]);
        Trace { patches, convolved, places: [places_1, places_2], flat, hidden, out }
    }

    /// Returns the gradients of `sum |out - target|^2 / 2` over the batch, and that sum.
    fn gradients(&self, pictures: &DMatrix<f32>, targets: &DMatrix<f32>) -> ([Gradients; 4], f32) {
        let trace = self.trace(pictures);
        let [_, second, dense, last] = &self.layers;
        let error = &trace.out - targets;
        let loss = 0.5 * error.norm_squared();
        let last_gradients = last.gradients(&trace.hidden, &error);
        let mut hidden = last.backward(&error);
        relu_backward(&mut hidden, &trace.hidden);
        let dense_gradients = dense.gradients(&trace.flat, &hidden);
        let flat = dense.backward(&hidden);
        let mut convolved = pool_backward(&flat, &trace.places[1], trace.convolved[1].shape());
        relu_backward(&mut convolved, &trace.convolved[1]);
        let second_gradients = second.gradients(&trace.patches[1], &convolved);
        let pooled = from_patches(&second.backward(&convolved), CHANNELS[0], SIDES[1], pictures.ncols());
        let mut convolved = pool_backward(&pooled, &trace.places[0], trace.convolved[0].shape());
        relu_backward(&mut convolved, &trace.convolved[0]);
        let first_gradients = self.layers[0].gradients(&trace.patches[0], &convolved);
        ([first_gradients, second_gradients, dense_gradients, last_gradients], loss)
    }

    /// Runs one step of Adam on a batch, and returns the mean loss per sample. `rate` is the learning rate
    /// and `decay` the weight decay.
    pub fn learn(
        &mut self,
        adam: &mut Adam,
        (pictures, targets): (&DMatrix<f32>, &DMatrix<f32>),
        rate: f32,
        decay: f32,
    ) -> f32 {
        let (gradients, loss) = self.gradients(pictures, targets);
        let samples = pictures.ncols() as f32;
        let [a, b, c, d] =
            gradients.map(|g| Gradients { weights: g.weights / samples, bias: g.bias / samples });
        let [la, lb, lc, ld] = &mut self.layers;
        adam.step(
            [
                la.weights.as_mut_slice(),
                la.bias.as_mut_slice(),
                lb.weights.as_mut_slice(),
                lb.bias.as_mut_slice(),
                lc.weights.as_mut_slice(),
                lc.bias.as_mut_slice(),
                ld.weights.as_mut_slice(),
                ld.bias.as_mut_slice(),
            ],
            [
                a.weights.as_slice(),
                a.bias.as_slice(),
                b.weights.as_slice(),
                b.bias.as_slice(),
                c.weights.as_slice(),
                c.bias.as_slice(),
                d.weights.as_slice(),
                d.bias.as_slice(),
            ],
            rate,
            decay,
        );
        loss / samples
    }

    /// Returns an Adam optimiser for this network.
    pub fn optimiser(&self) -> Adam {
        let sizes: Vec<usize> =
            self.layers.iter().flat_map(|layer| [layer.weights.len(), layer.bias.len()]).collect();
        Adam::new(&sizes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng as _;

    #[test]
    fn kernel_gradients_match_finite_differences() {
        let mut random = Pcg64::seed_from_u64(3);
        let mut network = ConvolutionalNetwork::random(5, &mut random);
        let pictures =
            DMatrix::from_fn(IMAGE_SIDE * IMAGE_SIDE, 3, |i, k| (0.37 * (i + 311 * k) as f32).sin().max(0.0));
        let targets = DMatrix::from_fn(5, 3, |i, k| (i as f32 - k as f32) * 0.3);
        let (gradients, _) = network.gradients(&pictures, &targets);
        for (layer, gradient) in gradients.iter().enumerate() {
            let count = network.layers[layer].weights.len();
            for at in [0, count / 3, count / 2, count - 1] {
                let step = 1e-2;
                let known = network.layers[layer].weights[at];
                let mut loss = |value: f32| {
                    network.layers[layer].weights[at] = value;
                    let error = network.forward(&pictures) - &targets;
                    0.5 * error.iter().map(|e| f64::from(*e).powi(2)).sum::<f64>()
                };
                let slope = (loss(known + step) - loss(known - step)) / (2.0 * f64::from(step));
                network.layers[layer].weights[at] = known;
                let found = f64::from(gradient.weights[at]);
                assert!(
                    (slope - found).abs() < 0.03 * (1.0 + slope.abs()),
                    "layer {layer}, {at}: {slope} {found}"
                );
            }
        }
    }
}
