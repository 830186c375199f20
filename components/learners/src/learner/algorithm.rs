//! All algorithms by name.

use core::str::FromStr;

use serde::{Deserialize, Serialize};

/// An algorithm of reinforcement learning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// Proximal policy optimisation.
    Ppo,
    /// Advantage actor-critic.
    A2c,
    /// REINFORCE with a baseline.
    Reinforce,
    /// Soft actor-critic.
    Sac,
    /// Twin delayed deep deterministic policy gradient.
    Td3,
    /// Deep deterministic policy gradient.
    Ddpg,
    /// Deep Q-network.
    Dqn,
}

/// Error of an unknown algorithm name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("algorithm \"{found}\", expected {}", Algorithm::ALL.map(Algorithm::name).join(", "))]
pub struct UnknownAlgorithm {
    /// Name found.
    pub found: String,
}

impl Algorithm {
    /// All algorithms.
    pub const ALL: [Self; 7] =
        [Self::Ppo, Self::A2c, Self::Reinforce, Self::Sac, Self::Td3, Self::Ddpg, Self::Dqn];

    /// Returns the name of the algorithm, which is also the name of its table in a task.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ppo => "ppo",
            Self::A2c => "a2c",
            Self::Reinforce => "reinforce",
            Self::Sac => "sac",
            Self::Td3 => "td3",
            Self::Ddpg => "ddpg",
            Self::Dqn => "dqn",
        }
    }
}

impl FromStr for Algorithm {
    type Err = UnknownAlgorithm;

    fn from_str(name: &str) -> Result<Self, UnknownAlgorithm> {
        let found = Self::ALL.into_iter().find(|algorithm| algorithm.name() == name);
        found.ok_or_else(|| UnknownAlgorithm { found: name.to_owned() })
    }
}
