//! Common interface of models: predictions (with variances if the model provides them), parameters as one
//! vector, and the class of the model.
//!
//! ```
//! use motorium_models::approximator::{Approximator, Data};
//! use motorium_models::gp::GaussianProcess;
//! use motorium_models::kernel::Kernel;
//!
//! let (x, y) = ([0.0, 1.0, 2.0, 3.0], [0.0, 0.8, 0.9, 0.1]);
//! let mut model = GaussianProcess::new(Kernel::rbf(1, 1.0), 1e-3, &x, 1, &y, 1)?;
//! let (mut mean, mut variance) = ([0.0], [0.0]);
//! assert!(model.predict_with_variance(&[1.0], &mut mean, &mut variance));
//! assert!((mean[0] - 0.8).abs() < 0.01 && variance[0] < 0.01);
//! assert_eq!(model.class().data, Data::Little);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use serde::Serialize;

use crate::gp::{GaussianProcess, GpError};
use crate::gplvm::{LatentError, LatentModel, Scratch};

/// Form of the parameters of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameters {
    /// A fixed number of parameters, on which the output depends linearly.
    Linear,
    /// A fixed number of parameters, on which the output depends nonlinearly.
    Nonlinear,
    /// The training data and a few hyperparameters.
    Data,
}

/// Extent of time that one prediction covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    /// A single step.
    Step,
    /// A whole movement.
    Trajectory,
}

/// Amount of training data that a model needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Data {
    /// At most one demonstration.
    One,
    /// Tens to hundreds of samples.
    Little,
    /// Thousands of samples or more.
    Much,
}

/// Properties of a kind of model, as in a row of table 2.4 of Delhaisse's PhD thesis (2019).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Class {
    /// Name of the kind of model.
    pub name: &'static str,
    /// Module path of the implementation.
    pub path: &'static str,
    /// Form of the model's parameters.
    pub parameters: Parameters,
    /// `true` if the model predicts distributions.
    pub probabilistic: bool,
    /// `true` if the model describes the joint distribution of the data, from which new data can be sampled.
    pub generative: bool,
    /// Extent of time that one prediction covers.
    pub scope: Scope,
    /// `true` if humans can interpret the model's parameters.
    pub interpretable: bool,
    /// `true` if the model can approximate any continuous function.
    pub universal: bool,
    /// Required amount of data.
    pub data: Data,
}

const fn class(
    name: &'static str,
    path: &'static str,
    parameters: Parameters,
    scope: Scope,
    data: Data,
) -> Class {
    Class {
        name,
        path,
        parameters,
        probabilistic: false,
        generative: false,
        scope,
        interpretable: false,
        universal: false,
        data,
    }
}

impl Class {
    const fn probabilistic(self) -> Self {
        Self { probabilistic: true, ..self }
    }

    const fn generative(self) -> Self {
        Self { probabilistic: true, generative: true, ..self }
    }

    const fn interpretable(self) -> Self {
        Self { interpretable: true, ..self }
    }

    const fn universal(self) -> Self {
        Self { universal: true, ..self }
    }
}

/// Properties of Gaussian processes.
pub const GAUSSIAN_PROCESS: Class =
    class("gaussian process", "motorium_models::gp", Parameters::Data, Scope::Step, Data::Little)
        .probabilistic()
        .universal();
/// Properties of shared latent spaces.
pub const SHARED_LATENT: Class =
    class("shared GP-LVM", "motorium_models::gplvm", Parameters::Data, Scope::Step, Data::Little)
        .generative()
        .universal();

/// Properties of all kinds of models in the workspace.
pub const CLASSES: [Class; 13] = [
    GAUSSIAN_PROCESS,
    SHARED_LATENT,
    class(
        "hidden Markov model",
        "motorium_models::hmm",
        Parameters::Nonlinear,
        Scope::Trajectory,
        Data::Little,
    )
    .generative()
    .interpretable(),
    class(
        "hidden semi-Markov model",
        "motorium_models::hmm",
        Parameters::Nonlinear,
        Scope::Trajectory,
        Data::Little,
    )
    .generative()
    .interpretable(),
    class("neural network", "motorium_models::networks", Parameters::Nonlinear, Scope::Step, Data::Much)
        .universal(),
    class(
        "dynamic movement primitive",
        "motorium_primitives::dmp",
        Parameters::Linear,
        Scope::Trajectory,
        Data::One,
    )
    .interpretable(),
    class(
        "probabilistic movement primitive",
        "motorium_primitives::promp",
        Parameters::Linear,
        Scope::Trajectory,
        Data::Little,
    )
    .generative()
    .interpretable(),
    class(
        "kernelised movement primitive",
        "motorium_primitives::kmp",
        Parameters::Data,
        Scope::Trajectory,
        Data::Little,
    )
    .probabilistic(),
    class(
        "Gaussian mixture regression",
        "motorium_primitives::gmm",
        Parameters::Nonlinear,
        Scope::Step,
        Data::Little,
    )
    .generative()
    .universal(),
    class("polynomial", "motorium_primitives::regression", Parameters::Linear, Scope::Trajectory, Data::One)
        .interpretable(),
    class(
        "central pattern generator",
        "motorium_primitives::cpg",
        Parameters::Nonlinear,
        Scope::Trajectory,
        Data::One,
    )
    .interpretable(),
    class("motion library", "motorium_library", Parameters::Linear, Scope::Trajectory, Data::Little)
        .interpretable(),
    class("actuator network", "motorium_robots::actuator", Parameters::Nonlinear, Scope::Step, Data::Much)
        .universal(),
];

