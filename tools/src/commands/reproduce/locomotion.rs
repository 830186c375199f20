//! `motorium reproduce locomotion`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, ensure};
use motorium::graph::Machine;
use motorium::plan::ClockKind;
use motorium_learners::experiments::locomotion::{
    DIMENSIONS, PARAMETERS, Searcher, Study, StudySettings, Trial, keys,
};
use motorium_learners::experiments::search::is_clearly_larger;
use motorium_learners::experiments::trials::median;
use motorium_learners::search::{Evaluation, Outcome};
use motorium_library::statistics::{mean_and_error, with_error};
use motorium_pictures::chart::{Chart, Series};
use serde_json::json;

use super::writer::FigureWriter;
use crate::commands::examples;
use crate::interrupt::interrupted;
use crate::output::Overwrite;
use crate::registry::registry;
use crate::report::decimal;
use crate::rollout::{Rollout, allowed_cores, overlay};

/// The graph: its policy is a pattern generator.
const GRAPH: &str = "quadruped-trot";
/// Condition on the base height of a robot that has not fallen.
const UPRIGHT: &str = "physics.base_height_lowest_m > 0.12";

/// Optimise the gait of a quadruped with Bayesian optimisation, figures 2.30 and 2.31 of Delhaisse's thesis
/// (2019): six numbers of an open-loop pattern generator.
///
/// Compares an RBF kernel with expected improvement and 5 initial points, as in the thesis, with a Matern
/// kernel, random search and the hand-set gait. Writes each figure as CSV and SVG (bars: standard errors over
/// seeds), all evaluations, and an overlay of the fastest gait, and reports which claims hold.
///
/// Example: motorium reproduce locomotion --output out/locomotion
#[derive(Debug, clap::Args)]
pub(super) struct Locomotion {
    /// The folder to write to
    #[arg(long, short, value_name = "DIR", default_value = "out/locomotion")]
    output: PathBuf,
    /// Number of seeds, each for one search with each method
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(2..=1000))]
    seeds: u64,
    /// First seed
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(0..=1_000_000_000))]
    seed: u64,
    /// Number of evaluations of each search
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u64).range(2..=10_000))]
    evaluations: u64,
    /// Simulated time of an evaluation, s
    #[arg(long, default_value_t = 5.0)]
    seconds: f64,
    /// Threads; all cores if not given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=256))]
    threads: Option<u32>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Locomotion {
    fn rollout(&self) -> anyhow::Result<Rollout> {
        let text = examples::text(GRAPH).context("the example of the quadruped is missing")?;
        Ok(Rollout {
            graph: PathBuf::from(format!("{GRAPH}.toml")),
            text: text.to_owned(),
            with: vec![],
            set: vec![format!("duration=\"{} s\"", self.seconds).parse()?],
            expect: vec![UPRIGHT.parse()?],
            no_expect: true,
            rewards: vec![format!("{:?}*physics.base_travel_x_m", 1.0 / self.seconds).parse()?],
            clock: ClockKind::Lockstep,
            machine: Machine::detect(),
            interrupted: interrupted()?,
        })
    }

    fn study(&self, rollout: &Rollout, writer: &FigureWriter) -> anyhow::Result<(Study, f64)> {
        let (registry, cores) = (registry(), allowed_cores(&rollout.machine));
        let threads = self.threads.map_or(cores.len(), |threads| threads as usize);
        let settings = StudySettings {
            first_seed: self.seed,
            seeds: self.seeds,
            evaluations: usize::try_from(self.evaluations)?,
        };
        let began = Instant::now();
        let study = Study::run(
            &settings,
            threads,
            |thread| -> anyhow::Result<usize> { Ok(cores[thread % cores.len()]) },
            |core, gait, seed| {
                let keys = keys(gait);
                match rollout.plan(&borrowed(&keys), &registry) {
                    Ok(mut plan) => {
                        plan.seed = seed;
                        Ok(rollout.run(plan, &registry, *core)?)
                    }
                    Err(error) => Ok(Evaluation::failed(Outcome::Refused, error.render(false))),
                }
            },
            || writer.bar.inc(1),
        )?;
        Ok((study, began.elapsed().as_secs_f64()))
    }

    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        ensure!((0.1..=600.0).contains(&self.seconds), "--seconds is {}, expected 0.1 to 600", self.seconds);
        let rollout = self.rollout()?;
        let runs = self.seeds * (1 + self.evaluations * Searcher::ALL.len() as u64);
        let mut writer = FigureWriter::new(self.output.clone(), "locomotion", runs, self.overwrite)?;
        let (study, seconds) = self.study(&rollout, &writer)?;
        charts(&mut writer, &study)?;
        writer.write("locomotion-evaluations.csv", &table(&study))?;
        claims(&mut writer, &study);
        let summary = json!({
            "seeds": self.seeds,
            "first_seed": self.seed,
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "runs": runs,
            "wall_seconds": seconds,
            "hand_set_speed_m_s": study.hand_set,
            "searches": Searcher::ALL.map(|searcher| json!({
                "method": searcher,
                "best_speed_m_s": study.finals(searcher),
                "median_m_s": median(&study.finals(searcher)),
                "failed": study.failures(searcher),
            })),
            "fastest": study.fastest().map(|(gait, speed, seed)| json!({
                "speed_m_s": speed,
                "seed": seed,
                "gait": PARAMETERS.iter().zip(gait).map(|(p, value)| (p.name, value))
                    .collect::<std::collections::BTreeMap<_, _>>(),
            })),
        });
        writer.write("locomotion.json", &serde_json::to_string_pretty(&summary)?)?;
        if let Some((gait, speed, seed)) = study.fastest() {
            let (registry, keys) = (registry(), keys(&gait));
            let plan = rollout.plan(&borrowed(&keys), &registry);
            let plan = plan.map_err(|error| anyhow::anyhow!(error.render(false)))?;
            let text = overlay(&plan, &registry, &borrowed(&keys))?;
            let head = format!(
                "# {speed:.3} m/s\n#   motorium run --example {GRAPH} --with locomotion-gait.toml --clock lockstep\n\n\
                 seed = {seed}\n"
            );
            writer.write("locomotion-gait.toml", &(head + &text))?;
        }
        writer.finish(self.json)
    }
}

