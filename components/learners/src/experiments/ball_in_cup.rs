//! Study of the ball-in-cup task: PoWER learns to catch a ball on a string in a cup. The weights of a motion
//! library or of radial kernels are searched.
//!
//! A demonstrator attempts the catch. Each attempt sways the cup once and jerks it up, with different
//! distances and timing; few attempts succeed. A movement of the cup is the response of a spring to forces,
//! which are weighted eigenforces of all attempts or the same number of weighted kernels. Each search starts
//! from the mean attempt and explores with the variance of the attempts' weights. A rollout is one episode,
//! with a random start and random masses.
//!
//! Sources: task and method from Kober, Peters, *Policy search for motor primitives in robotics*, NIPS 2008;
//! library from Delhaisse's thesis, 2019, section 3.4.3. The demonstrator's attempts are not part of these
//! sources.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use motorium_library::{
    BuildError, DAMPING, Metric, MotionLibrary, Movement, Recordings, SampledSpring, SpringError, Trajectory,
    Truncation,
};
use motorium_physics::Articulated;
use nalgebra::DMatrix;
use rand::RngExt as _;
use rand_pcg::Pcg64;
use serde::Serialize;

use super::search::{KernelPrior, SearchSpace};
use super::trials::{EPISODES, EVALUATION_WORLD, Setting, power_curve, run_jobs};
use crate::environment::{Environment, EnvironmentError, Scene, SceneError};
use crate::random::{Counter, Purpose};
use crate::search::{Start, StartError, TellError};
use crate::task::{End, Task};

/// Joints that the movement drives: along x and along z.
const DRIVEN: usize = 2;
/// Duration of a movement, s. Afterwards the cup stays at its start position.
const SECONDS: f64 = 1.2;
/// Number of attempts of the demonstrator.
const ATTEMPTS: u64 = 60;
/// Rollouts between two evaluations of the mean of a search.
const ROLLOUTS: u64 = 25;
/// Increase of the return that multiplies PoWER's positive reward by e.
const TEMPERATURE: f64 = 3.0;

/// Kind of the weights that a search varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Weights {
    /// Weights of eigenforces.
    Library,
    /// Weights of kernels, explored such that each kernel has the same share of the attempts' response.
    Kernels,
    /// Weights of kernels, explored with the variances of a fit to the attempts.
    FittedKernels,
}

impl Weights {
    /// All kinds of weights.
    pub const ALL: [Self; 3] = [Self::Library, Self::Kernels, Self::FittedKernels];

    /// Returns the name of the weights in figures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Library => "library",
            Self::Kernels => "kernels, equal response",
            Self::FittedKernels => "kernels, as fitted",
        }
    }

    fn space(self, library: &MotionLibrary, n: usize) -> SearchSpace {
        match self {
            Self::Library => SearchSpace::library(library, n),
            Self::Kernels => SearchSpace::kernels(library, n, KernelPrior::EqualResponse),
            Self::FittedKernels => SearchSpace::kernels(library, n, KernelPrior::Fitted),
        }
    }
}

/// Settings of a study of the ball-in-cup task.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudySettings {
    /// First seed of the searches.
    pub first_seed: u64,
    /// Number of seeds, at least 1.
    pub seeds: u64,
    /// Numbers of weights to compare, each at least 2.
    pub weights: Vec<usize>,
    /// Number of episodes of a search, at least 1.
    pub rollouts: u64,
}

