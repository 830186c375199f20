//! The recordings of a command: options and reading.

use std::path::PathBuf;

use motorium_library::{DAMPING, Interpolation, Metric, Recordings, SampledSpring};
use motorium_recordings::Selection;

use crate::values::{at_least, from_zero, positive};

/// Options that name recordings, and how to read them.
#[derive(Debug, clap::Args)]
pub(super) struct Source {
    /// Recordings: .csv, .tsv, .json or .jsonl files, or folders of such files
    #[arg(required = true)]
    pub(super) data: Vec<PathBuf>,
    /// Samples per second of recordings without times
    #[arg(long, default_value_t = 100.0, value_parser = positive)]
    rate: f64,
    /// Use only these degrees of freedom: names, or prefixes with `*`
    #[arg(long, value_delimiter = ',')]
    columns: Vec<String>,
    /// Smooth measured recordings with a Gaussian of this standard deviation, in samples
    #[arg(long, default_value_t = 0.0, value_name = "SAMPLES", value_parser = from_zero)]
    smooth: f64,
    /// Cut the recordings into half-overlapping windows with this number of samples
    #[arg(long, value_name = "SAMPLES", value_parser = at_least(2))]
    window: Option<usize>,
    /// With --window: drop windows with a larger step than this between two samples
    #[arg(long, default_value_t = f64::INFINITY)]
    leap: f64,
}

impl Source {
    pub(super) fn read(&self) -> anyhow::Result<Recordings> {
        let selection =
            Selection { rate: Some(self.rate), channels: self.columns.clone(), ..Selection::default() };
        let mut all = Recordings::read(&self.data, &selection)?;
        if self.smooth > 0.0 {
            all.trajectories.iter_mut().for_each(|trajectory| *trajectory = trajectory.smoothed(self.smooth));
        }
        if let Some(window) = self.window {
            all = all.windows(window, window / 2, self.leap);
            anyhow::ensure!(
                !all.trajectories.is_empty(),
                "no window of {window} samples in these recordings"
            );
        }
        Ok(all)
    }
}

/// Options for the conversion of recordings into forces.
#[derive(Debug, clap::Args)]
pub(super) struct Shape {
    /// Number of evenly spaced samples of each movement
    #[arg(long, default_value_t = 200)]
    samples: usize,
    /// Damping D of the spring; its stiffness is D^2 / 4
    #[arg(long, default_value_t = DAMPING)]
    damping: f64,
    /// Curve between samples: a natural cubic `spline`, or `linear`; stored in the library
    #[arg(long, value_enum, default_value = "spline", hide_possible_values = true)]
    interpolation: InterpolationName,
}

impl Shape {
    pub(super) fn spring(&self) -> anyhow::Result<SampledSpring> {
        let spring = SampledSpring::new(self.samples, self.damping)?;
        Ok(spring.with_interpolation(self.interpolation.into()))
    }
}

/// Curve between the samples of a recording.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum InterpolationName {
    /// A natural cubic spline
    Spline,
    /// Straight lines
    Linear,
}

impl From<InterpolationName> for Interpolation {
    fn from(name: InterpolationName) -> Self {
        match name {
            InterpolationName::Spline => Self::Spline,
            InterpolationName::Linear => Self::Linear,
        }
    }
}

/// Error that the eigenforces minimise.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(super) enum MetricName {
    /// Force, as in the literature
    Force,
    /// Position: more accurate paths with the same number of eigenforces
    Position,
}

impl From<MetricName> for Metric {
    fn from(name: MetricName) -> Self {
        match name {
            MetricName::Force => Self::Force,
            MetricName::Position => Self::Position,
        }
    }
}
