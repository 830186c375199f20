//! `motorium reproduce ball-in-cup`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context as _;
use motorium_learners::experiments::ball_in_cup::{Point, Study, StudySettings, Trial, Weights};
use motorium_learners::experiments::search::is_clearly_larger;
use motorium_learners::task::Task;
use motorium_library::statistics::{mean_and_error, with_error};
use motorium_pictures::chart::{Chart, Series};
use serde_json::json;

use super::writer::FigureWriter;
use crate::commands::learn::threads::threads;
use crate::output::Overwrite;

/// Catch a ball in a cup with PoWER, on the weights of a motion library and of radial kernels.
///
/// Each search starts from the mean of a demonstrator's attempts and learns from one episode per rollout.
/// Writes the returns as CSV and SVG (bars: standard errors over seeds), and reports which claims hold.
///
/// Example: motorium reproduce ball-in-cup --output out/ball-in-cup
#[derive(Debug, clap::Args)]
pub(super) struct BallInCup {
    /// The folder to write to
    #[arg(long, short, value_name = "DIR", default_value = "out/ball-in-cup")]
    output: PathBuf,
    /// File of the task
    #[arg(long, value_name = "FILE", default_value = "tasks/ball-in-cup.toml")]
    task: PathBuf,
    /// Number of seeds, each for one search in every space
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(2..=1000))]
    seeds: u64,
    /// First seed
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(0..=1_000_000_000))]
    seed: u64,
    /// Numbers of weights
    #[arg(long, value_delimiter = ',', default_values_t = [8, 16], value_parser = clap::value_parser!(u32).range(2..=120))]
    weights: Vec<u32>,
    /// Number of episodes of a search
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    rollouts: u64,
    /// Threads; all cores if not given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=256))]
    threads: Option<u32>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl BallInCup {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let settings = StudySettings {
            first_seed: self.seed,
            seeds: self.seeds,
            weights: self.weights.iter().map(|count| *count as usize).collect(),
            rollouts: self.rollouts,
        };
        let file = || self.task.display().to_string();
        let text = std::fs::read_to_string(&self.task).with_context(file)?;
        let task = Task::parse(&text).with_context(file)?;
        let base = self.task.parent().unwrap_or(Path::new(""));
        let trials = self.seeds * (Weights::ALL.len() * settings.weights.len()) as u64;
        let mut writer = FigureWriter::new(self.output.clone(), "ball-in-cup", trials, self.overwrite)?;
        let began = Instant::now();
        let study = Study::run(&task, base, &settings, threads(self.threads), || writer.bar.inc(1))?;
        let seconds = began.elapsed().as_secs_f64();
        for (name, y, value) in MEASURES {
            writer.chart(&format!("ball-in-cup-{name}"), &chart(&study, &settings, y, value))?;
        }
        writer.write("ball-in-cup-trials.csv", &table(&study))?;
        for count in &settings.weights {
            claims(&mut writer, &study, *count);
        }
        let ends = |weights: Weights, count: usize| {
            let ends = study.ends(weights, count);
            let all = |value: Value| ends.iter().map(value).collect::<Vec<f64>>();
            json!({ "weights": weights, "count": count, "last_return": all(mean_return), "caught": all(caught) })
        };
        let each = |count: &usize| Weights::ALL.map(|weights| ends(weights, *count)).to_vec();
        let summary = json!({
            "settings": settings,
            "wall_seconds": seconds,
            "caught_by_attempts": study.caught_by_attempts,
            "trials": settings.weights.iter().flat_map(each).collect::<Vec<_>>(),
        });
        writer.write("ball-in-cup.json", &serde_json::to_string_pretty(&summary)?)?;
        writer.finish(self.json)
    }
}

/// A number of an evaluation.
type Value = fn(&Point) -> f64;

fn mean_return(point: &Point) -> f64 {
    point.mean_return
}

fn caught(point: &Point) -> f64 {
    point.caught
}

/// File, axis and value of each figure.
const MEASURES: [(&str, &str, Value); 2] =
    [("return", "mean return", mean_return), ("caught", "share of caught balls", caught)];

/// Returns a value against the rollouts, with standard errors over seeds.
fn chart(study: &Study, settings: &StudySettings, y: &str, value: Value) -> Chart {
    let one = |weights: Weights, count: usize| {
        let trials: Vec<&Trial> = study.trials(weights, count).collect();
        let points = trials.first().map_or(0, |trial| trial.curve.len());
        let point = |k: usize| {
            let values: Vec<f64> = trials.iter().map(|trial| value(&trial.curve[k])).collect();
            let (mean, error) = mean_and_error(&values);
            [trials[0].curve[k].rollouts as f64, mean, error]
        };
        let name = format!("{}, n = {count}", weights.name());
        Series { name, points: (0..points).map(point).collect() }
    };
    let counts = || settings.weights.iter();
    Chart {
        title: "Ball-in-cup by PoWER".to_owned(),
        x: "rollouts".to_owned(),
        y: y.to_owned(),
        log_x: false,
        log_y: false,
        series: Weights::ALL.iter().flat_map(|weights| counts().map(|count| one(*weights, *count))).collect(),
    }
}

/// Returns one line per evaluation.
fn table(study: &Study) -> String {
    let mut table = "weights,count,seed,rollouts,mean_return,caught\n".to_owned();
    for Trial { weights, count, seed, curve } in &study.trials {
        for Point { rollouts, mean_return, caught } in curve {
            let name = weights.name().replace(',', ";");
            table += &format!("{name},{count},{seed},{rollouts},{mean_return:?},{caught:?}\n");
        }
    }
    table
}

fn claims(writer: &mut FigureWriter, study: &Study, count: usize) {
    let ends = |weights: Weights, value: Value| {
        mean_and_error(&study.ends(weights, count).iter().map(value).collect::<Vec<f64>>())
    };
    let library = ends(Weights::Library, mean_return);
    let kernels = [Weights::Kernels, Weights::FittedKernels]
        .map(|weights| (weights.name(), ends(weights, mean_return)))
        .into_iter()
        .max_by(|a, b| a.1.0.total_cmp(&b.1.0))
        .unwrap_or_default();
    let starts: Vec<f64> =
        study.trials(Weights::Library, count).map(|trial| trial.curve[0].mean_return).collect();
    let start = mean_and_error(&starts);
    let share = ends(Weights::Library, caught);
    writer.claim(
        "ball-in-cup",
        &format!("PoWER on {count} library weights surpasses the mean of the attempts"),
        is_clearly_larger(library, start),
        format!(
            "return {} after {}; {:.0} % caught, {:.0} % by the demonstrator",
            with_error(library.0, library.1),
            with_error(start.0, start.1),
            100.0 * share.0,
            100.0 * study.caught_by_attempts
        ),
    );
    writer.claim(
        "ball-in-cup",
        &format!("PoWER finds better movements with {count} weights of the library than of kernels"),
        is_clearly_larger(library, kernels.1),
        format!(
            "return {}, {} {}",
            with_error(library.0, library.1),
            kernels.0,
            with_error(kernels.1.0, kernels.1.1)
        ),
    );
}
