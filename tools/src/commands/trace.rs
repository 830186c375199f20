//! `motorium trace`: records every step and hand-over of a run for Perfetto.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium::units::TimeSpan;

use super::loading::GraphArgs;
use super::run::{Clock, Run, Traced};
use crate::output::{Overwrite, check_format};

/// Run a graph and write every step, wake-up, publication and hand-over as Chrome trace events.
///
/// The file opens in Perfetto (https://ui.perfetto.dev) and chrome://tracing: a row for each component, an
/// arrow from each publication to the step that read it first. The arguments of a step are its release, its
/// budget and the predicted response time. Times are wall-clock times, also in lockstep.
///
/// Example: motorium trace graphs/panda-reach.toml --for 2s --output out/trace.json
#[derive(Debug, clap::Args)]
pub(crate) struct Trace {
    #[command(flatten)]
    graph: GraphArgs,
    /// Duration of the run, such as `2s` [default: the graph's, or until Ctrl-C]
    #[arg(long = "for", value_name = "DURATION", allow_hyphen_values = true)]
    duration: Option<TimeSpan>,
    /// The clock, `realtime` or `lockstep` [default: the graph's]
    #[arg(long, value_enum, hide_possible_values = true)]
    clock: Option<Clock>,
    /// Run even if the budgets of the graph are not feasible, alone or together with other live runs
    #[arg(long)]
    force: bool,
    /// Print the report of the run as JSON on standard output
    #[arg(long)]
    json: bool,
    /// The file of the trace
    #[arg(long, short, value_name = "FILE.json", default_value = "trace.json")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl Trace {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let Self { graph, duration, clock, force, json, output, overwrite } = self;
        overwrite.check(&graph.with, [&output])?;
        check_format(&output, &["json"])?;
        Run::traced(Traced { graph, duration, clock, force, json, output }).run()
    }
}