/// Error of a study of the ball-in-cup task.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The robot cannot be loaded.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An environment failed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// The spring is unstable at the rate of the task.
    #[error(transparent)]
    Spring(#[from] SpringError),
    /// No library can be built from the attempts.
    #[error(transparent)]
    Library(#[from] BuildError),
    /// PoWER rejected its start.
    #[error(transparent)]
    Start(#[from] StartError),
    /// PoWER rejected a reward.
    #[error(transparent)]
    Tell(#[from] TellError),
    /// The task does not drive two joints.
    #[error("the task drives {found} joints, expected 2, along x and z")]
    Task {
        /// Number of driven joints.
        found: usize,
    },
}

/// Evaluation of the movement after a number of rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Number of rollouts before the evaluation; 0 at the start.
    pub rollouts: u64,
    /// Mean return of the movement without exploration.
    pub mean_return: f64,
    /// Fraction of the episodes in which the ball is caught.
    pub caught: f64,
}

/// Learning curve of one search.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Kind of the weights.
    pub weights: Weights,
    /// Number of weights.
    pub count: usize,
    /// Seed of the search.
    pub seed: u64,
    /// Evaluations in the order of the rollouts.
    pub curve: Vec<Point>,
}

/// Results of searches with all kinds of weights and several seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    /// Fraction of the demonstrator's attempts that catch the ball.
    pub caught_by_attempts: f64,
    /// All trials, ordered by kind of weights, number of weights and seed.
    pub trials: Vec<Trial>,
}

impl Study {
    /// Runs a study of the ball-in-cup task on several threads. The path of the task's robot is relative to
    /// `base`. `observe` is called after each trial. The result does not depend on the number of threads.
    ///
    /// # Errors
    ///
    /// [`StudyError`] if the robot cannot be loaded, or a search or an environment fails.
    pub fn run(
        task: &Task,
        base: &Path,
        settings: &StudySettings,
        threads: usize,
        observe: impl Fn() + Sync,
    ) -> Result<Self, StudyError> {
        let scene = Scene::load(task, base)?;
        let cup = Cup::new(task, &scene, settings)?;
        let seeds = settings.first_seed..settings.first_seed.saturating_add(settings.seeds);
        let mut jobs = Vec::new();
        for weights in Weights::ALL {
            for count in &settings.weights {
                jobs.extend(seeds.clone().map(|seed| (weights, *count, seed)));
            }
        }
        let trials = run_jobs(
            threads,
            &jobs,
            |_| Ok::<_, StudyError>(()),
            |(), (weights, count, seed)| {
                let curve = cup.search(&weights.space(&cup.library, *count), *seed)?;
                observe();
                Ok(Trial { weights: *weights, count: *count, seed: *seed, curve })
            },
        )?;
        Ok(Self { caught_by_attempts: cup.attempts()?, trials })
    }

    /// Returns the trials with a kind and number of weights.
    pub fn trials(&self, weights: Weights, count: usize) -> impl Iterator<Item = &Trial> {
        self.trials.iter().filter(move |trial| (trial.weights, trial.count) == (weights, count))
    }

    /// Returns the final evaluation of each trial with this kind and number of weights. There is one trial
    /// per seed.
    pub fn ends(&self, weights: Weights, count: usize) -> Vec<Point> {
        self.trials(weights, count).filter_map(|trial| trial.curve.last().copied()).collect()
    }
}

/// The task, and the movements of the cup.
struct Cup<'a> {
    setting: Setting<'a>,
    rollouts: u64,
    spring: SampledSpring,
    library: MotionLibrary,
    /// Forces of the mean attempt.
    mean: Vec<f64>,
    /// Range of each joint's action \[m\]; 0 for joints that are not driven.
    scale: Vec<f64>,
}

impl<'a> Cup<'a> {
    fn new(task: &'a Task, scene: &'a Scene, settings: &StudySettings) -> Result<Self, StudyError> {
        let policy = task.policy().map_err(EnvironmentError::from)?;
        let scale: Vec<f64> =
            (0..policy.action.joints.len()).map(|joint| policy.action.scale.get(joint)).collect();
        let driven: Vec<usize> = (0..scale.len()).filter(|joint| scale[*joint] != 0.0).collect();
        if driven != [0, 1] {
            return Err(StudyError::Task { found: driven.len() });
        }
        let spring = SampledSpring::new((SECONDS * task.rate()).round() as usize + 1, DAMPING)?;
        let attempts = attempts(&spring);
        let library = MotionLibrary::build(&attempts, spring, Metric::Force, Truncation::All)?;
        let mut mean = vec![0.0; library.rows()];
        for attempt in &attempts.trajectories {
            let forces = Movement::from_trajectory(attempt, &spring).forces;
            mean.iter_mut().zip(forces).for_each(|(mean, force)| *mean += force / ATTEMPTS as f64);
        }
        let setting = Setting { task, scene };
        Ok(Self { setting, rollouts: settings.rollouts, spring, library, mean, scale })
    }

