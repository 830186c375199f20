//! `motorium run`: launches a graph.

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium::graph::Override;
use motorium::launcher::{Event, Exit, Hosting, Options, Report};
use motorium::os::machine::online_cores;
use motorium::plan::{ClockKind, Expectation, Plan};
use motorium::schedule::{self, Admission, RtLimit};
use motorium::session::{Session, SessionError};
use motorium::units::TimeSpan;
use motorium::worker::Registry;

use super::check::problems;
use super::loading::GraphArgs;
use super::recording::Overlay;
use crate::exit::Code;
use crate::failure::{Failure, Kind};
use crate::metrics::{Address, Server};
use crate::out::{err, errln, out, outln};
use crate::printer::Printer;
use crate::screen::is_drawable;
use crate::trace::Tracing;
use crate::{overheads, registry, report, runs, style};

/// Launch a graph: every component as its own process.
///
/// Example: motorium run graphs/panda-reach.toml --for 10s --clock lockstep
#[derive(Debug, Default, clap::Args)]
pub(crate) struct Run {
    #[command(flatten)]
    graph: GraphArgs,
    /// Name of the run, instead of the graph's name; `--run` accepts it
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Duration of the run, such as `10s` [default: the graph's, or until Ctrl-C]
    #[arg(long = "for", value_name = "DURATION", allow_hyphen_values = true)]
    duration: Option<TimeSpan>,
    /// The clock, `realtime` or `lockstep` [default: the graph's]
    #[arg(long, value_enum, hide_possible_values = true)]
    clock: Option<Clock>,
    /// Hosting of the components: in `processes`, `threads`, or `inline` in one thread; `--core N` selects
    /// their core in lockstep
    #[arg(long, value_enum, default_value_t, hide_possible_values = true, hide_default_value = true)]
    hosting: HostingChoice,
    /// The same as `--hosting threads`
    #[arg(long, conflicts_with = "hosting", hide = true)]
    in_process: bool,
    /// Core of the whole run, in lockstep [default: the graph's]
    #[arg(long, hide = true)]
    core: Option<usize>,
    /// Number of episodes; in lockstep, each starts with a reset of all components
    #[arg(long, value_name = "N")]
    episodes: Option<u64>,
    /// Give each episode a separate seed: the graph's plus the episode number
    #[arg(long, requires = "episodes")]
    vary_seed: bool,
    /// Simulated time per real time [default: as fast as the machine allows]
    #[arg(long, value_name = "FACTOR", value_parser = pace)]
    pace: Option<f64>,
    /// Pause simulated time at the start, until `motorium step`
    #[arg(long)]
    paused: bool,
    /// Condition on a figure of the report, such as `controller.goals_missed == 0`; may be repeated
    #[arg(long, value_name = "FIGURE CONDITION")]
    expect: Vec<Expectation>,
    /// Ignore the expectations of the graph
    #[arg(long, conflicts_with = "expect", hide = true)]
    no_expect: bool,
    /// Run even if the budgets of the graph are not feasible, alone or together with other live runs
    #[arg(long)]
    force: bool,
    /// Record every sample into an MCAP file
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// With `--record`: replace the file if it exists
    #[arg(long, requires = "record")]
    overwrite: bool,
    /// With `--record`: keep only the last moments, such as `30s`, and write them only if the run ends badly
    #[arg(long, value_name = "TIME", requires = "record", allow_hyphen_values = true)]
    record_last: Option<TimeSpan>,
    /// Print the report as JSON on standard output
    #[arg(long)]
    json: bool,
    /// Serve Prometheus metrics, on a port of this machine (`9464`) or an address (`0.0.0.0:9464`)
    #[arg(long, value_name = "ADDR")]
    metrics: Option<Address>,
    /// The file of a trace of every step, as `motorium trace` writes it.
    #[arg(skip)]
    trace: Option<PathBuf>,
}

fn pace(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(factor) if factor.is_finite() && factor > 0.0 => Ok(factor),
        _ => {
            Err("expected a number above 0: the seconds of simulated time per second of real time"
                .to_string())
        }
    }
}

/// Returns the components that missed goals without an expectation in the graph, with their numbers.
fn unexpected_misses(report: &Report) -> Vec<(&str, u64)> {
    let missed = report.results.iter().filter_map(|(component, result)| {
        let missed = result.get("goals_missed")?.as_u64().filter(|missed| *missed > 0)?;
        let figure = format!("{component}.goals_missed");
        let is_judged = report.expectations.iter().any(|expectation| expectation.figure == figure);
        (!is_judged).then_some((component.as_str(), missed))
    });
    missed.collect()
}

