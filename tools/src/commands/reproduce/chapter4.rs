//! `motorium reproduce chapter4`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_library::statistics::with_error;
use motorium_models::gplvm::{
    BackForm, Estimate, Poses, Prior, Settings, TransferResult, compare, few_poses, trained_together,
    transfer_and_training,
};
use motorium_pictures::chart::{Chart, Series};

use super::writer::FigureWriter;

/// The shared latent spaces of Delhaisse's thesis (2019), chapter 4: figures 4.3 and 4.5 to 4.10.
///
/// Transfers each robot to a model of the human and WALK-MAN, and trains a model with the robot and one with
/// all robots, with and without back constraints; then finds how many poses of a robot are needed, compared
/// with a direct Gaussian process, ridge regression and the nearest pose. Writes each figure as CSV and SVG
/// (bars: standard errors over splits), and reports which claims hold.
///
/// Example: motorium reproduce chapter4 --data recordings/ --output out/chapter4
#[derive(Debug, clap::Args)]
pub(super) struct Chapter4 {
    /// The folder with human-robot-arms/human.csv, walkman.csv, coman.csv and centauro.csv
    #[arg(long)]
    data: PathBuf,
    /// The folder to write to
    #[arg(long, short, value_name = "DIR", default_value = "out/chapter4")]
    output: PathBuf,
    /// Number of splits of the poses, each with different held-out poses
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(2..=20))]
    splits: u64,
    /// Maximum number of iterations of each training
    #[arg(long, default_value_t = 300)]
    iterations: usize,
    /// Discard the results of an earlier run in this folder, and start again
    #[arg(long)]
    restart: bool,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

const SOURCE: &str = "walkman";
const ROBOTS: [&str; 2] = ["coman", "centauro"];
/// Dimensions of free and kernel-constrained latents.
const LATENTS: [usize; 2] = [2, 6];
/// Methods without a latent, in the figures of transfers.
const DIRECT: [&str; 3] = ["gaussian_process", "ridge", "nearest"];
/// Poses of the robot in the figure of few poses.
const COUNTS: [usize; 5] = [10, 20, 40, 80, 160];

/// A latent of the thesis's figure 4.1: free, or a function of the input's or the output's poses.
struct Form {
    name: &'static str,
    space: Option<&'static str>,
}

const FORMS: [Form; 3] = [
    Form { name: "free", space: None },
    Form { name: "back constraint on input", space: Some("human") },
    Form { name: "back constraint on output", space: Some(SOURCE) },
];

/// The error of one of the models of a pair.
type ErrorOf = fn(&Pair) -> Estimate;

/// A pair of a transferred and a trained model.
struct Pair {
    robot: &'static str,
    form: &'static str,
    latents: usize,
    result: TransferResult,
    /// Mean squared error of a model of the human and all robots.
    together: Estimate,
}

impl Pair {
    /// Returns `true` if an error is at most a standard error larger than with the model trained for this
    /// robot.
    fn is_no_worse(&self, a: Estimate) -> bool {
        let b = self.result.trained;
        a.mean <= b.mean + a.error.hypot(b.error)
    }

    /// Returns an error next to the error of the model trained for this robot.
    fn describe(&self, a: Estimate) -> String {
        let b = self.result.trained;
        let (a, b) = (with_error(a.mean, a.error), with_error(b.mean, b.error));
        format!("{} q = {} {}: {a} and {b} rad^2", self.robot, self.latents, self.form)
    }
}

/// Returns a point of a chart.
fn point(x: usize, estimate: Estimate) -> [f64; 3] {
    [x as f64, estimate.mean, estimate.error]
}

impl Chapter4 {
    fn poses(&self, name: &str) -> anyhow::Result<Poses> {
        Ok(Poses::read(&self.data.join("human-robot-arms").join(format!("{name}.csv")))?)
    }

