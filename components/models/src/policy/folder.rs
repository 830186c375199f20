//! A policy on disk: the description in `policy.toml`, and the network.

use std::path::{Path, PathBuf};

use super::{Policy, PolicyError};
use crate::inference::{Port, Program};
use crate::onnx::{Model, OnnxError};

/// Name of the file that describes a policy.
const FILE: &str = "policy.toml";

/// A policy read from a folder, with the location of its files.
#[derive(Clone, Debug)]
pub struct PolicyFolder {
    /// Content of `policy.toml`.
    pub policy: Policy,
    file: PathBuf,
}

/// Error of loading a policy from disk.
#[derive(Debug, thiserror::Error)]
pub enum PolicyFolderError {
    /// A file cannot be read.
    #[error("{}: {reason}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        reason: std::io::Error,
    },
    /// `policy.toml` is not valid.
    #[error("{}: {reason}", path.display())]
    Policy {
        /// Path of the file.
        path: PathBuf,
        /// Reason why the policy is invalid.
        reason: PolicyError,
    },
    /// The network cannot be read or compiled.
    #[error("{}: {reason}", path.display())]
    Onnx {
        /// Path of the file.
        path: PathBuf,
        /// Reason why the network cannot be used.
        reason: OnnxError,
    },
    /// The network does not match the policy.
    #[error("{}: {reason}", path.display())]
    Network {
        /// Path of the file.
        path: PathBuf,
        /// Description of the difference.
        reason: NetworkMismatch,
    },
}

/// Difference between the inputs or outputs of a network and its policy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NetworkMismatch {
    /// The number of values that the network reads differs from the size of the policy's observation.
    #[error(
        "the first input has the shape {found:?}, expected one row of {expected} numbers as in `observations`"
    )]
    Inputs {
        /// Shape of the first input; empty if the network has no input.
        found: Vec<usize>,
        /// Size of the observation.
        expected: usize,
    },
    /// The number of values that the network computes differs from the size of the policy's action.
    #[error(
        "the first output has the shape {found:?}, expected one row of {expected} numbers as in `action`"
    )]
    Outputs {
        /// Shape of the first output; empty if the network has no output.
        found: Vec<usize>,
        /// Number of values of the action.
        expected: usize,
    },
    /// The recurrent inputs do not match the recurrent outputs.
    #[error(
        "the recurrent input \"{input}\" has no matching output; help: after the action, export one output \
         for each recurrent input, in the same order and with the same shapes"
    )]
    State {
        /// Name of the recurrent input.
        input: String,
    },
    /// The initial states do not match the recurrent inputs.
    #[error("`initial_states` has {found:?} numbers, expected {expected:?}, as in the recurrent inputs")]
    InitialStates {
        /// Size of each initial state.
        found: Vec<usize>,
        /// Size of each recurrent input.
        expected: Vec<usize>,
    },
}

impl PolicyFolder {
    /// Reads a policy. `path` is a folder with a `policy.toml`, or the path of this file.
    ///
    /// # Errors
    ///
    /// [`PolicyFolderError`] with the path of the unreadable or invalid file.
    pub fn read(path: &Path) -> Result<Self, PolicyFolderError> {
        let file = if path.is_file() { path.to_owned() } else { path.join(FILE) };
        match std::fs::read_to_string(&file) {
            Ok(text) => match Policy::parse(&text) {
                Ok(policy) => Ok(Self { policy, file }),
                Err(reason) => Err(PolicyFolderError::Policy { path: file, reason }),
            },
            Err(reason) => Err(PolicyFolderError::Read { path: file, reason }),
        }
    }

    /// Returns the path of `policy.toml`.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Reads and compiles the network of the policy for one observation.
    ///
    /// # Errors
    ///
    /// [`PolicyFolderError`] with the path of the network.
    pub fn network(&self) -> Result<PolicyNetwork, PolicyFolderError> {
        let path = self.file.with_file_name(&self.policy.network);
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(reason) => return Err(PolicyFolderError::Read { path, reason }),
        };
        let program = Model::read(&bytes).and_then(|model| model.program(1));
        match program.map(|program| PolicyNetwork::new(&self.policy, program)) {
            Ok(Ok(network)) => Ok(network),
            Ok(Err(reason)) => Err(PolicyFolderError::Network { path, reason }),
            Err(reason) => Err(PolicyFolderError::Onnx { path, reason }),
        }
    }
}

/// The compiled network of a policy. The first input of the network is the observation, and the first output
/// is the action. All further inputs are recurrent states, in the same order as the further outputs. Running
/// the network does not allocate.
#[derive(Clone, Debug)]
pub struct PolicyNetwork {
    program: Program,
    states: usize,
    /// Values of the recurrent states at the start of an episode; empty for zeros.
    initial: Vec<Vec<f32>>,
}

impl PolicyNetwork {
    /// Creates the network of `policy` from a program compiled for one observation.
    ///
    /// # Errors
    ///
    /// [`NetworkMismatch`] if the widths or the recurrent states differ.
    pub fn new(policy: &Policy, program: Program) -> Result<Self, NetworkMismatch> {
        let shape = |port: Option<&Port>| port.map_or_else(Vec::new, |port| port.shape.clone());
        let is_row = |shape: &[usize], width: usize| {
            shape.last() == Some(&width) && shape.iter().product::<usize>() == width
        };
        let expected = policy.observations.iter().map(|term| policy.width(term) * term.history).sum();
        let found = shape(program.inputs().first());
        if !is_row(&found, expected) {
            return Err(NetworkMismatch::Inputs { found, expected });
        }
        let (found, expected) = (shape(program.outputs().first()), policy.outputs());
        if !is_row(&found, expected) {
            return Err(NetworkMismatch::Outputs { found, expected });
        }
        for (index, input) in program.inputs().iter().enumerate().skip(1) {
            if program.outputs().get(index).is_none_or(|output| output.shape != input.shape) {
                return Err(NetworkMismatch::State { input: input.name.clone() });
            }
        }
        let initial = policy.initial_states.clone();
        let found: Vec<usize> = initial.iter().map(Vec::len).collect();
        let states = program.inputs().iter().skip(1);
        let expected: Vec<usize> = states.map(|input| input.shape.iter().product()).collect();
        if !found.is_empty() && found != expected {
            return Err(NetworkMismatch::InitialStates { found, expected });
        }
        let states = program.inputs().len();
        let mut network = Self { program, states, initial };
        network.reset();
        Ok(network)
    }

    /// Resets the recurrent states to their initial values. Call this at the start of an episode.
    pub fn reset(&mut self) {
        for index in 1..self.states {
            let state = self.program.input_mut(index);
            match self.initial.get(index - 1) {
                Some(initial) => state.copy_from_slice(initial),
                None => state.fill(0.0),
            }
        }
    }

    /// Returns the buffer of the observation, which must be written before [`run`](Self::run).
    pub fn observation_mut(&mut self) -> &mut [f32] {
        self.program.input_mut(0)
    }

    /// Runs the network and returns the action. The recurrent states are kept for the next run.
    pub fn run(&mut self) -> &[f32] {
        self.program.run();
        (1..self.states).for_each(|index| self.program.feed_back(index, index));
        self.program.output(0)
    }
}
