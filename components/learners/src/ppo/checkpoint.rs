//! Checkpoints: everything that the rest of a training run depends on, in one safetensors file.

use motorium_models::networks::{Adam, Perceptron};
use motorium_models::safetensors::{self, SafetensorsError, Tensor, Tensors};
use motorium_physics::Engine;

use super::{Ppo, State};
use crate::environment::{self, EnvironmentError};

/// A checkpoint that does not fit.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file is not a safetensors file.
    #[error(transparent)]
    Format(#[from] SafetensorsError),
    /// A part is missing or has another size.
    #[error("{what}: {found}, expected {expected}; help: resume with the task and the settings of the run")]
    Mismatch {
        /// Part of the checkpoint.
        what: String,
        /// State found.
        found: String,
        /// State expected.
        expected: String,
    },
    /// The worlds cannot be replayed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
}

const PARTS: [&str; 3] = ["policy", "value", "deviations"];

impl<E: Engine + Send> Ppo<E> {
    /// The bytes of a checkpoint. The worlds are stored as the actions of their running episodes.
    ///
    /// # Errors
    ///
    /// [`CheckpointError::Format`].
    pub fn checkpoint(&self) -> Result<Vec<u8>, CheckpointError> {
        let mut file = Tensors::default();
        let mut insert = |name: String, values: Vec<f32>| {
            file.tensors.insert(name, Tensor { shape: vec![values.len()], values });
        };
        let networks = [self.policy.to_vec(), self.value.to_vec(), self.deviations.clone()];
        let [first, second] = self.adam.moments();
        for ((name, values), (first, second)) in PARTS.iter().zip(networks).zip(first.iter().zip(second)) {
            insert((*name).to_owned(), values);
            insert(format!("{name}.first_moment"), first.clone());
            insert(format!("{name}.second_moment"), second.clone());
        }
        let (mut episodes, mut levels) = (Vec::new(), Vec::new());
        for (world, running) in self.worlds.progress().into_iter().enumerate() {
            insert(format!("world.{world}.actions"), running.actions);
            episodes.push(running.number);
            levels.push(running.level);
        }
        let state = serde_json::json!({
            "state": self.state,
            "adam_steps": self.adam.steps(),
            "episodes": episodes,
            "levels": levels,
        });
        file.metadata.insert("algorithm".to_owned(), "ppo".to_owned());
        file.metadata.insert("state".to_owned(), state.to_string());
        Ok(safetensors::write(&file)?)
    }

    /// Restores a checkpoint of a run with the same task and settings: the run then continues bit for bit.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`].
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), CheckpointError> {
        #[derive(serde::Deserialize)]
        struct Numbers {
            state: State,
            adam_steps: i32,
            episodes: Vec<u64>,
            levels: Vec<f64>,
        }
        let mismatch = |what: &str, found: String, expected: String| CheckpointError::Mismatch {
            what: what.to_owned(),
            found,
            expected,
        };
        let mut file = safetensors::read(bytes)?;
        let algorithm = file.metadata.get("algorithm").cloned().unwrap_or_default();
        if algorithm != "ppo" {
            return Err(mismatch("algorithm", format!("\"{algorithm}\""), "\"ppo\"".to_owned()));
        }
        let text = file.metadata.get("state").cloned().unwrap_or_default();
        let numbers: Numbers = serde_json::from_str(&text)
            .map_err(|error| mismatch("state", error.to_string(), "the state of a run".to_owned()))?;
        let mut take = |name: String, length: Option<usize>| {
            let found = file.tensors.remove(&name).map(|tensor| tensor.values);
            match (found, length) {
                (Some(values), Some(length)) if values.len() != length => {
                    Err(mismatch(&name, format!("{} numbers", values.len()), length.to_string()))
                }
                (Some(values), _) => Ok(values),
                (None, _) => Err(mismatch(&name, "missing".to_owned(), "a tensor".to_owned())),
            }
        };
        let lengths = [self.policy.parameters(), self.value.parameters(), self.deviations.len()];
        let (mut networks, mut first, mut second) = (vec![], vec![], vec![]);
        for (name, length) in PARTS.iter().zip(lengths) {
            networks.push(take((*name).to_owned(), Some(length))?);
            first.push(take(format!("{name}.first_moment"), Some(length))?);
            second.push(take(format!("{name}.second_moment"), Some(length))?);
        }
        let worlds = self.worlds.worlds();
        let counts = [numbers.episodes.len(), numbers.levels.len(), numbers.state.running.len()];
        if counts != [worlds; 3] {
            let found = format!("{} worlds", numbers.episodes.len());
            return Err(mismatch("worlds", found, worlds.to_string()));
        }
        let mut progress = Vec::new();
        for (world, (number, level)) in numbers.episodes.iter().zip(&numbers.levels).enumerate() {
            let actions = take(format!("world.{world}.actions"), None)?;
            progress.push(environment::Progress { number: *number, level: *level, actions });
        }
        let adam = Adam::from_moments([first, second], numbers.adam_steps);
        let adam =
            adam.ok_or_else(|| mismatch("optimiser", "moments".to_owned(), "equal lengths".to_owned()))?;
        self.worlds.resume(numbers.state.seed, &progress)?;
        let set = |network: &mut Perceptron, values: &[f32]| network.set(values);
        set(&mut self.policy, &networks[0]);
        set(&mut self.value, &networks[1]);
        self.deviations.copy_from_slice(&networks[2]);
        self.adam = adam;
        self.state = numbers.state;
        Ok(())
    }
}
