//! Balancing a cart-pole by imitation, by reinforcement learning, and by both in sequence.
//!
//! The demonstrator keeps the pole upright, but pushes slightly to one side and ignores the cart, which runs
//! off its track. A policy learns first from a short demonstration and then from rewards, or only from
//! rewards. [`Power`] trains a linear policy; [`Ppo`] trains a network.
//!
//! Source: Delhaisse's thesis, 2019, section 2.4.4, figure 2.32. The thesis does not state the demonstration
//! and the settings.

use std::path::Path;

use motorium_models::inference::Unary;
use motorium_models::onnx::{self, Model, OnnxError};
use motorium_models::policy::PolicyNetwork;
use motorium_physics::Articulated;
use serde::Serialize;

use super::trials::{EPISODES, EVALUATION_WORLD, Setting, power_curve, run_jobs};
use crate::environment::{EnvironmentError, Scene, SceneError};
use crate::imitation::{Imitation, ImitationError, ImitationSettings};
use crate::learner::{Learner as _, LearnerError};
use crate::ppo::{Ppo, PpoSettings};
use crate::search::{Start, StartError, TellError};
use crate::task::Task;

/// Weights of the demonstrator for the observations of the task, followed by the bias of the demonstrator.
/// The observations are the positions of cart and pole relative to the default pose \[m, rad\], then their
/// velocities. The action is a fraction of the maximum force.
pub const DEMONSTRATOR: [f32; 5] = [0.0, 2.0, 0.0, 0.3, 0.03];
/// Length of an observation.
const INPUTS: usize = DEMONSTRATOR.len() - 1;
/// Standard deviation of the exploration of PoWER for these weights and for the bias.
const EXPLORATION: [f64; 5] = [0.3, 1.0, 0.3, 0.3, 0.02];
/// PoWER rollouts between two evaluations of its mean.
const ROLLOUTS: u64 = 10;
/// PPO updates between two evaluations of its policy.
const UPDATES: u64 = 4;

/// Method that learns from rewards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// PoWER, which trains a linear policy.
    Power,
    /// PPO, which trains a network.
    Ppo,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 2] = [Self::Power, Self::Ppo];

    /// Returns the name in the figures of the study.
    pub fn name(self) -> &'static str {
        match self {
            Self::Power => "PoWER",
            Self::Ppo => "PPO",
        }
    }
}

/// Policy from which a method starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Beginning {
    /// A clone of the demonstrator.
    Imitation,
    /// Zero weights of a linear policy, or random weights of a network.
    Scratch,
}

impl Beginning {
    /// All initial policies.
    pub const ALL: [Self; 2] = [Self::Imitation, Self::Scratch];

    /// Returns the name in the figures of the study.
    pub fn name(self) -> &'static str {
        match self {
            Self::Imitation => "after imitation",
            Self::Scratch => "from scratch",
        }
    }
}

/// Settings of a study of the cart-pole task.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudySettings {
    /// First seed of the trials.
    pub first_seed: u64,
    /// Number of seeds, at least 1.
    pub seeds: u64,
    /// Number of steps of a demonstration, at least 1.
    pub demonstration: u64,
    /// Number of episodes of a PoWER run, at least 1.
    pub rollouts: u64,
    /// Number of steps of a PPO run, at least 1.
    pub steps: u64,
}

