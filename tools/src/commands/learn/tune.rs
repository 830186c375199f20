//! `motorium learn tune`, and its continuation by `motorium learn resume`.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use motorium::graph::{GraphError, Machine, Override};
use motorium::plan::{ClockKind, Expectation, Plan};
use motorium::schedule::{self, RtLimit};
use motorium::units::TimeSpan;
use motorium::worker::Registry;
use motorium_learners::search::{Evaluation, Outcome};
use motorium_learners::tuning::{
    self, Attendance, Parameter, Progress, Settings, Subject, Summary, Tuning, TuningError,
};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::operator::{Terminal, is_simulation};
use super::threads::threads;
use crate::commands::loading::graph_file;
use crate::commands::run;
use crate::complete;
use crate::failure::Failure;
use crate::interrupt::interrupted;
use crate::out::{errln, outln};
use crate::output::check_folder;
use crate::overheads;
use crate::printer::Printer;
use crate::registry::registry;
use crate::rollout::{Reward, Rollout, RolloutError, allowed_cores, overlay};

/// Time between two lines of progress.
const INTERVAL: Duration = Duration::from_secs(1);

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Method {
    /// Covariance matrix adaptation with restarts
    CmaEs,
    /// The cross-entropy method
    CrossEntropy,
    /// Natural evolution strategy with one deviation per parameter
    Snes,
    /// Natural evolution strategy with a full covariance
    Xnes,
    /// Episodic relative entropy policy search
    Reps,
    /// Path integrals with black-box averaging
    PathIntegral,
    /// PoWER, for positive rewards
    Power,
    /// Gradient ascent by central differences
    FiniteDifferences,
    /// Gaussian process and expected improvement
    Bayesian,
    /// Uniform candidates
    Random,
}

impl From<Method> for tuning::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::CmaEs => Self::CmaEs,
            Method::CrossEntropy => Self::CrossEntropy,
            Method::Snes => Self::Snes,
            Method::Xnes => Self::Xnes,
            Method::Reps => Self::Reps,
            Method::PathIntegral => Self::PathIntegral,
            Method::Power => Self::Power,
            Method::FiniteDifferences => Self::FiniteDifferences,
            Method::Bayesian => Self::Bayesian,
            Method::Random => Self::Random,
        }
    }
}

/// Tune numbers of a graph for the largest reward, by a black-box search.
///
/// Each evaluation is one lockstep run in an inline session, one session on each core. With `--real-time` it
/// is an episode on a robot, permitted and judged by an operator, who enters the reward if there is no
/// `--reward`. `motorium run GRAPH --with OUTPUT/best.toml` runs the best. Equal seeds give equal results on
/// any number of threads; `motorium learn resume` continues.
///
/// Example: motorium learn tune graphs/quadruped-trot.toml --parameter policy.config.frequency=1:4 --reward
/// physics.base_travel_x_m --for 5s --output out/trot
#[derive(Debug, clap::Args)]
pub(super) struct Tune {
    /// The graph file
    #[arg(value_parser = graph_file(), add = complete::graphs())]
    graph: PathBuf,
    /// Key of a number, and its range; `:log` searches on a logarithmic scale; may be repeated
    #[arg(long, value_name = "KEY[,KEY]=LOW:HIGH[:log]", required = true)]
    parameter: Vec<Parameter>,
    /// Figure of the report to maximise; a weight of -1 minimises it; several are added
    #[arg(
        long,
        value_name = "[WEIGHT*]COMPONENT.FIGURE",
        required_unless_present = "real_time",
        allow_hyphen_values = true
    )]
    reward: Vec<Reward>,
    /// Condition that an evaluation must meet; `--no-expect` ignores the graph's conditions
    #[arg(long, value_name = "FIGURE CONDITION")]
    expect: Vec<Expectation>,
    /// Ignore the conditions of the graph
    #[arg(long, hide = true)]
    no_expect: bool,
    /// Duration of an evaluation [default: the graph's]
    #[arg(long = "for", value_name = "DURATION")]
    duration: Option<TimeSpan>,
    /// Search method: `cma-es`, `cross-entropy`, `snes`, `xnes`, `reps`, `path-integral`, `power`,
    /// `finite-differences`, `random` or `bayesian` (`--together 2`) [default: cma-es]
    #[arg(long, default_value = "cma-es", hide_possible_values = true, hide_default_value = true)]
    method: Method,
    /// Number of evaluations [default: 200]
    #[arg(long, default_value_t = 200, hide_default_value = true, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    evaluations: u64,
    /// Number of simultaneous evaluations of a Bayesian search
    #[arg(long, hide = true, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=256))]
    together: u16,
    /// Seed of the search; `--set seed=N` sets the graph's [default: 1]
    #[arg(long, default_value_t = 1, hide_default_value = true)]
    seed: u64,
    /// Threads; all cores if not given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=256))]
    threads: Option<u32>,
    /// One episode at a time in real time, each permitted at the terminal
    #[arg(long, conflicts_with_all = ["threads", "together"])]
    real_time: bool,
    /// With `--real-time`: run even if the budgets of the graph are not feasible
    #[arg(long, hide = true, requires = "real_time")]
    force: bool,
    /// Merge a file over the graph; may be repeated
    #[arg(long = "with", value_name = "OVERLAY.toml", add = complete::graphs())]
    with: Vec<PathBuf>,
    /// Set a value of the graph; may be repeated
    #[arg(long = "set", value_name = "COMPONENT.KEY=VALUE")]
    set: Vec<Override>,
    /// Folder of the tuning
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// The subject of a tuning in its folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Description {
    graph: PathBuf,
    with: Vec<PathBuf>,
    set: Vec<String>,
    expect: Vec<Expectation>,
    no_expect: bool,
    rewards: Vec<Reward>,
    /// How the graph runs.
    #[serde(default)]
    mode: Mode,
    /// The plan with the parameters in the middle of their ranges.
    #[serde(default)]
    plan: serde_json::Value,
}

