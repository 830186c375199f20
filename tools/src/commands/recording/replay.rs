//! `motorium replay`: replays a recorded run.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use motorium::launcher::{Event, Exit, Hosting, Options};
use motorium::plan::{ClockKind, Plan, Program};
use motorium::session::Session;
use motorium::units::TimeSpan;
use motorium_bridges::recording::{Recording, Verification, ease_in, loggers, replaced, replayed, verify};

use crate::out::{errln, out, outln};
use crate::printer::Printer;
use crate::{exit, registry, report, style};

/// Replay a recording, or run its graph again and compare every sample.
///
/// Each component publishes its recorded samples at the recorded times, except components of `--live`,
/// which run. Episodes follow in the recorded order.
///
/// A live robot that follows recorded joint commands approaches the first command within half of its joint
/// limits, and comes to rest after the last. Then it enters its safe state.
///
/// `--verify` runs the graph in lockstep again, from its seed, and compares all publications bit for bit. The
/// first difference is printed with its topic, time and field; the exit code is then 1.
///
/// A recording names the programs of its components. Programs that are not part of motorium run only with
/// `--allow-programs`.
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
    /// With `--verify`: a component replaced by its recording; may be repeated
    #[arg(long, value_name = "COMPONENT", requires = "verify")]
    replace: Vec<String>,
    /// A component to run instead of its recording; may be repeated [default: none]
    #[arg(long, value_name = "COMPONENT")]
    live: Vec<String>,
    /// Recorded time per real time; `0` means as fast as the machine allows
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    speed: f64,
    /// Index of the episode to replay, from 0 [default: all]
    #[arg(long, value_name = "INDEX", conflicts_with = "verify")]
    episode: Option<u64>,
    /// Pause simulated time at the start, until `motorium step`
    #[arg(long)]
    paused: bool,
    /// Run in real time, with the cores, priorities and budgets of the graph; required for real drives
    #[arg(long, conflicts_with_all = ["speed", "paused", "verify"])]
    realtime: bool,
    /// Time in which a live robot moves to the first recorded pose; `"0 s"` skips this motion
    #[arg(
        long,
        value_name = "TIME",
        default_value = "3 s",
        conflicts_with = "verify",
        allow_hyphen_values = true
    )]
    ease_in: TimeSpan,
    /// Time in which a live robot comes to rest after the last command
    #[arg(
        long,
        value_name = "TIME",
        default_value = "500 ms",
        conflicts_with = "verify",
        allow_hyphen_values = true
    )]
    ramp_down: TimeSpan,
    /// Run the programs that the recording names, with your rights
    #[arg(long)]
    allow_programs: bool,
    /// Print the report as JSON on standard output
    #[arg(long)]
    json: bool,
}

impl Replay {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let recording = super::opened(&self.file)?;
        if self.verify { self.verify(&recording) } else { self.publish(&recording) }
    }

    fn verify(&self, recording: &Recording) -> anyhow::Result<ExitCode> {
        let plan = replaced(recording, &self.replace)?;
        let Verification { samples, time, difference } =
            verify(recording, &registry::with_hidden(), &self.options(&plan)?, &self.replace)?;
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
        let mut plan = replayed(recording, &self.live, self.episode)?;
        if self.realtime {
            if let Some(episodes) = plan.episodes {
                anyhow::bail!(
                    "{} has {} episodes, and a real robot is not reset between them: choose one by `--episode INDEX`",
                    self.file.display(),
                    episodes.count
                );
            }
            plan.clock = ClockKind::Realtime;
        }
        self.ease_in(&mut plan);
        let mut options = self.options(&plan)?;
        options.stand_in = loggers(&plan);
        let mut printer = Printer::lines(self.json)?;
        let mut observe = |event: Event<'_>| printer.show(&event);
        let mut session = Session::observed(plan, &registry::with_hidden(), &options, &mut observe)?;
        if self.speed > 0.0 && !self.realtime {
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

    /// Eases live robots into the first recorded pose, and to rest after the last command.
    fn ease_in(&self, plan: &mut Plan) {
        let moves = |name: &String| plan.components.iter().any(|it| it.name == *name && it.actuator);
        let Some(robot) = self.live.iter().find(|name| moves(name)).filter(|_| self.ease_in.ns > 0) else {
            return;
        };
        let eased = ease_in(plan, &self.live, self.ease_in, self.ramp_down);
        if eased.is_empty() {
            errln!(
                "{} `{robot}` starts the recording from its current pose, because no component that commands it \
                 reads joint states measured in this run; add the component that measures them by `--live`",
                style::warning("warning:")
            );
        } else {
            errln!(
                "`{}`: {} to the first recorded pose, and {} to rest after the last pose",
                eased.join("`, `"),
                self.ease_in,
                self.ramp_down
            );
        }
    }

    /// Returns options that run all components in one thread, unless a component has a separate program.
    fn options(&self, plan: &Plan) -> anyhow::Result<Options> {
        let own = std::env::current_exe()?;
        for component in plan.components.iter().filter(|_| !self.allow_programs) {
            let path = match &component.program {
                Program::Exec { path } => path,
                // Programs in the folder of this one were installed with it.
                Program::Sibling { path, .. } if !is_beside(path, &own) => path,
                Program::Builtin { .. } | Program::Sibling { .. } => continue,
            };
            anyhow::bail!(
                "{} names the program `{}` for component `{}`, which would run with your rights\n  help: `--allow-programs` \
                 runs it",
                self.file.display(),
                path.display(),
                component.name
            );
        }
        if self.realtime {
            return Ok(Options::processes(own));
        }
        let builtin = |program: &Program| matches!(program, Program::Builtin { .. });
        if plan.components.iter().all(|component| builtin(&component.program)) {
            return Ok(Options::inline());
        }
        Ok(Options { hosting: Hosting::Processes, ..Options::processes(own) })
    }
}

/// Returns `true` if two programs are in the same folder, after links are resolved.
fn is_beside(path: &Path, own: &Path) -> bool {
    let folder = |path: &Path| path.canonicalize().ok()?.parent().map(Path::to_path_buf);
    folder(path).is_some_and(|found| folder(own) == Some(found))
}
