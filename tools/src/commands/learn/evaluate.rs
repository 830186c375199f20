//! `motorium learn evaluate`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_learners::evaluation::evaluate;

use super::warnings::warn;
use crate::out::outln;

/// Run a policy on a task without exploration, and print its returns.
///
/// Prints the mean, the median, and the interquartile mean with a 95 % bootstrap interval.
///
/// Example: motorium learn evaluate out/cart-pole --task tasks/cart-pole.toml --episodes 100
#[derive(Debug, clap::Args)]
pub(super) struct Evaluate {
    /// Folder of the policy
    policy: PathBuf,
    /// File of the task [default: the policy's task.toml]
    #[arg(long, value_name = "FILE")]
    task: Option<PathBuf>,
    /// Number of episodes
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    episodes: u32,
    /// Seed of the initial states of episodes
    #[arg(long, default_value_t = 1000)]
    seed: u64,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Evaluate {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let task = self.task.unwrap_or_else(|| self.policy.join("task.toml"));
        let found = evaluate(&self.policy, &task, self.episodes as usize, self.seed)?;
        warn(&found.warnings);
        if self.json {
            outln!("{}", serde_json::to_string(&found)?);
            return Ok(ExitCode::SUCCESS);
        }
        let [low, high] = found.iqm_interval;
        outln!("{} episodes of {:.1} steps on average", found.episodes, found.mean_length);
        outln!("{} failures, {} successes", found.failures, found.successes);
        outln!("mean return          {:.2}", found.mean);
        outln!("median               {:.2}", found.median);
        outln!("interquartile mean   {:.2} [{low:.2}, {high:.2}]", found.iqm);
        Ok(ExitCode::SUCCESS)
    }
}