/// The runs of a tuning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Mode {
    /// In lockstep, on all cores.
    #[default]
    Inline,
    /// In real time, one at a time, permitted by an operator; with `force` even if budgets cannot hold.
    RealTime { force: bool },
}

impl Description {
    fn rollout(&self, interrupted: Arc<AtomicBool>) -> anyhow::Result<Rollout> {
        Ok(Rollout {
            graph: self.graph.clone(),
            text: crate::input::text(&self.graph)?,
            with: self.with.clone(),
            set: self.set.iter().map(|set| set.parse()).collect::<Result<_, _>>()?,
            expect: self.expect.clone(),
            no_expect: self.no_expect,
            rewards: self.rewards.clone(),
            clock: match self.mode {
                Mode::Inline => ClockKind::Lockstep,
                Mode::RealTime { .. } => ClockKind::Realtime,
            },
            machine: Machine::detect(),
            interrupted,
        })
    }
}

/// A graph whose numbers are tuned.
struct Graph {
    rollout: Rollout,
    parameters: Vec<Parameter>,
    cores: Vec<usize>,
    /// The plan with the parameters in the middle of their ranges.
    middle: Plan,
    registry: Registry,
}

/// Returns the values of all keys of parameters.
fn keyed<'p>(parameters: &'p [Parameter], values: &[f64]) -> Vec<(&'p str, f64)> {
    let each = parameters.iter().zip(values);
    each.flat_map(|(parameter, value)| parameter.keys.iter().map(move |key| (key.as_str(), *value))).collect()
}

impl Subject for Graph {
    /// The core of the sessions.
    type Worker = usize;
    type Error = RolloutError;

    fn worker(&self, thread: usize) -> Result<Self::Worker, RolloutError> {
        Ok(self.cores[thread % self.cores.len()])
    }

    fn evaluate(&self, core: &mut usize, values: &[f64], _: u64) -> Result<Evaluation, RolloutError> {
        match self.rollout.plan(&keyed(&self.parameters, values), &self.registry) {
            Ok(plan) => self.rollout.run(plan, &self.registry, *core),
            Err(error) => Ok(Evaluation::failed(Outcome::Refused, error.render(false))),
        }
    }

    fn best(&self, values: &[f64], reward: f64) -> Result<String, RolloutError> {
        let text = overlay(&self.middle, &self.registry, &keyed(&self.parameters, values))?;
        let (graph, clock) = (self.rollout.graph.display(), self.rollout.clock_name());
        Ok(format!("# reward {reward}\n#   motorium run {graph} --with best.toml --clock {clock}\n\n{text}"))
    }
}

/// The graph in real time, with its components as processes.
struct Robot<'g>(&'g Graph);

impl Subject for Robot<'_> {
    type Worker = ();
    type Error = RolloutError;

    fn worker(&self, _: usize) -> Result<(), RolloutError> {
        Ok(())
    }

    fn evaluate(&self, (): &mut (), values: &[f64], _: u64) -> Result<Evaluation, RolloutError> {
        let Graph { rollout, parameters, registry, .. } = self.0;
        let plan = match rollout.plan(&keyed(parameters, values), registry) {
            Ok(plan) => plan,
            Err(error) => return Ok(Evaluation::failed(Outcome::Refused, error.render(false))),
        };
        let mut printer = Printer::lines(true).map_err(|error| RolloutError::Printer(error.to_string()))?;
        let result = rollout.run_in_real_time(plan, registry, &mut |event| printer.show(event));
        // the question follows the last line
        printer.finish();
        result
    }

    fn best(&self, values: &[f64], reward: f64) -> Result<String, RolloutError> {
        self.0.best(values, reward)
    }
}

