//! `motorium learn train` and `resume`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use motorium_bridges::recording::Demonstration;
use motorium_learners::component::{LearningProgress, PROGRESS_TOPIC, ProgressFeed};
use motorium_learners::learner::{Costs, Phase, Progress};
use motorium_learners::training::Run;
use motorium_learners::tuning::Tuning;
use motorium_learners::{imitation, learner};
use serde_json::json;

use super::curves;
use super::threads::threads;
use super::tune;
use super::warnings::warn;
use crate::commands::recording::opened;
use crate::interrupt::interrupted;
use crate::out::{errln, outln};
use crate::output::check_folder;

/// Time between two lines of progress.
const INTERVAL: Duration = Duration::from_secs(1);

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Algorithm {
    /// Proximal policy optimisation
    Ppo,
    /// Advantage actor-critic
    A2c,
    /// Policy gradient of whole episodes
    Reinforce,
    /// Soft actor-critic
    Sac,
    /// Twin delayed deterministic policy gradient
    Td3,
    /// Deterministic policy gradient
    Ddpg,
    /// Q-network on a grid of actions
    Dqn,
    /// Behaviour cloning of an expert
    Clone,
    /// Imitation of an expert in the states reached by the policy
    Dagger,
}

/// An algorithm that trains from rewards or from an expert.
enum Kind {
    Rewards(learner::Algorithm),
    Expert(imitation::Algorithm),
}

impl Algorithm {
    fn kind(self) -> Kind {
        match self {
            Self::Ppo => Kind::Rewards(learner::Algorithm::Ppo),
            Self::A2c => Kind::Rewards(learner::Algorithm::A2c),
            Self::Reinforce => Kind::Rewards(learner::Algorithm::Reinforce),
            Self::Sac => Kind::Rewards(learner::Algorithm::Sac),
            Self::Td3 => Kind::Rewards(learner::Algorithm::Td3),
            Self::Ddpg => Kind::Rewards(learner::Algorithm::Ddpg),
            Self::Dqn => Kind::Rewards(learner::Algorithm::Dqn),
            Self::Clone => Kind::Expert(imitation::Algorithm::Clone),
            Self::Dagger => Kind::Expert(imitation::Algorithm::Dagger),
        }
    }
}

/// Train a policy on a task.
///
/// Writes the policy, a checkpoint to resume from, and progress.csv to the output folder. Equal seeds give
/// equal weights with any number of threads.
///
/// Example: motorium learn train tasks/cart-pole.toml --seed 1 --output out/cart-pole
#[derive(Debug, clap::Args)]
pub(super) struct Train {
    /// File of the task
    task: PathBuf,
    /// Algorithm [default: ppo]
    #[arg(long, default_value = "ppo", hide_default_value = true)]
    algorithm: Algorithm,
    /// Folder of the expert policy for `clone` and `dagger`
    #[arg(long, value_name = "FOLDER")]
    expert: Option<PathBuf>,
    /// Recorded actions for `clone` and for the first iteration of `dagger`; may be repeated
    #[arg(long, value_name = "FILE.mcap")]
    recording: Vec<PathBuf>,
    /// Recorded topic of the observations [default: the only one of its type]
    #[arg(long, value_name = "TOPIC", requires = "recording")]
    observation: Option<String>,
    /// Recorded topic of the actions to learn [default: the only one of its type]
    #[arg(long, value_name = "TOPIC", requires = "recording")]
    action: Option<String>,
    /// Seed of all random numbers [default: 1]
    #[arg(long, default_value_t = 1, hide_default_value = true)]
    seed: u64,
    /// Threads; all cores if not given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=256))]
    threads: Option<u32>,
    /// Total steps of all worlds, instead of the task's, such as 2e5
    #[arg(long, value_parser = steps)]
    steps: Option<u64>,
    /// Folder of the run
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    show: Show,
}

/// Continue a training run, or a tuning of a graph, from its last checkpoint.
///
/// The result is bit-for-bit equal to a run without interruption.
///
/// Example: motorium learn resume out/cart-pole
#[derive(Debug, clap::Args)]
pub(super) struct Resume {
    /// Folder of the run
    folder: PathBuf,
    /// Threads; all cores if not given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=256))]
    threads: Option<u32>,
    #[command(flatten)]
    show: Show,
}

