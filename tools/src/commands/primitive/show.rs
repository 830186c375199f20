//! `motorium primitive show`: the content of a primitive.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_pictures::chart::Panel;
use motorium_primitives::dmp::{DmpModel, RhythmicModel, Variant};
use motorium_primitives::file::{Primitive, PrimitiveFile};
use motorium_primitives::rollout::{Override, roll_out};
use serde::Serialize;

use super::plot;
use crate::out::{out, outln};
use crate::output::{Overwrite, check_format, serialize_path};
use crate::report::table;
use crate::style;

/// Show a primitive: its equation, settings and weights.
///
/// Example: motorium primitive show reach.json --plot reach.svg
#[derive(Debug, clap::Args)]
pub(super) struct Show {
    /// The primitive, as `motorium primitive fit` wrote it
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Draw the movement and, below it, the forcing term (of a probabilistic primitive: two standard
    /// deviations)
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    kind: &'static str,
    equation: &'static str,
    duration_s: f64,
    settings: serde_json::Value,
    dimensions: Vec<Dimension<'a>>,
    #[serde(serialize_with = "serialize_path")]
    plot: Option<PathBuf>,
}

#[derive(Debug, Serialize)]
struct Dimension<'a> {
    name: &'a str,
    start: f64,
    goal: f64,
    weights: usize,
    largest_weight: f64,
}

impl Show {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check([&self.file], &self.plot)?;
        self.plot.iter().try_for_each(|plot| check_format(plot, &["svg"]))?;
        let file = PrimitiveFile::read(&self.file)?;
        if let Some(path) = &self.plot {
            plot::write(path, &panels(&file)?)?;
        }
        let (equation, settings, weights) = match &file.primitive {
            Primitive::Discrete(model) => {
                let weights: Vec<&[f64]> =
                    model.weights().as_slice().chunks_exact(model.kernels().count()).collect();
                (equation(model), serde_json::to_value(model.settings())?, weights)
            }
            Primitive::Rhythmic(model) => {
                let weights: Vec<&[f64]> =
                    model.weights().as_slice().chunks_exact(model.settings().kernels).collect();
                (RHYTHMIC, serde_json::to_value(model.settings())?, weights)
            }
            Primitive::Probabilistic(promp) => {
                let weights: Vec<&[f64]> =
                    promp.weight_mean().as_slice().chunks_exact(promp.basis().count()).collect();
                (PROBABILISTIC, serde_json::to_value(promp.basis())?, weights)
            }
            Primitive::Kernelised(movement) => {
                let settings = movement.settings();
                let settings = serde_json::json!({
                    "points": movement.reference().points().len(),
                    "mean_regularisation": settings.mean_regularisation,
                    "covariance_regularisation": settings.covariance_regularisation,
                    "length": settings.length,
                });
                (KERNELISED, settings, Vec::new())
            }
            Primitive::Polynomial(movement) => {
                let weights: Vec<&[f64]> =
                    movement.weights().as_slice().chunks_exact(movement.degree() + 1).collect();
                (POLYNOMIAL, serde_json::json!({ "degree": movement.degree() }), weights)
            }
        };
        let dimensions = file.names.iter().enumerate().map(|(d, name)| {
            // a kernelised primitive has a reference in their place
            let weights = weights.get(d).copied().unwrap_or_default();
            Dimension {
                name,
                start: file.start[d],
                goal: file.goal[d],
                weights: weights.len(),
                largest_weight: weights.iter().fold(0.0, |largest: f64, weight| largest.max(weight.abs())),
            }
        });
        let report = Report {
            kind: file.primitive.kind(),
            equation,
            duration_s: file.duration,
            settings,
            dimensions: dimensions.collect(),
            plot: self.plot.clone(),
        };
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            out!("{}", text(&report));
        }
        Ok(ExitCode::SUCCESS)
    }
}

const RHYTHMIC: &str = "tau^2 y'' = K (g - y) - D tau y' + r f, tau phi' = 1, f = sum(psi_i w_i) / sum(psi_i), psi_i = exp(h (cos(phi - c_i) - 1))";
const PROBABILISTIC: &str = "y(p) = Phi(p) w + e, w ~ N(mu, Sigma), e ~ N(0, s^2 I)";
const KERNELISED: &str = "m(p) = k(p) (K + lambda_1 S)^-1 mu, k(p, p') = exp(-(p - p')^2 / l), mu and S of a Gaussian mixture regression";
const POLYNOMIAL: &str = "y(p) = sum_k w_k p^k";