    /// Figures 4.3 and 4.5 to 4.8: transferred and trained models.
    fn transfer(&self, writer: &mut FigureWriter, human: &Poses, source: &Poses) -> anyhow::Result<()> {
        let folds = self.splits as usize;
        let mut pairs = vec![];
        let robots = [self.poses(ROBOTS[0])?, self.poses(ROBOTS[1])?];
        for form in &FORMS {
            for latents in LATENTS {
                let back = form.space.map(|space| (space.to_string(), BackForm::Kernel));
                let settings = Settings {
                    latents: Some(latents),
                    back,
                    prior: Prior::Normal,
                    iterations: self.iterations,
                };
                let all = [source, &robots[0], &robots[1]];
                let together = trained_together(human, &all, &settings, folds)?;
                for (k, robot) in ROBOTS.into_iter().enumerate() {
                    let result = transfer_and_training(human, source, &robots[k], &settings, folds)?;
                    pairs.push(Pair { robot, form: form.name, latents, result, together: together[k + 1] });
                    writer.bar.inc(1);
                }
            }
        }
        for robot in ROBOTS {
            let mut series = vec![];
            for form in &FORMS {
                let own = || pairs.iter().filter(|pair| pair.robot == robot && pair.form == form.name);
                let points =
                    |estimate: ErrorOf| own().map(|pair| point(pair.latents, estimate(pair))).collect();
                let models: [(&str, ErrorOf); 3] = [
                    ("transferred", |pair| pair.result.transferred),
                    ("trained", |pair| pair.result.trained),
                    ("trained with all robots", |pair| pair.together),
                ];
                for (name, estimate) in models {
                    series.push(Series { name: format!("{name}, {}", form.name), points: points(estimate) });
                }
            }
            let direct = compare(human, &self.poses(robot)?, &Settings::default(), folds)?;
            for error in direct.into_iter().filter(|error| DIRECT.contains(&error.method)) {
                let mean_error = error.deviation / (self.splits as f64).sqrt();
                let points = LATENTS.map(|latents| [latents as f64, error.mean, mean_error]);
                series.push(Series { name: error.method.to_string(), points: points.to_vec() });
            }
            let chart = Chart {
                title: format!("Held-out poses of {robot}: transferred and trained models"),
                x: "dimensions of the latent".to_string(),
                y: "mean squared error, rad^2".to_string(),
                log_x: false,
                log_y: false,
                series,
            };
            writer.chart(&format!("transfer-{robot}"), &chart)?;
        }
        let claims: [(&str, &str, ErrorOf); 2] = [
            (
                "4.5, 4.6",
                "a transferred model is no worse than one that is trained with the robot, in 10 of 12 pairs",
                |pair| pair.result.transferred,
            ),
            (
                "4.3",
                "one model of the human and all robots is no worse than one for each robot, in 10 of 12 pairs",
                |pair| pair.together,
            ),
        ];
        for (figures, claim, estimate) in claims {
            let good = pairs.iter().filter(|pair| pair.is_no_worse(estimate(pair))).count();
            let evidence: Vec<String> = pairs.iter().map(|pair| pair.describe(estimate(pair))).collect();
            let evidence = format!("{good} of {}: {}", pairs.len(), evidence.join("; "));
            writer.claim(figures, claim, 6 * good >= 5 * pairs.len(), evidence);
        }
        let share =
            |pair: &Pair| pair.result.transfer_seconds.mean / pair.result.training_seconds.mean.max(1e-9);
        let slowest = pairs.iter().map(share).fold(0.0, f64::max);
        let claim = "a transfer costs at most a sixth of the time of a training";
        writer.claim("4.5, 4.6", claim, slowest <= 1.0 / 6.0, format!("at most {:.3} of it", slowest));
        Ok(())
    }

