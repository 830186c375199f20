//! `motorium primitive fit`: a primitive from recordings.

mod report;
mod shown;

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use indicatif::{ProgressBar, ProgressStyle};
use motorium_pictures::chart::Panel;
use motorium_primitives::dmp::{
    Demonstration, DmpModel, Regression, RhythmicModel, RhythmicSettings, Scaling, Settings, Variant,
};
use motorium_primitives::file::PrimitiveFile;
use motorium_primitives::kmp::{KernelisedFit, KernelisedMovement};
use motorium_primitives::promp::{Learning, ProMp, ProMpBasis, ProMpFit};
use motorium_primitives::regression::PolynomialMovement;
use motorium_primitives::rollout::{Trajectory, reproduce};
use motorium_recordings::Recording;
use nalgebra::DMatrix;

use report::{Report, text};
use shown::Shown;

use super::super::samples::SampleArgs;
use super::plot;
use crate::out::{errln, out, outln};
use crate::output::{Overwrite, check_format, make_folder};
use crate::style;
use crate::values::up_to;

/// Fit a movement primitive to recordings of one movement: CSV, JSON, JSON lines or MCAP.
///
/// The output of `motorium topic echo --json` is accepted. Reports the error of the reproduced movement.
///
/// Example: motorium primitive fit demonstration.jsonl --output reach.json --plot reach.svg
#[derive(Debug, clap::Args)]
pub(super) struct Fit {
    /// The recordings
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Type of primitive [default: discrete]
    #[arg(
        long, value_enum, default_value_t = Model::Discrete, hide_default_value = true, hide_possible_values = true,
        value_name = "discrete|rhythmic|probabilistic|kernelised|polynomial"
    )]
    model: Model,
    /// The equation of a discrete primitive [default: quintic-goal]
    #[arg(
        long,
        value_enum,
        hide_possible_values = true,
        value_name = "quintic-goal|final-velocity|classic|goal-safe"
    )]
    variant: Option<VariantArg>,
    /// Number of kernels or basis functions (30) or of Gaussians of a kernelised primitive, or polynomial
    /// degree (5)
    #[arg(long, value_name = "N", value_parser = up_to(MOST_KERNELS))]
    kernels: Option<usize>,
    /// Method of regression [default: ridge (of a distribution: by EM)]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "ridge|locally-weighted|response")]
    regression: Option<RegressionArg>,
    /// Penalty of ridge and response regression [default: 1e-12]
    #[arg(long, value_name = "LAMBDA")]
    penalty: Option<f64>,
    /// Scaling of the shape of a discrete primitive with its displacement [default: fixed]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "fixed|displacement|similarity")]
    scaling: Option<ScalingArg>,
    #[command(flatten)]
    selection: SampleArgs,
    /// Cut-off frequency of a low-pass filter for noise [default: no filter]
    #[arg(long, value_name = "HZ")]
    cutoff: Option<f64>,
    /// Number of evenly spaced samples per recording, or per period of a rhythm [default: 200]
    #[arg(long, value_name = "N", default_value_t = 200, hide_default_value = true, value_parser = clap::value_parser!(u32).range(4..=100_000))]
    samples: u32,
    /// Number of periods in every recording of a rhythm [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    periods: Option<u32>,
    /// Write the primitive to this file
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Draw recordings and primitive
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// Maximum number of kernels: the regression stores the square of their number.
const MOST_KERNELS: u64 = 2000;
/// Penalty of ridge and response regression.
const PENALTY: f64 = 1e-12;
/// Default number of kernels per dimension.
const KERNELS: usize = 30;
/// Default degree of a polynomial, the degree of a minimum-jerk movement.
const DEGREE: usize = 5;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Model {
    Discrete,
    Rhythmic,
    Probabilistic,
    Kernelised,
    Polynomial,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum VariantArg {
    QuinticGoal,
    FinalVelocity,
    Classic,
    GoalSafe,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum RegressionArg {
    Ridge,
    LocallyWeighted,
    Response,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum ScalingArg {
    Fixed,
    Displacement,
    Similarity,
}

impl Fit {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.check()?;
        self.overwrite.check(&self.files, self.output.iter().chain(&self.plot))?;
        self.plot.iter().try_for_each(|plot| check_format(plot, &["svg"]))?;
        let shown = self.read()?;
        let file = match self.model {
            Model::Discrete => self.discrete(&shown)?,
            Model::Rhythmic => self.rhythmic(&shown)?,
            Model::Probabilistic => self.probabilistic(&shown)?,
            Model::Kernelised => self.kernelised(&shown)?,
            Model::Polynomial => self.polynomial(&shown)?,
        };
        let reproduced = reproduce(&file, &shown.demonstrations)
            .context("the primitive does not reproduce its demonstrations")?;
        if let Some(path) = &self.output {
            make_folder(path)?;
            file.write(path)?;
        }
        if let Some(path) = &self.plot {
            plot::write(path, &panels(&shown, &reproduced))?;
        }
        let report = Report::new(&file, &shown, &reproduced, [self.output.clone(), self.plot.clone()]);
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            out!("{}", text(&report));
        }
        for poor in report.poor() {
            errln!("{} {poor}", style::warning("warning:"));
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Refuses options that have no effect on this type of primitive.
    fn check(&self) -> anyhow::Result<()> {
        let discrete = self.model == Model::Discrete;
        let penalised = match self.regression {
            None => !matches!(self.model, Model::Probabilistic | Model::Kernelised),
            Some(regression) => !matches!(regression, RegressionArg::LocallyWeighted),
        };
        for (given, option, holds) in [
            (self.variant.is_some(), "--variant", discrete),
            (self.scaling.is_some(), "--scaling", discrete),
            (self.periods.is_some(), "--periods", self.model == Model::Rhythmic),
            (self.penalty.is_some(), "--penalty", penalised),
            (
                self.regression.is_some(),
                "--regression",
                !matches!(self.model, Model::Kernelised | Model::Polynomial),
            ),
        ] {
            if given && !holds {
                bail!(
                    "{option} has no effect on this fit: remove it, or choose another --model or --regression"
                );
            }
        }
        Ok(())
    }

    fn read(&self) -> anyhow::Result<Shown> {
        let recordings: Vec<Recording> =
            self.files.iter().map(|file| self.selection.read(file)).collect::<Result<_, _>>()?;
        let names = recordings[0].names().to_vec();
        for (file, recording) in self.files.iter().zip(&recordings) {
            if recording.names().len() != names.len() {
                let (found, expected) = (recording.names().len(), names.len());
                bail!("{} has {found} channels, {} has {expected}", file.display(), self.files[0].display());
            }
            if recording.names() != names {
                let (found, expected) = (recording.names().join(", "), names.join(", "));
                bail!(
                    "{} has the channels {found}, {} has {expected}: name them in one order by --channel",
                    file.display(),
                    self.files[0].display()
                );
            }
            if let Some((from, to)) = gap(recording.times()) {
                errln!(
                    "{} {}: no samples from {from:.3} s to {to:.3} s, interpolated; cut the recording there",
                    style::warning("warning:"),
                    file.display()
                );
            }
        }
        if let Some(cutoff) = self.cutoff {
            for (file, recording) in self.files.iter().zip(&recordings) {
                if let Some(highest) =
                    highest_frequency(recording.times()).filter(|highest| cutoff > *highest)
                {
                    errln!(
                        "{} {}: --cutoff {cutoff} has no effect: half of the sample rate is {highest:.1} Hz; choose a lower one",
                        style::warning("warning:"),
                        file.display()
                    );
                }
            }
        }
        if self.model == Model::Rhythmic {
            for (file, recording) in self.files.iter().zip(&recordings) {
                if let Some(problem) = open_end(recording) {
                    bail!(
                        "{}: {problem}, expected whole periods: cut the recording, and give their number by --periods",
                        file.display()
                    );
                }
            }
        }
        let (samples, periods) = (self.samples as usize, self.periods.unwrap_or(1) as usize);
        let mut demonstrations = Vec::new();
        for recording in &recordings {
            if self.model == Model::Rhythmic {
                let all = recording.evenly(samples * periods + 1, self.cutoff)?;
                let period = recording.duration() / periods as f64;
                for index in 0..periods {
                    demonstrations.push((period, all.rows(index * samples, samples).into_owned()));
                }
            } else {
                demonstrations.push((recording.duration(), recording.evenly(samples, self.cutoff)?));
            }
        }
        let duration = demonstrations.iter().map(|(time, _)| time).sum::<f64>() / demonstrations.len() as f64;
        Ok(Shown { recordings: self.files.len(), names, duration, demonstrations })
    }

    fn discrete(&self, shown: &Shown) -> anyhow::Result<PrimitiveFile> {
        let demonstrations = shown
            .demonstrations
            .iter()
            .map(|(duration, positions)| Ok(Demonstration::from_positions(*duration, positions.clone())?))
            .collect::<anyhow::Result<Vec<_>>>()?;
        let settings = Settings {
            variant: match self.variant.unwrap_or(VariantArg::QuinticGoal) {
                VariantArg::QuinticGoal => Variant::QuinticGoal,
                VariantArg::FinalVelocity => Variant::FinalVelocity,
                VariantArg::Classic => Variant::Classic,
                VariantArg::GoalSafe => Variant::GoalSafe,
            },
            scaling: match self.scaling.unwrap_or(ScalingArg::Fixed) {
                ScalingArg::Fixed => Scaling::Fixed,
                ScalingArg::Displacement => Scaling::Displacement { limit: 10.0 },
                ScalingArg::Similarity => Scaling::Similarity { limit: 10.0 },
            },
            kernels: self.kernels.unwrap_or(KERNELS),
            ..Settings::default()
        };
        let regression = match self.regression.unwrap_or(RegressionArg::Ridge) {
            RegressionArg::Ridge => Regression::Ridge { lambda: self.penalty.unwrap_or(PENALTY) },
            RegressionArg::LocallyWeighted => Regression::LocallyWeighted,
            RegressionArg::Response => Regression::Response { lambda: self.penalty.unwrap_or(PENALTY) },
        };
        let model = DmpModel::fit(settings, &demonstrations, regression)?;
        Ok(PrimitiveFile::discrete(shown.names.clone(), &demonstrations, model))
    }

    fn rhythmic(&self, shown: &Shown) -> anyhow::Result<PrimitiveFile> {
        let settings =
            RhythmicSettings { kernels: self.kernels.unwrap_or(KERNELS), ..RhythmicSettings::default() };
        let periods: Vec<DMatrix<f64>> =
            shown.demonstrations.iter().map(|(_, period)| period.clone()).collect();
        let model = match self.regression.unwrap_or(RegressionArg::Ridge) {
            RegressionArg::Ridge => RhythmicModel::fit(settings, &periods, self.penalty.unwrap_or(PENALTY))?,
            RegressionArg::LocallyWeighted => RhythmicModel::fit_locally_weighted(settings, &periods)?,
            RegressionArg::Response => bail!("a rhythm is fitted by ridge or locally-weighted regression"),
        };
        Ok(PrimitiveFile::rhythmic(shown.names.clone(), shown.duration, &periods, model))
    }

    fn probabilistic(&self, shown: &Shown) -> anyhow::Result<PrimitiveFile> {
        let learning = match self.regression {
            None => ProMpFit::default().learning,
            Some(RegressionArg::Ridge) => Learning::Ridge { lambda: self.penalty.unwrap_or(PENALTY) },
            Some(_) => bail!(
                "a distribution is fitted by expectation maximisation (the default) or ridge regression"
            ),
        };
        let bar = progress_bar(!self.json);
        let basis = ProMpBasis::gaussian(self.kernels.unwrap_or(KERNELS), 0.7)?;
        let fit = ProMpFit { learning, ..ProMpFit::default() };
        let promp = ProMp::fit_with_progress(basis, &positions(shown), &fit, |part| {
            bar.set_position((part * 1000.0) as u64);
        });
        bar.finish_and_clear();
        let mut promp = promp?;
        promp.set_duration(shown.duration)?;
        Ok(PrimitiveFile::probabilistic(shown.names.clone(), promp))
    }

    fn kernelised(&self, shown: &Shown) -> anyhow::Result<PrimitiveFile> {
        // If not given, the criterion selects the number of Gaussians.
        let fit = KernelisedFit { components: self.kernels, ..KernelisedFit::default() };
        let movement = KernelisedMovement::fit(&positions(shown), shown.duration, &fit)?;
        Ok(PrimitiveFile::kernelised(shown.names.clone(), movement)?)
    }

    fn polynomial(&self, shown: &Shown) -> anyhow::Result<PrimitiveFile> {
        let (degree, lambda) = (self.kernels.unwrap_or(DEGREE), self.penalty.unwrap_or(PENALTY));
        let movement = PolynomialMovement::fit(&positions(shown), shown.duration, degree, lambda)?;
        Ok(PrimitiveFile::polynomial(shown.names.clone(), movement))
    }
}

/// Largest permitted difference between the ends of a rhythm, as a fraction of its range.
const OPEN: f64 = 0.1;

/// Factor over the median interval above which an interval between samples is a gap.
const GAP: f64 = 20.0;

/// Returns start and end of the longest gap of a recording, in seconds after its first sample.
fn gap(times: &[f64]) -> Option<(f64, f64)> {
    let interval = |index: usize| times[index + 1] - times[index];
    let longest = (0..times.len().saturating_sub(1)).max_by(|a, b| interval(*a).total_cmp(&interval(*b)))?;
    let median = median_interval(times)?;
    (interval(longest) > GAP * median).then(|| (times[longest] - times[0], times[longest + 1] - times[0]))
}

/// Returns half of the sample rate of a recording \[Hz\].
fn highest_frequency(times: &[f64]) -> Option<f64> {
    median_interval(times).map(|interval| 0.5 / interval)
}

/// Returns the median time from one sample to the next \[s\].
fn median_interval(times: &[f64]) -> Option<f64> {
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_by(f64::total_cmp);
    intervals.get(intervals.len() / 2).copied()
}

/// Returns the channel whose end differs from its start by more than a fraction of its range, and both
/// values.
fn open_end(recording: &Recording) -> Option<String> {
    let (values, last) = (recording.values(), recording.samples() - 1);
    let differs = |channel: &usize| {
        let column = values.column(*channel);
        let range = column.max() - column.min();
        // One step of the recording may be missing: the last sample of a period is before the first of the
        // next.
        let step = (1..=last).map(|k| (column[k] - column[k - 1]).abs()).fold(0.0, f64::max);
        (column[last] - column[0]).abs() > (OPEN * range).max(1.5 * step)
    };
    let channel = (0..values.ncols()).find(differs)?;
    let (name, from, to) = (&recording.names()[channel], values[(0, channel)], values[(last, channel)]);
    Some(format!("`{name}` begins at {from:.4} and ends at {to:.4}"))
}

fn positions(shown: &Shown) -> Vec<DMatrix<f64>> {
    shown.demonstrations.iter().map(|(_, positions)| positions.clone()).collect()
}

fn panels(shown: &Shown, reproduced: &[Trajectory]) -> Vec<Panel> {
    let of = |(d, name): (usize, &String)| {
        let mut panel = plot::dimension(name, reproduced, d);
        for (duration, positions) in &shown.demonstrations {
            let last = (positions.nrows() - 1) as f64;
            let line = (0..positions.nrows()).map(|k| (duration * k as f64 / last, positions[(k, d)]));
            panel.reference(line.collect());
        }
        panel
    };
    shown.names.iter().enumerate().map(of).collect()
}

/// Returns a progress bar on a terminal, otherwise a hidden one.
fn progress_bar(wanted: bool) -> ProgressBar {
    if !(wanted && std::io::stderr().is_terminal()) {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(1000);
    if let Ok(style) = ProgressStyle::with_template("fitting {bar:40} {percent} %  {elapsed}") {
        bar.set_style(style);
    }
    bar
}
