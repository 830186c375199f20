//! `motorium learn compare`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_learners::evaluation::{Comparison, Evaluation, compare, evaluate};
use serde_json::json;

use super::curves;
use super::warnings::warn;
use crate::out::outln;
use crate::output::{Overwrite, check_format, write_file};

/// Run several policies on the same episodes of a task, and compare their returns with the first policy's.
///
/// Prints the interquartile mean of each policy, and its difference from the first policy's with a 95 %
/// bootstrap interval.
///
/// Example: motorium learn compare out/ppo out/a2c --task tasks/cart-pole.toml --curves out/curves.svg
#[derive(Debug, clap::Args)]
pub(super) struct Compare {
    /// Folders of the policies, the baseline first
    #[arg(required = true, num_args = 2..)]
    policies: Vec<PathBuf>,
    /// File of the task [default: the first policy's task.toml]
    #[arg(long, value_name = "FILE")]
    task: Option<PathBuf>,
    /// Number of episodes of each policy
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    episodes: u32,
    /// Seed of the initial states of episodes
    #[arg(long, default_value_t = 1000)]
    seed: u64,
    /// Write the training curves to an SVG file
    #[arg(long, value_name = "FILE")]
    curves: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check(&self.task, &self.curves)?;
        self.curves.iter().try_for_each(|curves| check_format(curves, &["svg"]))?;
        let task = self.task.clone().unwrap_or_else(|| self.policies[0].join("task.toml"));
        let evaluated = self.policies.iter().map(|policy| {
            evaluate(policy, &task, self.episodes as usize, self.seed)
                .with_context(|| policy.display().to_string())
        });
        let found: Vec<Evaluation> = evaluated.collect::<anyhow::Result<_>>()?;
        warn(&found[0].warnings);
        if let Some(file) = &self.curves {
            let series = self.policies.iter().map(|policy| curves::returns(policy));
            let series = series.collect::<anyhow::Result<_>>()?;
            let chart = curves::chart("Return in training", "mean return of 100 episodes", series);
            write_file(file, chart.svg())?;
        }
        let compared: Vec<Option<Comparison>> =
            found.iter().map(|other| compare(&found[0], other, self.seed)).collect();
        if self.json {
            let one = |((policy, found), compared): ((&PathBuf, &Evaluation), &Option<Comparison>)| json!({ "policy": policy.display().to_string(), "evaluation": found, "comparison": compared });
            let policies: Vec<_> = self.policies.iter().zip(&found).zip(&compared).map(one).collect();
            outln!("{}", json!({ "task": task.display().to_string(), "policies": policies }));
            return Ok(ExitCode::SUCCESS);
        }
        for ((policy, found), compared) in self.policies.iter().zip(&found).zip(&compared) {
            let [low, high] = found.iqm_interval;
            outln!("{}: interquartile mean {:.2} [{low:.2}, {high:.2}]", policy.display(), found.iqm);
            if let Some(Comparison { difference, difference_interval: [low, high], improved }) =
                compared.filter(|_| *policy != self.policies[0])
            {
                let share = 100.0 * improved;
                outln!(
                    "  difference {difference:.2} [{low:.2}, {high:.2}], better in {share:.0} % of the episodes"
                );
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}
