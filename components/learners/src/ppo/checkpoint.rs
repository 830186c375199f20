//! Checkpoints of on-policy methods.

use motorium_physics::Engine;

use super::{EPSILON, Ppo, State};
use crate::learner::{CheckpointError, CheckpointReader, CheckpointWriter};

const PARTS: [&str; 3] = ["policy", "value", "deviations"];
/// Recurrent states of policy and value.
const MEMORIES: [&str; 2] = ["policy.memory", "value.memory"];

impl<E: Engine + Send> Ppo<E> {
    /// Returns the bytes of a checkpoint. Worlds are stored as the actions of their running episodes.
    ///
    /// # Errors
    ///
    /// [`CheckpointError::Format`] if the content does not form a safetensors file.
    pub fn checkpoint(&self) -> Result<Vec<u8>, CheckpointError> {
        let mut writer = CheckpointWriter::new(self.variant.algorithm);
        let networks = [self.policy.to_vec(), self.value.to_vec(), self.deviations.clone()];
        for (name, values) in PARTS.into_iter().zip(networks) {
            writer.numbers(name, values);
        }
        for (name, states) in
            MEMORIES.into_iter().zip(&self.memories).filter(|(_, states)| !states.is_empty())
        {
            writer.numbers(name, states.clone());
        }
        writer.optimiser("adam_steps", &PARTS, &self.adam)?;
        writer.worlds(&self.worlds)?;
        writer.value("state", &self.state)?;
        writer.finish()
    }

    /// Restores a checkpoint of a run with the same task and settings. The run then continues bit for bit.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the checkpoint is invalid or does not fit the run. The run is then unusable.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), CheckpointError> {
        let mut reader = CheckpointReader::new(bytes, self.variant.algorithm)?;
        for (name, network) in PARTS.into_iter().zip([&mut self.policy, &mut self.value]) {
            network.set(&reader.numbers(name, network.parameters())?);
        }
        self.deviations = reader.numbers(PARTS[2], self.deviations.len())?;
        for (name, states) in
            MEMORIES.into_iter().zip(&mut self.memories).filter(|(_, states)| !states.is_empty())
        {
            *states = reader.numbers(name, states.len())?;
        }
        let lengths = [self.policy.parameters(), self.value.parameters(), self.deviations.len()];
        let slices: Vec<(&str, usize)> = PARTS.into_iter().zip(lengths).collect();
        self.adam = reader.optimiser("adam_steps", &slices)?.with_epsilon(EPSILON);
        let state: State = reader.value("state")?;
        reader.worlds(state.seed, &mut self.worlds)?;
        let (found, expected) = (state.episodes.worlds(), self.settings.worlds);
        if found != expected || state.discounted.len() != expected {
            return Err(CheckpointError::mismatch("worlds", format!("{found} worlds"), expected.to_string()));
        }
        self.state = state;
        Ok(())
    }
}