/// Error of a study of the cart-pole task.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The robot cannot be loaded.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An environment failed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// Imitation failed.
    #[error(transparent)]
    Imitation(#[from] ImitationError),
    /// PPO failed.
    #[error(transparent)]
    Learner(#[from] LearnerError),
    /// PoWER rejected its start.
    #[error(transparent)]
    Start(#[from] StartError),
    /// PoWER rejected a reward.
    #[error(transparent)]
    Tell(#[from] TellError),
    /// A network cannot be evaluated.
    #[error(transparent)]
    Network(#[from] OnnxError),
    /// The observations or actions of the task are not the observations and actions of a cart-pole.
    #[error("the task has {inputs} observations and {actions} actions, expected 4 and 2 as for a cart-pole")]
    Task {
        /// Length of an observation.
        inputs: usize,
        /// Length of an action.
        actions: usize,
    },
}

/// Mean return after a given amount of experience.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Number of episodes for PoWER, number of steps for PPO; 0 at the start.
    pub experience: u64,
    /// Mean return of the policy without exploration.
    pub mean_return: f64,
}

/// Learning curve of one method with one seed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Method that learns.
    pub method: Method,
    /// Policy from which the method starts.
    pub beginning: Beginning,
    /// Seed of the trial.
    pub seed: u64,
    /// Mean returns in order of experience.
    pub curve: Vec<Point>,
}

impl Trial {
    /// Returns the experience after which the mean return first reaches `level`; `None` if the level is never
    /// reached.
    pub fn experience_to(&self, level: f64) -> Option<u64> {
        self.curve.iter().find(|point| point.mean_return >= level).map(|point| point.experience)
    }
}

/// Trials of all methods and initial policies with several seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    /// Mean return of the demonstrator for each seed.
    pub demonstrator: Vec<f64>,
    /// All trials, ordered by method, initial policy and seed.
    pub trials: Vec<Trial>,
}

/// A job of a study.
enum Job {
    Demonstrator(u64),
    Trial(Method, Beginning, u64),
}

/// Result of a job.
enum Done {
    Demonstrator(f64),
    Trial(Trial),
}

impl Study {
    /// Runs a study of the cart-pole task on several threads. The path of the task's robot is relative to
    /// `base`. `observe` is called after each trial and each demonstrator. The result does not depend on the
    /// number of threads.
    ///
    /// # Errors
    ///
    /// [`StudyError`] if the robot cannot be loaded, or a method or an environment fails.
    pub fn run(
        task: &Task,
        base: &Path,
        settings: &StudySettings,
        threads: usize,
        observe: impl Fn() + Sync,
    ) -> Result<Self, StudyError> {
        let scene = Scene::load(task, base)?;
        let bench = Bench { setting: Setting { task, scene: &scene }, settings };
        let (inputs, actions) = bench.size()?;
        if (inputs, actions) != (INPUTS, 2) {
            return Err(StudyError::Task { inputs, actions });
        }
        let seeds = settings.first_seed..settings.first_seed.saturating_add(settings.seeds);
        let mut jobs: Vec<Job> = seeds.clone().map(Job::Demonstrator).collect();
        for method in Method::ALL {
            for beginning in Beginning::ALL {
                jobs.extend(seeds.clone().map(|seed| Job::Trial(method, beginning, seed)));
            }
        }
        let work = |(): &mut (), job: &Job| {
            let done = match *job {
                Job::Demonstrator(seed) => {
                    Done::Demonstrator(bench.linear_return(&DEMONSTRATOR.map(f64::from), seed)?)
                }
                Job::Trial(method, beginning, seed) => {
                    let curve = match method {
                        Method::Power => bench.power(beginning, seed)?,
                        Method::Ppo => bench.ppo(beginning, seed)?,
                    };
                    Done::Trial(Trial { method, beginning, seed, curve })
                }
            };
            observe();
            Ok::<Done, StudyError>(done)
        };
        let mut study = Self { demonstrator: Vec::new(), trials: Vec::new() };
        for done in run_jobs(threads, &jobs, |_| Ok(()), work)? {
            match done {
                Done::Demonstrator(found) => study.demonstrator.push(found),
                Done::Trial(trial) => study.trials.push(trial),
            }
        }
        Ok(study)
    }

    /// Returns the trials of a method with an initial policy.
    pub fn trials(&self, method: Method, beginning: Beginning) -> impl Iterator<Item = &Trial> {
        self.trials.iter().filter(move |trial| (trial.method, trial.beginning) == (method, beginning))
    }

    /// Returns the mean return at the start of each trial. There is one trial per seed.
    pub fn starts(&self, method: Method, beginning: Beginning) -> Vec<f64> {
        self.trials(method, beginning).filter_map(|trial| Some(trial.curve.first()?.mean_return)).collect()
    }

    /// Returns the mean return at the end of each trial. There is one trial per seed.
    pub fn ends(&self, method: Method, beginning: Beginning) -> Vec<f64> {
        self.trials(method, beginning).filter_map(|trial| Some(trial.curve.last()?.mean_return)).collect()
    }

    /// Returns the experience after which each trial first reaches a mean return of `level`; infinite if the
    /// level is never reached.
    pub fn experience_to(&self, level: f64, method: Method, beginning: Beginning) -> Vec<f64> {
        let found = |trial: &Trial| trial.experience_to(level).map_or(f64::INFINITY, |found| found as f64);
        self.trials(method, beginning).map(found).collect()
    }
}

/// The task and the settings of all trials.
#[derive(Clone, Copy)]
struct Bench<'a> {
    setting: Setting<'a>,
    settings: &'a StudySettings,
}

