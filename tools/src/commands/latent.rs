//! `motorium latent`: latent spaces shared by a human and robots.

mod retarget;

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use motorium_models::gplvm::{BackForm, LatentModel, Poses, Prior, Settings, compare};
use motorium_pictures::chart::{Chart, Series};
use serde_json::{Value, json};

use crate::out::outln;
use crate::output::{Overwrite, check_format, make_folder, write_file};

/// Latent spaces that a human and robots share: train one, show it, add robots, measure errors,
/// and find a robot's poses for a human's.
///
/// Example: motorium latent train poses --output arms.latent && motorium latent transfer arms.latent --robot
/// coman
#[derive(Debug, clap::Args)]
pub(crate) struct Latent {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Train(Train),
    Show(Show),
    Transfer(Transfer),
    Retarget(Box<retarget::Retarget>),
    Evaluate(Evaluate),
}

impl Latent {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Train(command) => command.run(),
            Command::Show(command) => command.run(),
            Command::Transfer(command) => command.run(),
            Command::Retarget(command) => command.run(),
            Command::Evaluate(command) => command.run(),
        }
    }
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Form {
    /// The pose itself
    Pose,
    /// Kernel regression
    Kernel,
    /// Network with one hidden layer
    Mlp,
    /// A free latent
    None,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PriorForm {
    /// Flat
    None,
    /// Standard normal
    Normal,
    /// From each pose to the next in a movement; a change of `clip` begins a new movement
    Dynamics,
}

#[derive(Debug, clap::Args)]
struct TrainingOptions {
    /// Dimensions of the latent [default: the columns of `--back-space` for `pose`, else 6]
    #[arg(long)]
    latents: Option<usize>,
    /// Function from the poses of `--back-space` to the latent
    #[arg(long, value_name = "FORM", default_value = "pose")]
    back: Form,
    /// The space of the back constraint
    #[arg(long, value_name = "SPACE", default_value = "human")]
    back_space: String,
    /// Maximum number of iterations [default: 300]
    #[arg(hide_default_value = true, long, default_value_t = 300)]
    iterations: usize,
}

impl TrainingOptions {
    fn settings(&self) -> Settings {
        let form = match self.back {
            Form::Pose => Some(BackForm::Pose),
            Form::Kernel => Some(BackForm::Kernel),
            Form::Mlp => Some(BackForm::Mlp),
            Form::None => None,
        };
        let back = form.map(|form| (self.back_space.clone(), form));
        Settings { latents: self.latents, back, prior: Prior::Normal, iterations: self.iterations }
    }
}

fn poses(data: &Path, space: &str) -> anyhow::Result<Poses> {
    Ok(Poses::read(&data.join(format!("{space}.csv")))?)
}

/// Train a shared latent space from a folder of poses.
///
/// Example: motorium latent train poses --output arms.latent --robot walkman
#[derive(Debug, clap::Args)]
struct Train {
    /// Folder with human.csv and one file a robot; line i of every file is the same instant
    data: PathBuf,
    /// The model's file
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Robots, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "walkman")]
    robot: Vec<String>,
    #[command(flatten)]
    options: TrainingOptions,
    /// Prior on the latent
    #[arg(long, value_name = "PRIOR", default_value = "normal")]
    prior: PriorForm,
    /// Plot the objective, SVG
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// Returns the chart of an objective: the smallest value so far, by evaluation.
fn objective_chart(values: Vec<(String, f64)>) -> Chart {
    let mut series: Vec<Series> = vec![];
    for (name, value) in values {
        if series.last().is_none_or(|last| last.name != name) {
            series.push(Series { name, points: vec![] });
        }
        if let Some(series) = series.last_mut().filter(|_| value.is_finite()) {
            let least = series.points.last().map_or(value, |[_, least, _]| least.min(value));
            series.points.push([series.points.len() as f64, least, 0.0]);
        }
    }
    Chart {
        title: "Objective of the training".to_string(),
        x: "evaluation".to_string(),
        y: "negative log likelihood, smallest so far".to_string(),
        log_x: false,
        log_y: false,
        series,
    }
}

impl Train {
    fn run(self) -> anyhow::Result<ExitCode> {
        let files = |name: &str| self.data.join(format!("{name}.csv"));
        let inputs: Vec<PathBuf> =
            std::iter::once("human").chain(self.robot.iter().map(String::as_str)).map(files).collect();
        self.overwrite.check(&inputs, [&self.output].into_iter().chain(&self.plot))?;
        self.plot.iter().try_for_each(|plot| check_format(plot, &["svg"]))?;
        let mut spaces = vec![poses(&self.data, "human")?];
        for robot in &self.robot {
            spaces.push(poses(&self.data, robot)?);
        }
        let data: Vec<_> = spaces.iter().map(Poses::data).collect();
        let prior = match self.prior {
            PriorForm::None => Prior::None,
            PriorForm::Normal => Prior::Normal,
            PriorForm::Dynamics => Prior::Dynamics { starts: spaces[0].starts.clone() },
        };
        let settings = Settings { prior, ..self.options.settings() };
        let shown = !self.json && std::io::stderr().is_terminal();
        let bar = if shown { ProgressBar::new_spinner() } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("{spinner} evaluation {pos}, {msg}, {elapsed}") {
            bar.set_style(style);
        }
        let mut values = vec![];
        let start = std::time::Instant::now();
        let (mut model, trained) =
            LatentModel::train_with_progress(&data, &settings, &mut |space, value| {
                bar.set_message(format!("{space}: {value:.2}"));
                bar.inc(1);
                values.push((space.to_string(), value));
            })?;
        let seconds = start.elapsed().as_secs_f64();
        bar.finish_and_clear();
        if let Some(plot) = &self.plot {
            write_file(plot, objective_chart(values).svg())?;
        }
        model.set_source(&std::path::absolute(&self.data)?.to_string_lossy());
        make_folder(&self.output)?;
        model.save(&self.output)?;
        let mut summary = summary(&model, &self.output);
        summary["objective"] = json!({ "start": trained.start, "end": trained.minimum.value });
        summary["iterations"] = json!(trained.minimum.iterations);
        summary["seconds"] = json!(seconds);
        show(&summary, self.json)
    }
}

