//! `motorium reproduce qp`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_control::{StackSample, TaskStack, run_stack};
use motorium_pictures::chart::{Chart, Series};

use super::writer::FigureWriter;
use crate::out::outln;
use crate::output::Overwrite;
use crate::report::decimal;

/// Compare stacks of tasks, figure 2.27 of Delhaisse's thesis (2019): a posture, a hand, their weighted sum,
/// and the hand with priority over the posture, on an iiwa with the same moving target.
///
/// Writes the errors of hand and posture as CSV and SVG, and reports which claims hold.
///
/// Example: motorium reproduce qp --output out/qp
#[derive(Debug, clap::Args)]
pub(super) struct Qp {
    /// The folder to write to
    #[arg(long, short, value_name = "DIR", default_value = "out/qp")]
    output: PathBuf,
    /// The robot, with a fixed base, a home pose and one end effector
    #[arg(long, default_value = "iiwa14")]
    robot: String,
    /// Duration of the motion, s
    #[arg(long, default_value_t = 8.0)]
    seconds: f64,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// A figure: an error of all stacks over time.
struct Figure {
    file: &'static str,
    title: &'static str,
    y: &'static str,
    value: fn(&StackSample) -> f64,
}

const FIGURES: [Figure; 2] = [
    Figure {
        file: "qp-hand",
        title: "Distance of the hand from its target",
        y: "distance, m",
        value: |sample| sample.position,
    },
    Figure {
        file: "qp-posture",
        title: "Difference of the joints from the posture",
        y: "difference, rad",
        value: |sample| sample.posture,
    },
];

impl Qp {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        anyhow::ensure!(
            (0.1..=600.0).contains(&self.seconds),
            "--seconds is {}, expected 0.1 to 600",
            self.seconds
        );
        let robot = motorium_robots::load(&self.robot, &std::env::current_dir()?)?;
        let model = &robot.model;
        anyhow::ensure!(!model.base().floating, "robot `{}` has a floating base", self.robot);
        let profile = robot.profile.as_ref();
        let profile = profile.ok_or_else(|| anyhow::anyhow!("robot `{}` has no profile", self.robot))?;
        let (home, hand) = (profile.home(model)?, robot.end_effector(None)?);
        let mut writer = FigureWriter::new(self.output.clone(), "qp", 4, self.overwrite)?;
        let mut runs = Vec::new();
        for stack in TaskStack::ALL {
            runs.push(run_stack(model, home.as_slice(), hand, stack, self.seconds)?);
            writer.bar.inc(1);
        }
        for Figure { file, title, y, value } in FIGURES {
            let series = TaskStack::ALL.iter().zip(&runs).map(|(stack, samples)| Series {
                name: stack.name().to_owned(),
                // every 20 ms
                points: samples.iter().step_by(20).map(|sample| [sample.time, value(sample), 0.0]).collect(),
            });
            let chart = Chart {
                title: title.to_owned(),
                x: "time, s".to_owned(),
                y: y.to_owned(),
                log_x: false,
                log_y: false,
                series: series.collect(),
            };
            writer.chart(file, &chart)?;
        }
        claims(&mut writer, &runs);
        writer.bar.finish_and_clear();
        if self.json {
            let report = serde_json::json!({ "claims": writer.claims, "files": writer.shown_files() });
            outln!("{}", serde_json::to_string_pretty(&report)?);
            return Ok(ExitCode::SUCCESS);
        }
        for claim in &writer.claims {
            let word = if claim.holds { "holds" } else { "does not hold" };
            outln!("{}: {}\n    {word}: {}", claim.figure, claim.claim, claim.evidence);
        }
        outln!("{} files in {}", writer.files.len(), self.output.display());
        Ok(ExitCode::SUCCESS)
    }
}

fn claims(writer: &mut FigureWriter, runs: &[Vec<StackSample>]) {
    let worst = |run: &[StackSample]| run.iter().fold(0.0_f64, |worst, sample| worst.max(sample.position));
    let posture =
        |run: &[StackSample]| run.iter().map(|sample| sample.posture).sum::<f64>() / run.len().max(1) as f64;
    let [postural, cartesian, soft, hard] = [0, 1, 2, 3].map(|index| runs[index].as_slice());
    let (alone, above, sum) = (worst(cartesian), worst(hard), worst(soft));
    writer.claim(
        "2.27",
        "above the posture the hand is as near to its target as alone",
        above < alone + 1e-4,
        format!("at most {} m, alone {} m", decimal(above), decimal(alone)),
    );
    writer.claim(
        "2.27",
        "in a sum the posture holds the hand off its target",
        sum > 10.0 * above.max(1e-6),
        format!("at most {} m, above the posture {} m", decimal(sum), decimal(above)),
    );
    let (with, without) = (posture(hard), posture(cartesian));
    writer.claim(
        "2.27",
        "below the hand the posture is kept at least as well as without a posture task",
        with <= without + 1e-9,
        format!("mean {} rad, without {} rad", decimal(with), decimal(without)),
    );
    let (still, moved) = (posture(postural), worst(postural));
    writer.claim(
        "2.27",
        "a posture alone stays, and its hand is left behind",
        still < 1e-9 && moved > sum,
        format!("mean {} rad, the hand up to {} m from the target", decimal(still), decimal(moved)),
    );
}