    /// Runs the next episode with the movement under some forces. Returns its return, and `true` if the ball
    /// is caught.
    fn episode(
        &self,
        environment: &mut Environment<Articulated>,
        mut forces: Vec<f64>,
    ) -> Result<(f64, bool), EnvironmentError> {
        let steps = self.spring.forces();
        forces.chunks_exact_mut(steps).for_each(|block| self.spring.respond(block));
        let mut step = 0;
        let episode = environment.run_episode(|_, action| {
            let sample = step.min(steps - 1);
            for joint in 0..DRIVEN {
                action[joint] = (forces[joint * steps + sample] / self.scale[joint]) as f32;
            }
            step += 1;
        })?;
        Ok((episode.total, episode.end == End::Success))
    }

    /// Returns the fraction of the attempts that catch the ball.
    fn attempts(&self) -> Result<f64, EnvironmentError> {
        let mut environment = self.setting.environment(0, 0)?;
        let mut caught = 0;
        for column in self.library.weights().column_iter() {
            let forces = self.library.forces(column.as_slice());
            caught += u32::from(self.episode(&mut environment, forces)?.1);
        }
        Ok(f64::from(caught) / ATTEMPTS as f64)
    }

    fn evaluate(&self, forces: &[f64], seed: u64, rollouts: u64) -> Result<Point, EnvironmentError> {
        let mut environment = self.setting.environment(seed, EVALUATION_WORLD)?;
        let mut point = Point { rollouts, mean_return: 0.0, caught: 0.0 };
        for _ in 0..EPISODES {
            let (total, is_caught) = self.episode(&mut environment, forces.to_vec())?;
            point.mean_return += total / EPISODES as f64;
            point.caught += f64::from(u8::from(is_caught)) / EPISODES as f64;
        }
        Ok(point)
    }

    /// Runs a search in a space, starting from the mean attempt.
    fn search(&self, space: &SearchSpace, seed: u64) -> Result<Vec<Point>, StudyError> {
        let deviation = space.variance.iter().map(|variance| variance.max(0.0).sqrt()).collect();
        let start = Start::new(space.weights_of(&self.mean, &self.spring), deviation, seed);
        let mut environment = self.setting.environment(seed, 0)?;
        let forces = |weights: &[f64]| {
            let weights = DMatrix::from_column_slice(weights.len(), 1, weights);
            (&space.functions * weights).as_slice().to_vec()
        };
        power_curve(
            start,
            (self.rollouts, ROLLOUTS),
            |weights| Ok((self.episode(&mut environment, forces(weights))?.0 / TEMPERATURE).exp()),
            |weights, rollouts| Ok(self.evaluate(&forces(weights), seed, rollouts)?),
        )
    }
}

/// Returns a raised cosine: 0 until `begin`, 1 after half of `width`, and 0 again after `width`.
fn bump(time: f64, begin: f64, width: f64) -> f64 {
    let part = ((time - begin) / width).clamp(0.0, 1.0);
    0.5 * (1.0 - (TAU * part).cos())
}

