//! `motorium calibrate`: measures the overheads of a machine and the times of a graph's components, and
//! proposes budgets.

mod budgets;
mod machine;

use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use motorium::graph::Override;
use motorium::launcher::{Exit, Options, Report};
use motorium::os::IdleLimit;
use motorium::plan::{ClockKind, Plan};
use motorium::schedule::{Admission, Overheads, RtLimit, admit};
use motorium::session;
use motorium::units::TimeSpan;
use serde::Serialize;

use self::budgets::{Cover, Proposal};
use super::check;
use super::loading::GraphArgs;
use crate::failure::{Failure, Kind};
use crate::out::{err, errln, out, outln};
use crate::runs::event_line;
use crate::{overheads, registry, style};

/// Measure this machine and the components of a graph, and propose budgets.
///
/// Runs the graph in real time, even if its budgets are not feasible. Stop other work first: disturbances
/// count as overhead of the machine.
///
/// Example: motorium calibrate graphs/panda-reach.toml --for 30s --save
#[derive(Debug, clap::Args)]
pub(crate) struct Calibrate {
    #[command(flatten)]
    graph: GraphArgs,
    /// Duration of the run
    #[arg(long = "for", value_name = "DURATION", default_value = "10 s", allow_hyphen_values = true)]
    duration: TimeSpan,
    /// Execution time that a budget covers
    #[arg(long, value_enum, default_value = "p999")]
    cover: Cover,
    /// Margin added to this execution time, as a fraction of it
    #[arg(long, default_value_t = 0.5, value_parser = budgets::parse_margin)]
    margin: f64,
    /// Save the overheads of the machine: `check` and `run` on this machine use them from then on
    #[arg(long)]
    save: bool,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
}

/// Measured times, and the budgets derived from them.
#[derive(Debug, Serialize)]
struct Answer {
    machine: overheads::Machine,
    /// Overheads of the machine, as used by the admission check.
    overheads: Overheads,
    /// Steps and proposed budget of each component.
    components: Vec<Proposal>,
    /// Admission check with the proposed budgets.
    admission: Admission,
}

impl Calibrate {
    pub(crate) fn run(mut self) -> anyhow::Result<ExitCode> {
        let duration = self.duration.to_string();
        for (path, value) in [("clock", "realtime"), ("duration", duration.as_str())] {
            self.graph.set.push(Override { path: path.to_string(), value: format!("{value:?}") });
        }
        let registry = registry::registry();
        let checked = match self.graph.load(&registry) {
            Ok(checked) => checked,
            Err(code) => return Ok(code),
        };
        debug_assert_eq!(checked.plan.clock, ClockKind::Realtime);
        let program = std::env::current_exe().context("finding this program's own file")?;
        self.progress("measuring how this machine wakes threads and hands over ...");
        // Same lock as in a running graph: if it is denied there, it is denied here.
        let idle_limit = IdleLimit::hold(Duration::from_nanos(checked.plan.scheduling.idle_exit_ns));
        let floor = machine::measure(&program, &registry::with_hidden(), Duration::from_secs(2))?;
        drop(idle_limit);
        self.progress(&format!("running the graph for {duration} ..."));
        let options = Options::processes(program);
        let quiet = self.json;
        let report = session::run(checked.plan.clone(), &registry, &options, &mut |event| {
            if let (false, Some(line)) = (quiet, event_line(&event)) {
                errln!("{line}");
            }
        })?;
        if let Exit::SafeStop { reason } = &report.exit {
            return Ok(Failure::new(Kind::SafeStop, format!("safe stop: {reason}")).report());
        }
        let answer = self.conclude(checked.plan, &report, &floor);
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&answer)?);
        } else {
            print(&answer, &report);
        }
        if self.save {
            let path = overheads::save(answer.overheads)?;
            self.progress(&format!(
                "saved in {}: `motorium check` and `motorium run` now use these overheads",
                path.display()
            ));
        }
        Ok(ExitCode::SUCCESS)
    }

    fn conclude(&self, mut plan: Plan, report: &Report, floor: &machine::Floor) -> Answer {
        let overheads = floor.overheads(&plan, report);
        let components = budgets::propose(&plan, report, self.cover, self.margin);
        for (component, proposal) in plan.components.iter_mut().zip(&components) {
            component.budget_ns = Some(proposal.budget_ns);
        }
        let admission = admit(&plan, &overheads, RtLimit::detect());
        Answer { machine: overheads::Machine::this(), overheads, components, admission }
    }

    fn progress(&self, text: &str) {
        if !self.json {
            errln!("{}", style::dim(text.to_string()));
        }
    }
}

fn print(answer: &Answer, report: &Report) {
    let time = |ns: u64| TimeSpan { ns };
    let overheads = &answer.overheads;
    outln!("\nthis machine: {}, {} cores", answer.machine.processor, answer.machine.cores);
    outln!("  late wake-up              {}", time(overheads.wake_ns));
    outln!("  hand-over on a core       {}", time(overheads.hop_same_core_ns));
    outln!("  hand-over to another core {}", time(overheads.hop_cross_core_ns));
    outln!("  worker, per step          {}", time(overheads.worker_ns));
    outln!("  release by the clock      {}", time(overheads.timer_ns));
    out!("\n{}", budgets::describe(&answer.components, report));
    out!("{}", check::describe_admission(&answer.admission, "as measured just now"));
    err!("{}", check::problems(&answer.admission));
}
