//! `motorium kill`: ends the process of one component, to test the reaction of the run.

use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use anyhow::Context as _;
use motorium::nearest::suggest;
use motorium::os::Watch;
use rustix::process::Signal;
use serde_json::json;

use crate::out::outln;
use crate::runs::RunArg;
use crate::style;

/// Time limit for a process to end.
const END_WITHIN: Duration = Duration::from_secs(5);

/// Kill, end or stop the process of one component of a run.
///
/// Use this command to test the reaction of the run: `on_failure` and `restart` decide whether the component
/// is restarted or the graph stops. `motorium events` lists the consequences.
///
/// Example: motorium kill panda-reach controller
#[derive(Debug, clap::Args)]
pub(crate) struct Kill {
    /// The run: its id, a prefix of the id, or the name of its graph
    #[arg(value_name = "RUN", add = crate::complete::runs())]
    run: String,
    /// The component
    #[arg(value_name = "COMPONENT", add = crate::complete::components())]
    component: String,
    /// Signal to send: SIGKILL, SIGTERM (the component ends in good order), SIGSTOP or SIGCONT
    #[arg(long, value_enum, default_value_t = Choice::Kill)]
    signal: Choice,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Choice {
    Kill,
    Terminate,
    Stop,
    Continue,
}

impl Choice {
    fn signal(self) -> Signal {
        match self {
            Self::Kill => Signal::KILL,
            Self::Terminate => Signal::TERM,
            Self::Stop => Signal::STOP,
            Self::Continue => Signal::CONT,
        }
    }
}

impl Kill {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let run = RunArg::named(Some(&self.run)).open()?;
        let (graph, name) = (&run.plan.name, &self.component);
        let names = || run.plan.components.iter().map(|component| component.name.as_str());
        let index = names().position(|known| known == name).with_context(|| {
            format!("graph `{graph}` has no component `{name}`; {}", suggest(name, names(), "it has"))
        })?;
        let pid = run.region.components()[index].pid.load(Relaxed);
        anyhow::ensure!(
            pid != run.region.header().launcher.load(Relaxed),
            "`{name}` is a thread of the launcher, which would end with it; `motorium stop` ends the run, and with \
             `--hosting processes` each component has a separate process"
        );
        let process = Watch::new(pid).with_context(|| format!("`{name}` has no living process"))?;
        process.signal(self.signal.signal());
        if matches!(self.signal, Choice::Kill | Choice::Terminate) {
            anyhow::ensure!(
                process.wait(Some(END_WITHIN)),
                "process {pid} of `{name}` did not end within {} s; use `--signal kill`",
                END_WITHIN.as_secs()
            );
        }
        if self.json {
            outln!("{}", json!({ "run": run.folder.id(), "component": name, "pid": pid }));
            return Ok(ExitCode::SUCCESS);
        }
        let done = match self.signal {
            Choice::Kill => "killed",
            Choice::Terminate => "ended",
            Choice::Stop => "stopped",
            Choice::Continue => "continued",
        };
        outln!("{} of run {}: process {pid} {done}", style::strong(name), run.folder.id());
        Ok(ExitCode::SUCCESS)
    }
}