/// Results of a training run, and where they are seen.
#[derive(Clone, Copy, Debug, clap::Args)]
struct Show {
    /// Publish the progress on the topic learn/progress of a run, for `view` and `topic`
    #[arg(long)]
    publish: bool,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Parses a number of steps, with or without an exponent.
fn steps(text: &str) -> Result<u64, String> {
    let value: f64 =
        text.replace('_', "").parse().map_err(|_| "expected a number, such as 2e5".to_owned())?;
    if (1.0..=1e15).contains(&value) { Ok(value as u64) } else { Err("expected 1 to 1e15".to_owned()) }
}

impl Train {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        check_folder(&self.output)?;
        let seed = (self.seed, threads(self.threads));
        let is_taught = self.expert.is_some() || !self.recording.is_empty();
        let run = match self.algorithm.kind() {
            Kind::Expert(algorithm) if is_taught => return self.imitate(algorithm, seed),
            Kind::Expert(algorithm) => bail!(
                "--algorithm {}: no --expert and no --recording, expected the folder of a policy or the file of a \
                 recording",
                algorithm.name()
            ),
            Kind::Rewards(algorithm) if is_taught => bail!(
                "--expert or --recording with --algorithm {}, expected `clone` or `dagger`",
                algorithm.name()
            ),
            Kind::Rewards(algorithm) => Run::create(algorithm, &self.task, &self.output, seed, self.steps)?,
        };
        let [low, high] = run.task().reward_range()?;
        anstream::eprintln!("{}: reward of a step {low} to {high}", run.task().title);
        finish(run, &self.output, self.show)
    }
}

impl Train {
    /// Imitates the policy in a folder, or recorded actions.
    fn imitate(&self, algorithm: imitation::Algorithm, seed: (u64, usize)) -> anyhow::Result<ExitCode> {
        if self.show.publish {
            bail!(
                "--publish with --algorithm {}, expected an algorithm that learns from rewards",
                algorithm.name()
            );
        }
        let began = Instant::now();
        let extent = (algorithm, self.steps);
        let recorded = self.recording.iter().map(|file| self.recorded(file));
        let recorded = recorded.collect::<anyhow::Result<Vec<_>>>()?;
        let sources = imitation::Sources { expert: self.expert.as_deref(), recorded: &recorded };
        let mut run = imitation::Run::create((&self.task, sources), &self.output, seed, extent)?;
        warn(run.warnings());
        while let Some(progress) = run.advance()? {
            let imitation::Progress { iteration, labels, beta, mean_return, loss, .. } = progress;
            let mean =
                mean_return.map_or_else(|| "no return".to_owned(), |mean| format!("mean return {mean:.1}"));
            anstream::eprintln!(
                "iteration {iteration}: {labels} labels, expert {beta:.3}, {mean}, loss {loss:.2e}"
            );
        }
        let (summary, seconds) = (run.summary(), began.elapsed().as_secs_f64());
        let last = summary.last;
        if self.show.json {
            outln!(
                "{}",
                json!({
                    "iterations": last.map(|last| last.iteration),
                    "labels": last.map(|last| last.labels),
                    "loss": last.map(|last| last.loss),
                    "seconds": seconds,
                    "weights_sha256": summary.weights_sha256,
                })
            );
            return Ok(ExitCode::SUCCESS);
        }
        outln!("{} labels in {seconds:.1} s", last.map_or(0, |last| last.labels));
        outln!("weights {}", summary.weights_sha256);
        Ok(ExitCode::SUCCESS)
    }

    /// Returns the recorded observations and actions.
    fn recorded(&self, file: &Path) -> anyhow::Result<imitation::Recorded> {
        let recording = opened(file)?;
        let topics = [&self.observation, &self.action].map(Option::as_deref);
        let shown = Demonstration::read(&recording, topics[0], topics[1])
            .with_context(|| file.display().to_string())?;
        let single = |numbers: &[f64]| numbers.iter().map(|number| *number as f32).collect();
        Ok(imitation::Recorded {
            widths: [shown.inputs, shown.outputs],
            observations: single(&shown.observations),
            actions: single(&shown.actions),
        })
    }
}

