//! `motorium bench kill`: kills, stops and hangs the processes of running graphs.

use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use comfy_table::CellAlignment;
use motorium_benches::Distribution;
use motorium_benches::kill::{Cell, Fault, Settings, Summary, Victim, run};

use crate::commands::loading::{DEFAULT_GRAPH, GraphArgs, graph_file};
use crate::out::{err, errln, out};
use crate::{exit, registry, report, style};

/// Kill, stop and hang the processes of running graphs, and measure the consequences.
///
/// Starts the graph as `motorium run` does, with restarts allowed, and sends signals to its processes:
/// components, launcher, guard, and an observing `topic echo`. Prints the times to the safe state and to the
/// return of the component. Exit code 1 after a hang, a leftover, or an unsafe state.
///
/// Example: motorium bench kill --count 100 --victim controller --fault hang
#[derive(Debug, clap::Args)]
pub(crate) struct Kill {
    /// The graph
    #[arg(default_value = DEFAULT_GRAPH, value_parser = graph_file())]
    graph: PathBuf,
    /// Number of faults
    #[arg(long, short = 'n', default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    count: u32,
    /// Largest number of faults in one run
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    per_run: u32,
    /// Seed for choosing victims, faults and times
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Send signals only to these processes: a component by name, `launcher`, `guard` or `observer`
    #[arg(long, value_name = "NAME", num_args = 1..)]
    victim: Vec<String>,
    /// Inject only these faults
    #[arg(long, value_name = "FAULT", num_args = 1..,
          value_parser = ["kill", "abort", "segfault", "terminate", "hang", "pause"])]
    fault: Vec<String>,
    /// Print everything as JSON; the table is then printed to standard error
    #[arg(long)]
    json: bool,
    /// Print the table as Markdown
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
    /// Print the outcome of each fault in each process as Markdown, as in the book; the table is then printed
    /// to standard error
    #[arg(long, conflicts_with_all = ["json", "markdown"])]
    matrix: bool,
}

impl Kill {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let graph = GraphArgs { graph: self.graph.clone(), ..GraphArgs::default() };
        let checked = match graph.load(&registry::registry()) {
            Ok(checked) => checked,
            Err(code) => return Ok(code),
        };
        let components: Vec<String> =
            checked.plan.components.iter().map(|component| component.name.clone()).collect();
        let wanted = if self.victim.is_empty() {
            let others = ["launcher", "guard", "observer"].map(str::to_string);
            components.iter().cloned().chain(others).collect()
        } else {
            self.victim
        };
        let mut victims = Vec::new();
        for name in wanted {
            let victim = Victim::named(&name, &components);
            let known = || {
                format!(
                    "unknown process `{name}`, expected {}, launcher, guard or observer",
                    components.join(", ")
                )
            };
            victims.push(victim.with_context(known)?);
        }
        let faults = if self.fault.is_empty() {
            Fault::ALL.to_vec()
        } else {
            self.fault.iter().filter_map(|name| Fault::named(name)).collect()
        };
        let settings = Settings {
            program: std::env::current_exe().context("finding this program's own file")?,
            graph: self.graph,
            components,
            count: self.count,
            per_run: self.per_run,
            seed: self.seed,
            victims,
            faults,
        };
        let shows = std::io::stderr().is_terminal();
        let summary = run(&settings, &mut |made| {
            if shows {
                err!("\r{made} of {}", settings.count);
            }
        })?;
        if shows {
            errln!("");
        }
        let table = if self.markdown { markdown(&summary) } else { table(&summary) };
        if self.matrix {
            err!("{table}");
            out!("{}", matrix(&settings, &summary));
        } else if self.json {
            err!("{table}");
            out!("{}\n", serde_json::to_string(&summary)?);
        } else {
            out!("{table}");
        }
        Ok(if summary.is_clean() { ExitCode::SUCCESS } else { exit::FAILED })
    }
}

const COLUMNS: [&str; 6] = ["hit", "fault", "count", "detected, ms", "safe, ms", "back, ms"];

/// Returns the p50, p99 and the largest value, ms.
fn times(times: &Distribution) -> String {
    if times.count == 0 {
        return "-".to_string();
    }
    let ms = |ns: u64| format!("{:.1}", ns as f64 * 1e-6);
    format!("{} / {} / {}", ms(times.p50), ms(times.p99), ms(times.max))
}

fn cells(cell: &Cell) -> [String; 6] {
    [
        cell.victim.to_string(),
        cell.fault.to_string(),
        cell.count.to_string(),
        times(&cell.detected),
        times(&cell.safe),
        times(&cell.restarted),
    ]
}

fn table(summary: &Summary) -> String {
    let mut table = report::table(COLUMNS);
    for cell in &summary.cells {
        table.add_row(cells(cell));
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    format!("{table}\n{}", closing(summary))
}

fn row(cells: &[String]) -> String {
    format!("| {} |\n", cells.join(" | "))
}

/// Returns one row per fault and one column per process: the behaviour of the robot and the outcome for the
/// process.
fn matrix(settings: &Settings, summary: &Summary) -> String {
    let head: Vec<String> =
        ["fault".to_string()].into_iter().chain(settings.victims.iter().map(ToString::to_string)).collect();
    let rule: Vec<String> = head.iter().map(|_| "---".to_string()).collect();
    let outcome = |victim: &Victim, fault: Fault| {
        let cell = summary.cells.iter().find(|cell| cell.victim == *victim && cell.fault == fault);
        cell.and_then(|cell| cell.outcome).map_or("not seen".to_string(), |outcome| outcome.to_string())
    };
    let of_fault = |fault: &Fault| {
        let cells = settings.victims.iter().map(|victim| outcome(victim, *fault));
        row(&[fault.to_string()].into_iter().chain(cells).collect::<Vec<_>>())
    };
    row(&head) + &row(&rule) + &settings.faults.iter().map(of_fault).collect::<String>()
}

fn markdown(summary: &Summary) -> String {
    let mut text = row(&COLUMNS.map(str::to_string)) + &row(&COLUMNS.map(|_| "---".to_string()));
    summary.cells.iter().for_each(|cell| text += &row(&cells(cell)));
    text + "\n" + &closing(summary)
}

fn closing(summary: &Summary) -> String {
    let mut text = format!(
        "p50 / p99 / max of {} faults in {} runs, {:.0} s, seed {}\n",
        summary.faults, summary.runs, summary.seconds, summary.seed
    );
    let counts = [
        (u64::from(summary.hangs), "hangs"),
        (u64::from(summary.strays), "processes left behind"),
        (u64::from(summary.leaks), "objects left in shared memory"),
        (u64::from(summary.failed_runs), "runs that failed"),
        (u64::from(summary.unsafe_outages), "stale commands followed"),
        (summary.steps_beyond_a_velocity_limit, "steps beyond a velocity limit"),
    ];
    for (count, what) in counts {
        let number = if count == 0 { style::good(count) } else { style::error(count) };
        let _ = writeln!(text, "{number} {what}");
    }
    summary.failures.iter().for_each(|failure| text += &format!("{failure}\n"));
    text
}
