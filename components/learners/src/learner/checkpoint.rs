//! Checkpoints: files in the safetensors format with the complete state of a training run.

use motorium_models::networks::{Adam, Perceptron};
use motorium_models::safetensors::{self, SafetensorsError, Tensor, Tensors};
use motorium_physics::Engine;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::Algorithm;
use crate::environment::{EnvironmentError, Progress, VectorEnvironment};

/// Error of a checkpoint that does not fit the run.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file is not a safetensors file.
    #[error(transparent)]
    Format(#[from] SafetensorsError),
    /// An entry is missing or has the wrong size.
    #[error("{what}: {found}, expected {expected}; help: resume with the task and the settings of the run")]
    Mismatch {
        /// Name of the entry.
        what: String,
        /// Description of the state found.
        found: String,
        /// Description of the expected state.
        expected: String,
    },
    /// The worlds cannot be restored by replaying their episodes.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
}

impl CheckpointError {
    pub(crate) fn mismatch(what: &str, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Mismatch { what: what.to_owned(), found: found.into(), expected: expected.into() }
    }
}

/// A checkpoint under construction.
#[derive(Debug)]
pub struct CheckpointWriter(Tensors);

impl CheckpointWriter {
    /// Creates an empty checkpoint of an algorithm.
    pub fn new(algorithm: Algorithm) -> Self {
        let mut file = Tensors::default();
        file.metadata.insert("algorithm".to_owned(), algorithm.name().to_owned());
        Self(file)
    }

    /// Adds an array of numbers.
    pub fn numbers(&mut self, name: impl Into<String>, values: Vec<f32>) {
        self.0.tensors.insert(name.into(), Tensor { shape: vec![values.len()], values });
    }

    /// Adds the state of an optimiser for parameters in named slices.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if a value does not serialise.
    pub fn optimiser(&mut self, name: &str, slices: &[&str], adam: &Adam) -> Result<(), CheckpointError> {
        let [first, second] = adam.moments();
        for (slice, (first, second)) in slices.iter().zip(first.iter().zip(second)) {
            self.numbers(format!("{slice}.first_moment"), first.clone());
            self.numbers(format!("{slice}.second_moment"), second.clone());
        }
        self.value(name, &adam.steps())
    }

    /// Adds the running episodes of all worlds.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if a value does not serialise.
    pub fn worlds<E: Engine + Send>(&mut self, worlds: &VectorEnvironment<E>) -> Result<(), CheckpointError> {
        let mut episodes = Vec::new();
        for (world, Progress { number, level, actions }) in worlds.progress().into_iter().enumerate() {
            self.numbers(format!("world.{world}.actions"), actions);
            episodes.push((number, level));
        }
        self.value("episodes", &episodes)
    }

    /// Adds a value as JSON.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the value does not serialise.
    pub fn value(&mut self, name: &str, value: &impl Serialize) -> Result<(), CheckpointError> {
        let json = serde_json::to_string(value)
            .map_err(|error| CheckpointError::mismatch(name, error.to_string(), "numbers"))?;
        self.0.metadata.insert(name.to_owned(), json);
        Ok(())
    }

    /// Returns the bytes of the checkpoint file.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the content does not form a safetensors file.
    pub fn finish(&self) -> Result<Vec<u8>, CheckpointError> {
        Ok(safetensors::write(&self.0)?)
    }
}

/// A checkpoint from which a run is restored.
#[derive(Debug)]
pub struct CheckpointReader(Tensors);

impl CheckpointReader {
    /// Reads a checkpoint of an algorithm from the bytes of its file.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the file is invalid or belongs to another algorithm.
    pub fn new(bytes: &[u8], algorithm: Algorithm) -> Result<Self, CheckpointError> {
        let file = safetensors::read(bytes)?;
        let found = file.metadata.get("algorithm").map_or("", String::as_str);
        if found != algorithm.name() {
            let expected = format!("\"{}\"", algorithm.name());
            return Err(CheckpointError::mismatch("algorithm", format!("\"{found}\""), expected));
        }
        Ok(Self(file))
    }

    /// Removes an array of any length and returns it.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the array is missing.
    pub fn any_numbers(&mut self, name: &str) -> Result<Vec<f32>, CheckpointError> {
        let found = self.0.tensors.remove(name).map(|tensor| tensor.values);
        found.ok_or_else(|| CheckpointError::mismatch(name, "missing", "a tensor"))
    }

    /// Removes an array of a given length and returns it.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the array is missing or its length differs.
    pub fn numbers(&mut self, name: &str, length: usize) -> Result<Vec<f32>, CheckpointError> {
        let values = self.any_numbers(name)?;
        if values.len() != length {
            let found = format!("{} numbers", values.len());
            return Err(CheckpointError::mismatch(name, found, length.to_string()));
        }
        Ok(values)
    }

    /// Replaces the parameters of `network` by the parameters in the checkpoint.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the parameters are missing or their number differs.
    pub fn network(&mut self, name: &str, network: &mut Perceptron) -> Result<(), CheckpointError> {
        network.set(&self.numbers(name, network.parameters())?);
        Ok(())
    }

    /// Removes the state of an optimiser and returns it. `slices` contains the name and length of each slice
    /// of parameters.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the state is missing or a length differs.
    pub fn optimiser(&mut self, name: &str, slices: &[(&str, usize)]) -> Result<Adam, CheckpointError> {
        let (mut first, mut second) = (vec![], vec![]);
        for (slice, length) in slices {
            first.push(self.numbers(&format!("{slice}.first_moment"), *length)?);
            second.push(self.numbers(&format!("{slice}.second_moment"), *length)?);
        }
        let adam = Adam::from_moments([first, second], self.value(name)?);
        adam.ok_or_else(|| CheckpointError::mismatch(name, "a negative count", "steps"))
    }

    /// Restores all worlds of the run with the seed `seed` by replaying their running episodes.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if an episode is missing or cannot be replayed.
    pub fn worlds<E: Engine + Send>(
        &mut self,
        seed: u64,
        worlds: &mut VectorEnvironment<E>,
    ) -> Result<(), CheckpointError> {
        let episodes: Vec<(u64, f64)> = self.value("episodes")?;
        if episodes.len() != worlds.worlds() {
            let found = format!("{} worlds", episodes.len());
            return Err(CheckpointError::mismatch("worlds", found, worlds.worlds().to_string()));
        }
        let mut progress = Vec::new();
        for (world, (number, level)) in episodes.into_iter().enumerate() {
            let actions = self.any_numbers(&format!("world.{world}.actions"))?;
            progress.push(Progress { number, level, actions });
        }
        Ok(worlds.resume(seed, &progress)?)
    }

    /// Reads a value stored as JSON.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the value is missing or does not parse.
    pub fn value<T: DeserializeOwned>(&self, name: &str) -> Result<T, CheckpointError> {
        let text = self.0.metadata.get(name).map_or("", String::as_str);
        serde_json::from_str(text)
            .map_err(|error| CheckpointError::mismatch(name, error.to_string(), "the state of a run"))
    }
}