/// Show a model: its spaces, hyperparameters and noise.
///
/// Example: motorium latent show arms.latent
#[derive(Debug, clap::Args)]
struct Show {
    /// The model
    file: PathBuf,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Show {
    fn run(self) -> anyhow::Result<ExitCode> {
        show(&summary(&load(&self.file)?, &self.file), self.json)
    }
}

/// Add a robot to a model, with the latent and all other spaces fixed.
///
/// Example: motorium latent transfer arms.latent --robot coman
#[derive(Debug, clap::Args)]
struct Transfer {
    /// The model, to which the robot is added
    file: PathBuf,
    /// Folder with the robot's poses, at the instants of the training [default: the training's folder]
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
    /// The robot
    #[arg(long)]
    robot: String,
    /// Maximum number of iterations for each of three starts
    #[arg(long, default_value_t = 200)]
    iterations: usize,
    /// Write here instead of to the model's file
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Transfer {
    fn run(self) -> anyhow::Result<ExitCode> {
        // without an output, the robot is added to the model's own file
        self.overwrite.check(&[], &self.output)?;
        let mut model = load(&self.file)?;
        let folder = self.data.or_else(|| model.source().map(PathBuf::from)).with_context(|| {
            format!(
                "the model {} does not name a folder of poses\nhelp: pass --data FOLDER",
                self.file.display()
            )
        })?;
        let robot = poses(&folder, &self.robot)?;
        let start = std::time::Instant::now();
        let transferred = model.transfer(&robot.data(), self.iterations)?;
        let seconds = start.elapsed().as_secs_f64();
        let output = self.output.as_ref().unwrap_or(&self.file);
        make_folder(output)?;
        model.save(output)?;
        let mut summary = summary(&model, output);
        summary["objective"] = json!({ "starts": transferred.starts, "end": transferred.minimum.value });
        summary["seconds"] = json!(seconds);
        summary["left_out"] = json!(transferred.left_out);
        summary["warning"] = json!(transferred.warning);
        show(&summary, self.json)
    }
}

/// Compare errors on held-out poses with a direct Gaussian process, ridge regression and the nearest pose.
///
/// Example: motorium latent evaluate poses --robot coman --folds 5
#[derive(Debug, clap::Args)]
struct Evaluate {
    /// Folder with human.csv and the robot's poses
    data: PathBuf,
    /// The robot
    #[arg(long)]
    robot: String,
    /// Number of folds of the poses, each held out of one training
    #[arg(long, default_value_t = 5)]
    folds: usize,
    #[command(flatten)]
    options: TrainingOptions,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Evaluate {
    fn run(self) -> anyhow::Result<ExitCode> {
        let (human, robot) = (poses(&self.data, "human")?, poses(&self.data, &self.robot)?);
        let errors = compare(&human, &robot, &self.options.settings(), self.folds)?;
        if self.json {
            let methods: Vec<Value> = errors
                .iter()
                .map(
                    |e| json!({ "method": e.method, "mean_squared_error": e.mean, "deviation": e.deviation }),
                )
                .collect();
            outln!("{}", json!({ "robot": self.robot, "folds": self.folds, "methods": methods }));
            return Ok(ExitCode::SUCCESS);
        }
        for error in errors {
            outln!("{:<18} {:.4} +- {:.4}", error.method, error.mean, error.deviation);
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn load(path: &Path) -> anyhow::Result<LatentModel> {
    LatentModel::load(path).with_context(|| path.display().to_string())
}

fn summary(model: &LatentModel, path: &Path) -> Value {
    let spaces: Vec<Value> = model
        .spaces()
        .iter()
        .map(|space| {
            json!({
                "name": space.name,
                "columns": space.columns,
                "variance": space.kernel.variance,
                "lengths": space.kernel.lengths,
                "noise": space.noise,
                "noise_share": space.noise_share(),
            })
        })
        .collect();
    json!({
        "file": path.display().to_string(),
        "latents": model.latents(),
        "poses": model.poses(),
        "back_constraint": model.back_constrained().map(|space| &space.name),
        "spaces": spaces,
    })
}

fn show(summary: &Value, json: bool) -> anyhow::Result<ExitCode> {
    if json {
        outln!("{summary}");
        return Ok(ExitCode::SUCCESS);
    }
    outln!("{} poses in {} latent dimensions", summary["poses"], summary["latents"]);
    for space in summary["spaces"].as_array().into_iter().flatten() {
        let name = space["name"].as_str().unwrap_or_default();
        let columns = space["columns"].as_array().map_or(0, Vec::len);
        let noise = 100.0 * space["noise_share"].as_f64().unwrap_or(f64::NAN);
        outln!("{name:<16} {columns} columns, {noise:.1} % noise");
    }
    if let Some(seconds) = summary["seconds"].as_f64() {
        outln!("{seconds:.2} s");
    }
    if let Some(warning) = summary["warning"].as_str() {
        outln!("warning: {warning}");
    }
    Ok(ExitCode::SUCCESS)
}