/// Trace of a run for `motorium trace`.
pub(super) struct Traced {
    pub(super) graph: GraphArgs,
    pub(super) duration: Option<TimeSpan>,
    pub(super) clock: Option<Clock>,
    pub(super) force: bool,
    pub(super) json: bool,
    pub(super) output: PathBuf,
}

/// Run of a graph written by another command.
pub(super) struct Generated {
    pub(super) graph: PathBuf,
    pub(super) clock: Option<Clock>,
    pub(super) record: Option<PathBuf>,
    pub(super) overwrite: bool,
    pub(super) json: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub(super) enum Clock {
    /// The machine's clock, absolute deadlines
    Realtime,
    /// Simulated time, deterministic, as fast as the machine allows
    Lockstep,
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum HostingChoice {
    /// Each component in a separate process
    #[default]
    Processes,
    /// Each component in a thread of this process
    Threads,
    /// All components in one thread, one after the other; in lockstep
    Inline,
}

impl Run {
    /// Creates a run that writes a trace.
    pub(super) fn traced(trace: Traced) -> Self {
        let Traced { graph, duration, clock, force, json, output } = trace;
        // A traced run is examined for its timing, not for its goals.
        Self { graph, duration, clock, force, json, no_expect: true, trace: Some(output), ..Self::default() }
    }

    /// Creates a run of a graph written by another command.
    pub(super) fn generated(generated: Generated) -> Self {
        let Generated { graph, clock, record, overwrite, json } = generated;
        let graph = GraphArgs { graph, ..GraphArgs::default() };
        Self { graph, clock, record, overwrite, json, ..Self::default() }
    }

    pub(crate) fn run(mut self) -> anyhow::Result<ExitCode> {
        let mut set = |path: &str, value: String| {
            self.graph.set.push(Override { path: path.to_string(), value });
        };
        if let Some(name) = &self.name {
            set("name", format!("{name:?}"));
        }
        if let Some(duration) = &self.duration {
            set("duration", format!("\"{duration}\""));
        }
        match self.clock {
            Some(Clock::Realtime) => set("clock", "\"realtime\"".to_string()),
            Some(Clock::Lockstep) => set("clock", "\"lockstep\"".to_string()),
            None => {}
        }
        if let Some(episodes) = self.episodes {
            set("episodes.count", episodes.to_string());
            set("episodes.vary_seed", self.vary_seed.to_string());
        }
        for expectation in &self.expect {
            set(&format!("expect.{}", expectation.figure), format!("{:?}", expectation.condition()));
        }
        let overwrite = self.overwrite;
        let recording =
            self.record.as_ref().map(|output| Overlay::recording(output, self.record_last, overwrite));
        let recording = recording.transpose()?;
        self.graph.with.extend(recording.iter().map(|overlay| overlay.path().to_path_buf()));
        let registry = registry::registry();
        let checked = match self.graph.load(&registry) {
            Ok(checked) => checked,
            Err(code) => return Ok(code),
        };
        if let Some(code) = self.wrong_core(&checked.plan) {
            return Ok(code);
        }
        let known = overheads::load();
        let admission = schedule::admit(&checked.plan, &known.overheads, RtLimit::detect());
        if let Some(code) = refused(&checked.plan, &admission, known.origin, self.force) {
            return Ok(code);
        }
        let mut metrics = self.metrics.map(Server::bind).transpose()?;
        if let Some(server) = &metrics {
            errln!("metrics at {}", server.url());
        }
        let mut serve = |event: &Event<'_>| {
            if let Event::Created { run, plan } = event
                && let Some(server) = metrics.take()
                && let Err(error) = server.serve_created(run, plan)
            {
                errln!("{} metrics are not served: {error:#}", style::warning("warning:"));
            }
        };
        let options = self.options()?;
        let mut plan = checked.plan;
        if self.no_expect {
            plan.expectations.clear();
        }
        let tracing =
            self.trace.as_deref().map(|file| Tracing::new(file, &mut plan, &admission)).transpose()?;
        let lockstep = plan.clock == ClockKind::Lockstep;
        let terminal = std::io::stdout().is_terminal() && std::io::stderr().is_terminal();
        let live = !self.json && !lockstep && terminal && is_drawable();
        // a terminal that claims to support drawing but does not answer receives plain lines
        let mut printer = match live.then(|| Printer::screen(&plan)) {
            Some(Ok(screen)) => screen,
            Some(Err(_)) | None => Printer::lines(self.json)?,
        };
        let ran = self.drive(plan, &registry, &options, &mut |event| {
            serve(&event);
            if let (Event::Created { run, .. }, Some(tracing)) = (&event, &tracing) {
                tracing.follow(run);
            }
            printer.show(&event);
        });
        // Errors are printed after the last lines.
        printer.finish();
        let report = ran?;
        if let Some(tracing) = tracing {
            tracing.finish(&report)?;
        }
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            out!("{}", report::summary(&report));
        }
        let unmet: Vec<_> = report.expectations.iter().filter(|expectation| !expectation.met).collect();
        for expectation in &unmet {
            errln!("{}: {expectation}", style::error("error"));
        }
        for (component, missed) in unexpected_misses(&report) {
            errln!(
                "{} `{component}` missed {missed} of its goals; `--expect \"{component}.goals_missed == 0\"` \
                 changes the exit code to {}",
                style::warning("warning:"),
                Code::Unmet as u8
            );
        }
        if let Exit::SafeStop { reason } = &report.exit {
            errln!("{}: safe stop: {reason}", style::error("error"));
        }
        Ok(Code::of_run(&report).into())
    }

