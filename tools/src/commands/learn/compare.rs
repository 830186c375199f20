//! `motorium learn compare`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, ensure};
use motorium_learners::evaluation::{Comparison, Evaluation, compare, evaluate};
use serde_json::json;

use super::warnings::warn;
use crate::chart::{Chart, Series};
use crate::out::outln;

/// Run several policies on equal episodes of a task, and compare their returns with the first one's.
///
/// Prints the interquartile mean of each and its difference from the first with a bootstrap interval of 95 %.
///
/// Example: motorium learn compare out/ppo out/a2c --task tasks/cart-pole.toml --curves out/curves.svg
#[derive(Debug, clap::Args)]
pub(super) struct Compare {
    /// Folders of the policies, the baseline first
    #[arg(required = true, num_args = 2..)]
    policies: Vec<PathBuf>,
    /// File of the task; the first policy's task.toml if not given
    #[arg(long, value_name = "FILE")]
    task: Option<PathBuf>,
    /// Episodes of each policy
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    episodes: u32,
    /// Seed of the starts of episodes
    #[arg(long, default_value_t = 1000)]
    seed: u64,
    /// Write the training curves to an SVG file
    #[arg(long, value_name = "FILE")]
    curves: Option<PathBuf>,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let task = self.task.clone().unwrap_or_else(|| self.policies[0].join("task.toml"));
        let evaluated = self.policies.iter().map(|policy| {
            evaluate(policy, &task, self.episodes as usize, self.seed)
                .with_context(|| policy.display().to_string())
        });
        let found: Vec<Evaluation> = evaluated.collect::<anyhow::Result<_>>()?;
        warn(&found[0].warnings);
        if let Some(file) = &self.curves {
            let series = self.policies.iter().map(|policy| curve(policy));
            let chart = Chart {
                title: "Return in training".to_owned(),
                x: "steps".to_owned(),
                y: "mean return of 100 episodes".to_owned(),
                log_x: false,
                log_y: false,
                series: series.collect::<anyhow::Result<_>>()?,
            };
            std::fs::write(file, chart.svg()).with_context(|| file.display().to_string())?;
        }
        let compared: Vec<Option<Comparison>> =
            found.iter().map(|other| compare(&found[0], other, self.seed)).collect();
        if self.json {
            let one = |((policy, found), compared): ((&PathBuf, &Evaluation), &Option<Comparison>)| json!({ "policy": policy, "evaluation": found, "comparison": compared });
            let policies: Vec<_> = self.policies.iter().zip(&found).zip(&compared).map(one).collect();
            outln!("{}", json!({ "task": task, "policies": policies }));
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

/// Mean return against steps, from the table of a training run.
fn curve(policy: &Path) -> anyhow::Result<Series> {
    let file = policy.join("progress.csv");
    let text = std::fs::read_to_string(&file).with_context(|| file.display().to_string())?;
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = |names: [&str; 2]| head.iter().position(|name| names.contains(name));
    let columns = column(["steps", "labels"]).zip(column(["mean_return"; 2]));
    let (steps, returns) =
        columns.with_context(|| format!("{}: no columns `steps` and `mean_return`", file.display()))?;
    let mut points = Vec::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |column: usize| cells.get(column).and_then(|cell| cell.parse::<f64>().ok());
        // the cell is empty before the first end of an episode
        if let (Some(x), Some(y)) = (number(steps), number(returns)) {
            points.push([x, y, 0.0]);
        }
    }
    ensure!(!points.is_empty(), "{}: no episode has ended, expected a longer run", file.display());
    Ok(Series { name: policy.display().to_string(), points })
}
