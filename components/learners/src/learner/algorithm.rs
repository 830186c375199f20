//! All algorithms by name.

use core::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{Learner, read_settings};
use crate::a2c::A2cSettings;
use crate::ddpg::DdpgSettings;
use crate::dqn::DqnSettings;
use crate::environment::{EnvironmentError, Scene};
use crate::ppo::{Ppo, PpoSettings};
use crate::reinforce::ReinforceSettings;
use crate::sac::SacSettings;
use crate::task::Task;
use crate::td3::Td3Settings;

/// An algorithm that trains a policy.
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

/// A name that is not an algorithm's.
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

    /// Name of its table in a task.
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

    /// A learner before its first step, with the settings of the task; `steps` replaces theirs.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`].
    pub fn learner(
        self,
        task: &Task,
        scene: &Scene,
        steps: Option<u64>,
        (seed, threads): (u64, usize),
    ) -> Result<Box<dyn Learner>, EnvironmentError> {
        let (table, run, build) = (&task.algorithms, (seed, threads), || scene.simulation());
        Ok(match self {
            Self::Ppo => {
                let mut settings = PpoSettings::from_table(table)?;
                settings.steps = steps.unwrap_or(settings.steps);
                Box::new(Ppo::new(task, settings, run, build)?)
            }
            Self::A2c => {
                let mut settings: A2cSettings = read_settings(table, self)?;
                settings.steps = steps.unwrap_or(settings.steps);
                Box::new(settings.learner(task, run, build)?)
            }
            Self::Reinforce => {
                let mut settings: ReinforceSettings = read_settings(table, self)?;
                settings.steps = steps.unwrap_or(settings.steps);
                Box::new(settings.learner(task, run, build)?)
            }
            Self::Sac => {
                let mut settings: SacSettings = read_settings(table, self)?;
                settings.replay.steps = steps.unwrap_or(settings.replay.steps);
                Box::new(settings.learner(task, run, build)?)
            }
            Self::Td3 => {
                let mut settings: Td3Settings = read_settings(table, self)?;
                settings.replay.steps = steps.unwrap_or(settings.replay.steps);
                Box::new(settings.learner(task, run, build)?)
            }
            Self::Ddpg => {
                let mut settings: DdpgSettings = read_settings(table, self)?;
                settings.replay.steps = steps.unwrap_or(settings.replay.steps);
                Box::new(settings.learner(task, run, build)?)
            }
            Self::Dqn => {
                let mut settings: DqnSettings = read_settings(table, self)?;
                settings.replay.steps = steps.unwrap_or(settings.replay.steps);
                Box::new(settings.learner(task, run, build)?)
            }
        })
    }
}

impl FromStr for Algorithm {
    type Err = UnknownAlgorithm;

    fn from_str(name: &str) -> Result<Self, UnknownAlgorithm> {
        let found = Self::ALL.into_iter().find(|algorithm| algorithm.name() == name);
        found.ok_or_else(|| UnknownAlgorithm { found: name.to_owned() })
    }
}