    /// Figures 4.9 and 4.10, and the number of poses that a robot needs.
    fn needed_poses(
        &self,
        writer: &mut FigureWriter,
        human: &Poses,
        source: &Poses,
        robot: &'static str,
    ) -> anyhow::Result<()> {
        let poses = self.poses(robot)?;
        let most = human.len() - human.len().div_ceil(5);
        let counts: Vec<usize> = COUNTS.into_iter().filter(|count| *count <= most).collect();
        anyhow::ensure!(!counts.is_empty(), "{} poses, expected at least 13", human.len());
        let forms = [
            ("default, the pose", Settings { iterations: self.iterations, ..Settings::default() }),
            (
                "free latent, q = 6",
                Settings { latents: Some(6), back: None, iterations: self.iterations, ..Settings::default() },
            ),
        ];
        let mut series: Vec<Series> = vec![];
        let mut found = vec![];
        for (index, (name, settings)) in forms.iter().enumerate() {
            let points = few_poses(human, source, &poses, settings, &counts, self.splits)?;
            for (method, (label, _)) in points[0].errors.iter().enumerate() {
                let is_latent = method < 2;
                if is_latent || index == 0 {
                    let name = if is_latent { format!("{label}, {name}") } else { (*label).to_string() };
                    let points = points.iter().map(|few| point(few.poses, few.errors[method].1)).collect();
                    series.push(Series { name, points });
                }
            }
            found.push(points);
            writer.bar.inc(1);
        }
        let chart = Chart {
            title: format!("Held-out poses of {robot} by the number of its known poses"),
            x: "poses of the robot".to_string(),
            y: "mean squared error, rad^2".to_string(),
            log_x: true,
            log_y: true,
            series,
        };
        writer.chart(&format!("poses-{robot}"), &chart)?;
        let estimate = |form: usize, count: usize, method: &str| {
            let few = &found[form][count];
            let known = few.errors.iter().find(|(name, _)| *name == method);
            known.map_or(Estimate { mean: f64::NAN, error: 0.0 }, |(_, estimate)| *estimate)
        };
        let text = |estimate: Estimate| with_error(estimate.mean, estimate.error);
        let (last, free) = (counts.len() - 1, 1);
        let direct = estimate(0, last, "gaussian_process");
        for (name, form) in [("the free latent", free), ("the default latent", 0)] {
            let latent = estimate(form, last, "transferred");
            let holds = latent.mean <= direct.mean + latent.error.hypot(direct.error);
            let claim = format!("{name} predicts {robot} as well as a direct Gaussian process");
            let evidence = format!("{} and {} rad^2 with {} poses", text(latent), text(direct), counts[last]);
            writer.claim("4.9, 4.10", &claim, holds, evidence);
        }
        let (shared, alone) = (estimate(free, 0, "transferred"), estimate(free, 0, "alone"));
        let claim = format!(
            "with few poses of {robot}, the shared latent predicts better than a latent of these poses"
        );
        let holds = shared.mean + shared.error.hypot(alone.error) < alone.mean;
        let evidence = format!("{} and {} rad^2 with {} poses", text(shared), text(alone), counts[0]);
        writer.claim("beyond the thesis", &claim, holds, evidence);
        let direct = estimate(0, 0, "gaussian_process");
        let claim = format!(
            "with few poses of {robot}, the shared latent predicts better than a direct Gaussian process"
        );
        let holds = shared.mean + shared.error.hypot(direct.error) < direct.mean;
        let evidence = format!("{} and {} rad^2 with {} poses", text(shared), text(direct), counts[0]);
        writer.claim("beyond the thesis", &claim, holds, evidence);
        Ok(())
    }

    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let (human, source) = (self.poses("human")?, self.poses(SOURCE)?);
        let of = serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "data": self.data.display().to_string(),
            "poses": human.len(),
            "splits": self.splits,
            "iterations": self.iterations,
        });
        let mut writer = FigureWriter::resuming(self.output.clone(), "chapter4", 16, of, self.restart)?;
        writer.part("transfer", |writer| self.transfer(writer, &human, &source))?;
        for robot in ROBOTS {
            let part = format!("few poses of {robot}");
            writer.part(&part, |writer| self.needed_poses(writer, &human, &source, robot))?;
        }
        writer.finish(self.json)
    }
}
