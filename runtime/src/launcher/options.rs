//! The options of a launch.

use std::path::PathBuf;

use super::LaunchError;
use crate::plan::{ClockKind, Plan, Program};

/// Options of a launch: where the components run, and the role of the launching program.
///
/// ```
/// use motorium::launcher::{Hosting, Options};
///
/// let options = Options::inline().on_core(1);
/// assert_eq!((options.hosting, options.core), (Hosting::Inline, Some(1)));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Processes, threads, or one thread for the components.
    pub hosting: Hosting,
    /// Program that hosts built-in kinds and the guard, usually the current one. Only processes need it.
    pub program: PathBuf,
    /// In lockstep, the core of the whole run. Defaults to the first core that the graph assigns to a
    /// component; a thread that hosts components inline is then not moved.
    pub core: Option<usize>,
    /// `true` if `SIGINT`, `SIGTERM` and `SIGHUP` end the run normally. While no such run exists, they have
    /// their previous effect.
    pub catch_signals: bool,
    /// Components that are not started. The program replaces them and publishes on their topics.
    pub stand_in: Vec<String>,
}

/// The hosting of components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hosting {
    /// Each component in a separate process.
    Processes,
    /// Each component in a thread of the launching process, without protection from one another. For tests
    /// and for learning.
    Threads,
    /// All components in the launching thread, stepped one after the other without waits. Only in lockstep,
    /// for roll-outs.
    Inline,
}

impl Options {
    fn new(hosting: Hosting, program: PathBuf) -> Self {
        Self { hosting, program, core: None, catch_signals: true, stand_in: Vec::new() }
    }

    /// Runs each component in a separate process, hosted by `program`: the `motorium` command, or another
    /// program that calls `program::run_worker`.
    pub fn processes(program: PathBuf) -> Self {
        Self::new(Hosting::Processes, program)
    }

    /// Runs each component in a thread of this process.
    pub fn threads() -> Self {
        Self::new(Hosting::Threads, PathBuf::new())
    }

    /// Runs all components in the calling thread.
    pub fn inline() -> Self {
        Self::new(Hosting::Inline, PathBuf::new())
    }

    /// Pins a lockstep run to one core. Concurrent runs need one core each.
    #[must_use]
    pub fn on_core(self, core: usize) -> Self {
        Self { core: Some(core), ..self }
    }

    /// Does not handle the signals of the process. If a signal ends the program, the shared memory of its
    /// threads remains until `motorium doctor --clean`.
    #[must_use]
    pub fn leaving_signals(self) -> Self {
        Self { catch_signals: false, ..self }
    }

    /// Replaces a component: it is not started, and the program publishes on its topics.
    #[must_use]
    pub fn standing_in_for(mut self, component: &str) -> Self {
        self.stand_in.push(component.to_string());
        self
    }

    /// Checks that a plan can run with these options.
    pub(super) fn check(&self, plan: &Plan) -> Result<(), LaunchError> {
        let unsuitable = |what: &str, reason: String, advice| {
            Err(LaunchError::Unsuitable { what: what.to_string(), reason, advice })
        };
        if let Some(name) = self.stand_in.iter().find(|name| plan.components.iter().all(|c| c.name != **name))
        {
            let names: Vec<&str> = plan.components.iter().map(|component| component.name.as_str()).collect();
            let reason = format!("the graph has no component `{name}`, but {}", names.join(", "));
            return unsuitable("standing in for a component", reason, "name one of these");
        }
        if self.hosting != Hosting::Inline {
            return Ok(());
        }
        if plan.clock != ClockKind::Lockstep {
            let reason =
                format!("graph `{}` runs in real time, where each component waits for itself", plan.name);
            return unsuitable("hosting inline", reason, "add `--clock lockstep`, or host it in threads");
        }
        let is_program = |program: &Program| !matches!(program, Program::Builtin { .. });
        if let Some(component) = plan.components.iter().find(|component| is_program(&component.program)) {
            let reason = match &component.program {
                Program::Sibling { kind, path } => {
                    format!("component `{}` is a `{kind}`, which `{}` hosts", component.name, path.display())
                }
                _ => format!("component `{}` is a separate program (`exec`)", component.name),
            };
            return unsuitable("hosting inline", reason, "host the graph in processes");
        }
        Ok(())
    }
}
