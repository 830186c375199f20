//! Learned actuator models: neural networks that compute the effort of a motor from recent measurements of
//! its drive.

use std::sync::Arc;

use motorium_networks::inference::{LayerSizeError, Program, Unary};
use motorium_networks::safetensors::{self, SafetensorsError, Tensor, Tensors};
use schemars::JsonSchema;
use serde::Deserialize;

use super::Delay;

/// Activation function between the layers of a network.
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

impl From<Activation> for Unary {
    fn from(activation: Activation) -> Self {
        match activation {
            Activation::Softsign => Self::Softsign,
            Activation::Tanh => Self::Tanh,
            Activation::Relu => Self::Relu,
            Activation::Elu => Self::Elu(1.0),
        }
    }
}

/// Order of the inputs of an actuator network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InputOrder {
    /// The position errors at all times come first, followed by the velocities.
    #[default]
    PositionVelocity,
    /// The velocities at all times come first, followed by the position errors.
    VelocityPosition,
}

/// Weights of a multilayer perceptron with one output, in double precision.
#[derive(Clone, Debug)]
pub struct NetworkWeights {
    /// Weights (one row per output) and bias of each layer.
    layers: Vec<(Vec<f64>, Vec<f64>)>,
    activation: Activation,
    program: Program<f64>,
}

impl PartialEq for NetworkWeights {
    fn eq(&self, other: &Self) -> bool {
        (&self.layers, self.activation) == (&other.layers, other.activation)
    }
}

/// Error of reading a file that is not an actuator network.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NetworkError {
    /// The file cannot be read.
    #[error("{0}")]
    File(#[from] SafetensorsError),
    /// The output size of a layer differs from the input size of the next layer.
    #[error(transparent)]
    Size(#[from] LayerSizeError),
    /// A layer has the wrong shape.
    #[error("tensor \"{tensor}\" is {found}, expected {expected}")]
    Layer {
        /// Name of the tensor.
        tensor: String,
        /// Shape of the tensor, or "missing".
        found: String,
        /// Expected shape.
        expected: String,
    },
    /// The file has no layers.
    #[error(
        "no tensor whose name ends in `.weight`; expected the layers of a `torch.nn.Sequential`, such as `0.weight` and `0.bias`"
    )]
    Empty,
}

impl NetworkWeights {
    /// Reads the layers of a safetensors file. The network has `inputs` inputs and one output. Each layer has
    /// the tensors `NAME.weight` (outputs x inputs) and `NAME.bias`. The numbers in the names define the
    /// order of the layers, as in a `torch.nn.Sequential` of linear layers.
    ///
    /// # Errors
    ///
    /// [`NetworkError`] if the file does not contain such layers.
    pub fn read(bytes: &[u8], inputs: usize, activation: Activation) -> Result<Self, NetworkError> {
        let Tensors { tensors, .. } = safetensors::read(bytes)?;
        let shape = |tensor: Option<&Tensor<f64>>| {
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
            layers.push((weight, bias));
            width = outputs;
        }
        if layers.is_empty() {
            return Err(NetworkError::Empty);
        }
        let program = Program::mlp(1, inputs, &layers, activation.into())?;
        Ok(Self { layers, activation, program })
    }
}

/// Returns the first number in a name.
fn number(name: &str) -> Option<u64> {
    let digits = name.split(|c: char| !c.is_ascii_digit()).rfind(|digits| !digits.is_empty())?;
    digits.parse().ok()
}

/// An actuator network with the interpretation of its inputs and output.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkSettings {
    /// Weights of the network, which has two inputs for each entry of `times`.
    pub weights: NetworkWeights,
    /// Ages of the input measurements \[s\], in the order of the inputs.
    pub times: Vec<f64>,
    /// Order of the inputs.
    pub input_order: InputOrder,
    /// Factor that multiplies position errors at the input \[1/rad or 1/m\].
    pub position_scale: f64,
    /// Factor that multiplies velocities at the input \[s/rad or s/m\].
    pub velocity_scale: f64,
    /// Effort at the motor that corresponds to a network output of 1 \[Nm or N\].
    pub effort_scale: f64,
}

/// A learned actuator (Hwangbo et al. 2019): computes the effort of a motor from current and past position
/// errors and velocities of its joint.
///
/// Inputs for times before the first measurement are set to the first measurement.
#[derive(Clone, Debug)]
pub struct ActuatorNetwork {
    settings: Arc<NetworkSettings>,
    past: Vec<Delay<Option<[f64; 2]>>>,
    program: Program<f64>,
    first: Option<[f64; 2]>,
}

impl ActuatorNetwork {
    /// Creates a network that has not received any measurements.
    pub fn new(settings: Arc<NetworkSettings>) -> Self {
        let past = settings.times.iter().map(|age| Delay::new(*age, None)).collect();
        Self { past, program: settings.weights.program.clone(), first: None, settings }
    }

    /// Returns the effort \[Nm or N\] for a position error \[rad or m\] and a velocity \[rad/s or m/s\]
    /// measured now.
    pub fn effort(&mut self, error: f64, velocity: f64) -> f64 {
        let Self { settings, past, program, first } = self;
        let newest = [error, velocity];
        let first = first.unwrap_or(newest);
        let (count, values) = (past.len(), program.input_mut(0));
        for (index, past) in past.iter().enumerate() {
            let [error, velocity] = past.acting(Some(newest)).unwrap_or(first);
            let (at_error, at_velocity) = match settings.input_order {
                InputOrder::PositionVelocity => (index, count + index),
                InputOrder::VelocityPosition => (count + index, index),
            };
            values[at_error] = settings.position_scale * error;
            values[at_velocity] = settings.velocity_scale * velocity;
        }
        program.run();
        settings.effort_scale * program.output(0)[0]
    }

    /// Adds a measurement and advances by `dt` \[s\].
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
