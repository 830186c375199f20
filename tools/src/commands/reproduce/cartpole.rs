//! `motorium reproduce cartpole`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use motorium_learners::experiments::cartpole::{Beginning, Method, Study, StudySettings, Trial};
use motorium_learners::experiments::trials::median;
use motorium_learners::task::Task;
use motorium_library::statistics::{mean_and_error, with_error};
use motorium_pictures::chart::{Chart, Series};
use serde_json::json;

use super::writer::FigureWriter;
use crate::commands::learn::threads::threads;
use crate::output::Overwrite;

/// The task.
const TASK: &str = include_str!("../../../tasks/cart-pole.toml");
/// Return of a solved cart-pole; 500 is the largest.
const SOLVED: f64 = 475.0;

/// Balance a cart-pole by imitation and reinforcement, figure 2.32 of Delhaisse's thesis (2019).
///
/// A linear policy learns by PoWER and a network by PPO, each after imitating a demonstrator that lets the
/// cart run off its track, and from scratch. Writes the returns as CSV and SVG (bars: standard errors over
/// seeds), and reports which claims hold.
///
/// Example: motorium reproduce cartpole --output out/cartpole
#[derive(Debug, clap::Args)]
pub(super) struct Cartpole {
    /// The folder to write to
    #[arg(long, short, value_name = "DIR", default_value = "out/cartpole")]
    output: PathBuf,
    /// Number of seeds, each for one trial of every method, with and without imitation
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(2..=1000))]
    seeds: u64,
    /// First seed
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(0..=1_000_000_000))]
    seed: u64,
    /// Number of steps of a demonstration
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    demonstration: u64,
    /// Number of episodes from which PoWER learns
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    rollouts: u64,
    /// Number of steps from which PPO learns
    #[arg(long, default_value_t = 50_000, value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    steps: u64,
    /// Threads; all cores if not given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=256))]
    threads: Option<u32>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Cartpole {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let settings = StudySettings {
            first_seed: self.seed,
            seeds: self.seeds,
            demonstration: self.demonstration,
            rollouts: self.rollouts,
            steps: self.steps,
        };
        let trials = self.seeds * (1 + (Method::ALL.len() * Beginning::ALL.len()) as u64);
        let mut writer = FigureWriter::new(self.output.clone(), "cartpole", trials, self.overwrite)?;
        let (task, began) = (Task::parse(TASK)?, Instant::now());
        let study =
            Study::run(&task, Path::new("."), &settings, threads(self.threads), || writer.bar.inc(1))?;
        let seconds = began.elapsed().as_secs_f64();
        for method in Method::ALL {
            writer.chart(&format!("cartpole-{}", method.name().to_lowercase()), &chart(&study, method))?;
        }
        writer.write("cartpole-returns.csv", &table(&study))?;
        claims(&mut writer, &study);
        let each = |method: Method, beginning: Beginning| {
            json!({
                "method": method,
                "beginning": beginning,
                "first_return": study.starts(method, beginning),
                "last_return": study.ends(method, beginning),
                // `null` for a seed that never reaches it
                "experience_to_475": study.experience_to(SOLVED, method, beginning),
            })
        };
        let found: Vec<_> =
            Method::ALL.map(|method| Beginning::ALL.map(|start| each(method, start))).concat();
        let summary = json!({
            "settings": settings,
            "wall_seconds": seconds,
            "demonstrator_return": study.demonstrator,
            "trials": found,
        });
        writer.write("cartpole.json", &serde_json::to_string_pretty(&summary)?)?;
        writer.finish(self.json)
    }
}

/// Returns the mean return of a method against its experience, with the demonstrator's.
fn chart(study: &Study, method: Method) -> Chart {
    let one = |beginning: Beginning| {
        let curves: Vec<&Trial> = study.trials(method, beginning).collect();
        let points = curves.first().map_or(0, |trial| trial.curve.len());
        let point = |k: usize| {
            let returns: Vec<f64> = curves.iter().map(|trial| trial.curve[k].mean_return).collect();
            let (mean, error) = mean_and_error(&returns);
            [curves[0].curve[k].experience as f64, mean, error]
        };
        Series { name: beginning.name().to_owned(), points: (0..points).map(point).collect() }
    };
    let mut series: Vec<Series> = Beginning::ALL.map(one).into();
    let (mean, error) = mean_and_error(&study.demonstrator);
    let last = series[0].points.last().map_or(1.0, |point| point[0]);
    let points = vec![[0.0, mean, error], [last, mean, error]];
    series.push(Series { name: "demonstrator".to_owned(), points });
    let experience = match method {
        Method::Power => "episodes",
        Method::Ppo => "steps",
    };
    Chart {
        title: format!("Return of the cart-pole by {}", method.name()),
        x: experience.to_owned(),
        y: "mean return".to_owned(),
        log_x: false,
        log_y: false,
        series,
    }
}

/// Returns one line per evaluation.
fn table(study: &Study) -> String {
    let mut table = "method,beginning,seed,experience,mean_return\n".to_owned();
    for Trial { method, beginning, seed, curve } in &study.trials {
        for point in curve {
            let (method, beginning) = (method.name(), beginning.name());
            table += &format!("{method},{beginning},{seed},{},{:?}\n", point.experience, point.mean_return);
        }
    }
    table
}

fn claims(writer: &mut FigureWriter, study: &Study) {
    let seeds = study.demonstrator.len();
    let demonstrator = mean_and_error(&study.demonstrator);
    for method in Method::ALL {
        let name = method.name();
        let starts = mean_and_error(&study.starts(method, Beginning::Imitation));
        writer.claim(
            "2.32",
            &format!("imitation alone reaches the return of the demonstrator ({name}'s policy)"),
            starts.0 >= demonstrator.0 - starts.1.hypot(demonstrator.1),
            format!(
                "{} and {}, {seeds} seeds",
                with_error(starts.0, starts.1),
                with_error(demonstrator.0, demonstrator.1)
            ),
        );
        let ends = study.ends(method, Beginning::Imitation);
        let improved = ends.iter().zip(&study.demonstrator).filter(|(end, shown)| end > shown).count();
        let (mean, error) = mean_and_error(&ends);
        writer.claim(
            "2.32",
            &format!("{name} after imitation surpasses the demonstrator"),
            improved == seeds,
            format!("{} at the end; larger with {improved} of {seeds} seeds", with_error(mean, error)),
        );
        let [after, scratch] =
            Beginning::ALL.map(|beginning| median(&study.experience_to(SOLVED, method, beginning)));
        let unit = match method {
            Method::Power => "episodes",
            Method::Ppo => "steps",
        };
        let text = |count: f64| {
            if count.is_finite() { format!("{count:.0} {unit}") } else { "never".to_owned() }
        };
        writer.claim(
            "2.32",
            &format!(
                "{name} reaches a return of 475 earlier after imitation than from scratch, in the median"
            ),
            after < scratch,
            format!("{} and {}", text(after), text(scratch)),
        );
    }
}