/// A model that predicts outputs from inputs.
pub trait Approximator {
    /// Error of [`set_parameters`](Self::set_parameters).
    type Error;

    /// Returns the properties of the kind of model.
    fn class(&self) -> Class;

    /// Returns the number of inputs.
    fn inputs(&self) -> usize;

    /// Returns the number of outputs.
    fn outputs(&self) -> usize;

    /// Returns the trainable parameters as one vector.
    fn parameters(&self) -> Vec<f64>;

    /// Replaces the trainable parameters.
    ///
    /// # Errors
    /// Returns an error if the number of parameters or a value is invalid.
    fn set_parameters(&mut self, parameters: &[f64]) -> Result<(), Self::Error>;

    /// Predicts outputs from inputs `x` and writes their mean.
    ///
    /// # Panics
    /// If a slice has the wrong length.
    fn predict(&mut self, x: &[f64], mean: &mut [f64]);

    /// Predicts outputs from inputs `x` and writes their mean and variance. A model without variances writes
    /// only the mean and returns `false`.
    ///
    /// # Panics
    /// If a slice has the wrong length.
    fn predict_with_variance(&mut self, x: &[f64], mean: &mut [f64], variance: &mut [f64]) -> bool;
}

impl Approximator for GaussianProcess {
    type Error = GpError;

    fn class(&self) -> Class {
        GAUSSIAN_PROCESS
    }

    fn inputs(&self) -> usize {
        self.dimensions()
    }

    fn outputs(&self) -> usize {
        self.output_count()
    }

    fn parameters(&self) -> Vec<f64> {
        GaussianProcess::parameters(self)
    }

    fn set_parameters(&mut self, parameters: &[f64]) -> Result<(), GpError> {
        GaussianProcess::set_parameters(self, parameters)
    }

    fn predict(&mut self, x: &[f64], mean: &mut [f64]) {
        let mut scratch = self.scratch();
        GaussianProcess::predict(self, x, mean, &mut scratch);
    }

    fn predict_with_variance(&mut self, x: &[f64], mean: &mut [f64], variance: &mut [f64]) -> bool {
        let mut scratch = self.scratch();
        let shared = GaussianProcess::predict(self, x, mean, &mut scratch);
        variance.fill(shared);
        true
    }
}

/// A map from poses in one space of a [`LatentModel`] to poses in another space, for example from human poses
/// to robot poses.
#[derive(Clone, Debug)]
pub struct LatentMap {
    model: LatentModel,
    from: usize,
    to: usize,
    scratch: Scratch,
    variance: Vec<f64>,
}

impl LatentMap {
    /// Creates the map from the space named `from` to the space named `to`.
    ///
    /// # Errors
    /// [`LatentError`] if the model has no space with one of these names.
    pub fn new(model: LatentModel, from: &str, to: &str) -> Result<Self, LatentError> {
        let (from, to) = (model.space(from)?, model.space(to)?);
        let variance = vec![0.0; model.spaces()[to].dimensions()];
        Ok(Self { scratch: model.scratch(), model, from, to, variance })
    }
}

impl Approximator for LatentMap {
    type Error = LatentError;

    fn class(&self) -> Class {
        SHARED_LATENT
    }

    fn inputs(&self) -> usize {
        self.model.spaces()[self.from].dimensions()
    }

    fn outputs(&self) -> usize {
        self.model.spaces()[self.to].dimensions()
    }

    fn parameters(&self) -> Vec<f64> {
        self.model.parameters(self.to)
    }

    fn set_parameters(&mut self, parameters: &[f64]) -> Result<(), LatentError> {
        self.model.set_parameters(self.to, parameters)
    }

    fn predict(&mut self, x: &[f64], mean: &mut [f64]) {
        let point = self.model.latent_of_pose(self.from, x);
        self.model.predict(self.to, &point, mean, &mut self.variance, &mut self.scratch);
    }

    fn predict_with_variance(&mut self, x: &[f64], mean: &mut [f64], variance: &mut [f64]) -> bool {
        let point = self.model.latent_of_pose(self.from, x);
        self.model.predict(self.to, &point, mean, variance, &mut self.scratch);
        true
    }
}