/// Checks before the first episode that the graph can meet its deadlines in real time, and that an operator
/// can answer. Returns an exit code if it must not be started.
fn admit(plan: &Plan, force: bool) -> anyhow::Result<Option<ExitCode>> {
    ensure!(
        is_simulation(plan) || std::io::stdin().is_terminal(),
        "standard input is not a terminal, and the graph may move a robot: expected an operator\n\
         help: run the command in a terminal, within sight of the robot"
    );
    let known = overheads::load();
    let admission = schedule::admit(plan, &known.overheads, RtLimit::detect());
    Ok(run::refused(plan, &admission, known.origin, force))
}

impl Graph {
    /// Checks the graph with the parameters in the middle of their ranges. The inner `Err` contains the
    /// errors of the graph.
    fn check(rollout: Rollout, settings: &Settings) -> anyhow::Result<Result<Self, GraphError>> {
        let (registry, middle) = (registry(), settings.middle());
        let keyed = keyed(&settings.parameters, &middle);
        let middle = match rollout.plan(&keyed, &registry) {
            Ok(plan) => plan,
            Err(error) => return Ok(Err(error)),
        };
        ensure!(
            middle.duration_ns.is_some(),
            "the graph has no duration, expected the duration of an evaluation\nhelp: add `--for 5s`"
        );
        for figure in middle.expectations.iter().rev().take(rollout.rewards.len()) {
            let component = figure.component();
            let names: Vec<&str> =
                middle.components.iter().map(|component| component.name.as_str()).collect();
            ensure!(
                names.contains(&component),
                "the reward `{}` names component `{component}`, expected one of {}",
                figure.figure,
                names.join(", ")
            );
        }
        overlay(&middle, &registry, &keyed)?;
        let cores = allowed_cores(&rollout.machine);
        let parameters = settings.parameters.clone();
        Ok(Ok(Self { rollout, parameters, cores, middle, registry }))
    }
}

/// Prints the mistakes of a graph.
pub(super) fn refuse(error: &GraphError) -> ExitCode {
    errln!("{}", error.render(std::io::stderr().is_terminal()));
    Failure::of_graph(error.reports()).print_json()
}

impl Tune {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        check_folder(&self.output)?;
        let mut set: Vec<String> = self.set.iter().map(Override::to_string).collect();
        set.extend(self.duration.map(|duration| format!("duration=\"{duration}\"")));
        let absolute = |path: &PathBuf| std::path::absolute(path).with_context(|| path.display().to_string());
        let mut description = Description {
            graph: absolute(&self.graph)?,
            with: self.with.iter().map(absolute).collect::<Result<_, _>>()?,
            set,
            expect: self.expect,
            no_expect: self.no_expect,
            rewards: self.reward,
            mode: if self.real_time { Mode::RealTime { force: self.force } } else { Mode::Inline },
            plan: serde_json::Value::Null,
        };
        let settings = Settings {
            parameters: self.parameter,
            method: self.method.into(),
            seed: self.seed,
            evaluations: self.evaluations,
            together: usize::from(self.together),
        };
        let graph = match Graph::check(description.rollout(interrupted()?)?, &settings)? {
            Ok(graph) => graph,
            Err(error) => return Ok(refuse(&error)),
        };
        if let Mode::RealTime { force } = description.mode
            && let Some(code) = admit(&graph.middle, force)?
        {
            return Ok(code);
        }
        description.plan = serde_json::to_value(&graph.middle)?;
        let tuning = Tuning::create(&self.output, settings, serde_json::to_value(&description)?)?;
        finish(tuning, &graph, &self.output, (self.threads, self.json))
    }
}