fn equation(model: &DmpModel) -> &'static str {
    match model.settings().variant {
        Variant::Classic => "T^2 y'' = K (g - y) - D T y' + f, f = s sum(psi_i w_i) / sum(psi_i)",
        Variant::GoalSafe => {
            "T^2 y'' = K (g - y) - D T y' - K (g - y0) s + K f, f = s sum(psi_i w_i) / sum(psi_i)"
        }
        Variant::QuinticGoal => {
            "T^2 y'' = K (g(t) - y) + D T (g'(t) - y') + T^2 g''(t) + f, g(t) minimum-jerk to rest at g"
        }
        Variant::FinalVelocity => {
            "T^2 y'' = K (g(t) - y) + D T (g'(t) - y') + T^2 g''(t) + f, g(t) a quintic through g with a final velocity"
        }
    }
}

fn panels(file: &PrimitiveFile) -> anyhow::Result<Vec<Panel>> {
    const SAMPLES: usize = 300;
    let wish = Override {
        periods: matches!(file.primitive, Primitive::Rhythmic(_)).then_some(1.0),
        ..Override::default()
    };
    let trajectory = roll_out(file, &wish, file.duration / SAMPLES as f64)?;
    let mut panels = Vec::new();
    for (d, name) in file.names.iter().enumerate() {
        panels.push(plot::dimension(name, std::slice::from_ref(&trajectory), d));
        let forcing: Option<Vec<(f64, f64)>> = match &file.primitive {
            Primitive::Discrete(model) => Some(discrete_forcing(model, file.duration, d, SAMPLES)),
            Primitive::Rhythmic(model) => Some(rhythmic_forcing(model, file.duration, d, SAMPLES)),
            Primitive::Probabilistic(_) | Primitive::Kernelised(_) | Primitive::Polynomial(_) => None,
        };
        if let Some(forcing) = forcing {
            let mut panel = Panel::new(&format!("forcing of {name}, units of {name}"));
            panel.line(forcing);
            panels.push(panel);
        }
    }
    Ok(panels)
}

fn discrete_forcing(model: &DmpModel, duration: f64, d: usize, samples: usize) -> Vec<(f64, f64)> {
    let mut features = vec![0.0; model.kernels().count()];
    let at = |k: usize| {
        let progress = k as f64 / samples as f64;
        model.kernels().features_into(progress, &mut features);
        let sum = features.iter().zip(model.weights().column(d).iter()).map(|(f, w)| f * w).sum();
        (progress * duration, sum)
    };
    (0..=samples).map(at).collect()
}

fn rhythmic_forcing(model: &RhythmicModel, period: f64, d: usize, samples: usize) -> Vec<(f64, f64)> {
    let mut features = vec![0.0; model.settings().kernels];
    let at = |k: usize| {
        let part = k as f64 / samples as f64;
        model.features_into(part * std::f64::consts::TAU, &mut features);
        let sum = features.iter().zip(model.weights().column(d).iter()).map(|(f, w)| f * w).sum();
        (part * period, sum)
    };
    (0..=samples).map(at).collect()
}

fn text(report: &Report<'_>) -> String {
    let mut rows = table(["dimension", "from", "to", "weights", "largest"]);
    for d in &report.dimensions {
        rows.add_row([
            d.name.to_string(),
            format!("{:.4}", d.start),
            format!("{:.4}", d.goal),
            d.weights.to_string(),
            format!("{:.4}", d.largest_weight),
        ]);
    }
    let settings: Vec<String> = match &report.settings {
        serde_json::Value::Object(settings) => settings
            .iter()
            .filter(|(_, value)| !value.is_null())
            .map(|(key, value)| format!("{key} = {}", value.to_string().replace('"', "")))
            .collect(),
        other => vec![other.to_string()],
    };
    let drew = report.plot.as_ref().map_or_else(String::new, |path| format!("drew {}\n", path.display()));
    format!(
        "{} primitive of {} dimensions, {:.3} s\n  {}\n  {}\n{rows}\n{drew}",
        style::strong(report.kind),
        report.dimensions.len(),
        report.duration_s,
        report.equation,
        style::dim(settings.join(", ")),
    )
}