impl Bench<'_> {
    /// Returns the lengths of an observation and an action.
    fn size(&self) -> Result<(usize, usize), EnvironmentError> {
        let environment = self.setting.environment(0, 0)?;
        Ok((environment.terms().inputs(), environment.terms().actions()))
    }

    /// Returns the mean return over the episodes of an evaluation, which are the same for all policies with
    /// one seed.
    fn mean_return(
        &self,
        seed: u64,
        mut act: impl FnMut(&[f32], &mut [f32]),
    ) -> Result<f64, EnvironmentError> {
        let mut environment = self.setting.environment(seed, EVALUATION_WORLD)?;
        let mut total = 0.0;
        for _ in 0..EPISODES {
            total += environment.run_episode(&mut act)?.total;
        }
        Ok(total / EPISODES as f64)
    }

    /// Returns the mean return of a linear policy.
    fn linear_return(&self, weights: &[f64], seed: u64) -> Result<f64, EnvironmentError> {
        self.mean_return(seed, |observation, action| act_linearly(weights, observation, action))
    }

    /// Clones the demonstrator from a demonstration.
    fn imitation(&self, hidden: &[usize], seed: u64) -> Result<Imitation<Articulated>, StudyError> {
        let (weights, bias) = DEMONSTRATOR.split_at(INPUTS);
        let layer = ([weights, &[0.0; INPUTS]].concat(), vec![bias[0], 0.0]);
        let bytes = onnx::write_mlp(INPUTS, &[layer], Unary::Tanh, &[]);
        let policy = self.setting.task.policy().map_err(EnvironmentError::from)?;
        let expert = PolicyNetwork::new(&policy, Model::read(&bytes)?.program(1)?)
            .expect("a network of 4 observations and 2 actions");
        let settings = ImitationSettings {
            iterations: 1,
            steps: self.settings.demonstration,
            worlds: 1,
            epochs: 100,
            rate: if hidden.is_empty() { 1e-2 } else { 3e-3 },
            hidden: hidden.to_vec(),
            ..ImitationSettings::default()
        };
        let mut imitation = Imitation::new(self.setting.task, settings, &expert, (seed, 1), || {
            self.setting.scene.simulation()
        })?;
        imitation.advance()?;
        Ok(imitation)
    }

    fn power(&self, beginning: Beginning, seed: u64) -> Result<Vec<Point>, StudyError> {
        let mut weights = vec![0.0; EXPLORATION.len()];
        if beginning == Beginning::Imitation {
            let layers = self.imitation(&[], seed)?.policy().layers;
            let (rows, bias) = &layers[0];
            let row = rows[..INPUTS].iter().chain(&bias[..1]);
            weights = row.map(|weight| f64::from(*weight)).collect();
        }
        let start = Start::new(weights, EXPLORATION.to_vec(), seed);
        let mut environment = self.setting.environment(seed, 0)?;
        power_curve(
            start,
            (self.settings.rollouts, ROLLOUTS),
            |weights| {
                let act =
                    |observation: &[f32], action: &mut [f32]| act_linearly(weights, observation, action);
                Ok(environment.run_episode(act)?.total)
            },
            |weights, experience| Ok(Point { experience, mean_return: self.linear_return(weights, seed)? }),
        )
    }

    fn ppo(&self, beginning: Beginning, seed: u64) -> Result<Vec<Point>, StudyError> {
        let mut settings =
            PpoSettings::from_table(&self.setting.task.algorithms).map_err(EnvironmentError::from)?;
        settings.steps = self.settings.steps;
        let hidden = settings.hidden.clone();
        let mut ppo = Ppo::new(self.setting.task, settings, (seed, 1), || self.setting.scene.simulation())?;
        if beginning == Beginning::Imitation {
            let imitation = self.imitation(&hidden, seed)?;
            let (network, normaliser) = imitation.network();
            ppo.start_from(network, normaliser);
        }
        let mut curve = vec![Point { experience: 0, mean_return: self.network_return(&ppo, seed)? }];
        while !ppo.is_finished() {
            ppo.advance()?;
            if ppo.updates().is_multiple_of(UPDATES) || ppo.is_finished() {
                let mean_return = self.network_return(&ppo, seed)?;
                curve.push(Point { experience: ppo.steps(), mean_return });
            }
        }
        Ok(curve)
    }

    /// Returns the mean return of a run's policy without exploration.
    fn network_return(&self, ppo: &Ppo<Articulated>, seed: u64) -> Result<f64, StudyError> {
        let mut program = Model::read(&ppo.policy().to_onnx(&[]))?.program(1)?;
        let found = self.mean_return(seed, |observation, action| {
            program.input_mut(0).copy_from_slice(observation);
            program.run();
            action.copy_from_slice(program.output(0));
        });
        Ok(found?)
    }
}