/// Continues the tuning in a folder.
pub(super) fn resume(folder: &Path, threads: Option<u32>, json: bool) -> anyhow::Result<ExitCode> {
    let (tuning, description) = Tuning::resume(folder)?;
    let description: Description = serde_json::from_value(description)
        .with_context(|| format!("{}: the description of the graph", folder.display()))?;
    let graph = match Graph::check(description.rollout(interrupted()?)?, tuning.settings())? {
        Ok(graph) => graph,
        Err(error) => return Ok(refuse(&error)),
    };
    ensure!(
        serde_json::to_value(&graph.middle)? == description.plan,
        "{} or a file over it has changed since the tuning began, expected the same graph\n\
         help: restore it, or tune it in another folder",
        description.graph.display()
    );
    if let Mode::RealTime { force } = description.mode {
        ensure!(
            threads.is_none(),
            "--threads: {} is a tuning in real time, which runs one episode at a time",
            folder.display()
        );
        if let Some(code) = admit(&graph.middle, force)? {
            return Ok(code);
        }
    }
    errln!("resumed after {} evaluations", tuning.evaluations());
    finish(tuning, &graph, folder, (threads, json))
}

/// Evaluates to the end, or until the operator stops.
fn finish(
    mut tuning: Tuning,
    graph: &Graph,
    folder: &Path,
    (given, json): (Option<u32>, bool),
) -> anyhow::Result<ExitCode> {
    let (first, began) = (tuning.evaluations(), Instant::now());
    let interrupted = &graph.rollout.interrupted;
    let result = match graph.rollout.clock {
        ClockKind::Lockstep => run_inline(&mut tuning, graph, threads(given)),
        ClockKind::Realtime => {
            let parameters = tuning.settings().parameters.clone();
            let mut operator = Terminal::new(&graph.middle, &parameters, interrupted.clone());
            tuning.attend(&Robot(graph), &mut operator, |_| {})
        }
    };
    let is_interrupted = match &result {
        Ok(Attendance::Stopped) => interrupted.load(Relaxed),
        Err(error) => matches!(error, TuningError::Subject(RolloutError::Interrupted)),
        Ok(Attendance::Finished) => false,
    };
    let resume = format!("`motorium learn resume {}`", folder.display());
    if is_interrupted {
        bail!(
            "interrupted after {} of {} evaluations\nhelp: continue with {resume}",
            tuning.evaluations(),
            tuning.settings().evaluations
        );
    }
    let ended = result?;
    let seconds = began.elapsed().as_secs_f64();
    let summary = tuning.summary()?;
    if ended == Attendance::Stopped {
        let all = tuning.settings().evaluations;
        errln!("stopped after {} of {all} evaluations; continue with {resume}", summary.evaluations);
    } else {
        ensure!(
            summary.best.is_some(),
            "none of {} evaluations has a reward: {} has the reasons",
            summary.evaluations,
            folder.join("evaluations.csv").display()
        );
    }
    let rate = (summary.evaluations - first) as f64 / seconds;
    if json {
        let table = folder.join("evaluations.csv");
        outln!("{}", to_json(&tuning, &summary, (seconds, rate), &table));
    } else {
        print(&tuning, &summary, (seconds, rate), graph);
    }
    Ok(ExitCode::SUCCESS)
}

/// Evaluates in inline sessions, with a line of progress a second on standard error.
fn run_inline(
    tuning: &mut Tuning,
    graph: &Graph,
    threads: usize,
) -> Result<Attendance, TuningError<RolloutError>> {
    let (first, began) = (tuning.evaluations(), Instant::now());
    let mut printed = began;
    tuning.run(graph, threads, |progress| {
        if printed.elapsed() >= INTERVAL && progress.evaluation < progress.evaluations {
            printed = Instant::now();
            let rate = (progress.evaluation - first) as f64 / began.elapsed().as_secs_f64();
            let left = (progress.evaluations - progress.evaluation) as f64 / rate;
            errln!("{}, {left:.0} s left", line(&progress));
        }
    })?;
    Ok(Attendance::Finished)
}

/// Returns the result as JSON. `reward`, `parameters` and `overlay` are `null` without a reward so far.
fn to_json(
    tuning: &Tuning,
    summary: &Summary,
    (seconds, rate): (f64, f64),
    table: &Path,
) -> serde_json::Value {
    let parameters = summary.best.as_ref().map(|(values, _)| {
        let pairs = tuning.settings().parameters.iter().zip(values);
        let pairs = pairs.map(|(parameter, value)| (parameter.name(), json!(value)));
        pairs.collect::<serde_json::Map<String, serde_json::Value>>()
    });
    json!({
        "evaluations": summary.evaluations,
        "outcomes": summary.outcomes,
        "reward": summary.best.as_ref().map(|(_, reward)| reward),
        "parameters": parameters,
        "overlay": summary.best.as_ref().map(|_| tuning.best_file().display().to_string()),
        "table": table.display().to_string(),
        "table_sha256": summary.table_sha256,
        "seconds": seconds,
        "evaluations_per_second": rate,
    })
}

