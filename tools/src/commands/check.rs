//! `motorium check`: checks a graph file without starting anything.

mod admission;
mod components;
mod declared;
mod memory;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium::plan::{ClockKind, Plan};
use motorium::schedule::{Admission, RtLimit, Timeline, admit, timeline};
use motorium::units::TimeSpan;
use motorium_pictures::graph;

pub(crate) use admission::{describe as describe_admission, problems};

use super::loading::GraphArgs;
use crate::out::{err, errln, out, outln};
use crate::output::{refuse_existing, write_file};
use crate::{exit, overheads, registry, style};

/// Longest part of a hyperperiod drawn by default.
const LONGEST: TimeSpan = TimeSpan { ns: 1_000_000_000 };

/// Check a graph file without starting anything: wiring, types, and timing.
///
/// The exit code is 3 if the graph cannot run, or if its budgets, rates and latencies are not feasible on its
/// cores.
///
/// Example: motorium check graphs/panda-reach.toml --timeline svg --output timeline.svg
#[derive(Debug, clap::Args)]
pub(crate) struct Check {
    #[command(flatten)]
    graph: GraphArgs,
    /// Draw the schedule of the cores over one hyperperiod [default: text]
    #[arg(long, value_enum, value_name = "FORMAT")]
    timeline: Option<Format>,
    /// Longest part of the hyperperiod to draw [default: 1 s]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    span: Option<TimeSpan>,
    /// File to write the timeline to [default: standard output]
    #[arg(long, short, requires = "timeline")]
    output: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long, requires = "output")]
    overwrite: bool,
    /// Print the checked plan with its response times and latencies, or the errors, as JSON; with --timeline
    /// or --span, also the timeline
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// Bars in a terminal
    Text,
    /// A picture
    Svg,
}

impl Check {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        self.output.iter().try_for_each(|output| refuse_existing(output, self.overwrite))?;
        let registry = registry::registry();
        let loaded = match self.json {
            true => self.graph.load_silently(&registry),
            false => self.graph.load(&registry),
        };
        let checked = match loaded {
            Ok(checked) => checked,
            Err(code) => return Ok(code),
        };
        let plan = &checked.plan;
        let known = overheads::load();
        let admission = admit(plan, &known.overheads, RtLimit::detect());
        let span = self.span.unwrap_or(LONGEST);
        let drawn = (plan.clock == ClockKind::Realtime).then(|| timeline(plan, &known.overheads, span.ns));
        let to_file = self.write(plan, drawn.as_ref())?;
        if self.json {
            let diagnostics: Vec<_> = checked.warnings.iter().map(|warning| warning.report()).collect();
            let mut answer = serde_json::json!({
                "valid": !admission.refuses(),
                "diagnostics": diagnostics,
                "declared": declared::to_json(&checked.declared),
                "plan": plan,
                "memory": memory::per_topic(plan),
                "admission": admission,
                "overheads_origin": known.origin,
            });
            if self.timeline.is_some() || self.span.is_some() {
                answer["timeline"] = serde_json::to_value(&drawn)?;
            }
            outln!("{}", serde_json::to_string_pretty(&answer)?);
        } else {
            err!("{}", declared::warnings(&checked.declared));
            self.print(plan, &admission, known.origin, drawn.as_ref().filter(|_| !to_file));
        }
        Ok(if admission.refuses() { exit::invalid() } else { ExitCode::SUCCESS })
    }

    /// Writes the timeline to its file or to standard output; true for a file.
    fn write(&self, plan: &Plan, drawn: Option<&Timeline>) -> anyhow::Result<bool> {
        let (Some(format), Some(path)) = (self.timeline, &self.output) else { return Ok(false) };
        let drawn = drawn.context("a graph in lockstep has no timeline: nothing in it has a deadline")?;
        write_file(path, self::draw(format, plan, drawn))?;
        Ok(true)
    }

    fn print(&self, plan: &Plan, admission: &Admission, origin: &str, drawn: Option<&Timeline>) {
        let mut text = components::describe(plan);
        text += &memory::describe(plan);
        text += &admission::describe(admission, origin);
        let picture = self.timeline == Some(Format::Svg);
        match drawn {
            // a picture on standard output is printed alone
            Some(drawn) if picture => {
                out!("{}", self::draw(Format::Svg, plan, drawn));
                err!("{text}");
            }
            Some(drawn) => {
                let drawn = self::draw(Format::Text, plan, drawn);
                let gap = if drawn.is_empty() { "" } else { "\n" };
                out!("{text}{gap}{drawn}");
            }
            None => out!("{text}"),
        }
        err!("{}", problems(admission));
        let file = plan.file.display();
        if admission.refuses() {
            let count = admission.refusals().count();
            let errors = if count == 1 { "error" } else { "errors" };
            errln!("{count} {errors}: {file} cannot meet its deadlines");
        } else if drawn.is_some() && picture {
            errln!("{} {file} is valid", style::good("ok:"));
        } else {
            outln!("{} {file} is valid", style::good("ok:"));
        }
    }
}

fn draw(format: Format, plan: &Plan, drawn: &Timeline) -> String {
    match format {
        Format::Text => graph::timeline_text(drawn),
        Format::Svg => graph::timeline_svg(&plan.name, drawn),
    }
}