impl Resume {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        if Tuning::exists(&self.folder) {
            if self.show.publish {
                bail!("--publish: {} is a tuning, expected a training run", self.folder.display());
            }
            return tune::resume(&self.folder, self.threads, self.show.json);
        }
        let run = Run::resume(&self.folder, threads(self.threads))?;
        anstream::eprintln!("{}: resumed after {} steps", run.task().title, run.steps().0);
        finish(run, &self.folder, self.show)
    }
}

/// Trains to the end, with a line of progress a second on standard error. A signal ends the training after an
/// update, with a checkpoint.
fn finish(mut run: Run, folder: &Path, show: Show) -> anyhow::Result<ExitCode> {
    warn(run.warnings());
    let interrupted = interrupted()?;
    let feed = show.publish.then(ProgressFeed::start).transpose().context("--publish")?;
    if let Some(feed) = &feed {
        errln!("progress on the topic {PROGRESS_TOPIC}: `motorium view --run {}`", feed.run());
    }
    let (first, began) = (run.steps().0, Instant::now());
    let mut printed = began;
    while let Some(progress) = run.advance()? {
        let (steps, all) = run.steps();
        if let Some(feed) = &feed {
            let rate = (steps - first) as f64 / began.elapsed().as_secs_f64();
            feed.publish(LearningProgress::new(&progress, run.measures(), rate));
        }
        if interrupted.load(Relaxed) && steps < all {
            run.save()?;
            bail!(
                "interrupted after {steps} of {all} steps\nhelp: continue with `motorium learn resume {}`",
                folder.display()
            );
        }
        if printed.elapsed() >= INTERVAL && steps < all {
            printed = Instant::now();
            let rate = (steps - first) as f64 / began.elapsed().as_secs_f64();
            let left = (all - steps) as f64 / rate;
            let costs = shares(&run.costs());
            anstream::eprintln!("{}, {rate:.0} steps/s, {left:.0} s left; {costs}", line(&progress));
        }
    }
    let seconds = began.elapsed().as_secs_f64();
    let (summary, costs) = (run.summary(), run.costs());
    let page = folder.join(curves::PAGE);
    std::fs::write(&page, curves::page(folder, &run.task().title, &summary)?)
        .with_context(|| page.display().to_string())?;
    let rate = (summary.steps - first) as f64 / seconds;
    if show.json {
        let last = summary.last.as_ref();
        let phases = Phase::ALL.map(|phase| (phase.name().to_owned(), json!(costs.seconds(phase))));
        outln!(
            "{}",
            json!({
                "algorithm": summary.algorithm,
                "steps": summary.steps,
                "updates": summary.updates,
                "episodes": last.map(|last| last.episodes),
                "mean_return": last.and_then(|last| last.mean_return),
                "mean_length": last.and_then(|last| last.mean_length),
                "seconds": seconds,
                "seconds_by_phase": serde_json::Map::from_iter(phases),
                "steps_per_second": rate,
                "weights_sha256": summary.weights_sha256,
            })
        );
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(last) = &summary.last {
        outln!("{}", line(last));
    }
    outln!("{} steps in {seconds:.1} s, {rate:.0} steps/s", summary.steps - first);
    if costs.total() > 0.0 {
        outln!("{}", shares(&costs));
    }
    outln!("weights {}", summary.weights_sha256);
    Ok(ExitCode::SUCCESS)
}

/// Returns the share of each phase in the time of all.
fn shares(costs: &Costs) -> String {
    let share = |phase| 100.0 * costs.seconds(phase) / costs.total();
    Phase::ALL.map(|phase| format!("{} {:.0} %", phase.name(), share(phase))).join(", ")
}

fn line(progress: &Progress) -> String {
    let Progress { steps, episodes, mean_return, .. } = progress;
    let mean =
        mean_return.map_or_else(|| "no return yet".to_owned(), |mean| format!("mean return {mean:.1}"));
    format!("{steps:>9} steps, {episodes} episodes, {mean}")
}