/// Prints the result.
fn print(tuning: &Tuning, summary: &Summary, (seconds, rate): (f64, f64), graph: &Graph) {
    let Summary { evaluations, outcomes, best, table_sha256 } = summary;
    let reward =
        best.as_ref().map_or_else(|| "no reward".to_owned(), |(_, best)| format!("reward {best:.6}"));
    outln!("{reward} after {evaluations} evaluations in {seconds:.1} s, {rate:.1} a second");
    for (outcome, count) in outcomes.iter().filter(|(outcome, _)| **outcome != Outcome::Finished) {
        outln!("{count} {}", outcome.name());
    }
    let Some((values, _)) = best else { return };
    for (parameter, value) in tuning.settings().parameters.iter().zip(values) {
        outln!("{} = {value}", parameter.name());
    }
    outln!("table {table_sha256}");
    outln!("motorium run {} --with {}", graph.rollout.graph.display(), tuning.best_file().display());
}

fn line(progress: &Progress<'_>) -> String {
    let Progress { evaluation, evaluations, result, best, .. } = progress;
    let found = match &result.reason {
        None => format!("reward {:.4}", result.reward),
        Some(_) => result.outcome.name().to_owned(),
    };
    let best = best.map_or_else(|| "no reward yet".to_owned(), |best| format!("best {best:.4}"));
    format!("{evaluation:>5} of {evaluations}: {found}, {best}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trot of 0.3 s at two parameters.
    fn graph(expect: &str) -> (Graph, Settings) {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/quadruped-trot.toml");
        let description = Description {
            graph: file,
            with: vec![],
            set: vec!["duration=\"300 ms\"".into()],
            expect: vec![expect.parse().expect("an expectation")],
            no_expect: false,
            rewards: vec!["physics.base_travel_x_m".parse().expect("a reward")],
            mode: Mode::Inline,
            plan: serde_json::Value::Null,
        };
        let parameters = [
            "policy.config.frequency=1:4",
            "policy.config.legs.0.joints.0.amplitude,policy.config.legs.3.joints.0.amplitude=0.05:0.3",
        ];
        let parameters = parameters.map(|text| text.parse().expect("a parameter")).into();
        let method = tuning::Method::Bayesian;
        let settings = Settings { parameters, method, seed: 2, evaluations: 7, together: 2 };
        let checked =
            Graph::check(description.rollout(Arc::default()).expect("a graph"), &settings).expect("a plan");
        (checked.unwrap_or_else(|error| panic!("{}", error.render(false))), settings)
    }

    #[test]
    fn tuning_repeats_and_its_overlay_has_the_reward() {
        let (graph, settings) = graph("physics.base_height_lowest_m > 0.12");
        let tables = [1, 2].map(|threads| {
            let folder = tempfile::tempdir().expect("a folder");
            let mut tuning = Tuning::create(folder.path(), settings.clone(), json!(null)).expect("a tuning");
            tuning.run(&graph, threads, |_| {}).expect("rewards");
            let text = std::fs::read_to_string(tuning.best_file()).expect("an overlay");
            (tuning.summary().expect("a table"), text)
        });
        assert_eq!(tables[0], tables[1]);
        let [(summary, text), _] = tables;
        assert_eq!(summary.outcomes, [(Outcome::Finished, 7)].into());
        // the overlay over the graph has the reward of the best evaluation to the bit
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("best.toml");
        std::fs::write(&file, text).expect("a file");
        let rollout = Rollout { with: vec![file], ..graph.rollout };
        let registry = registry();
        let plan = rollout.plan(&[], &registry).expect("a plan");
        let found = rollout.run(plan, &registry, graph.cores[0]).expect("a run");
        assert_eq!(Some(found.reward), summary.best.map(|(_, reward)| reward));
    }

    #[test]
    fn failed_rollouts_have_an_outcome_and_a_reason() {
        let (graph, _) = graph("physics.base_height_lowest_m > 9");
        let mut worker = graph.worker(0).expect("a worker");
        let mut outcome = |values: &[f64]| {
            let found = graph.evaluate(&mut worker, values, 0).expect("an evaluation");
            assert!(found.reward.is_nan());
            (found.outcome, found.reason.expect("a reason"))
        };
        let (unmet, reason) = outcome(&[2.0, 0.2]);
        assert_eq!(unmet, Outcome::Unmet);
        assert!(reason.starts_with("expected `physics.base_height_lowest_m` > 9, found 0."), "{reason}");
        let (refused, reason) = outcome(&[25.0, 0.2]);
        assert_eq!(refused, Outcome::Refused);
        assert!(reason.contains("expected 0 to 20"), "{reason}");
    }
}