    /// Launches a plan and runs it to its end.
    fn drive(
        &self,
        plan: Plan,
        registry: &Registry,
        options: &Options,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Result<Report, SessionError> {
        let mut session = Session::observed(plan, registry, options, observe)?;
        if self.pace.is_some() {
            session.pace(self.pace)?;
        }
        if self.paused {
            session.pause(true)?;
        }
        session.run()?;
        Ok(session.stop())
    }

    fn options(&self) -> anyhow::Result<Options> {
        let program = std::env::current_exe().context("finding this program's own file")?;
        let hosting = match self.hosting {
            HostingChoice::Processes if !self.in_process => Hosting::Processes,
            HostingChoice::Processes | HostingChoice::Threads => Hosting::Threads,
            HostingChoice::Inline => Hosting::Inline,
        };
        Ok(Options { hosting, core: self.core, ..Options::processes(program) })
    }

    /// Returns an exit code if `--core` names a missing core, or the graph runs in real time, where the graph
    /// file sets the cores.
    fn wrong_core(&self, plan: &Plan) -> Option<ExitCode> {
        let core = self.core?;
        let cores = online_cores();
        let (found, help) = if plan.clock == ClockKind::Realtime {
            let reason =
                format!("`--core {core}` is for `--clock lockstep`, and this graph runs in real time");
            (reason, "to choose the core of a component, set its key `core`".to_string())
        } else if cores.contains(&core) {
            return None;
        } else {
            let known: Vec<String> = cores.iter().map(usize::to_string).collect();
            (
                format!("`--core {core}` is not a core of this machine"),
                format!("its cores: {}", known.join(", ")),
            )
        };
        Some(Failure::new(Kind::Usage, format!("{found}; {help}")).help(&help).report())
    }
}

/// Checks whether a graph in real time can meet its deadlines, alone and next to the running graphs. Prints
/// the problems, and returns an exit code if it must not be started. `origin` describes the overheads.
pub(super) fn refused(plan: &Plan, admission: &Admission, origin: &str, force: bool) -> Option<ExitCode> {
    if plan.clock != ClockKind::Realtime {
        return None;
    }
    if admission.refuses() {
        err!("{}", problems(admission));
        if !force {
            errln!("{}", style::dim(format!("overheads of the machine: {origin}")));
            errln!("not started; use `--force` to start it anyway");
            let problem = admission.refusals().next().map(|refusal| refusal.message.clone());
            let reason = problem.unwrap_or_else(|| "the graph cannot meet its deadlines".to_string());
            return Some(Failure::new(Kind::Invalid, reason).help("`--force` runs it anyway").print_json());
        }
        errln!("started anyway (`--force`)");
    }
    refused_beside_others(plan, force)
}

/// Checks whether a graph in real time can meet its deadlines next to the running graphs.
fn refused_beside_others(plan: &Plan, force: bool) -> Option<ExitCode> {
    let others = runs::living();
    let others: Vec<_> = others.into_iter().filter(|(_, other)| other.clock == ClockKind::Realtime).collect();
    if others.is_empty() {
        return None;
    }
    let together = schedule::beside(plan, &others);
    let admission = schedule::admit(&together, &overheads::load().overheads, RtLimit::detect());
    if !admission.refuses() {
        return None;
    }
    err!("{}", problems(&admission));
    let names: Vec<String> = others.iter().map(|(run, _)| format!("`{run}`")).collect();
    errln!("the graph cannot meet its deadlines next to the running graphs: {}", names.join(", "));
    if force {
        errln!("started anyway (`--force`)");
        return None;
    }
    errln!("not started; stop the other runs, give the graph separate cores, or use `--force`");
    let reason = format!("the graph cannot meet its deadlines next to {}", names.join(", "));
    Some(Failure::new(Kind::Failed, reason).help("stop the other runs, or use `--force`").print_json())
}