fn borrowed(keys: &[(String, f64)]) -> Vec<(&str, f64)> {
    keys.iter().map(|(key, value)| (key.as_str(), *value)).collect()
}

fn charts(writer: &mut FigureWriter, study: &Study) -> anyhow::Result<()> {
    let chart = |title: &str, y: &str, series| Chart {
        title: title.to_owned(),
        x: "evaluation".to_owned(),
        y: y.to_owned(),
        log_x: false,
        log_y: false,
        series,
    };
    let each = |points: &dyn Fn(Searcher) -> Vec<[f64; 3]>| -> Vec<Series> {
        let one = |searcher: Searcher| Series { name: searcher.name().to_owned(), points: points(searcher) };
        Searcher::ALL.map(one).into()
    };
    let mut speeds = each(&|searcher| study.speeds(searcher));
    let (mean, error) = mean_and_error(&study.hand_set);
    let last = speeds[0].points.last().map_or(1.0, |point| point[0]);
    speeds.push(Series {
        name: "hand-set gait".to_owned(),
        points: vec![[1.0, mean, error], [last, mean, error]],
    });
    let title = "Forward speed of the quadruped's best gait so far";
    writer.chart("locomotion-speed", &chart(title, "speed, m/s", speeds))?;
    let distances = each(&|searcher| study.distances(searcher));
    let title = "Distance of a gait from the one before";
    writer.chart("locomotion-distance", &chart(title, "distance, ranges", distances))
}

/// Returns one line per evaluation.
fn table(study: &Study) -> String {
    let names = PARAMETERS.map(|parameter| format!("\"{}\"", parameter.name)).join(",");
    let mut table = format!("method,seed,evaluation,outcome,\"speed, m/s\",{names}\n");
    for Trial { searcher, seed, gaits } in &study.trials {
        for (index, (gait, found)) in gaits.iter().enumerate() {
            let speed = Some(found.reward).filter(|speed| speed.is_finite());
            let speed = speed.map_or_else(String::new, |speed| format!("{speed:?}"));
            let values: [String; DIMENSIONS] = gait.map(|value| format!("{value:?}"));
            let (name, outcome) = (searcher.name(), found.outcome.name());
            table += &format!("{name},{seed},{},{outcome},{speed},{}\n", index + 1, values.join(","));
        }
    }
    table
}

fn claims(writer: &mut FigureWriter, study: &Study) {
    let finals = Searcher::ALL.map(|searcher| study.finals(searcher));
    let [rbf, matern, random] = Searcher::ALL.map(|searcher| mean_and_error(&study.finals(searcher)));
    let medians = finals.each_ref().map(|speeds| median(speeds));
    let seeds = finals[0].len();
    let text = |(mean, error): (f64, f64)| with_error(mean, error);
    let (hand, _) = mean_and_error(&study.hand_set);
    writer.claim(
        "2.30, 2.31",
        "Bayesian optimisation with an RBF kernel finds a gait that walks faster than 0.3 m/s, in the median",
        medians[0] > 0.3,
        format!(
            "median {} m/s of {seeds} seeds, {:.0} % of the gaits failed",
            decimal(medians[0]),
            100.0 * study.failures(Searcher::BayesianRbf)
        ),
    );
    writer.claim(
        "2.30, 2.31",
        "it walks faster than the hand-set gait, in the median",
        medians[0] > hand,
        format!("median {} m/s, hand-set {} m/s", decimal(medians[0]), decimal(hand)),
    );
    writer.claim(
        "2.30, 2.31",
        "it walks faster than the best gait of random search after as many evaluations",
        is_clearly_larger(rbf, random),
        format!("{} and {} m/s", text(rbf), text(random)),
    );
    writer.claim(
        "beyond the thesis",
        "a Matern kernel finds gaits at least as fast as an RBF kernel",
        matern.0 >= rbf.0 - matern.1.hypot(rbf.1),
        format!(
            "{} and {} m/s, medians {} and {}",
            text(matern),
            text(rbf),
            decimal(medians[1]),
            decimal(medians[0])
        ),
    );
}
