//! A run that a program drives: launched, stepped, read and ended by its owner.

use crate::launcher::{Event, Exit, Launch, LaunchError, Limit, Options, Report};
use crate::plan::{ClockKind, Plan};
use crate::worker::Registry;

/// Runs a plan to its end: its duration, a signal, or a failure that its policies do not forgive.
///
/// `observe` is called with every [`Event`] while the graph runs; with a status about 20 times a second.
///
/// # Errors
/// The graph did not start; nothing is left behind then. A graph that ran and failed is no error: its report says how
/// it ended.
pub fn run(
    plan: Plan,
    registry: &Registry,
    options: &Options,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Report, LaunchError> {
    let end = plan.duration_ns.unwrap_or(u64::MAX);
    let clock = plan.clock;
    let (mut launch, ended) = Launch::start(plan, registry, options, observe)?;
    let exit = ended.unwrap_or_else(|| {
        let ended = match clock {
            ClockKind::Lockstep => launch.run_rounds(Limit { until_ns: end, rounds: u64::MAX }, observe),
            ClockKind::Realtime => launch.supervise(end, observe),
        };
        ended.unwrap_or(Exit::Finished)
    });
    Ok(launch.finish(exit, observe))
}