/// Writes the action of a linear policy: four weights and a bias. The hinge has no drive.
fn act_linearly(weights: &[f64], observation: &[f32], action: &mut [f32]) {
    let terms = weights.iter().zip(observation).map(|(weight, number)| weight * f64::from(*number));
    let bias = weights.last().copied().unwrap_or(0.0);
    action.copy_from_slice(&[(terms.sum::<f64>() + bias) as f32, 0.0]);
}

#[cfg(test)]
mod tests {
    use super::*;

    const TASK: &str = include_str!("../../../../tasks/cart-pole.toml");

    fn study(threads: usize, settings: &StudySettings) -> Study {
        let task = Task::parse(TASK).expect("a task");
        Study::run(&task, Path::new("."), settings, threads, || {}).expect("a study")
    }

    #[test]
    fn imitation_saves_rollouts_of_power() {
        let settings = StudySettings { first_seed: 1, seeds: 3, demonstration: 600, rollouts: 60, steps: 1 };
        let found = study(2, &settings);
        assert_eq!(found, study(1, &settings), "threads change no bit");
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let demonstrator = mean(&found.demonstrator);
        // the cart runs off its track, but not immediately
        assert!((60.0..475.0).contains(&demonstrator), "{demonstrator}");
        let cloned = mean(&found.starts(Method::Power, Beginning::Imitation));
        assert!((cloned / demonstrator - 1.0).abs() < 0.25, "{cloned} of {demonstrator}");
        let improved = mean(&found.ends(Method::Power, Beginning::Imitation));
        assert!(improved > demonstrator, "{improved} of {demonstrator}");
        let scratch = mean(&found.starts(Method::Power, Beginning::Scratch));
        assert!(scratch < 0.6 * demonstrator, "{scratch} of {demonstrator}");
        for trial in &found.trials {
            let experience: Vec<u64> = trial.curve.iter().map(|point| point.experience).collect();
            assert!(experience.is_sorted() && experience[0] == 0, "{trial:?}");
        }
    }

    #[test]
    fn ppo_starts_from_the_cloned_network() {
        let settings = StudySettings { first_seed: 4, seeds: 1, demonstration: 1000, rollouts: 1, steps: 1 };
        let found = study(1, &settings);
        let [cloned] = found.starts(Method::Ppo, Beginning::Imitation)[..] else { panic!("one seed") };
        let [random] = found.starts(Method::Ppo, Beginning::Scratch)[..] else { panic!("one seed") };
        assert!(cloned > 2.0 * random && cloned > 0.6 * found.demonstrator[0], "{cloned} {random}");
    }

    #[test]
    fn experience_counts_to_the_first_return_at_a_level() {
        let point = |experience, mean_return| Point { experience, mean_return };
        let curve = vec![point(0, 20.0), point(10, 480.0), point(20, 400.0), point(30, 490.0)];
        let trial = Trial { method: Method::Power, beginning: Beginning::Scratch, seed: 1, curve };
        assert_eq!(trial.experience_to(475.0), Some(10));
        assert_eq!(trial.experience_to(485.0), Some(30));
        assert_eq!(trial.experience_to(499.0), None);
    }

    #[test]
    fn tasks_of_other_robots_are_refused() {
        let task = Task::parse(include_str!("../../../../tasks/pendulum.toml")).expect("a task");
        let settings = StudySettings { first_seed: 1, seeds: 1, demonstration: 1, rollouts: 1, steps: 1 };
        let refused = Study::run(&task, Path::new("."), &settings, 1, || {});
        assert!(matches!(refused, Err(StudyError::Task { actions: 1, .. })));
    }
}
