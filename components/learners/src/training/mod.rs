//! Training with any [`Algorithm`]: learners by name, and runs in folders.

mod run;

pub use run::{Run, RunError, Summary};

use crate::a2c::A2cSettings;
use crate::ddpg::DdpgSettings;
use crate::dqn::DqnSettings;
use crate::environment::{EnvironmentError, Scene};
use crate::learner::{Algorithm, Learner, read_settings, settings_table};
use crate::ppo::{Ppo, PpoSettings};
use crate::reinforce::ReinforceSettings;
use crate::sac::SacSettings;
use crate::task::{Task, TaskError};
use crate::td3::Td3Settings;

/// Creates a learner with the settings of the task. The learner has not performed any step yet. `steps`
/// overrides the total number of steps.
///
/// # Errors
///
/// [`EnvironmentError`] if a setting is invalid, the task does not fit the robot, or a simulation cannot be
/// built.
pub fn start(
    algorithm: Algorithm,
    task: &Task,
    scene: &Scene,
    steps: Option<u64>,
    (seed, threads): (u64, usize),
) -> Result<Box<dyn Learner>, EnvironmentError> {
    let (table, run, build) = (&task.algorithms, (seed, threads), || scene.simulation());
    Ok(match algorithm {
        Algorithm::Ppo => {
            let mut settings = PpoSettings::from_table(table)?;
            settings.steps = steps.unwrap_or(settings.steps);
            Box::new(Ppo::new(task, settings, run, build)?)
        }
        Algorithm::A2c => {
            let mut settings: A2cSettings = read_settings(table, algorithm)?;
            settings.steps = steps.unwrap_or(settings.steps);
            Box::new(settings.learner(task, run, build)?)
        }
        Algorithm::Reinforce => {
            let mut settings: ReinforceSettings = read_settings(table, algorithm)?;
            settings.steps = steps.unwrap_or(settings.steps);
            Box::new(settings.learner(task, run, build)?)
        }
        Algorithm::Sac => {
            let mut settings: SacSettings = read_settings(table, algorithm)?;
            settings.replay.steps = steps.unwrap_or(settings.replay.steps);
            Box::new(settings.learner(task, run, build)?)
        }
        Algorithm::Td3 => {
            let mut settings: Td3Settings = read_settings(table, algorithm)?;
            settings.replay.steps = steps.unwrap_or(settings.replay.steps);
            Box::new(settings.learner(task, run, build)?)
        }
        Algorithm::Ddpg => {
            let mut settings: DdpgSettings = read_settings(table, algorithm)?;
            settings.replay.steps = steps.unwrap_or(settings.replay.steps);
            Box::new(settings.learner(task, run, build)?)
        }
        Algorithm::Dqn => {
            let mut settings: DqnSettings = read_settings(table, algorithm)?;
            settings.replay.steps = steps.unwrap_or(settings.replay.steps);
            Box::new(settings.learner(task, run, build)?)
        }
    })
}

/// Returns all settings of an algorithm: its table in the task, completed with defaults.
///
/// # Errors
///
/// [`TaskError`] with the key of an invalid setting.
pub fn settings(algorithm: Algorithm, task: &Task) -> Result<toml::Table, TaskError> {
    let table = &task.algorithms;
    match algorithm {
        Algorithm::Ppo => settings_table(algorithm, &PpoSettings::from_table(table)?),
        Algorithm::A2c => settings_table(algorithm, &read_settings::<A2cSettings>(table, algorithm)?),
        Algorithm::Reinforce => {
            settings_table(algorithm, &read_settings::<ReinforceSettings>(table, algorithm)?)
        }
        Algorithm::Sac => settings_table(algorithm, &read_settings::<SacSettings>(table, algorithm)?),
        Algorithm::Td3 => settings_table(algorithm, &read_settings::<Td3Settings>(table, algorithm)?),
        Algorithm::Ddpg => settings_table(algorithm, &read_settings::<DdpgSettings>(table, algorithm)?),
        Algorithm::Dqn => settings_table(algorithm, &read_settings::<DqnSettings>(table, algorithm)?),
    }
}

#[cfg(test)]
mod tests;
