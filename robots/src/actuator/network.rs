//! A learned actuator: a network from recent measurements of a drive to the effort of its motor.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::Delay;
use crate::safetensors::{self, SafetensorsError, Tensor};

/// The function between the layers of a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// `x / (1 + |x|)`.
    #[default]
    Softsign,
    /// `tanh(x)`.
    Tanh,
    /// `max(x, 0)`.
    Relu,
    /// `x` above 0, `exp(x) - 1` below.
    Elu,
}

impl Activation {
    fn apply(self, x: f64) -> f64 {
        match self {
            Self::Softsign => x / (1.0 + x.abs()),
            Self::Tanh => x.tanh(),
            Self::Relu => x.max(0.0),
            Self::Elu => {
                if x > 0.0 {
                    x
                } else {
                    x.exp_m1()
                }
            }
        }
    }
}

/// The order of a network's inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InputOrder {
    /// The position errors at all times, then the velocities.
    #[default]
    PositionVelocity,
    /// The velocities at all times, then the position errors.
    VelocityPosition,
}

/// The weights of a multilayer perceptron with one output.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkWeights {
    layers: Vec<Layer>,
    activation: Activation,
}

#[derive(Clone, Debug, PartialEq)]
struct Layer {
    /// One row per output.
    weight: Vec<f64>,
    bias: Vec<f64>,
    inputs: usize,
}

/// The file is not an actuator network.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NetworkError {
    /// A file that cannot be read.
    #[error("{0}")]
    File(#[from] SafetensorsError),
    /// A layer has the wrong shape.
    #[error("tensor \"{tensor}\" is {found}, expected {expected}")]
    Layer {
        /// The tensor.
        tensor: String,
        /// Shape found, or that the layer is missing.
        found: String,
        /// The shape expected.
        expected: String,
    },
    /// No layer at all.
    #[error(
        "no tensor whose name ends in `.weight`; expected the layers of a `torch.nn.Sequential`, such as `0.weight` and `0.bias`"
    )]
    Empty,
}

impl NetworkWeights {
    /// The layers of a safetensors file, with `inputs` numbers going in and one coming out: tensors
    /// `NAME.weight` (outputs by inputs) and `NAME.bias`, in the order of the numbers in their names, as a
    /// `torch.nn.Sequential` of linear layers has them.
    ///
    /// # Errors
    ///
    /// [`NetworkError`].
    pub fn read(bytes: &[u8], inputs: usize, activation: Activation) -> Result<Self, NetworkError> {
        let tensors = safetensors::read(bytes)?;
        let shape = |tensor: Option<&Tensor>| {
            tensor.map_or_else(|| "missing".to_owned(), |tensor| format!("{:?}", tensor.shape))
        };
        let mut names: Vec<&str> = tensors.keys().filter_map(|name| name.strip_suffix(".weight")).collect();
        names.sort_by_key(|name| (number(name), *name));
        let (mut layers, mut width) = (Vec::new(), inputs);
        for (index, name) in names.iter().enumerate() {
            let (tensor, is_last) = (format!("{name}.weight"), index + 1 == names.len());
            let weight = &tensors[&tensor];
            let wrong = |tensor, found, expected| Err(NetworkError::Layer { tensor, found, expected });
            let outputs = match weight.shape[..] {
                [1, inputs] if inputs == width && is_last => 1,
                [outputs, inputs] if inputs == width && outputs > 0 && !is_last => outputs,
                _ => {
                    let outputs = if is_last { "1" } else { "N" };
                    return wrong(tensor, shape(Some(weight)), format!("[{outputs}, {width}]"));
                }
            };
            let tensor = format!("{name}.bias");
            let bias = match tensors.get(&tensor) {
                Some(bias) if bias.shape == [outputs] => bias,
                other => return wrong(tensor, shape(other), format!("[{outputs}]")),
            };
            let (weight, bias) = (weight.values.clone(), bias.values.clone());
            if let Some(value) = weight.iter().chain(&bias).find(|value| !value.is_finite()) {
                return wrong(format!("{name}.weight"), format!("{value}"), "finite numbers".to_owned());
            }
            layers.push(Layer { weight, bias, inputs: width });
            width = outputs;
        }
        if layers.is_empty() { Err(NetworkError::Empty) } else { Ok(Self { layers, activation }) }
    }

