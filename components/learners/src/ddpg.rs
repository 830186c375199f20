//! Deep deterministic policy gradient (DDPG).
//!
//! A deterministic policy `mu(o)` between -1 and 1 ascends the gradient of a critic. With target networks
//! `mu'` and `Q'`, and samples `(o, a, r, o')` from the replay buffer, each gradient step minimises
//!
//! ```text
//! y   = r + discount Q'(o', mu'(o'))
//! L_Q = 1/2 E[(Q(o, a) - y)^2]
//! L   = -E[Q(o, mu(o))]
//! ```
//!
//! and moves the target networks towards the trained networks by the fraction `polyak`. Exploration adds
//! `N(0, noise^2)` to the actions. The implementation is [TD3](crate::td3) with one critic.
//!
//! Source: Lillicrap, Hunt, Pritzel and others, *Continuous control with deep reinforcement learning*, ICLR
//! 2016; for defaults, see [`DdpgSettings`].

use motorium_physics::{BuildError, Engine, Simulation};
use serde::{Deserialize, Serialize};

use crate::environment::EnvironmentError;
use crate::learner::{Algorithm, Check};
use crate::replay::{OffPolicy, ReplaySettings};
use crate::task::{Task, TaskError, Terms};
use crate::td3::{Deterministic, Td3Settings};

/// Settings of DDPG: the table `[algorithms.ddpg]` of a task.
///
/// Unless stated otherwise, defaults follow CleanRL's `ddpg_continuous_action` (learning rate 3e-4, minibatch
/// of 256, polyak 0.005, discount 0.99, Gaussian noise of 0.1 instead of the paper's correlated noise).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DdpgSettings {
    /// Settings of steps, replay and networks. The defaults are the defaults of
    /// [`SacSettings`](crate::sac::SacSettings), some of which differ from the source.
    #[serde(flatten)]
    pub replay: ReplaySettings,
    /// Standard deviation of the exploration noise, at least 0. Default 0.1.
    pub noise: f64,
}

impl Default for DdpgSettings {
    fn default() -> Self {
        Self { replay: crate::sac::SacSettings::default().replay, noise: 0.1 }
    }
}

impl DdpgSettings {
    /// Returns the TD3 settings that make it DDPG.
    fn to_td3(&self) -> Td3Settings {
        let Self { replay, noise } = self.clone();
        Td3Settings { replay, noise, target_noise: 0.0, target_clip: 0.0, delay: 1 }
    }

    /// Checks all settings.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] with the key of the first invalid setting.
    pub fn check(&self) -> Result<(), TaskError> {
        self.to_td3().check_for(Check(Algorithm::Ddpg))
    }

    /// Creates a training run that has not performed any step yet. `run` contains the seed and the number of
    /// threads; `build` creates the simulation of each world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if a setting is invalid, the task does not fit the robot, or a simulation cannot
    /// be built.
    pub fn learner<E: Engine + Send>(
        self,
        task: &Task,
        run: (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<OffPolicy<E, Deterministic>, EnvironmentError> {
        self.check()?;
        let settings = self.to_td3();
        let method = |terms: &Terms| Deterministic::new(terms, &settings, (Algorithm::Ddpg, 1), run.0);
        OffPolicy::new(task, settings.replay.clone(), run, method, build)
    }
}
