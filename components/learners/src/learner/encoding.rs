//! Convolutions of the images among the observations.

use core::ops::Range;

use motorium_models::networks::differentiable::{Convolution, Layer as _};
use motorium_models::networks::{ImageEncoder, ImageLayers, Perceptron};
use motorium_models::policy::Policy;
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::Normaliser;
use crate::task::TaskError;

/// A convolution of the images among the observations: an entry of `convolutions` in the table of an
/// algorithm. ReLU follows each convolution.
///
/// ```toml
/// convolutions = [{ channels = 8, kernel = 4, stride = 2, padding = 1 }, { channels = 16, kernel = 3 }]
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConvolutionSettings {
    /// Number of output channels, 1 to 256.
    pub channels: usize,
    /// Height and width of the kernel \[px\], at least 1.
    pub kernel: usize,
    /// Distance between neighbouring positions of the kernel \[px\], at least 1. Default 1.
    #[serde(default = "single")]
    pub stride: usize,
    /// Width of the zero padding around the image \[px\], less than `kernel`. Default 0.
    #[serde(default)]
    pub padding: usize,
}

fn single() -> usize {
    1
}

/// Returns the error of an entry of `convolutions` in the table `algorithm`.
fn wrong(algorithm: &str, index: usize, key: &str, found: usize, expected: &str) -> TaskError {
    TaskError::value(format!("algorithms.{algorithm}.convolutions[{index}].{key}"), found, expected)
}

/// Checks the ranges of `convolutions` in the table `algorithm`.
pub(crate) fn check_convolutions(
    algorithm: &str,
    convolutions: &[ConvolutionSettings],
) -> Result<(), TaskError> {
    for (index, convolution) in convolutions.iter().enumerate() {
        let ConvolutionSettings { channels, kernel, stride, padding } = *convolution;
        if !(1..=256).contains(&channels) {
            return Err(wrong(algorithm, index, "channels", channels, "1 to 256"));
        }
        for (key, count) in [("kernel", kernel), ("stride", stride)] {
            if count == 0 {
                return Err(wrong(algorithm, index, key, count, "at least 1"));
            }
        }
        if padding >= kernel {
            let expected = format!("less than `kernel` = {kernel}");
            return Err(wrong(algorithm, index, "padding", padding, &expected));
        }
    }
    Ok(())
}

/// The images among the observations of a task and their convolutions. Without convolutions, pixels are
/// inputs of the first layer, as all other observations.
#[derive(Clone, Debug, Default)]
pub(crate) struct Encoding {
    images: Vec<ImageLayers>,
}

impl Encoding {
    /// Applies the convolutions in the table `algorithm` to each image that a policy observes. The images of
    /// a history are the channels of one image.
    pub(crate) fn new(
        algorithm: &str,
        convolutions: &[ConvolutionSettings],
        policy: &Policy,
    ) -> Result<Self, TaskError> {
        if convolutions.is_empty() {
            return Ok(Self::default());
        }
        let (mut images, mut first) = (Vec::new(), 0);
        for observation in &policy.observations {
            if let Some([columns, rows]) = observation.pixels {
                let (mut channels, mut size) = (observation.history, [rows, columns]);
                let mut layers = Vec::new();
                for (index, convolution) in convolutions.iter().enumerate() {
                    let ConvolutionSettings { channels: filters, kernel, stride, padding } = *convolution;
                    let most = size[0].min(size[1]) + 2 * padding;
                    if kernel > most {
                        let name = observation.camera.as_deref().unwrap_or_default();
                        let [rows, columns] = size;
                        let expected = format!(
                            "at most {most}: the image of `cameras.{name}` has {columns} x {rows} pixels before \
                             this convolution"
                        );
                        return Err(wrong(algorithm, index, "kernel", kernel, &expected));
                    }
                    let layer = Convolution { channels, filters, size, kernel: [kernel; 2], stride, padding };
                    (channels, size) = (filters, layer.output_size());
                    layers.push(layer);
                }
                images.push(ImageLayers { first, layers });
            }
            first += policy.width(observation) * observation.history;
        }
        if images.is_empty() {
            let key = format!("algorithms.{algorithm}.convolutions");
            return Err(TaskError::value(key, convolutions.len(), "none: the task observes no image"));
        }
        Ok(Self { images })
    }

    /// Creates a network with random weights. `sizes` contains the number of inputs, which start with the
    /// observations, then the number of units of each layer.
    pub(crate) fn network(&self, sizes: &[usize], gain: f32, random: &mut Pcg64) -> Perceptron {
        if self.images.is_empty() {
            return Perceptron::random(sizes, gain, random);
        }
        let encoder = ImageEncoder::random(sizes[0], &self.images, random);
        let mut sizes = sizes.to_vec();
        sizes[0] = encoder.outputs();
        Perceptron::random(&sizes, gain, random).with_encoder(encoder)
    }

    /// Creates the statistics of `inputs` observations. The pixels of an image with convolutions have one
    /// standard deviation, so that an object has the same contrast everywhere.
    pub(crate) fn normaliser(&self, inputs: usize) -> Normaliser {
        let pixels =
            |image: &ImageLayers| -> Range<usize> { image.first..image.first + image.layers[0].inputs() };
        Normaliser::new(inputs).with_shared_deviations(self.images.iter().map(pixels).collect())
    }
}