    fn widest(&self) -> usize {
        self.layers.iter().map(|layer| layer.inputs).max().unwrap_or(0)
    }

    /// Returns the output for the inputs at the beginning of `values`; both buffers have room for the widest
    /// layer.
    fn output<'a>(&self, mut values: &'a mut [f64], mut next: &'a mut [f64]) -> f64 {
        for (index, Layer { weight, bias, inputs }) in self.layers.iter().enumerate() {
            let is_last = index + 1 == self.layers.len();
            for ((row, bias), out) in weight.chunks_exact(*inputs).zip(bias).zip(next.iter_mut()) {
                let sum =
                    row.iter().zip(values.iter()).fold(*bias, |sum, (weight, value)| sum + weight * value);
                *out = if is_last { sum } else { self.activation.apply(sum) };
            }
            core::mem::swap(&mut values, &mut next);
        }
        values[0]
    }
}

/// The first number in a name.
fn number(name: &str) -> Option<u64> {
    let digits = name.split(|c: char| !c.is_ascii_digit()).rfind(|digits| !digits.is_empty())?;
    digits.parse().ok()
}

/// A network with the meaning of its inputs and its output.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkSettings {
    /// The network; it has two inputs for each of `times`.
    pub weights: NetworkWeights,
    /// Ages of the measurements that go in \[s\], in the order of the inputs.
    pub times: Vec<f64>,
    /// Order of the inputs.
    pub input_order: InputOrder,
    /// Scale of position errors at the input \[1/rad or 1/m\].
    pub position_scale: f64,
    /// Scale of velocities at the input \[s/rad or s/m\].
    pub velocity_scale: f64,
    /// Effort of an output of one \[Nm or N\].
    pub effort_scale: f64,
}

/// A learned actuator network (Hwangbo et al. 2019): computes the effort of a motor from current and past
/// position errors and velocities of its joint.
///
/// Until a measurement of an age exists, the first one is used.
#[derive(Clone, Debug)]
pub struct ActuatorNetwork {
    settings: Arc<NetworkSettings>,
    past: Vec<Delay<Option<[f64; 2]>>>,
    values: Vec<f64>,
    next: Vec<f64>,
    first: Option<[f64; 2]>,
}

impl ActuatorNetwork {
    /// Creates a network without measurements.
    pub fn new(settings: Arc<NetworkSettings>) -> Self {
        let width = settings.weights.widest().max(1);
        let past = settings.times.iter().map(|age| Delay::new(*age, None)).collect();
        Self { past, values: vec![0.0; width], next: vec![0.0; width], first: None, settings }
    }

    /// The effort \[Nm or N\] for a position error \[rad or m\] and a velocity \[rad/s or m/s\] that are
    /// measured now.
    pub fn effort(&mut self, error: f64, velocity: f64) -> f64 {
        let (settings, newest) = (&*self.settings, [error, velocity]);
        let first = self.first.unwrap_or(newest);
        let count = self.past.len();
        for (index, past) in self.past.iter().enumerate() {
            let [error, velocity] = past.acting(Some(newest)).unwrap_or(first);
            let (at_error, at_velocity) = match settings.input_order {
                InputOrder::PositionVelocity => (index, count + index),
                InputOrder::VelocityPosition => (count + index, index),
            };
            self.values[at_error] = settings.position_scale * error;
            self.values[at_velocity] = settings.velocity_scale * velocity;
        }
        settings.effort_scale * settings.weights.output(&mut self.values, &mut self.next)
    }

    /// Advances by `dt` \[s\] after a measurement.
    pub fn advance(&mut self, error: f64, velocity: f64, dt: f64) {
        let newest = [error, velocity];
        self.first.get_or_insert(newest);
        self.past.iter_mut().for_each(|past| past.advance(Some(newest), dt));
    }

    /// Resets to the initial state, without measurements.
    pub fn reset(&mut self) {
        self.first = None;
        self.past.iter_mut().for_each(Delay::reset);
    }
}
