//! `motorium replay`: a recorded run once more.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium::launcher::{Event, Exit, Hosting, Options};
use motorium::plan::{ClockKind, Plan};
use motorium::session::Session;
use motorium_bridges::recording::{Recording, Verification, replaced, verify};

use crate::out::{errln, out, outln};
use crate::printer::Printer;
use crate::{exit, registry, report, style};

/// Publish a recording once more, or run its graph again and compare every sample.
///
/// Each component publishes what the recording has of it, at the times of the recording; those that `--live` names run
/// themselves, on what the others have published. Topics can be looked at as in any run.
///
/// `--verify` runs the graph of a recording in lockstep again, from its seed, and compares all that it publishes to the last
/// bit: the exit code is 1 at a difference, which is printed with its topic, time and field.
///
/// Example: motorium replay out/a.mcap --verify
#[derive(Debug, clap::Args)]
pub(crate) struct Replay {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Run the graph again and compare
    #[arg(long, conflicts_with_all = ["live", "speed", "paused"])]
    verify: bool,
    /// With `--verify`: a component whose recording takes its place; may be repeated
    #[arg(long, value_name = "COMPONENT", requires = "verify")]
    replace: Vec<String>,
    /// A component that runs itself; may be repeated. None if not given: all is replayed
    #[arg(long, value_name = "COMPONENT")]
    live: Vec<String>,
    /// Recorded time per real time; `0` for as fast as the machine allows
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    speed: f64,
    /// Hold time at the start, until `motorium step`
    #[arg(long)]
    paused: bool,
    /// Print the report as JSON on standard output
    #[arg(long)]
    json: bool,
}

impl Replay {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let recording = Recording::open(&self.file)?;
        if !recording.is_whole() {
            errln!(
                "{} {} has no end: what there is of it is replayed",
                style::warning("warning:"),
                self.file.display()
            );
        }
        if self.verify { self.verify(&recording) } else { self.publish(&recording) }
    }

    fn verify(&self, recording: &Recording) -> anyhow::Result<ExitCode> {
        let Verification { samples, time, difference } =
            verify(recording, &registry::with_hidden(), &self.options(recording.plan()?)?, &self.replace)?;
        let file = self.file.display();
        if self.json {
            let difference = difference.as_ref().map(ToString::to_string);
            let time_s = time.as_secs_f64();
            outln!(
                "{}",
                serde_json::json!({ "samples": samples, "time_s": time_s, "difference": difference })
            );
        } else if difference.is_none() {
            outln!("{file}: {samples} samples in {:.3} s are equal to the last bit", time.as_secs_f64());
        }
        if let Some(difference) = difference {
            errln!("{}: {file} differs after {samples} equal samples: {difference}", style::error("error"));
            return Ok(exit::FAILED);
        }
        Ok(ExitCode::SUCCESS)
    }

    fn publish(&self, recording: &Recording) -> anyhow::Result<ExitCode> {
        anyhow::ensure!(self.speed.is_finite() && self.speed >= 0.0, "`--speed` is 0 or above");
        let plan = recording.plan()?;
        let live = |name: &str| self.live.iter().any(|live| live == name);
        for name in &self.live {
            anyhow::ensure!(
                plan.components.iter().any(|component| component.name == *name),
                "the recorded graph has no component `{name}`, but {}",
                plan.components
                    .iter()
                    .map(|component| component.name.as_str())
                    .collect::<Vec<_>>()
                    .join(", ")
            );
        }
        let names = plan.components.iter().map(|component| component.name.clone());
        let names: Vec<String> = names.filter(|name| !live(name)).collect();
        let mut plan = replaced(recording, &names)?;
        (plan.clock, plan.episodes, plan.expectations) = (ClockKind::Lockstep, None, Vec::new());
        let mut options = self.options(plan.clone())?;
        options.stand_in = motorium_bridges::recording::loggers(&plan);
        let mut printer = Printer::plain(self.json)?;
        let mut observe = |event: Event<'_>| printer.show(&event);
        let mut session = Session::observed(plan, &registry::with_hidden(), &options, &mut observe)?;
        if self.speed > 0.0 {
            session.pace(Some(self.speed))?;
        }
        if self.paused {
            session.pause(true)?;
        }
        session.run()?;
        let ended = session.stop();
        printer.finish();
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&ended)?);
        } else {
            out!("{}", report::summary(&ended));
        }
        Ok(match &ended.exit {
            Exit::Finished | Exit::Interrupted => ExitCode::SUCCESS,
            Exit::SafeStop { reason } => {
                errln!("{}: safe stop: {reason}", style::error("error"));
                exit::safe_stop()
            }
        })
    }

    /// One thread for all, unless a component has a program of its own.
    fn options(&self, plan: Plan) -> anyhow::Result<Options> {
        use motorium::plan::Program;
        let builtin = |program: &Program| matches!(program, Program::Builtin { .. });
        if plan.components.iter().all(|component| builtin(&component.program)) {
            return Ok(Options::inline());
        }
        Ok(Options { hosting: Hosting::Processes, ..Options::processes(std::env::current_exe()?) })
    }
}