/// Returns the attempts of the demonstrator, which start and end at the home position \[m\].
fn attempts(spring: &SampledSpring) -> Recordings {
    let attempt = |index: u64| {
        let counter = Counter { step: index, ..Counter::default() };
        let mut random = counter.stream(Purpose::Start);
        Trajectory {
            id: index.to_string(),
            label: None,
            duration: SECONDS,
            positions: attempt(spring.samples(), &mut random),
        }
    };
    let names = ["x", "z"].map(str::to_owned).to_vec();
    Recordings { names, trajectories: (0..ATTEMPTS).map(attempt).collect() }
}

/// Returns positions along x and z: a sway, a dip and an upward jerk.
fn attempt(samples: usize, random: &mut Pcg64) -> DMatrix<f64> {
    let mut within = |low: f64, high: f64| random.random_range(low..high);
    let (sway, period) = (within(0.08, 0.25), within(0.6, 1.1));
    let (dip, dip_begin, dip_width) = (within(0.0, 0.15), within(0.0, 0.3), within(0.3, 0.5));
    let (jerk, jerk_begin, jerk_width) = (within(0.15, 0.3), within(0.3, 0.6), within(0.3, 0.5));
    DMatrix::from_fn(samples, DRIVEN, |sample, axis| {
        let time = SECONDS * sample as f64 / (samples - 1) as f64;
        if axis == 0 {
            sway * (TAU * time / period).sin() * (PI * time / SECONDS).sin()
        } else {
            jerk * bump(time, jerk_begin, jerk_width) - dip * bump(time, dip_begin, dip_width)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TASK: &str = include_str!("../../../../tasks/ball-in-cup.toml");

    fn study(threads: usize) -> Study {
        let task = Task::parse(TASK).expect("a task");
        let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tasks");
        let settings = StudySettings { first_seed: 1, seeds: 2, weights: vec![6], rollouts: 30 };
        Study::run(&task, &base, &settings, threads, || {}).expect("a study")
    }

    #[test]
    fn studies_repeat_on_any_number_of_threads() {
        let found = study(1);
        assert_eq!(study(2), found);
        assert_eq!(found.trials.len(), 3 * 2);
        for weights in Weights::ALL {
            for trial in found.trials(weights, 6) {
                let rollouts: Vec<u64> = trial.curve.iter().map(|point| point.rollouts).collect();
                assert_eq!(rollouts, [0, 25, 30]);
                // the mean attempt swings the ball: its return is between a hanging and a caught ball's
                assert!((-30.0..10.0).contains(&trial.curve[0].mean_return), "{trial:?}");
            }
            assert_eq!(found.ends(weights, 6).len(), 2);
        }
        // the demonstrator is no expert
        assert!(found.caught_by_attempts < 0.5, "{}", found.caught_by_attempts);
    }

    #[test]
    fn attempts_start_and_end_at_home_within_reach() {
        let spring = SampledSpring::new(61, DAMPING).expect("a spring");
        for attempt in attempts(&spring).trajectories {
            let positions = attempt.positions;
            assert!(positions.amax() < 0.3, "{}", attempt.id);
            assert!(positions.row(0).amax() < 1e-12 && positions.row(60).amax() < 1e-12, "{}", attempt.id);
        }
    }

    #[test]
    fn weights_of_a_movement_in_a_space_reproduce_it() {
        let spring = SampledSpring::new(61, DAMPING).expect("a spring");
        let attempts = attempts(&spring);
        let library =
            MotionLibrary::build(&attempts, spring, Metric::Force, Truncation::All).expect("a library");
        let forces = Movement::from_trajectory(&attempts.trajectories[3], &spring).forces;
        let path = |forces: &[f64]| {
            let mut path = forces.to_vec();
            path.chunks_exact_mut(spring.forces()).for_each(|block| spring.respond(block));
            path
        };
        for weights in Weights::ALL {
            let space = weights.space(&library, 40);
            let found = DMatrix::from_vec(space.variance.len(), 1, space.weights_of(&forces, &spring));
            let found = path((&space.functions * found).as_slice());
            let error = found.iter().zip(path(&forces)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 0.01, "{weights:?}: {error} m");
        }
    }
}
