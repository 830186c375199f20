//! The options of a launch.

use std::path::PathBuf;

use super::LaunchError;
use crate::plan::{ClockKind, Plan, Program};

/// Options of a launch: where the components run, and which tasks the launching program handles.
///
/// ```
/// use motorium::launcher::{Hosting, Options};
///
/// let options = Options::inline().on_core(1);
/// assert_eq!((options.hosting, options.core), (Hosting::Inline, Some(1)));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Hosting of the components: processes, threads, or the launching thread.
    pub hosting: Hosting,
    /// Program that runs built-in kinds and the guard, usually the current one. Only needed for processes.
    pub program: PathBuf,
    /// Core to which the whole run is pinned in lockstep. With `None`, processes and threads are pinned to
    /// the first core that the graph assigns to a component. A thread that hosts components inline is then
    /// not pinned.
    pub core: Option<usize>,
    /// `true` if `SIGINT`, `SIGTERM` and `SIGHUP` end the run normally. Before and after the run, these
    /// signals have their usual effect.
    pub catch_signals: bool,
    /// Names of components that are not started. The launching program publishes on their topics in their
    /// place.
    pub stand_in: Vec<String>,
}

/// Hosting of the components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hosting {
    /// Each component runs in a separate process.
    Processes,
    /// Each component runs in a thread of the launching process, without protection from other components.
    /// Intended for tests and for learning.
    Threads,
    /// All components run in the launching thread, which steps them one after the other without waits.
    /// Requires lockstep. Intended for roll-outs.
    Inline,
}

impl Options {
    fn new(hosting: Hosting, program: PathBuf) -> Self {
        Self { hosting, program, core: None, catch_signals: true, stand_in: Vec::new() }
    }

    /// Creates options that run each component in a separate process. `program` hosts the built-in kinds. It
    /// is the `motorium` command or any program that calls `program::run_worker`.
    pub fn processes(program: PathBuf) -> Self {
        Self::new(Hosting::Processes, program)
    }

    /// Creates options that run each component in a thread of this process.
    pub fn threads() -> Self {
        Self::new(Hosting::Threads, PathBuf::new())
    }

    /// Creates options that run all components in the calling thread.
    pub fn inline() -> Self {
        Self::new(Hosting::Inline, PathBuf::new())
    }

    /// Pins a lockstep run to one core. Simultaneous runs need a separate core each.
    #[must_use]
    pub fn on_core(self, core: usize) -> Self {
        Self { core: Some(core), ..self }
    }

    /// Leaves the handling of signals to the launching program. If a signal ends the program, the shared
    /// memory of the run remains until `motorium doctor --clean` removes it.
    #[must_use]
    pub fn leaving_signals(self) -> Self {
        Self { catch_signals: false, ..self }
    }

    /// Replaces a component by the launching program: the component is not started, and the program publishes
    /// on the component's topics.
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
            let reason =
                format!("the graph has no component `{name}`; its components are {}", names.join(", "));
            return unsuitable("replacing a component", reason, "name one of its components");
        }
        if self.hosting != Hosting::Inline {
            return Ok(());
        }
        if plan.clock != ClockKind::Lockstep {
            let reason = format!(
                "graph `{}` runs in real time, where each component needs a separate process or thread",
                plan.name
            );
            return unsuitable(
                "hosting inline",
                reason,
                "add `--clock lockstep`, or host the graph in threads",
            );
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
